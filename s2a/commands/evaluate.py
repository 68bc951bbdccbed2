"""sim.usd and a policy or the planner -> metrics.json."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import torch
from PIL import Image

from s2a import robot
from s2a.env.vec_env import VecEnv
from s2a.errors import InputError
from s2a.evaluate import Agent, Policy, baseline, evaluate, warn_of_errors
from s2a.outputs import atomic_write
from s2a.planner.motion import Planner, PlannerConfig
from s2a.provenance import provenance
from s2a.ranges import Count, CountFromZero
from s2a.rl.checkpoint import load_model, load_policy
from s2a.rl.export import export
from s2a.rl.run_world import read_world
from s2a.robot.spec import RobotSpec
from s2a.sim.camera import Camera, CameraConfig
from s2a.sim.limit_use import LimitUse
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.sim.world import read_stage
from s2a.tasks import MdpSettings, MetricSettings, make_env
from s2a.usd.sim_check import refuse_unphysical


@dataclass(frozen=True)
class Config:
    """Keys of `s2a evaluate`.

    Attributes:
        stage: the sim.usd.
        part: id of the articulated part; null: the only one of the stage.
        out: the metrics.json to write.
        checkpoint: model_N.pt of a training run, or null: the planner.
        agent: who acts instead, as a baseline: zero (actions of 0), random (uniform in [-1, 1]), extreme (-1 and 1, held for up
            to four seconds); or null.
        export: write the checkpoint as TorchScript and ONNX too, beside it.
        num_envs: worlds, one episode each.
        device: cpu, cuda:0, or auto: a GPU where there is one.
        seed: of the start noise.
        robot: the robot that the stage was prepared for.
        sim: how physics is stepped; a checkpoint brings that of its training.
        task: what the robot has to do; a checkpoint brings that of its training.
        metrics: what is reported of an episode.
        planner: the planner's motion.
        images: folder for before.png and after.png (world 0 where its part moved farthest), or null.
        camera: how they are taken.
    """

    stage: Path
    part: str | None
    out: Path
    checkpoint: Path | None
    agent: Agent | None
    export: bool
    num_envs: Count
    device: str
    seed: CountFromZero
    robot: RobotSpec
    sim: SimConfig
    task: MdpSettings
    metrics: MetricSettings
    planner: PlannerConfig
    images: Path | None
    camera: CameraConfig


class Album:
    """World 0 as it began and where its part was farthest from there in its first episode, as joint coordinates."""

    def __init__(self, env: VecEnv) -> None:
        """Keep the environment that is watched."""
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
            Image.fromarray(camera.image(pose)).save(folder / f"{name}.png")


def _policy(config: Config, env: VecEnv) -> Policy:
    """Return who acts."""
    if config.agent:
        return baseline(config.agent, env, config.seed)
    return load_policy(env, config.checkpoint) if config.checkpoint else Planner(env, config.planner)


def _who(config: Config) -> str:
    """Return who acts: an agent, a checkpoint with its folder, or the planner."""
    trained = config.checkpoint and f"{config.checkpoint.absolute().parent.name}/{config.checkpoint.name}"
    return config.agent or trained or "planner"


def _refuse_contradictions(config: Config) -> None:
    """Raise for keys that cannot go together, before an evaluation is spent on them."""
    if config.export and not config.checkpoint:
        raise InputError("key 'export' is true, and there is no checkpoint to export; give checkpoint=.../model_N.pt")
    if config.agent and config.checkpoint:
        raise InputError(
            f"keys 'agent' ({config.agent}) and 'checkpoint' ({config.checkpoint}): only one can act; drop the other"
        )
    if config.images and config.images.exists() and not config.images.is_dir():
        raise InputError(f"key 'images' is {str(config.images)!r}, a file; give a folder")


def run(config: Config) -> str:
    """Run one episode in every world, write the metrics, and return the rates."""
    _refuse_contradictions(config)
    world = read_world(config.checkpoint) if config.checkpoint else None
    sim_config, task = world or (config.sim, config.task)
    with atomic_write(config.out) as out:
        refuse_unphysical(config.stage)
        stage = read_stage(config.stage, config.part, robot=config.robot.name)
        robot.check_unchanged(config.robot)
        sim = Simulation(stage, sim_config, config.num_envs, device_of(config.device))
        env = make_env(sim, task, config.metrics, {}, config.seed)
        policy = _policy(config, env)
        album, use = Album(env), LimitUse(sim)

        def watch() -> None:
            use.watch(env.episode_step == 0)
            if config.images:  # it waits for the device in every step
                album.watch()

        origin = {"stage": config.stage.name, "policy": _who(config), "seed": config.seed, **provenance(sim.device)}
        metrics = evaluate(env, policy, watch) | {"limit_use": use.fractions()} | origin
        out.write_text(json.dumps(metrics, indent=1))
    warn_of_errors(metrics, env)
    if config.export and config.checkpoint:
        export(load_model(env, config.checkpoint), config.checkpoint)
    if config.images:
        config.images.mkdir(parents=True, exist_ok=True)
        album.save(Camera(sim.stage, config.camera), config.images)
    names = [name for name in env.task.METRICS if name not in env.task.VALUES]
    lines = [
        f"  {name:24}{r['rate']:6.1%}  [{r['low']:.1%}, {r['high']:.1%}]" for name in names if (r := metrics[name])
    ]
    lines += [
        f"  {name:24}mean {v['mean']:.3f}, min {v['min']:.3f}" for name in env.task.VALUES if (v := metrics[name])
    ]
    used = ", ".join(f"{name.replace('_', ' ')} {fraction:.0%}" for name, fraction in use.fractions().items())
    lines.append(f"  of the robot's limits at most: {used}")
    return "\n".join([f"{config.out}: {metrics['episodes']} episodes", *lines])
