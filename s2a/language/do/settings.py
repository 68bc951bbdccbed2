"""The numbers with which skills are executed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, make_dataclass
from typing import Annotated, Any

from s2a import tasks
from s2a.core import config
from s2a.core.bounds import CountFromZero
from s2a.motion.settings import PlannerConfig
from s2a.sim.camera import CameraConfig
from s2a.sim.simulation import SimConfig
from s2a.tasks.base import Task


def _settings(kind: type[Task]) -> type:
    """Return the settings of a skill: `task` and the thresholds of its `metrics`, those of a kind of task."""
    return make_dataclass("SkillSettings", [("task", kind.Config), ("metrics", kind.Metrics)], frozen=True)


def _chosen(values: Mapping[str, Any]) -> type:
    """Return the dataclass of a command's key `skills`: the settings of each skill by its name."""
    fields = [(name, _settings(tasks.of(each))) for name, each in values["skills"].items()]
    return make_dataclass("Skills", fields, frozen=True)


Skills = Annotated[Any, config.Chosen(_chosen)]
"""A command's key `skills`: `task` and `metrics` of each skill by its name."""


def tasks_of(skills: Any) -> dict[str, type[Task]]:
    """Return the task of each skill of a command's key `skills`."""
    return {name: tasks.task(each.task.name) for name, each in vars(skills).items()}


@dataclass(frozen=True)
class ExecutionConfig:
    """How skills are executed.

    Attributes:
        robot: name of the robot.
        device: of the simulation.
        seed: of the start noise.
        sim: how physics is stepped, the same for all skills.
        skills: their tasks, as the key `skills`.
        planner: the planner's motion.
        camera: of the images.
    """

    robot: str
    device: str
    seed: CountFromZero
    sim: SimConfig
    skills: Any
    planner: PlannerConfig
    camera: CameraConfig
