"""Command `s2a evaluate`: measure the success of a policy or of the planner."""

from __future__ import annotations

import hashlib
import json
import logging
import re
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import torch
from PIL import Image

from s2a import tasks
from s2a.commands.worlds import WorldsConfig
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write, require_writable
from s2a.core.provenance import provenance
from s2a.learn.evaluate import Agent, SoftStates, baseline, by_part, evaluate_soft, run_episodes, summary
from s2a.learn.perception.follow import DepthPolicy, Follower, is_depth, read_policy
from s2a.learn.perception.follow import export as export_depth
from s2a.learn.rl.policy_file import PolicyFile, export
from s2a.learn.rl.ppo import load_model, load_policy
from s2a.learn.rl.run_folder import read_world
from s2a.motion.open import variant_path
from s2a.motion.part_base import ready_to_move
from s2a.motion.policy import Planner
from s2a.motion.search import Unreachable
from s2a.robot.tool_path import variants
from s2a.scene.usd import sim_stage
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.camera import Camera, CameraConfig
from s2a.sim.depth_cameras import DepthCameraConfig
from s2a.sim.recorder import LimitUse, Recorder
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.sim.soft_body import SoftConfig, soft_body
from s2a.sim.world import SimStage
from s2a.tasks import make_env, pool
from s2a.tasks.base import MdpConfig, Task, meanings
from s2a.tasks.env import Policy, VecEnv
from s2a.tasks.soft import COLUMNS, NAME, SOFT_TASK, VALUES, SoftMetrics, SoftTask, trials
from s2a.tasks.state import LIMITS
from s2a.view import states

_log = logging.getLogger(__name__)
SEEN = (7, 121, 361, 721)  # Control steps after which what depth cameras see is drawn
LAG = 0.005  # [m] By which a part may stay behind the end of a plan
REFUSED = ("also", "checkpoint", "policy", "agent", "export", "images", "search_base", "recordings")


def run_soft(config: Config) -> tuple[dict[str, Any], tuple[str, ...], tuple[str, ...]]:
    """Run the trials one after the other, writing metrics and states after each; return the metrics, their rates and values."""
    task = config.task
    if type(task) is not SoftTask:
        raise InputError(f"physics=soft is not possible with task={task.name}; give task={SOFT_TASK}")
    if config.part not in (None, NAME):
        raise InputError(f"part={config.part}: with physics=soft the object is the {NAME}; leave the key out")
    if given := [key for key in REFUSED if getattr(config, key)]:
        raise InputError(f"keys not possible with physics=soft: {', '.join(given)}; leave them out")
    room, body = sim_stage.read(config.stage, visuals=False), soft_body(config.soft.shape)
    every = trials(room, body, config.soft, task, config.robot, config.planner.approach, config.num_envs, config.seed)
    device, states = device_of(config.device), SoftStates()
    origin = {"stage": config.stage.name, "policy": "planner", "physics": "soft", "seed": config.seed}
    origin |= {"start": task.start, "place": task.place, **provenance(device)}
    metrics: dict[str, Any] = {}
    for result in evaluate_soft(
        every, config.num_envs, config.planner, config.soft_metrics, config.seed, device, states
    ):
        metrics = result | origin
        with atomic_write(config.out) as out:
            out.write_text(json.dumps(metrics, indent=1))
        if config.states:
            with atomic_write(config.states) as out, out.open("wb") as file:
                np.savez_compressed(file, **states.arrays())  # type: ignore[arg-type]
    return metrics, COLUMNS, VALUES


