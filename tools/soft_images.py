"""Render a trial of `s2a evaluate physics=soft states=FILE.npz`: `python tools/soft_images.py room.usd FILE.npz out.png`.

Shows the soft body's fine surface, which follows the simulated cells, the arm and the room, at the moments of --at.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from s2a.core import config
from s2a.sim.camera import Camera, CameraConfig
from s2a.sim.soft_body import SoftConfig, soft_body
from s2a.sim.world import SimStage, read_stage


def main() -> None:
    """Write a strip of images."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("room", type=Path)
    parser.add_argument("states", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--trial", type=int, default=0, help="of those that were simulated")
    parser.add_argument(
        "--at", type=float, nargs="*", default=[0.0, 0.3, 0.45, 0.6, 0.8, 1.0], help="fractions of the episode"
    )
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--distance", type=float, default=1.0)
    args = parser.parse_args()
    with np.load(args.states) as file:
        states = trial_of(dict(file), args.trial)
    settings = SoftConfig()
    body = soft_body(settings.shape)
    camera = config.load(CameraConfig, config.compose("camera/default")["camera"])
    camera = replace(camera, width=args.width, height=args.width * 3 // 4, distance=args.distance)
    stage, images = _stage(args.room, states), []
    for fraction in args.at:
        k = round(fraction * (len(states["joints"]) - 1))
        surface = body.shown(np.float64(states["particles"][k]) + states["goal"][:3])
        shot = Camera(stage, camera, [surface])
        q = torch.zeros(shot.coordinates)
        q[: states["joints"].shape[1]] = torch.from_numpy(states["joints"][k])
        images.append(shot.image(q))
    rows = [np.concatenate(images[i : i + 3], axis=1) for i in range(0, len(images), 3)]
    Image.fromarray(np.concatenate([row for row in rows if row.shape == rows[0].shape], axis=0)).save(args.out)


def trial_of(states: dict[str, np.ndarray], trial: int) -> dict[str, np.ndarray]:
    """Return the arrays of one trial: its frames, its poses and its pedestal."""
    ends = np.cumsum(states["frames"])
    frames = slice(ends[trial] - states["frames"][trial], ends[trial])
    found = {name: states[name][frames] for name in ("joints", "particles")}
    return found | {name: states[name][trial] for name in ("start", "goal", "base", "pedestal")}


def _stage(room: Path, states: dict[str, np.ndarray]) -> SimStage:
    """Return a stage with the robot where it stood in the trial, which looks at the place; its part stays shut."""
    from s2a.scene.usd import sim_stage

    part = next(iter(sim_stage.read(room, visuals=False).articulations))
    stage = read_stage(room, part)
    return replace(
        stage, base=states["base"], pedestal=(float(states["pedestal"]), stage.pedestal[1]), grasp=states["goal"]
    )


if __name__ == "__main__":
    main()
