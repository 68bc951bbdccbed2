"""A strip of images and a short video of one demonstration in a dataset of `s2a collect` (format=lerobot).

    python tools/filmstrip.py DATASET OUT [--episode 0] [--frames 5] [--seconds 8] [--speed 1]

Writes OUT.png, the scene's camera at evenly spaced times, and OUT.webp, the scene's camera beside the wrist's, `speed` times as
fast as it was, or faster where it would take longer than `seconds`.

    s2a collect stage=ROOM.usd part=drawer_7 episodes=1 num_envs=1 views.width=320 views.height=240 every=6 out=runs/open
    python tools/filmstrip.py runs/open docs/demonstration_open
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path

import av
import numpy as np
from PIL import Image

from s2a.learn.collect.lerobot import CHUNK, IMAGES, VIDEO
from s2a.sim.camera import CAMERAS

MIN_FPS = 8.0
"""Images a second of the video."""
QUALITY = 60
GAP = 4
"""[pixel] Between images, white."""


def main() -> None:
    """Write both files."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("dataset", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--episode", type=int, default=0)
    parser.add_argument("--frames", type=int, default=5, help="of the strip")
    parser.add_argument("--seconds", type=float, default=8.0, help="of the video, at most")
    parser.add_argument("--speed", type=float, default=1.0)
    args = parser.parse_args()
    fps = json.loads((args.dataset / "meta/info.json").read_text())["fps"]
    scene, wrist = (frames(args.dataset, args.episode, camera) for camera in CAMERAS)
    chosen = np.linspace(0, len(scene) - 1, args.frames).round().astype(int)
    Image.fromarray(beside([scene[k] for k in chosen])).save(args.out.with_suffix(".png"), optimize=True)
    speed = max(args.speed, len(scene) / fps / args.seconds)
    step = max(1, math.floor(fps * speed / MIN_FPS))
    images = [Image.fromarray(beside([scene[k], wrist[k]])) for k in range(0, len(scene), step)]
    duration = round(1000 * step / (fps * speed))
    video = {"save_all": True, "append_images": images[1:], "duration": duration, "loop": 0, "quality": QUALITY}
    images[0].save(args.out.with_suffix(".webp"), **video)
    size = args.out.with_suffix(".webp").stat().st_size / 2**20
    print(f"{args.out}.webp: {len(images)} images, {speed:.1f} times as fast, {size:.2f} MiB")


def frames(dataset: Path, episode: int, camera: str) -> list[np.ndarray]:
    """Return the images of a camera [height width 3]."""
    key = IMAGES.format(camera=camera)
    path = dataset / VIDEO.format(video_key=key, chunk_index=episode // CHUNK, file_index=episode % CHUNK)
    with av.open(str(path)) as file:
        return [frame.to_ndarray(format="rgb24") for frame in file.decode(video=0)]


def beside(images: list[np.ndarray]) -> np.ndarray:
    """Return images in a row."""
    white = np.full((images[0].shape[0], GAP, 3), 255, np.uint8)
    row = [part for image in images for part in (image, white)]
    return np.concatenate(row[:-1], axis=1)


if __name__ == "__main__":
    main()
