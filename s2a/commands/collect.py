"""sim.usd and a policy -> demonstrations: what the robot saw and did, as a LeRobot dataset (docs/demonstrations.md)."""

from __future__ import annotations

import json
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from s2a.collect.episodes import Collector, temporary, write
from s2a.collect.lerobot import LeRobotDataset
from s2a.commands.worlds import WorldsConfig
from s2a.errors import InputError
from s2a.outputs import atomic_write
from s2a.planner.motion import Planner
from s2a.provenance import provenance
from s2a.ranges import Count
from s2a.rl.policy_file import PolicyFile
from s2a.rl.run_world import world_json
from s2a.sim import pool
from s2a.sim.recorder import Recorder
from s2a.sim.simulation import Simulation, device_of
from s2a.sim.views import Views, ViewsConfig
from s2a.tasks import make_env
from s2a.usd.stamp import layer_hash

ABOUT = "meta/s2a.json"
PATIENCE = 5
"""Batches without a success after which collecting ends."""


@dataclass(frozen=True)
class Config(WorldsConfig):
    """Keys of `s2a collect`.

    Attributes:
        out: folder of the dataset; one that is there already is gone on with.
        episodes: that succeed, with those that are there already.
        policy: who acts: null, the planner; pretrained; or a model_N.onnx.
        instruction: what the robot is to do, in words; null: open, and the part's label.
        every: control steps a frame.
        views: the cameras.
    """

    out: Path
    episodes: Count
    policy: Path | None
    instruction: str | None
    every: Count
    views: ViewsConfig


def run(config: Config) -> str:
    """Collect episodes until there are enough, and return how many there are."""
    if pool.is_index(config.stage):
        raise InputError(f"{config.stage} is a pool; give a sim.usd and a part")
    if config.views.width % 2 or config.views.height % 2:
        raise InputError(
            f"images of {config.views.width} x {config.views.height} pixels cannot be a video; give even numbers"
        )
    file = PolicyFile(config.policy) if config.policy else None
    physics, task = file.world if file else (config.sim, config.task)
    if physics.vary:
        physics = type(physics)(
            **{**vars(physics), "vary": None}
        )  # every world alike, or no episode could be played again
    stage = config.read_stage()
    sim = Simulation([stage], physics, config.num_envs, device_of(config.device))
    recorder = Recorder(sim)
    env = make_env(sim, task, config.metrics, {}, config.seed)
    policy = file.bound(env) if file else Planner(env, config.planner)
    views = Views(stage, config.views, config.num_envs, sim.device)
    collector = Collector(env, recorder, views, (config.views.width, config.views.height), config.every)
    dataset = LeRobotDataset(config.out, collector.fps, stage.robot, collector.features())
    words = config.instruction or f"open the {stage.target.rsplit('_', 1)[0].replace('_', ' ')}"
    about = {"part": stage.target, "robot": stage.robot, "seed": config.seed, "views": asdict(config.views)}
    about |= {"stage_sha256": layer_hash(config.stage), "world": json.loads(world_json(physics, task))}
    with temporary(config.out) as folder:
        _keep(config.out / ABOUT, json.loads(json.dumps(about, default=str)), provenance(sim.device))
        began, first, run_episodes = time.perf_counter(), dataset.count, 0
        while dataset.count < config.episodes:
            if run_episodes >= PATIENCE * config.num_envs and dataset.count == first:
                raise InputError(f"none of {run_episodes} episodes succeeded; see what s2a evaluate says of this part")
            # A dataset that is gone on with begins no episode twice: of each start at least one is past its seed.
            batch = collector.run(policy, config.seed + dataset.count + run_episodes, Path(folder))
            run_episodes += config.num_envs
            for world in batch.success.nonzero()[0][: config.episodes - dataset.count]:
                write(dataset, batch, int(world), words)
    made, seconds = dataset.count - first, time.perf_counter() - began
    frames = dataset.info["total_frames"]
    return (
        f"{config.out}: {dataset.count} episodes, {frames} frames at {collector.fps} a second; {made} of {run_episodes} episodes "
        f"kept, {60.0 * made / seconds:.1f} a minute"
    )


def _keep(file: Path, about: dict[str, Any], made: dict[str, Any]) -> None:
    """Write what a dataset is of; InputError where it is of something else: its episodes could not be played again."""
    if file.is_file():
        known = json.loads(file.read_text())
        if other := [key for key in about if key != "seed" and known.get(key) != about[key]]:
            raise InputError(
                f"{file.parent.parent} was collected with another {', '.join(other)}; choose another place"
            )
    file.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(file) as out:
        out.write_text(json.dumps({**about, **made}, indent=1))
