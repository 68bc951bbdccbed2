"""Where a part comes to rest that nobody holds: a lid that stands open falls shut, or open."""

from __future__ import annotations

import math

import numpy as np

from s2a.scene.articulation import displace
from s2a.sim.world import SimStage

GRAVITY = 9.81
"""[m/s^2]"""
STEP = math.radians(0.5)
"""[rad] Between coordinates at which the weight's moment is looked at."""


def at_rest(stage: SimStage, coordinate: float) -> float:
    """Return the coordinate [m] or [rad] at which a stage's part comes to rest that is let go at one.

    It moves where its weight exceeds its dry friction, until that holds it, or to the end of its range. What else draws it,
    such as a spring, is not known here; nor does momentum carry it past its rest.
    """
    joint, part = stage.joint, stage.room.articulations[stage.target]
    friction = part.friction + (part.resistance.breakaway if part.resistance else 0.0)
    if joint.kind == "prismatic":
        force = -_weight(stage) * joint.axis[2]
        return coordinate if abs(force) <= friction else joint.limits[int(force > 0.0)]
    sense = math.copysign(1.0, _moment(stage, coordinate))
    while sense * _moment(stage, coordinate) > friction:
        following = coordinate + sense * STEP
        if not joint.limits[0] < following < joint.limits[1]:
            return joint.limits[int(sense > 0.0)]
        coordinate = following
    return coordinate


def _weight(stage: SimStage) -> float:
    """Return the weight of a stage's part [N]."""
    return GRAVITY * stage.room.bodies[stage.target].mass.mass


def _moment(stage: SimStage, coordinate: float) -> float:
    """Return the moment of the weight of a hinged part about its axis at a coordinate [N m]."""
    center = displace(np.array([stage.room.bodies[stage.target].mass.center]), stage.joint, coordinate)[0]
    arm = np.cross(stage.joint.axis, center - np.array(stage.joint.origin))
    return -_weight(stage) * float(arm[2])
