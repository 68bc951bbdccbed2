"""What robots do: one folder a task, found by its name."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any

from s2a.core import config
from s2a.core.errors import InputError
from s2a.env.task import MdpConfig, Task, meanings
from s2a.env.vec_env import VecEnv
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT
from s2a.sim import pool
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage


def names() -> list[str]:
    """Return the names of all tasks: the folders beside this file."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if module.ispkg)


def task(name: str) -> type[Task]:
    """Return a task by its name; InputError for an unknown one."""
    if name not in names():
        raise InputError(f"task {name!r} is unknown{config.nearest(name, names())}")
    return importlib.import_module(f"s2a.tasks.{name}").TASK


def of(values: Mapping[str, Any]) -> type[Task]:
    """Return the task that a command's plain values mean: `task.name`."""
    settings = values.get("task")
    return task(str(settings.get("name") if isinstance(settings, Mapping) else settings))


MdpSettings = Annotated[MdpConfig, config.Chosen(lambda values: of(values).Config)]
"""A command's key `task`: the numbers of a decision process."""
MetricSettings = Annotated[Any, config.Chosen(lambda values: of(values).Metrics)]
"""A command's key `metrics`: the thresholds of what is reported."""
RewardWeights = Annotated[dict[str, float], config.Described(lambda values: meanings(of(values).REWARDS))]
"""A command's key `reward`: weights of reward terms by name; a term that is not listed weighs 0."""


def make_env(
    sim: Simulation, mdp: MdpConfig, metrics: Any, reward: Mapping[str, float], seed: int, **more: Any
) -> VecEnv:
    """Return the environment of the task that `mdp.name` says; `more` goes to VecEnv."""
    return VecEnv(sim, task(mdp.name)(sim, mdp, metrics), reward, seed, **more)


def read_stages(
    kind: type[Task], path: Path, part: str | None, robot: str | None, also: Sequence[str], config: Any, motion: Any
) -> list[SimStage]:
    """Return the stage of a room's part, as the task reads it; of the index of a pool those of all its parts.

    Args:
        kind: the task.
        path: a sim.usd, or an index.
        part: of a room; None: its only one.
        robot: its name; None: the one that the room was prepared for.
        also: ids of further parts and free objects of a room that move.
        config: the task's settings.
        motion: the planner's settings.

    Raises:
        InputError: as the task's; an unphysical room; an index of which something is to be chosen.
    """
    if not pool.is_index(path):
        refuse_unphysical(path)
        return [kind.read_stage(path, part, robot, also, config, motion)]
    if part or also:
        raise InputError(f"keys 'part' and 'also' choose from a room; {path} has the parts of a pool: leave them out")
    return pool.stages(path, robot or DEFAULT_ROBOT)
