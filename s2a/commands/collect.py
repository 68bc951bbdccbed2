"""Command `s2a collect`: collect demonstrations with cameras, as a LeRobot or robomimic dataset."""

import json
import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Literal

from s2a import tasks
from s2a.commands.worlds import WorldsConfig
from s2a.core.bounds import Count
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write, full_disk_reported
from s2a.core.provenance import provenance
from s2a.learn.collect.episodes import Collector, Dataset, read_stage, temporary, write_stage
from s2a.learn.collect.lerobot import LeRobot
from s2a.learn.collect.robomimic import Robomimic
from s2a.learn.perception.follow import read_policy
from s2a.learn.rl.run_folder import world_json
from s2a.motion.policy import Planner
from s2a.scene.artefacts import DATASET, DATASET_STAGE
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.camera import Views, ViewsConfig
from s2a.sim.depth_cameras import DepthCameraConfig
from s2a.sim.recorder import Recorder
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.sim.world import SimStage
from s2a.tasks import make_env, pool
from s2a.tasks.base import MdpConfig
from s2a.tasks.env import Policy, VecEnv

Format = Literal["lerobot", "robomimic"]
PATIENCE = 5  # Batches without a success after which collecting ends


@dataclass(frozen=True)
class Config(WorldsConfig):
    """Keys of `s2a collect`.

    Attributes:
        out: folder of the dataset; an existing one is continued.
        episodes: number of successful episodes, existing ones included.
        policy: policy that drives the robot: null, the planner; pretrained; pretrained_depth; a model_N.onnx; or a .depth.
        instruction: the robot's instruction in words; null: the task and the part's label.
        every: control steps per frame.
        format: lerobot: LeRobotDataset v3.0; robomimic: HDF5 as robomimic reads it.
        views: the cameras.
        depth_camera: the cameras of a policy with depth cameras.
    """

    out: Output
    episodes: Count
    policy: Path | None
    instruction: str | None
    every: Count
    format: Format
    views: ViewsConfig
    depth_camera: DepthCameraConfig


@dataclass(frozen=True)
class Session:
    """What collects."""

    stage: SimStage  # in which
    env: VecEnv  # the worlds
    policy: Policy  # that drives the robot
    views: Views  # the cameras
    collector: Collector  # runs the episodes
    words: str  # the instruction


def begin(config: Config) -> Session:
    """Build the worlds, the cameras and the policy; InputError for keys that cannot go together."""
    file = read_policy(config.policy, config.depth_camera) if config.policy else None
    env, views, collector, words = worlds(
        config, *(file.worlds(config.sim, config.task) if file else (config.sim, config.task))
    )
    policy = file.bound(env) if file else Planner(env, config.planner)
    if isinstance(policy, Planner):
        policy.warn_of_cut()
    return Session(env.sim.stage, env, policy, views, collector, words)


def worlds(config: Config, physics: SimConfig, task: MdpConfig) -> tuple[VecEnv, Views, Collector, str]:
    """Build what is collected in: worlds and their cameras, what reads both, the instruction; InputError as of `begin`."""
    if pool.is_index(config.stage):
        raise InputError(f"{config.stage} is a pool; give a sim.usd and a part")
    size = config.views.width, config.views.height
    if size[0] % 2 or size[1] % 2:
        raise InputError(f"images of {size[0]} x {size[1]} pixels cannot be a video; give even numbers")
    physics = replace(physics, vary=None)  # every world alike, or no episode could be played again
    stage = _stage(config, task)
    sim = Simulation([stage], physics, config.num_envs, device_of(config.device))
    recorder = Recorder(sim)
    env = make_env(sim, task, config.metrics, {}, config.seed)
    views = Views(stage, config.views, config.num_envs, sim.device)
    collector = Collector(env, recorder, views, size, config.every, json.loads(world_json(physics, task)))
    return env, views, collector, config.instruction or tasks.task(task.name).instruction(stage)


def run(config: Config) -> str:
    """Collect episodes until there are enough, and return how many there are."""
    session = begin(config)
    collector = session.collector
    dataset = format_of(config.format)(config.out, collector.features)
    with full_disk_reported(config.out), temporary(config.out) as folder, collector.encoders(dataset) as encoders:
        _keep(config, session)
        began, first, run_episodes = time.perf_counter(), dataset.count, 0
        while dataset.count < config.episodes:
            if run_episodes >= PATIENCE * config.num_envs and dataset.count == first:
                raise InputError(f"none of {run_episodes} episodes succeeded; measure the part with s2a evaluate")
            # A dataset that is continued begins no episode twice: of each start at least one is past its seed.
            seed = config.seed + dataset.count + run_episodes
            run_episodes += config.num_envs
            for episode in collector.run(session.policy, seed, Path(folder), encoders, session.words):
                if dataset.count < config.episodes:
                    dataset.add(episode)
    made, seconds = dataset.count - first, time.perf_counter() - began
    return (
        f"{config.out}: {dataset.count} episodes, {dataset.frames} frames at {collector.features.fps} per second; "
        f"{made} of {run_episodes} episodes kept, {60.0 * made / seconds:.1f} per minute"
    )


def format_of(name: Format) -> type[Dataset]:
    """Return what writes a format."""
    return Robomimic if name == "robomimic" else LeRobot


def _stage(config: Config, task: MdpConfig) -> SimStage:
    """Return the stage of the dataset that is there, or read it, for which some tasks plan."""
    if not (config.out / DATASET_STAGE).is_file():
        return config.read_stage()
    stage = read_stage(tasks.task(task.name).Stage, config.stage, config.out)
    other = {"part": config.part not in (None, stage.target), "also": bool(set(config.further) - set(stage.also))}
    if any(other.values()):
        names = ", ".join(name for name, differs in other.items() if differs)
        raise InputError(f"{config.out} was collected with another {names}; choose another out")
    return stage


def _keep(config: Config, session: Session) -> None:
    """Write what a dataset is of; InputError where it is of something else: its episodes could not be played again."""
    stage, file = session.stage, config.out / DATASET
    content = {"part": stage.target, "robot": stage.robot, "seed": config.seed, "views": asdict(config.views)}
    content |= {"stage_sha256": layer_hash(config.stage), "format": config.format}
    content |= {"world": session.collector.features.world, "instances": session.views.instances}
    content |= {"robot_base": stage.base.tolist(), "instruction": session.words}
    about = json.loads(json.dumps(content, default=str))
    if file.is_file():
        record = json.loads(file.read_text())
        if other := [key for key in about if key not in ("seed", "instruction") and record.get(key) != about[key]]:
            raise InputError(f"{config.out} was collected with another {', '.join(other)}; choose another out")
    file.parent.mkdir(parents=True, exist_ok=True)
    made = provenance(session.collector.device)
    with atomic_write(file) as out:
        out.write_text(json.dumps({**about, **made}, indent=1))
    write_stage(stage, config.out)
