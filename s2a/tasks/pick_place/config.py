"""The numbers of picking and placing: of its decision process, and apart from them of what is reported."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.bounds import Fraction, NotNegative, Positive
from s2a.env.task import MdpConfig


@dataclass(frozen=True)
class PickPlaceConfig(MdpConfig):
    """The decision process.

    `start` and `place` are each null (where the object stands in the room), the id of a support
    (its nearest free placements, see `s2a.motion.places`), "nearby" (those of what carries the object at the other end, and of
    what is near that), a pose "x y z [yaw in degrees]" of the object's origin, or the insert.json of an insertion of it.

    Attributes:
        start: where the object stands at the start of an episode.
        place: where it is to be placed.
        start_shift: how far from there it stands along x and y, at most [m]; drawn for each episode and world.
        start_turn: by how much it is turned about the vertical there, at most [rad]; likewise.
        velocity_scale: factor of the joint velocities in the observation.
        observation_limit: observations are clamped to +- this.
        contact_distance: distance of a contact from the object's surface up to which it is on it [m].
        contact_force: normal force of each finger from which a pinch holds [N].
        rest_time: for which the object rests at its place before the episode ends [s].
        settle_time: at the start of an episode, in which objects come to rest before displacements count [s].
        position_tolerance: of the object at its place [m].
        angle_tolerance: likewise [rad].
        rest_shift: displacement of the object's origin in `rest_time`, up to which it is at rest [m].
        rest_turn: of its rotation, likewise [rad].
        clear_distance: of the tool frame's origin and both fingers from the object's surface, from which the gripper is gone [m].
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


@dataclass(frozen=True)
class PickPlaceMetrics:
    """What is reported of an episode.

    Attributes:
        carried_fraction: fraction of the object's path over which a pinch must have held.
        max_drift: largest displacement of the object after the robot last touched it [m].
        max_disturbance: largest displacement of anything else that can move [m].
        error_fraction: fraction of the episodes from which infinite values, dropped rows and dropped contacts are warned of.
    """

    carried_fraction: Fraction
    max_drift: NotNegative
    max_disturbance: NotNegative
    error_fraction: Fraction
