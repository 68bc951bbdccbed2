"""What a task is to the environment: its settings, its kernels, and the names of its columns."""

from __future__ import annotations

import inspect
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
import warp as wp

from s2a.core.bounds import AtLeast, CountFromZero, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.env.state import State
from s2a.robot.tool_path import PathSettings, ToolPath
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage, read_stage


@dataclass(frozen=True)
class MdpConfig:
    """What every task's decision process has; each task's own settings add to it.

    Attributes:
        name: of the task.
        episode_steps: control steps after which an episode is cut.
        action_scale: speed of a joint target for an action of 1 [rad/s].
        finger_speed: fraction of it for the fingers [m/s].
        start_noise: half range of the uniform noise on the start position [rad, m].
        action_delay: least and greatest number of control steps by which an action comes late, drawn for an episode.
    """

    name: str
    episode_steps: Annotated[int, AtLeast(2)]
    action_scale: Positive
    finger_speed: Positive
    start_noise: NotNegative
    action_delay: tuple[CountFromZero, CountFromZero]


class Task:
    """A task in bound worlds; a subclass is one folder of `s2a.tasks`.

    Class attributes:
        Config: dataclass of the decision process's numbers, an MdpConfig.
        Metrics: dataclass of the thresholds of what is reported; none of them changes what the robot sees or is paid.
        Handles: the struct of `handles`.
        PERSISTENT: arrays in it that a later step reads before it writes them.
        REWARDS: reward terms: Warp functions (state, handles, world) -> float; their docstrings tell what the weight is of.
        METRICS: columns of a finished episode's result; each is 0 or 1 except those in VALUES.
        VALUES: columns that hold a number, in the unit that the task's documentation gives.
        LOGGED: rates over recent episodes that training logs; the first one decides which checkpoint is the best.
        Stage: what `read_stage` returns.
        PUSHES: `tool_path` heeds a stage's `push`.
        INSTRUCTION: the task in words, "{part}" for the target's label, "{into}" for that of what an object is put into.
        METRICS_VERSION: raised whenever a column changes its meaning.

    Attributes:
        config: the decision process's numbers.
        observations: length of an observation.
        privileged: how many numbers a critic is told besides.
        handles: the task's struct, which its kernels and reward terms take.
        thresholds: what counts in these worlds, by name, for reports.
        error_fraction: fraction of the episodes from which physics' errors are warned of.
    """

    Config: ClassVar[type[MdpConfig]]
    Metrics: ClassVar[type]
    Handles: ClassVar[Any]
    PERSISTENT: ClassVar[tuple[str, ...]] = ()
    REWARDS: ClassVar[Sequence[wp.Function]]
    METRICS: ClassVar[tuple[str, ...]]
    VALUES: ClassVar[tuple[str, ...]] = ()
    LOGGED: ClassVar[tuple[str, ...]]
    METRICS_VERSION: ClassVar[int]
    Stage: ClassVar[type[SimStage]] = SimStage
    PUSHES: ClassVar[bool] = False
    INSTRUCTION: ClassVar[str]

    config: Any
    observations: int
    privileged: int = 0
    handles: Any
    thresholds: Mapping[str, float]
    error_fraction: float = 0.001

    @staticmethod
    def tool_path(stage: SimStage, motion: PathSettings, config: Any) -> ToolPath:
        """Return the path of the tool frame that does the task, of these settings, in a stage: what the planner follows."""
        raise NotImplementedError

    @staticmethod
    def read_stage(
        path: Path, part: str | None, robot: str | None, also: Sequence[str], config: Any, motion: Any
    ) -> SimStage:
        """Return the stage that the task of these settings is done in by a planner of these; see `s2a.sim.world.read_stage`."""
        return read_stage(path, part, robot=robot, also=also)

    @classmethod
    def instruction(cls, stage: SimStage) -> str:
        """Return what the robot is to do in a stage, in words."""
        labels = {"part": stage.target, "into": getattr(stage, "part", "")}
        return cls.INSTRUCTION.format(**{key: each.rsplit("_", 1)[0].replace("_", " ") for key, each in labels.items()})

    def trajectory(self, settings: Any) -> Any:
        """Return the trajectory (`s2a.motion.trajectory`) of these planner settings; None: the planner follows `tool_path`."""
        return None

    def __init__(self, sim: Simulation, config: Any, metrics: Any) -> None:
        """Bind the task to worlds."""
        raise NotImplementedError

    def start(self, coords: np.ndarray) -> np.ndarray:
        """Return the coordinates with which episodes start, shape [world coord], of those that were scanned."""
        return coords

    def persistent(self) -> dict[str, wp.array]:
        """Return the arrays that a later step reads before it writes them, by name."""
        return {name: getattr(self.handles, name) for name in self.PERSISTENT}

    def seen_grasp(self) -> np.ndarray | None:
        """Return the pose of the grasp that is seen in the true grasp's frame, shape [world 7]; None: they are the same."""
        return None

    def reset(self, state: State) -> None:
        """Start a new episode where `state.done` is 1; the environment has put robot and room back."""

    def before_step(self, state: State) -> None:
        """Prepare for a control step, before physics."""

    def after_substep(self, state: State) -> None:
        """Keep what the solver forgets in its next physics step."""

    def update(self, state: State) -> None:
        """After physics: what the reward terms read; sets `state.terminated`."""

    def observe(self, state: State) -> None:
        """Write `state.observation`, and `state.privileged`."""

    def result(self, state: State) -> None:
        """Write the columns METRICS of `state.result` where `state.done` is 1."""


def meanings(terms: Sequence[wp.Function]) -> dict[str, str]:
    """Return what the weight of each reward term is of, by the term's name."""
    return {term.key: " ".join(inspect.cleandoc(term.func.__doc__ or "").split()) for term in terms}


def weights_of(terms: Sequence[wp.Function], weights: Mapping[str, float]) -> list[float]:
    """Return the weights in the terms' order, 0 for those that are not given; InputError for an unknown name."""
    names = [term.key for term in terms]
    for name in weights:
        if name not in names:
            raise InputError(f"reward term {name!r} does not exist; known: {', '.join(names)}")
    return [float(weights.get(name, 0.0)) for name in names]


def columns(names: Sequence[str]) -> Any:
    """Return an enumeration of columns by name, from 0, that kernels can use as indices."""
    return IntEnum("Column", list(names), start=0)
