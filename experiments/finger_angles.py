"""How opposed are the forces of a policy's fingers while it opens parts? -> experiments/results/finger_angles.json.

    python experiments/skill_rooms.py     # once: the rooms
    python experiments/finger_angles.py [--rooms FOLDER] [--policy pretrained] [--episodes 2] [--device cpu] [--out FILE]

A grasp counts from 120 degrees between the forces of both fingers on (docs/metrics.md). A row is an episode that opened its part:
the fraction of the time in which both fingers pressed, of that in which the part was opening, and the median angle there.
Every fifth control step is read, as the benchmark runs (seed 7).
"""

from __future__ import annotations

import argparse
import contextlib
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from s2a.core.config import compose, load
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.learn.evaluate import run_episodes
from s2a.learn.rl.policy_file import PolicyFile
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.sim.world import SimStage, read_stage
from s2a.tasks import make_env
from s2a.tasks.env import VecEnv
from s2a.tasks.open_part import OpenPartMetrics
from s2a.tasks.state import Opened

SEED, STEPS, EVERY, OPENING = 7, 2200, 5, 1e-4
"""Of the benchmark; control steps between readings; gain between two readings from which a part opens [m]."""


class Angles:
    """Reads the contacts of all worlds.

    Attributes:
        read: opening gained so far [m], lesser of both fingers' forces [N] and angle between them [degree], shape
            [reading world 3].
    """

    def __init__(self, env: VecEnv) -> None:
        """Read nothing yet."""
        self.env, self._step = env, 0
        self.read: list[np.ndarray] = []

    def __call__(self) -> None:
        """Read, every so many control steps."""
        self._step += 1
        if self._step % EVERY:
            return
        world = self.env.task.world
        pressed, normal = (getattr(world.contacts, name).numpy() for name in ("on_region", "normal"))
        lengths = np.maximum(np.linalg.norm(normal, axis=-1).prod(axis=1), 1e-9)
        angle = np.degrees(np.arccos(np.clip((normal[:, 0] * normal[:, 1]).sum(axis=-1) / lengths, -1.0, 1.0)))
        gained = world.opened.numpy()[:, Opened.gained]
        self.read.append(np.stack([gained, pressed.min(axis=1), angle], axis=1))


def main() -> None:
    """Run the episodes and write a row for each that opened its part."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", type=Path, default=Path("runs/skills/inputs"), help="with a room.usd in each folder")
    parser.add_argument("--policy", type=Path, default=Path("pretrained"))
    parser.add_argument("--episodes", type=int, default=2)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, default=Path("experiments/results/finger_angles.json"))
    args = parser.parse_args()
    stages, file = list(_stages(args.rooms)), PolicyFile(args.policy)
    device, asked = device_of(args.device), compose("bench")
    sim = Simulation([stage for _, stage in stages], load(SimConfig, asked["sim"]), len(stages) * args.episodes, device)
    task, metrics = replace(file.world[1], episode_steps=STEPS), load(OpenPartMetrics, asked["metrics"])
    env = make_env(sim, task, metrics, {}, SEED)
    angles = Angles(env)
    done = run_episodes(env, file.bound(env), angles)
    read = np.array(angles.read)
    rows = [
        {"room": stages[i][0], "part": stages[i][1].target, "grasped": bool(done["grasp_success"][world])}
        | _while_opening(read[:, world])
        for world, i in enumerate(sim.stage_of_env)
        if done["success"][world]
    ]
    about = {"policy": file.name, "parts": len(stages), "episodes": env.num_envs, "opened": len(rows), "seed": SEED}
    with atomic_write(args.out) as place:
        place.write_text(json.dumps({**about, **_summary(rows), **provenance(device), "rows": rows}, indent=1) + "\n")
    print(json.dumps(about | _summary(rows)))


def _stages(rooms: Path) -> Iterator[tuple[str, SimStage]]:
    """Yield the rooms' names and the stages of all their parts for which `s2a prepare` found a place of the robot."""
    for file in sorted(rooms.glob("*/room.usd")):
        for part in sim_stage.read(file, visuals=False).articulations:
            with contextlib.suppress(InputError):
                yield file.parent.name, read_stage(file, part)


def _while_opening(read: np.ndarray) -> dict[str, float | None]:
    """Return how the fingers pressed in the readings between which the part opened."""
    opening = read[np.diff(read[:, 0], prepend=0.0) > OPENING]
    both = opening[opening[:, 1] >= 1.0]
    return {
        "both_pressed": round(len(both) / max(len(opening), 1), 3),
        "median_angle": round(float(np.median(both[:, 2])), 1) if len(both) else None,
    }


def _summary(rows: list[dict]) -> dict[str, object]:
    """Return what the episodes have in common that were grasped, and that were opened without a grasp."""
    groups = {"grasped": [r for r in rows if r["grasped"]], "not_grasped": [r for r in rows if not r["grasped"]]}
    return {name: _group(rows) for name, rows in groups.items()}


def _group(rows: list[dict]) -> dict[str, object]:
    angle = [row["median_angle"] for row in rows if row["median_angle"] is not None]
    return {
        "episodes": len(rows),
        "both_pressed_80pct": sum(row["both_pressed"] >= 0.8 for row in rows),
        "median_angle_quartiles": [round(float(x), 1) for x in np.percentile(angle, [25, 50, 75])],
    }


if __name__ == "__main__":
    main()
