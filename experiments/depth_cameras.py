"""Measure a policy with depth cameras on a pool with visuals, as it is and under disturbances of its cameras.

    python experiments/depth_cameras.py pools/test/pool.json experiments/results/depth_cameras.json [key=value ...]

Keys: those of KEYS, and conditions="NAME;NAME" of CONDITIONS. Rows are written after each condition; none is begun that would end
after `seconds`. `held_out` is a pattern of rooms; `episodes` are of each part.
"""

from __future__ import annotations

import json
import re
import sys
import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from s2a import tasks
from s2a.core import config
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.learn.evaluate import by_part, run_episodes
from s2a.learn.perception.follow import Follower, StatePolicy, read_network, state_world
from s2a.learn.rl.policy_file import PRETRAINED, PolicyFile
from s2a.sim.depth_cameras import DepthCameraConfig, DepthView, WorldCameras
from s2a.sim.simulation import Simulation, device_of
from s2a.tasks import make_env, pool
from s2a.tasks.env import Policy


@dataclass(frozen=True)
class Disturbance:
    """What is wrong with the cameras.

    Attributes:
        delay: frames, of 0.1 s, by which estimates come late.
        off: metres and degrees, in directions that are drawn each episode, by which a camera is elsewhere than believed.
        moved: metres and degrees by which the stand is elsewhere than where training puts it, and believed to be there.
        noise: factor of the depth noise.
        holes: fraction of the pixels that measure nothing.
    """

    delay: int = 0
    off: dict[str, tuple[float, float]] = field(default_factory=dict)
    moved: tuple[float, float] = (0.0, 0.0)
    noise: float = 1.0
    holes: float = 0.0


CONDITIONS = {
    "as trained": Disturbance(),
    "100 ms late": Disturbance(delay=1),
    "moved 5 cm, 5 degrees": Disturbance(moved=(0.05, 5.0)),
    "stand off by 5 cm, 5 degrees": Disturbance(off={"stand": (0.05, 5.0)}),
    "noise doubled, 10 % holes": Disturbance(noise=2.0, holes=0.1),
    "wrist off by 5 cm, 5 degrees": Disturbance(off={"wrist": (0.05, 5.0)}),
    "late, moved, noise": Disturbance(delay=1, moved=(0.05, 5.0), noise=2.0, holes=0.1),
    "stand off by 1 cm, 1 degree": Disturbance(off={"stand": (0.01, 1.0)}),
    "another seed": Disturbance(),
    "true poses": Disturbance(),
}
RATES = "success", "grasp_success"
KEYS = {
    "policy": "pretrained_depth",
    "episodes": "10",
    "steps": "1000",
    "seed": "11",
    "device": "auto",
    "held_out": "",
    "seconds": "1e9",
}


class DisturbedCameras(WorldCameras):
    """Cameras with a disturbance."""

    disturbance = Disturbance()

    def begin(self, worlds: torch.Tensor) -> None:
        """Draw place and calibration, and the directions in which cameras are off."""
        super().begin(worlds)
        for name, (shift, turn) in self.disturbance.off.items():
            by = [torch.nn.functional.normalize(self._normal(1.0), dim=1) * worlds[:, None] for _ in range(2)]
            old_turn, old_shift = self._error[name]
            self._error[name] = old_turn + np.deg2rad(turn) * by[0], old_shift + shift * by[1]

    def _view(self, name: str, pose: torch.Tensor, error: tuple[torch.Tensor, torch.Tensor]) -> DepthView:
        view = super()._view(name, pose, error)
        measured = torch.rand(view.valid.shape, generator=self.random, device=self._device) >= self.disturbance.holes
        return replace(view, valid=view.valid & measured, is_part=view.is_part & measured)


def moved(places: torch.Tensor, by: tuple[float, float], seed: int) -> torch.Tensor:
    """Return poses (shape [world place 4 4]) shifted by metres and turned by degrees in drawn directions."""
    random, out = np.random.default_rng(seed), places.cpu().numpy()
    shift, axis = random.normal(size=(2, *out.shape[:2], 3))
    shift, axis = (each / np.linalg.norm(each, axis=-1, keepdims=True) for each in (shift, axis))
    turn = Rotation.from_rotvec(np.deg2rad(by[1]) * axis.reshape(-1, 3)).as_matrix().reshape(*out.shape[:2], 3, 3)
    pose = np.concatenate([turn @ out[..., :3, :3], out[..., :3, 3:] + by[0] * shift[..., None]], axis=-1)
    return torch.from_numpy(np.concatenate([pose, out[..., 3:, :]], axis=-2)).to(places)


def main(index: Path, out: Path, keys: dict[str, str]) -> None:
    """Measure in all conditions."""
    begun, longest = time.perf_counter(), 0.0
    seed, episodes, device = int(keys["seed"]), int(keys["episodes"]), device_of(keys["device"])
    pairs = list(zip(pool.read(index), pool.stages(index, "panda"), strict=True))
    pairs = [pair for pair in pairs if re.search(keys["held_out"], Path(pair[0].room).stem)]
    entries, stages = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    physics, task = state_world()
    sim = Simulation(stages, physics, len(stages) * episodes, device)
    metrics = config.load(tasks.task(task.name).Metrics, config.file(f"metrics/{task.name}"))
    plain = config.load(DepthCameraConfig, config.file("depth_camera/default"))
    env = make_env(sim, replace(task, episode_steps=int(keys["steps"])), metrics, {}, seed)  # type: ignore[call-arg]
    cameras = DisturbedCameras(sim, plain, seed)
    network = read_network(Path(keys["policy"])).to(device)
    places = cameras.places
    about = {"policy": keys["policy"], "episodes_a_part": episodes, "steps": int(keys["steps"]), "seed": seed}
    print(f"{time.perf_counter() - begun:.0f} s: {len(stages)} parts, {sim.num_envs} worlds", flush=True)
    rows: dict[str, Any] = {}
    for name in keys.get("conditions", ";".join(CONDITIONS)).split(";"):
        started, disturbance = time.perf_counter(), CONDITIONS[name]
        if started - begun + longest > float(keys["seconds"]):
            break
        cameras.disturbance, cameras.places = disturbance, moved(places, disturbance.moved, seed)
        cameras.config = replace(plain, noise=plain.noise * disturbance.noise, delay=disturbance.delay)
        drawn = seed + (name == "another seed")
        torch.manual_seed(drawn)
        env.reset_all(drawn)
        policy: Policy = Follower(env, cameras, network, StatePolicy(Path(PRETRAINED)).to(device), drawn)
        if name == "true poses":
            policy = PolicyFile(Path(PRETRAINED)).bound(env)
        done = run_episodes(env, policy)
        rates = {column: done[column].numpy() for column in RATES}
        rows[name] = by_part(rates, entries, sim.stage_of_env, seed)
        longest = max(longest, time.perf_counter() - started)
        content = {**about, "parts": len(stages), "seconds": time.perf_counter() - begun, "conditions": rows}
        with atomic_write(out) as file:
            file.write_text(json.dumps({**content, **provenance(device)}))
        both = [rows[name]["over_parts"]["all"][column] for column in RATES]
        text = "; ".join(f"{row['rate']:.1%} [{row['low']:.1%}, {row['high']:.1%}]" for row in both)
        print(f"{time.perf_counter() - begun:.0f} s: {name}: {text}", flush=True)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), KEYS | dict(text.split("=", 1) for text in sys.argv[3:]))
