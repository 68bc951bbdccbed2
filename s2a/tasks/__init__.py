"""Tasks: the vectorised environment, and one file a task, found by its name or by its path."""

import importlib
import importlib.util
import sys
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Annotated, Any

import gymnasium
import warp as wp

from s2a import robot as robots
from s2a.core import config
from s2a.core.errors import InputError
from s2a.motion.trajectory import PlannerConfig
from s2a.scene.usd.sim_read import refuse_unphysical
from s2a.scene.usd.sim_scene import DEFAULT_ROBOT
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.sim.world import SimStage
from s2a.tasks import pool
from s2a.tasks.base import MdpConfig, Task, meanings
from s2a.tasks.env import TaskVectorEnv, VecEnv


def names() -> list[str]:
    """Return the names of the package's tasks: the files of conf/task."""
    return sorted(path.stem for path in (config.folder() / "task").glob("*.yaml"))


def task(name: str) -> type[Task]:
    """Return a task by its name or its file, FILE.py; InputError for an unknown one."""
    if name.endswith(".py"):
        module = _of_file(Path(name).expanduser().resolve())
    elif name in names():
        module = importlib.import_module(f"s2a.tasks.{name}")
    else:
        raise InputError(f"task {name!r} is unknown{config.nearest(name, names())}; or give a file, task=FILE.py")
    kind = getattr(module, "TASK", None)
    if not (isinstance(kind, type) and issubclass(kind, Task)):
        raise InputError(f"{name}: no TASK; give it a subclass of s2a.tasks.base.Task, as docs/new_task.md shows")
    return kind


@cache
def _of_file(file: Path) -> ModuleType:
    """Return the module of a task's file; Warp looks for it among the modules."""
    name = f"s2a_task_{file.stem}"
    spec = importlib.util.spec_from_file_location(name, file)
    if not file.is_file() or spec is None or spec.loader is None:
        raise InputError(f"{file}: no such file of a task")
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def of(values: Mapping[str, Any]) -> type[Task]:
    """Return the task that a command's plain values mean: `task.name`."""
    settings = values.get("task")
    return task(str(settings.get("name") if isinstance(settings, Mapping) else settings))


# A command's key `task`: the settings of a decision process
MdpSettings = Annotated[MdpConfig, config.Chosen(lambda values: of(values).Config)]
# A command's key `metrics`: the thresholds of what is reported
MetricSettings = Annotated[Any, config.Chosen(lambda values: of(values).Metrics)]
# A command's key `reward`: weights of reward terms by name; a term that is not listed weighs 0
RewardWeights = Annotated[dict[str, float], config.Described(lambda values: meanings(of(values).REWARDS))]


def make_env(
    sim: Simulation, mdp: MdpConfig, metrics: Any, reward: Mapping[str, float], seed: int, **more: Any
) -> VecEnv:
    """Return the environment of the task that `mdp.name` says; `more` goes to VecEnv.

    Raises:
        InputError: the metrics are of another task, as where a policy's own task takes the place of the one that was given.
    """
    kind = task(mdp.name)
    if not isinstance(metrics, kind.Metrics):
        raise InputError(
            f"the policy is of task {mdp.name!r}, and key 'task' names another one; "
            f"give task={mdp.name}, or a policy of the other task"
        )
    return VecEnv(sim, kind(sim, mdp, metrics), reward, seed, **more)


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
        InputError: as the task's; an unphysical room; an index of which something is to be chosen; a robot that drives.
    """
    if robot and robots.load(robot).drive is not None:
        raise InputError(
            f"robot {robot!r} has a driving base, which only s2a do supports; give one with a fixed base, robot={DEFAULT_ROBOT}"
        )
    if not pool.is_index(path):
        refuse_unphysical(path)
        return [kind.read_stage(path, part, robot, also, config, motion)]
    if part or also:
        raise InputError(f"keys 'part' and 'also' choose from a room; {path} has the parts of a pool: leave them out")
    return pool.stages(path, robot or DEFAULT_ROBOT)


def make(
    name: str,
    room: Path,
    part: str | None,
    num_envs: int,
    device: str,
    seed: int,
    overrides: Sequence[str],
    numpy: bool,
) -> TaskVectorEnv:
    """Return a task in worlds of a simulation-ready room, or of the parts of many; arguments are those of `s2a.api.make`."""
    wp.config.log_level = wp.LOG_WARNING  # its lines of versions and modules go to stdout
    kind = task(name)
    values = config.compose("train", [f"task={name}", "stage=-", "out=-", *overrides])
    mdp = config.load(kind.Config, values["task"])
    metrics: Any = config.load(kind.Metrics, values["metrics"])
    is_named = any(each.startswith("robot=") for each in overrides)  # else the one that the room was prepared for
    motion, robot = config.load(PlannerConfig, values["planner"]), values["robot"] if is_named else None
    stages = read_stages(kind, room, part, robot, (), mdp, motion)
    sim = Simulation(stages, config.load(SimConfig, values["sim"]), num_envs, device_of(device))
    return TaskVectorEnv(make_env(sim, mdp, metrics, values["reward"], seed, final_observation=True), numpy)


def _register() -> None:
    """Register every task with Gymnasium, `open_part` as s2a/OpenPart-v1; its environments return NumPy arrays."""
    for name in names():
        title = "".join(word.capitalize() for word in name.split("_"))
        gymnasium.register(f"s2a/{title}-v1", vector_entry_point="s2a.api:make", kwargs={"task": name, "numpy": True})


_register()