@dataclass(frozen=True)
class Config(WorldsConfig):
    """Keys of `s2a evaluate`.

    Attributes:
        out: the metrics.json to write.
        checkpoint: model_N.pt of a training run, or null: the planner.
        policy: policy in its place: model_N.onnx, as `s2a train export=true` writes it; a .depth of `s2a perceive`, with
            depth cameras instead of the part's true pose; pretrained or pretrained_depth: the bundled ones; or null.
        agent: baseline in its place: zero (actions of 0), random (uniform in [-1, 1]), extreme (-1 and 1, held for up
            to four seconds); or null.
        export: write the checkpoint as TorchScript and ONNX too, beside it; a policy with depth cameras as two ONNX files beside
            `out`.
        images: folder for before.png and after.png (world 0 where its part moved farthest), or null; with depth cameras also for
            seen_N.png: what they see after N steps.
        depth_camera: the depth cameras, and the pixel that selects the part.
        search_base: Enable the search for another base where the prepared one does not serve for all of the planner's motion.
        recordings: folder for joint positions and torques, a CSV file for each world, which `s2a identify` reads, or null.
        states: npz file for the pose of everything after every control step, which `s2a view` plays, or null; with
            physics=soft one for tools/soft_images.py.
        camera: camera of the images.
        physics: rigid, or soft: the planner picks and places a teddy bear, in worlds that are simulated one after the other.
    """

    out: Output
    checkpoint: Path | None
    policy: Path | None
    agent: Agent | None
    export: bool
    images: Output | None
    search_base: bool
    recordings: Output | None
    states: Output | None
    camera: CameraConfig
    depth_camera: DepthCameraConfig
    physics: Literal["rigid", "soft"]
    soft: SoftConfig = SoftConfig()  # the bear
    soft_metrics: SoftMetrics = SoftMetrics()  # what is reported of it


class Album:
    """World 0 as it began and where its part was farthest from there in its first episode, as joint coordinates."""

    def __init__(self, env: VecEnv) -> None:
        self._env = env
        self._poses: list[torch.Tensor] = []
        self._over = False

    def watch(self) -> None:
        """Look at the environment after its reset or a step."""
        self._over |= bool(self._env.done[0])
        if self._over:  # the world was reset, and what follows belongs to another episode
            return
        pose = self._env.sim.joint_q[0].clone()
        if len(self._poses) < 2:
            self._poses.append(pose)
        elif self._moved(pose) > self._moved(self._poses[1]):
            self._poses[1] = pose

    def _moved(self, pose: torch.Tensor) -> float:
        coord = self._env.sim.layout.part_coord
        return abs(float(pose[coord] - self._poses[0][coord]))

    def save(self, camera: Camera, folder: Path) -> None:
        """Write before.png and after.png."""
        for name, pose in zip(("before", "after"), (self._poses[0], self._poses[-1]), strict=True):
            with atomic_write(folder / f"{name}.png") as file:
                Image.fromarray(camera.image(pose)).save(file)


def _policy(config: Config, env: VecEnv, file: PolicyFile | DepthPolicy | None) -> Policy:
    """Return the policy; the planner has motions for a pool."""
    if config.agent:
        return baseline(config.agent, env, config.seed)
    if file:
        return file.bound(env)
    if config.checkpoint:
        return load_policy(env, config.checkpoint)
    return Planner(env, config.planner, pool.motions(config.stage) if pool.is_index(config.stage) else ())


def _who(config: Config) -> str:
    """Return the policy: an agent, a policy's file, a checkpoint with its folder, or the planner."""
    if config.policy:
        return config.policy.name
    trained = config.checkpoint and f"{config.checkpoint.absolute().parent.name}/{config.checkpoint.name}"
    return config.agent or trained or "planner"


def _about(config: Config, env: VecEnv) -> dict[str, Any]:
    """Return what was evaluated: room, part, robot, task, and all settings but places of outputs."""
    stage, is_pool = env.sim.stage, pool.is_index(config.stage)
    outputs = ("out", "images", "recordings", "states")
    settings = {name: value for name, value in asdict(config).items() if name not in outputs}
    settings |= {"sim": asdict(env.sim.config), "task": asdict(env.task.config)}
    return {
        "stage": config.stage.name,
        "path": str(config.stage.absolute()),
        "sha256": hashlib.sha256(config.stage.read_bytes()).hexdigest() if is_pool else layer_hash(config.stage),
        "part": None if is_pool else stage.target,
        "robot": stage.robot,
        "task": config.task.name,
        "episode_steps": env.max_episode_length,
        "seed": config.seed,
        "settings": json.loads(json.dumps(settings, default=str)),
    }


def variation(task: MdpConfig, sim: SimConfig) -> list[str]:
    """Return in what worlds of one part differ; where in nothing, they are copies and their interval is of one episode."""
    moves_object = hasattr(task, "start_shift")
    moved = [getattr(task, key, 0.0) for key in ("start_shift", "start_turn")]
    errors = [getattr(task, key, (0.0, 0.0)) for key in ("grasp_error", "grasp_turn")]  # of tasks with a handle

    def drawn_in(name: str) -> bool:
        return sim.vary is not None and len({*getattr(sim.vary, name)}) > 1

    drawn = {
        "start": task.start_noise > 0.0 or any(moved),
        "action delay": task.action_delay[0] < task.action_delay[1],
        "observed grasp": any(most > 0.0 for _, most in errors),
        "joint friction": drawn_in("joint_friction") and not moves_object,
        "joint damping": drawn_in("joint_damping") and not moves_object,
        "mass": drawn_in("mass"),
        "contact friction": drawn_in("contact_friction"),
        "gains": drawn_in("gains"),
    }
    return [name for name, differs in drawn.items() if differs]


