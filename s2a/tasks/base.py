"""A task: its settings, its terms by name, and the hooks in which its own kernels run."""

import inspect
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import warp as wp

from s2a.core.bounds import AtLeast, CountFromZero, Fraction, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.motion.floor import FreeFloor
from s2a.robot.tool_path import PathSettings, ToolPath
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage, stage_of
from s2a.tasks import state
from s2a.tasks.kernels import observation_kernel, result_kernel
from s2a.tasks.mdp import grasp
from s2a.tasks.mdp.grasp import clear_contacts, keep_region_force
from s2a.tasks.state import PERSISTENT, State

Terms = Mapping[str, wp.Function]  # Warp functions of (State, World, world) by name


@dataclass(frozen=True)
class MdpConfig:
    """Settings of every task's decision process; each task's own add to them.

    Attributes:
        name: name of the task.
        episode_steps: control steps after which an episode is cut.
        action_scale: speed of a joint target for an action of 1 [rad/s].
        finger_speed: fraction of it for the fingers [m/s].
        start_noise: half range of the uniform noise on the start position [rad, m].
        action_delay: minimum and maximum delay of an action in control steps, drawn for an episode.
    """

    name: str
    episode_steps: Annotated[int, AtLeast(2)]
    action_scale: Positive
    finger_speed: Positive
    start_noise: NotNegative
    action_delay: tuple[CountFromZero, CountFromZero]


@dataclass(frozen=True)
class PartMdp(MdpConfig):
    """Settings of the decision processes with a part on a joint.

    Attributes:
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        tcp_offset: shift of the tool frame from the point between the pads, in that frame [m].
        describe_part: for a policy of many parts: observe their differences too, and give the critic what no sensor measures
            (`s2a.tasks.mdp.observations`).
        fine_grasp: observe the vector to the grasp in finer units too, and whether the gripper holds from within.
        grasp_error: minimum and maximum distance of the observed grasp from the true one [m], drawn for an episode.
        grasp_turn: minimum and maximum angle between them [degree], about any axis.
        contact_distance: distance of a contact from the annotated region up to which it is on it [m].
        contact_force: normal force from which a contact counts [N].
    """

    velocity_scale: float
    observation_limit: Positive
    tcp_offset: tuple[float, float, float]
    describe_part: bool
    fine_grasp: bool
    grasp_error: tuple[NotNegative, NotNegative]
    grasp_turn: tuple[NotNegative, NotNegative]
    contact_distance: NotNegative
    contact_force: NotNegative


@dataclass(frozen=True, kw_only=True)
class MetricsConfig:
    """Thresholds of what is reported, of every task; they change neither what the robot sees nor its reward.

    Attributes:
        error_fraction: fraction of the episodes from which infinite values, dropped rows and dropped contacts are warned of.
    """

    error_fraction: Fraction = 0.001


@dataclass(frozen=True)
class Results:
    """Results of a finished episode: columns of `State.result` by name."""

    rates: Terms  # columns of 0 or 1
    values: Terms  # columns of a number
    # rates over recent episodes that training logs; the first one decides which checkpoint is the best, and which
    # demonstrations are kept
    logged: tuple[str, ...]
    success: str  # the rate by which the task counts as done
    version: int  # raised whenever a column changes its meaning

    @property
    def names(self) -> tuple[str, ...]:
        """All columns."""
        return (*self.rates, *self.values)


@dataclass(frozen=True)
class Instruction:
    """A task in words: what the robot is to do, and what a request for it needs.

    Attributes:
        text: the task, with "{part}" for the target's label and "{into}" for that of what an object is put into.
        takes: what a request names: "part", "object", "support".
        phrases: verbs with which English requests for a task that takes a part alone begin.
        needs: what it needs of the room, and does, in sentences for a language model.
        begins, leaves: the part before and after it, where that is decided.
    """

    text: str
    takes: tuple[str, ...]
    needs: str
    phrases: tuple[str, ...] = ()
    begins: Literal["open", "shut"] | None = None
    leaves: Literal["open", "shut"] | None = None


