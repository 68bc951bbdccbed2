"""The numbers with which skills are executed."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.bounds import CountFromZero
from s2a.motion.settings import PlannerConfig
from s2a.sim.camera import CameraConfig
from s2a.sim.simulation import SimConfig
from s2a.tasks.close_part.config import ClosePartConfig, ClosePartMetrics
from s2a.tasks.open_part.config import OpenPartConfig, OpenPartMetrics
from s2a.tasks.pick_place.config import PickPlaceConfig, PickPlaceMetrics
from s2a.tasks.put_in.config import PutInConfig, PutInMetrics


@dataclass(frozen=True)
class OpenSkill:
    """Opening a part: its `task` and the thresholds of its `metrics`."""

    task: OpenPartConfig
    metrics: OpenPartMetrics


@dataclass(frozen=True)
class CloseSkill:
    """Closing a part: its `task` and the thresholds of its `metrics`."""

    task: ClosePartConfig
    metrics: ClosePartMetrics


@dataclass(frozen=True)
class PickPlaceSkill:
    """Picking an object and placing it: its `task` and the thresholds of its `metrics`."""

    task: PickPlaceConfig
    metrics: PickPlaceMetrics


@dataclass(frozen=True)
class PutInSkill:
    """Putting an object into a part: its `task` and the thresholds of its `metrics`."""

    task: PutInConfig
    metrics: PutInMetrics


@dataclass(frozen=True)
class Skills:
    """The task of every skill.

    Attributes:
        open: task open_part.
        close: task close_part; `start_opening` is what the skill before left.
        pick_place: task pick_place; `start` and `place` are what the skill says.
        put_in: task put_in; likewise.
    """

    open: OpenSkill
    close: CloseSkill
    pick_place: PickPlaceSkill
    put_in: PutInSkill


@dataclass(frozen=True)
class ExecutionConfig:
    """How skills are executed.

    Attributes:
        robot: name of the robot.
        device: of the simulation.
        seed: of the start noise.
        sim: how physics is stepped, the same for all skills.
        skills: their tasks.
        planner: the planner's motion.
        camera: of the images.
    """

    robot: str
    device: str
    seed: CountFromZero
    sim: SimConfig
    skills: Skills
    planner: PlannerConfig
    camera: CameraConfig
