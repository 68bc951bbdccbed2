"""Picking a free object and placing it on a support."""

from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import warp as wp

from s2a.core.bounds import Fraction, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.motion import pick
from s2a.motion.trajectory import Trajectory
from s2a.sim.contacts import query_mesh
from s2a.sim.world import SimStage
from s2a.tasks.base import Instruction, MdpConfig, MetricsConfig, Results, Task, Terms, terms
from s2a.tasks.mdp import carrying, observations, rewards
from s2a.tasks.state import ObjectPlace, State, watch_others


@dataclass(frozen=True)
class PickPlaceConfig(MdpConfig):
    """The decision process.

    `start` and `place` are each null (where the object stands in the room), the id of a support
    (its nearest free placements, see `s2a.motion.places`), "nearby" (those of what carries the object at the other end, and of
    what is near that), a pose "x y z [yaw in degrees]" of the object's origin, or the insert.json of an insertion of it.

    Attributes:
        start: place of the object at the start of an episode.
        place: place where it is put.
        start_shift: maximum distance from there along x and y [m]; drawn for each episode and world.
        start_turn: maximum rotation about the vertical there [rad]; likewise.
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        contact_distance: distance of a contact from the object's surface up to which it is on it [m].
        contact_force: normal force of each finger from which a grasp holds [N].
        rest_time: time for which the object rests at its place before the episode ends [s].
        settle_time: time at the start of an episode in which objects come to rest before displacements count [s].
        position_tolerance: tolerance of the object's position at its place [m].
        angle_tolerance: likewise [rad].
        rest_shift: displacement of the object's origin in `rest_time`, up to which it is at rest [m].
        rest_turn: the same of its rotation [rad].
        clear_distance: distance of tool frame and fingers from the object's surface beyond which the gripper has retreated [m].
    """

    start: str | None
    place: str | None
    start_shift: NotNegative
    start_turn: NotNegative
    velocity_scale: float
    observation_limit: Positive
    contact_distance: NotNegative
    contact_force: NotNegative
    rest_time: Positive
    settle_time: NotNegative
    position_tolerance: Positive
    angle_tolerance: Positive
    rest_shift: Positive
    rest_turn: Positive
    clear_distance: NotNegative


@dataclass(frozen=True, kw_only=True)
class PickPlaceMetrics(MetricsConfig):
    """Thresholds of what is reported.

    Attributes:
        carried_fraction: fraction of the object's path over which a grasp must have held.
        max_drift: largest displacement of the object after the robot last touched it [m]. After the last touch: more is
            dropped or thrown.
        max_disturbance: largest displacement of anything else that can move [m].
    """

    carried_fraction: Fraction
    max_drift: NotNegative = 0.02
    max_disturbance: NotNegative = 0.005


class PickPlace(Task):
    """Pick the object of every world and place it."""

    Config: ClassVar[type[MdpConfig]] = PickPlaceConfig
    Metrics: ClassVar[type[MetricsConfig]] = PickPlaceMetrics
    INSTRUCTION: ClassVar[Instruction] = Instruction(
        "pick up the {part} and put it down at its place",
        takes=("object", "support"),
        needs="The object must be free and not in a shut part; the support is fixed and has a level top. The robot chooses the "
        "spot on it.",
    )
    REWARDS: ClassVar[Terms] = terms(rewards.distance, rewards.pinch, rewards.place, rewards.rest, rewards.action)
    OBSERVATIONS = {"": observations.OBJECT}
    RESULTS: ClassVar[Results] = Results(
        rates=terms(
            carrying.success,
            carrying.placed,
            carrying.carried,
            carrying.released_at_rest,
            carrying.undisturbed,
            carrying.grasped,
        ),  # fmt: skip
        values=terms(
            carrying.position_error,
            carrying.angle_error,
            carrying.carried_fraction,
            carrying.drift,
            carrying.disturbance,
        ),
        logged=("success", "placed", "carried", "grasped"),
        success="success",
        version=3,
    )
    Stage: ClassVar[type[SimStage]] = pick.PickStage

    read_stage = staticmethod(pick.read_stage)

    @staticmethod
    def requested(config: Any, place: str | None, opened: float) -> Any:
        """Return the settings of an object that stands where it is, and its place."""
        return replace(config, start=None, place=place)

    def trajectory(self, settings: Any) -> Trajectory:
        """Return the planned trajectory."""
        assert isinstance(self.sim.stage, pick.PickStage)
        return pick.trajectory(self.sim, self.sim.stage.plan, settings)

    def bind(self) -> None:
        """Set the place, what must not move, and what is reported; InputError for the stage of another task."""
        sim, config, metrics, stage = self.sim, self.config, self.metrics, self.sim.stage
        if not isinstance(stage, self.Stage) or not isinstance(stage, pick.PickStage):
            raise InputError(f"task {config.name} needs the stage that its own read_stage returns")
        self.thresholds = {
            "position": config.position_tolerance,
            "angle": config.angle_tolerance,
            "rest": config.rest_time,
            "carried_fraction": metrics.carried_fraction,
            "drift": metrics.max_drift,
            "disturbance": metrics.max_disturbance,
        }
        rate = sim.config.control_frequency
        self.surfaces, place = [query_mesh(stage.region)], ObjectPlace()
        place.object, place.container = self.surfaces[0].id, -1
        place.goal = wp.transform(*stage.goal[:3], *stage.goal[3:])
        place.rest_steps, place.settle_steps = round(config.rest_time * rate), round(config.settle_time * rate)
        self.world.place = place
        watch_others(self.world, sim, ())

    def start(self, coords: np.ndarray) -> np.ndarray:
        """Return the coordinates with the object at its start."""
        assert isinstance(self.sim.stage, pick.PickStage)
        coords, first = coords.copy(), self.sim.layout.part_coord
        coords[:, first : first + 7] = self.sim.stage.start
        return coords

    def reset(self, state: State) -> None:
        """Start a new episode where one ended."""
        far, turn = self.config.start_shift, self.config.start_turn
        if far or turn:  # random streams stay as they are where nothing is drawn
            self.launch(carrying.shift, state, far, turn)
        self.launch(carrying.begin, state)

    def after_substep(self, state: State) -> None:
        """Attribute the object's path to what held it."""
        super().after_substep(state)
        self.launch(carrying.track, state, *self.now(state))

    def update(self, state: State) -> None:
        """Count the steps at rest at the place."""
        self.launch(carrying.update, state)


TASK = PickPlace
