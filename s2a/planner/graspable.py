"""Whether a gripper can hold an object at all, whatever stands around it."""

from __future__ import annotations

import math

import numpy as np

from s2a.planner.contact import FIRM, Contact
from s2a.planner.misses import Misses, Unreachable
from s2a.planner.object_grasps import SAMPLES, matrix, object_grasps
from s2a.robot.spec import RobotSpec
from s2a.scene.usd.sim_scene import SimRoom

AROUND = 0.002
"""[m] Around the gripper what it passes must leave free: the arm's error."""


class Ungraspable(Unreachable):
    """The gripper fits nowhere on the object."""


def refuse_ungraspable(room: SimRoom, target: str, spec: RobotSpec, contact: Contact = FIRM) -> None:
    """Raise Ungraspable where no grasp of a free object with a contact fits a robot's gripper."""
    body = room.free[target]
    up = matrix(np.array([*body.position, *body.orientation]))[2, :3]
    hulls = [c.mesh for c in body.colliders]
    found = object_grasps(hulls, np.array(body.mass.center), spec.gripper, 0, SAMPLES[-1], contact, up)
    if not len(found.tool):
        points = np.concatenate([hull.vertices for hull in hulls])
        raise ungraspable(target, float(np.ptp(points, axis=0).min()), spec)


def ungraspable(target: str, size: float, spec: RobotSpec) -> Ungraspable:
    """Return what says that a gripper holds an object of this thinnest extent [m] nowhere."""
    return Ungraspable(
        f"{target!r}: grasp: no two opposite faces as wide as the pads fit between the fingers, which open "
        f"{1000 * spec.gripper.max_opening:.0f} mm; the object's thinnest extent is {1000 * size:.0f} mm; choose "
        "a smaller object or another robot="
    )


def failure(target: str, nearest: float, size: float, misses: Misses, spec: RobotSpec) -> Unreachable:
    """Return why there is no plan for an object.

    Args:
        target: id of the object.
        nearest: least penetration depth of a grasp [m], inf where there is none.
        size: its thinnest extent [m].
        misses: of what was tried with the grasps that are clear.
        spec: the robot.
    """
    if math.isinf(nearest):
        return ungraspable(target, size, spec)
    if nearest > 0.0:
        return Unreachable(
            f"{target!r}: grasp: with {1000 * AROUND:.0f} mm around it the gripper reaches at least {1000 * nearest:.1f} mm "
            "into what is around the object or its place; choose a place with more room around it"
        )
    return Unreachable(f"{target!r} cannot be picked and placed so: {misses.text}")