def _beyond(planner: Planner, env: VecEnv) -> list[str]:
    """Return the rates that ask for as wide an opening as that at which a plan ends, or wider: reached by chance, or never."""
    end = float(np.abs(planner.trajectories[0].part).max()) * env.sim.stage.lever_arm
    limits = {name: limit for name, limit in env.task.thresholds.items() if name in LIMITS}
    return [name for name in env.task.RESULTS.rates if limits.get(name.removeprefix("final_"), 0.0) > end - LAG]


def _refuse_contradictions(config: Config) -> None:
    """Raise for keys that cannot go together, before an evaluation is spent on them."""
    if config.export and not config.checkpoint and not (config.policy and is_depth(config.policy)):
        raise InputError("key 'export' is true, and there is no checkpoint to export; give checkpoint=.../model_N.pt")
    if config.export and config.checkpoint and config.checkpoint.is_file():
        require_writable(config.checkpoint, "give export=false, or copy the run's folder")
    actors = {name: getattr(config, name) for name in ("agent", "checkpoint", "policy") if getattr(config, name)}
    if len(actors) > 1:
        given = " and ".join(f"{name!r} ({value})" for name, value in actors.items())
        raise InputError(f"keys {given}: only one can drive the robot; leave the other out")
    if pool.is_index(config.stage):
        _refuse_of_a_pool(config)
    for name, folder in (("images", config.images), ("recordings", config.recordings)):
        if folder and folder.exists() and not folder.is_dir():
            raise InputError(f"key {name!r} is {str(folder)!r}, a file; give a folder")


def _based(stage: SimStage, config: Config) -> SimStage:
    """Return the stage with a base from which the planner can do all of the task, if that is asked for."""
    task = tasks.task(config.task.name)
    if not config.search_base:
        return stage
    if task.tool_path is Task.tool_path:
        raise InputError(f"key 'search_base' is true, and task={config.task.name} always searches; leave it out")

    tool_path, planner = partial(task.tool_path, config=config.task), config.planner
    failure: Unreachable | None = None
    for variant in variants(stage.joint, stage.grasp, internal=stage.internal):
        path_of = partial(variant_path, settings=planner, tool_path=tool_path, variant=variant)
        try:
            return ready_to_move(stage, path_of, config.robot, planner.start_noise, planner.seed, may_push=task.PUSHES)
        except Unreachable as error:
            failure = failure or error
    assert failure is not None, "there are variants to try"
    raise failure


def _refuse_of_a_pool(config: Config) -> None:
    """Raise for keys that mean one room, and for parts without an episode."""
    if config.images or config.recordings or config.states or config.search_base:
        raise InputError(
            "keys 'images', 'recordings', 'states' and 'search_base' are for one room; "
            f"{config.stage} has the parts of many: give a sim.usd"
        )
    if config.num_envs < (count := len(pool.read(config.stage))):
        raise InputError(
            f"key 'num_envs' is {config.num_envs}, and {config.stage} has {count} parts; give {count} or more"
        )


