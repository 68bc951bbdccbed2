"""Rollouts of a policy as rows of images, one a part: what it does where it fails, and where it succeeds.

    python tools/rollout_sheet.py OUT.png STAGE.usd:PART [STAGE.usd:PART ...] [--policy pretrained] [--seed 7] [--steps 2200]

Each row is one episode in the policy's own world, seen by the camera before the furniture at four times and by the wrist's at the
third; the caption says how it ended. OUT.json has the metrics of each.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import sheet
import torch

from s2a.commands.collect import Config as CollectConfig
from s2a.commands.evaluate import Config
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.learn.evaluate import run_episodes
from s2a.learn.rl.policy_file import PolicyFile
from s2a.sim.camera import Views, ViewsConfig
from s2a.sim.simulation import Simulation
from s2a.tasks import make_env

TIMES = (0.0, 0.2, 0.45, 0.98)
"""Of an episode."""
WRIST_AT = 2
SIZE = (320, 240)
SHOWN = ("success", "grasp_success", "single_finger_success", "off_handle_success", "opening", "grasped_fraction")


def main() -> None:
    """Write the sheet and the metrics."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("rollouts", nargs="+", help="STAGE.usd:PART")
    parser.add_argument("--policy", type=Path, default=Path("pretrained"))
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--steps", type=int, default=2200)
    args = parser.parse_args()
    tiles: list[tuple[str, np.ndarray]] = []
    rows = []
    for each in args.rollouts:
        stage, _, part = each.rpartition(":")
        images, result = rollout(Path(stage), part, args.policy, args.seed, args.steps)
        name = f"{Path(stage).parent.name} {part}"
        rows.append({"room": Path(stage).parent.name, "part": part, **result})
        ended = "grasped" if result["grasp_success"] else "opened" if result["success"] else "failed"
        captions = [name, ended, f"{result['opening']:.2f} m", "wrist", ""]
        tiles += zip(captions, images, strict=True)
        print(json.dumps(rows[-1]), flush=True)
    print(sheet.write(tiles, args.out, len(TIMES) + 1, 18))
    about = {"policy": str(args.policy), "seed": args.seed, "steps": args.steps, **provenance("cpu")}
    args.out.with_suffix(".json").write_text(json.dumps({**about, "rollouts": rows}, indent=1) + "\n")


def rollout(
    stage_file: Path, part: str, policy: Path, seed: int, steps: int
) -> tuple[list[np.ndarray], dict[str, float]]:
    """Return the images of one episode, each [height width 3], and its metrics."""
    keys = [f"stage={stage_file}", f"part={part}", "out=unused", "num_envs=1", "device=cpu", f"seed={seed}"]
    settings = config.load(Config, config.compose("evaluate", keys))
    file = PolicyFile(policy)
    sim_config, task = file.world
    sim = Simulation(settings.read_stages(), sim_config, 1, "cpu")
    env = make_env(sim, replace(task, episode_steps=steps), settings.metrics, {}, seed)
    views = Views(sim.stage, _views(), 1, "cpu")
    views.begin(np.random.default_rng(seed))
    due, scene, wrist = [round(t * steps) for t in TIMES], [], []

    def watch() -> None:
        if len(scene) < len(due) and int(env.episode_step[0]) >= due[len(scene)]:
            for camera in views.render(sim.joint_q, instances=False):
                (wrist if camera == "wrist" else scene).append(views.images()["image"][0].numpy().copy())

    columns = run_episodes(env, file.bound(env), watch)
    images = [*scene[:WRIST_AT], scene[WRIST_AT], wrist[WRIST_AT], *scene[WRIST_AT + 1 :]]
    return images, {name: float(columns[name][0]) for name in SHOWN if name in columns}


def _views() -> ViewsConfig:
    """Return the cameras of demonstrations, without what differs between them."""
    views = config.load(CollectConfig, config.compose("collect", ["stage=unused", "out=unused"])).views
    width, height = SIZE
    return replace(views, width=width, height=height, jitter=0.0, light=(0.5, 0.5))


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