class Task:
    """A task in bound worlds; a subclass is one file.

    Class attributes:
        Config: dataclass of the decision process's settings, an MdpConfig.
        Metrics: dataclass of the thresholds of what is reported, a MetricsConfig.
        REWARDS: reward terms; their docstrings tell what the weight is of.
        OBSERVATIONS: observation terms in their order, by the setting that turns them on; "" stands for always.
        CRITIC: likewise what a critic observes besides.
        RESULTS: what an episode came to.
        OWN: names of the task's own columns of `World.own`.
        INSTRUCTION: the task in words.
        Stage: what `read_stage` returns.
        PUSHES: `tool_path` heeds a stage's `push`.

    Attributes:
        sim: the worlds.
        config: the decision process's settings.
        metrics: the thresholds of what is reported.
        sensor: of the contacts with the target.
        world: the struct that terms take.
        columns: of an observation by term.
        observations: length of an observation.
        privileged: how many numbers a critic observes besides.
        thresholds: what counts in these worlds, by name, for reports.
    """

    Config: ClassVar[type[MdpConfig]]
    Metrics: ClassVar[type[MetricsConfig]]
    REWARDS: ClassVar[Terms]
    OBSERVATIONS: ClassVar[Mapping[str, Sequence[wp.Function]]]
    CRITIC: ClassVar[Mapping[str, Sequence[wp.Function]]] = {}
    RESULTS: ClassVar[Results]
    OWN: ClassVar[tuple[str, ...]] = ()
    INSTRUCTION: ClassVar[Instruction]
    Stage: ClassVar[type[SimStage]] = SimStage
    PUSHES: ClassVar[bool] = False

    def __init__(self, sim: Simulation, config: Any, metrics: Any) -> None:
        """Bind the task to worlds.

        Raises:
            InputError: settings that exclude each other.
        """
        self.sim, self.config, self.metrics = sim, config, metrics
        self.thresholds: Mapping[str, float] = {}
        if getattr(config, "fine_grasp", False) and not getattr(config, "describe_part", False):
            raise InputError("key 'task.fine_grasp' adds to what task.describe_part=true observes; give that, too")
        with wp.ScopedDevice(sim.device):
            self.sensor = ContactSensor(sim, getattr(config, "contact_distance", 0.0))
            self.world = state.bind(sim, self.sensor, config, metrics, len(self.OWN))
            self.bind()
            joints = sim.layout.robot_joints
            self.columns, self.observations, self._observe = _layout(active(self.OBSERVATIONS, config), joints)
            _, self.privileged, self._observe_privileged = _layout(active(self.CRITIC, config), joints)
            self._write_result = result_kernel(list({**self.RESULTS.rates, **self.RESULTS.values}.values()))

    # What a task adds: its stage, its motion, its start, and its own kernels.

    @staticmethod
    def read_stage(
        path: Path,
        part: str | None,
        robot: str | None,
        also: Sequence[str],
        config: Any,
        motion: Any,
        room: SimRoom | None = None,
        floor: FreeFloor | None = None,
    ) -> SimStage:
        """Return the stage that the task of these settings is done in by a planner of these; see `s2a.sim.world.read_stage`.

        `room`: as it stands now, of which the path is the file; None: as it is there. `floor`: on which the robot drives.
        """
        return stage_of(path, room or sim_stage.read(path, visuals=False), part, robot=robot, also=also)

    @staticmethod
    def tool_path(stage: SimStage, motion: PathSettings, config: Any) -> ToolPath:
        """Return the path of the tool frame that does the task, of these settings, in a stage: what the planner follows."""
        raise NotImplementedError

    @staticmethod
    def requested(config: Any, place: str | None, opened: float) -> Any:
        """Return the settings for a request.

        Args:
            config: the task's settings.
            place: id of the support or part where an object is to be put; None for tasks without one.
            opened: how far the part is open as the task begins [m].
        """
        return config

    def trajectory(self, settings: Any) -> Any:
        """Return the trajectory (`s2a.motion.trajectory`) of these planner settings; None: the planner follows `tool_path`."""
        return None

    def bind(self) -> None:
        """Set `thresholds`, and what of `world` is the task's own."""

    def start(self, coords: np.ndarray) -> np.ndarray:
        """Return the coordinates with which episodes start, shape [world coord], of those that were scanned."""
        return coords

    def reset(self, state: State) -> None:
        """Start a new episode where `state.done` is 1; the environment has put robot and room back."""
        self._draw_seen_grasp(state)

    def before_step(self, state: State) -> None:
        """Prepare for a control step, before physics."""
        self.launch(clear_contacts, state)

    def after_substep(self, state: State) -> None:
        """Keep what the solver forgets in its next physics step."""
        self.sensor.update()
        if self.world.region_force.size:
            self.launch(keep_region_force, state)

    def update(self, state: State) -> None:
        """After physics: what terms read; may set `state.terminated`."""

    # What the environment and others call besides.

    def launch(self, kernel: wp.Kernel, state: State, *more: object) -> None:
        """Launch a kernel of (State, World, ...) in all worlds."""
        wp.launch(kernel, dim=len(state.done), inputs=[state, self.world, *more])

    def now(self, state: State) -> tuple[wp.array, wp.array]:
        """Return coordinates [world coord] and poses [world body] after the last physics step.

        After an odd number of physics steps they are in the simulation's other buffer.
        """
        now = self.sim.state
        return self.sim.of_worlds(now.joint_q), now.body_q.reshape(state.body_q.shape)

    def observe(self, state: State) -> None:
        """Write `state.observation`, and `state.privileged`."""
        limit = getattr(self.config, "observation_limit", 0.0)
        self.launch(self._observe, state, state.observation, limit)
        if self.privileged:
            self.launch(self._observe_privileged, state, state.privileged, 0.0)

    def result(self, state: State) -> None:
        """Write the task's columns of `state.result` where `state.done` is 1."""
        self.launch(self._write_result, state)

    def persistent(self) -> dict[str, wp.array]:
        """Return the arrays that a later step reads before it writes them, by name."""
        arrays = {name: getattr(self.world, name) for name in PERSISTENT}
        return {name: array for name, array in arrays.items() if array is not None and array.size}

    def seen_grasp(self) -> np.ndarray | None:
        """Return the pose of the grasp that is seen in the true grasp's frame, shape [world 7]; None: they are the same."""
        return self.world.seen.numpy() if any(map(max, self._errors())) else None

    @classmethod
    def instruction(cls, stage: SimStage) -> str:
        """Return what the robot is to do in a stage, in words."""
        labels = {"part": stage.target, "into": getattr(stage, "part", "")}
        words = {key: each.rsplit("_", 1)[0].replace("_", " ") for key, each in labels.items()}
        return cls.INSTRUCTION.text.format(**words)

    def _errors(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return least and greatest error of the seen grasp [m] and [degree]."""
        none = (0.0, 0.0)
        return getattr(self.config, "grasp_error", none), getattr(self.config, "grasp_turn", none)

    def _draw_seen_grasp(self, state: State) -> None:
        """Draw a new error of the grasp that is seen in worlds whose episode ended."""
        if any(map(max, self._errors())):  # else the stream of random numbers stays as it is
            length, turn = self._errors()
            self.launch(grasp.misplace, state, wp.vec2(*length), wp.vec2(*map(math.radians, turn)))


def terms(*functions: wp.Function) -> dict[str, wp.Function]:
    """Return functions by their own names."""
    return {each.key: each for each in functions}


def meanings(rewards: Terms) -> dict[str, str]:
    """Return what the weight of each reward term is of, by the term's name."""
    return {name: " ".join(inspect.cleandoc(each.func.__doc__ or "").split()) for name, each in rewards.items()}


def weights_of(rewards: Terms, weights: Mapping[str, float]) -> list[float]:
    """Return the weights in the terms' order, 0 for those that are not given; InputError for an unknown name."""
    for name in weights:
        if name not in rewards:
            raise InputError(f"reward term {name!r} does not exist; possible: {', '.join(rewards)}")
    return [float(weights.get(name, 0.0)) for name in rewards]


def active(groups: Mapping[str, Sequence[wp.Function]], config: Any) -> list[wp.Function]:
    """Return the terms that a task's settings turn on, in their order."""
    return [each for setting, group in groups.items() if not setting or getattr(config, setting) for each in group]


def columns_of(functions: Sequence[wp.Function], joints: int) -> dict[str, slice]:
    """Return the columns of observation terms by name, for a robot of so many joints.

    A term that takes a joint besides (State, World, world) has a column a joint; one that returns a wp.vec3 three; else one.
    """
    columns, first = {}, 0
    for each in functions:
        width = {"joint": joints, "vector": 3, "number": 1}[_shape(each)]
        columns[each.key] = slice(first, first := first + width)
    return columns


def _shape(function: wp.Function) -> Literal["joint", "vector", "number"]:
    signature = inspect.signature(function.func)
    if len(signature.parameters) == 4:
        return "joint"
    return "vector" if signature.return_annotation is wp.vec3 else "number"


def _layout(functions: Sequence[wp.Function], joints: int) -> tuple[dict[str, slice], int, wp.Kernel]:
    """Return the columns of observation terms by name, their number, and the kernel that writes them."""
    columns = columns_of(functions, joints)
    first = {each: columns[each.key].start for each in functions}
    kinds = [
        [(each, first[each]) for each in functions if _shape(each) == kind] for kind in ("number", "vector", "joint")
    ]
    return columns, max((each.stop for each in columns.values()), default=0), observation_kernel(*kinds)
