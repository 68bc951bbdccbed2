"""Worlds with a part to open, for tests: with physics, or with a part and contacts that move as the test says."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import torch
import warp as wp
from cabinet import HANDLE
from settings import load

from s2a import tasks
from s2a.scene.scene import Joint
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.env import VecEnv
from s2a.tasks.mdp.grasp import is_grasped, opening_force
from s2a.tasks.open_part import OpenPartConfig, OpenPartMetrics
from s2a.tasks.state import World

RADIUS = 0.3
"""From the hinge to the handle [m], where a test makes the stage a hinge's."""


def task_settings(**changes: Any) -> OpenPartConfig:
    """Return the decision process of conf/, some of its numbers changed."""
    return load(OpenPartConfig, "task/open_part", **changes)


def metric_settings(**changes: Any) -> OpenPartMetrics:
    """Return the thresholds of conf/, some of them changed."""
    return load(OpenPartMetrics, "metrics/open_part", **changes)


def make_env(
    stage: SimStage | Path | list[SimStage],
    num_envs: int = 2,
    seed: int = 0,
    sim: str | Simulation = "sim/paper",
    graph: bool = False,
    **task: Any,
) -> VecEnv:
    """Return worlds of a stage with the reference's settings, some of the task's changed.

    Their step is not captured but with `graph`: tests take parts of it away, and look into it.
    """
    if isinstance(sim, str):
        stage = read_stage(stage) if isinstance(stage, Path) else stage
        sim = Simulation(stage, load(SimConfig, sim), num_envs)
    return tasks.make_env(sim, task_settings(**task), metric_settings(), load(dict, "reward/paper"), seed, graph=graph)


def hold_still(env: VecEnv) -> VecEnv:
    """Let physics leave the state and the contacts as the test puts them: a control step is one that changes nothing."""
    env.task.sensor.update = lambda: None
    env.sim.step = lambda: [watch() for watch in env.sim.after_substep]
    return env


def open_to(env: VecEnv, opening: float | torch.Tensor, feel: Callable[[], object] = lambda: None) -> None:
    """Do a control step without an action, in which the part's coordinate becomes `opening`, with the contacts of `feel`."""
    env.sim.joint_q[:, env.sim.layout.part_coord] = opening
    env.task.sensor.update = feel
    env.step(torch.zeros(env.num_envs, env.num_actions))
    env.task.sensor.update = lambda: None


def contacts(env: VecEnv) -> dict[str, torch.Tensor]:
    """Return tensors that share the memory of the contacts that the task reads."""
    found = env.task.world.contacts
    return {
        name: wp.to_torch(getattr(found, name)) for name in ("normal", "on_region", "off_region", "other_links", "pull")
    }


def counts(env: VecEnv) -> dict[str, float]:
    """Return the sums over finished episodes by name."""
    return dict(zip(("episodes", *env.columns), env.counts.tolist(), strict=True))


def column(env: VecEnv, name: str) -> list[float]:
    """Return a column of how the last finished episodes went."""
    return env.result[:, env.columns.index(name)].tolist()


def term(env: VecEnv, name: str) -> torch.Tensor:
    """Return a reward term [world] of the last step."""
    return env.terms[:, list(env.task.REWARDS).index(name)]


def opens_backwards(stage: SimStage) -> SimStage:
    """Return a stage whose joint opens towards its lower limit."""
    return replace(stage, joint=replace(stage.joint, limits=(-0.4, 0.0)))


def hinge(stage: SimStage, limits: tuple[float, float] = (-0.5, 1.2)) -> SimStage:
    """Return a stage that says of itself it is a hinge, RADIUS beside the handle."""
    origin = HANDLE + [0.0, RADIUS, 0.0]
    return replace(stage, joint=Joint("revolute", (0.0, 0.0, 1.0), tuple(origin), limits))


@wp.kernel
def _measure(w: World, sense: float, force: wp.array2d(dtype=float), grasped: wp.array(dtype=int)):
    world = wp.tid()
    for i in range(2):
        force[world, i] = opening_force(w.target[world], w.contacts.pull[world, i])
    grasped[world] = int(is_grasped(w, w.number.contact_force, sense, world))


def opening_forces(env: VecEnv) -> torch.Tensor:
    """Return the force along the opening [N] of the fingers on the region and of all else of the robot, shape [world 2]."""
    return _measured(env, 1.0)[0]


def grasped(env: VecEnv, sense: float = 1.0) -> list[int]:
    """Return where the part is grasped (1) while it is moved in a sense: 1 opens, -1 closes."""
    return _measured(env, sense)[1].tolist()


def _measured(env: VecEnv, sense: float) -> tuple[torch.Tensor, torch.Tensor]:
    force, held = wp.zeros((env.num_envs, 2), dtype=float), wp.zeros(env.num_envs, dtype=int)
    wp.launch(_measure, dim=env.num_envs, inputs=[env.task.world, sense, force, held])
    return wp.to_torch(force), wp.to_torch(held)
