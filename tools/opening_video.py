"""Render docs/opening.webp: the planner's robot opens a scanned drawer, in the episode that `s2a evaluate` runs.

    python tools/opening_video.py demo docs/opening.webp

The first argument is the folder that `make demo` fills; it is read for `room.usd`. Frames come at the speed of the simulation.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.core.progress import track
from s2a.learn.evaluate import evaluate
from s2a.motion.policy import Planner
from s2a.sim.camera import Camera
from s2a.sim.simulation import Simulation, device_of
from s2a.tasks import make_env

EVERY, CONTROL_RATE = 5, 60.0
"""Control steps a frame, and their number a second."""
LAST = 1500
"""[ms] For which the open drawer is shown before the video begins again."""
OVERSAMPLED = 2
"""Pixels rendered across one that is written."""
SIZE = {"width": 640, "height": 400}
VIEW = {"fov": 0.62, "distance": 1.9, "azimuth": 1.25, "elevation": 0.42}
QUALITY = 62
MAX_BYTES = 2 * 2**20


def main(demo: Path, out: Path) -> None:
    """Let the planner open the part once; write what a camera sees."""
    overrides = [f"stage={demo / 'room.usd'}", "part=drawer_15", "out=-", "num_envs=1", "task.start_noise=0"]
    settings = config.load(Config, config.compose("evaluate", overrides))
    sim = Simulation(settings.read_stages(), settings.sim, settings.num_envs, device_of(settings.device))
    env = make_env(sim, settings.task, settings.metrics, {}, settings.seed)
    poses: list[torch.Tensor] = []
    evaluate(env, Planner(env, settings.planner), lambda: poses.append(sim.joint_q[0].clone()))
    rendered = {name: value * OVERSAMPLED for name, value in SIZE.items()}
    camera = Camera(sim.stage, replace(settings.camera, **rendered, **VIEW))
    shown = poses[: _widest(poses, sim.layout.part_coord) + 1 : EVERY]
    frames = [_small(camera.image(pose)) for pose in track(shown, "render")]
    write(frames, out)


def write(frames: list[Image.Image], out: Path) -> None:
    """Write an endless WebP animation."""
    times = [round(1000.0 * EVERY / CONTROL_RATE)] * (len(frames) - 1) + [LAST]
    frames[0].save(out, save_all=True, append_images=frames[1:], duration=times, loop=0, quality=QUALITY, method=6)
    size = out.stat().st_size
    print(f"{out}: {len(frames)} frames, {sum(times) / 1000.0:.1f} s, {size / 1000:.0f} kB")
    if size > MAX_BYTES:
        raise SystemExit(f"{out} is larger than {MAX_BYTES} bytes; make SIZE, QUALITY or the frame rate smaller")


def _widest(poses: list[torch.Tensor], coord: int) -> int:
    """Return the step at which the part stands open widest; what follows is the end of the episode, or its reset."""
    return int(np.argmax([abs(float(pose[coord])) for pose in poses]))


def _small(image: np.ndarray) -> Image.Image:
    return Image.fromarray(image).resize((SIZE["width"], SIZE["height"]), Image.Resampling.LANCZOS)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("image", type=Path)
    args = parser.parse_args()
    main(args.folder, args.image)