def run(config: Config) -> str:
    """Run one episode in every world, write the metrics, and return the rates."""
    _refuse_contradictions(config)
    if config.physics == "soft":
        return _run_soft(config)
    file = read_policy(config.policy, config.depth_camera) if config.policy else None
    world = (
        file.worlds(config.sim, config.task) if file else read_world(config.checkpoint) if config.checkpoint else None
    )
    sim_config, task = world or (config.sim, config.task)
    with atomic_write(config.out) as out:
        device = device_of(config.device)
        stages = [_based(stage, config) for stage in config.read_stages()]
        sim = Simulation(stages, sim_config, config.num_envs, device)
        recorder = Recorder(sim) if config.recordings else None
        played = states.Watch(sim) if config.states else None
        env = make_env(sim, task, config.metrics, {}, config.seed)
        policy = _policy(config, env, file)
        if isinstance(policy, Planner):
            env.lengthen(policy.episode_steps)
        album, use = Album(env), LimitUse(sim)
        views: dict[int, Image.Image] = {}

        def watch() -> None:
            use.watch(env.episode_step == 0)
            if config.images:  # it waits for the device in every step
                album.watch()
                if isinstance(policy, Follower) and int(env.episode_step[0]) in SEEN:
                    views[int(env.episode_step[0])] = policy.image(torch.arange(min(8, env.num_envs)))
            if recorder:
                recorder.watch(env.done.bool())
            if played:
                played.sample(env.done)

        origin = {**_about(config, env), "policy": _who(config), **provenance(sim.device)}
        columns = run_episodes(env, policy, watch)
        metrics: dict[str, Any] = {"episodes": env.num_envs, **summary(env, columns)}
        differs = variation(env.task.config, env.sim.config) + ["depth cameras"] * isinstance(policy, Follower)
        metrics |= {"limit_use": use.fractions(), **origin, "variation": differs}
        beyond = _beyond(policy, env) if isinstance(policy, Planner) and len(stages) == 1 else []
        metrics["beyond_plan"] = [name for name in beyond if metrics[name]["rate"] == 0.0]
        metrics["meanings"] = meanings({**env.task.RESULTS.rates, **env.task.RESULTS.values})
        names = list(env.task.RESULTS.rates)
        if pool.is_index(config.stage):
            rates = {name: columns[name].numpy() for name in names}
            metrics |= by_part(rates, pool.read(config.stage), sim.stage_of_env, config.seed)
        out.write_text(json.dumps(metrics, indent=1))
    if not metrics["variation"] and isinstance(policy, Planner) and env.num_envs > len(stages):
        _log.warning(
            "worlds of a part are copies of one another, so the intervals have no meaning; give task.start_noise"
        )
    if config.export and config.checkpoint:
        export(load_model(env, config.checkpoint), config.checkpoint)
    if config.export and isinstance(file, DepthPolicy):
        export_depth(file.network, config.out)
    if config.images:
        for step, image in views.items():
            with atomic_write(config.images / f"seen_{step}.png") as place:
                image.save(place, "PNG")
    _save(config, sim, album, played.states(columns.get("success")) if played else None, recorder)
    return "\n".join(
        [
            f"{config.out}: {metrics['episodes']} episodes of {metrics['episode_steps']} steps; "
            f"worlds differ in: {', '.join(metrics['variation']) or 'nothing'}",
            *_lines(metrics, names, list(env.task.RESULTS.values)),
        ]
    )


def _save(
    config: Config, sim: Simulation, album: Album, played: states.States | None, recorder: Recorder | None
) -> None:
    """Write what was watched beside the metrics: images, states, sensors."""
    if config.images:
        config.images.mkdir(parents=True, exist_ok=True)
        album.save(Camera(sim.stage, config.camera), config.images)
    if config.states and played:
        with atomic_write(config.states) as out:
            states.write(played, out)
    if config.recordings and recorder:
        config.recordings.mkdir(parents=True, exist_ok=True)
        recorder.save(config.recordings)


def _lines(metrics: dict[str, Any], names: Sequence[str], values: Sequence[str]) -> list[str]:
    """Return the rates, values and use of the robot's limits as text."""
    beyond = metrics.get("beyond_plan", [])
    shown = {name: metrics[name] for name in names if name not in beyond}
    lines = [f"  {name:24}{r['rate']:6.1%}  [{r['low']:.1%}, {r['high']:.1%}]" for name, r in shown.items()]
    lines += [f"  not reachable by the plan (planner.opening): {', '.join(beyond)}"] if beyond else []
    units = {name: re.search(r" \[([^\]]+)\]", text) for name, text in metrics.get("meanings", {}).items()}
    for name, v in ((name, metrics[name]) for name in values if name in metrics):
        unit = f" {match[1]}" if (match := units.get(name)) else ""
        lines.append(f"  {name:24}mean {v['mean']:.3f}{unit}, min {v['min']:.3f}{unit}")
    used = ", ".join(f"{name.replace('_', ' ')} {fraction:.0%}" for name, fraction in metrics["limit_use"].items())
    return [*lines, f"  peak use of the robot's limits: {used}"]


def _run_soft(config: Config) -> str:
    """Do what `run` does with a soft body."""
    metrics, names, values = run_soft(config)
    return "\n".join([f"{config.out}: {metrics['episodes']} trials", *_lines(metrics, names, values)])
