"""Grasps of a free object that several searches for a plan share."""

from __future__ import annotations

import numpy as np

from s2a.planner.contact import Contact
from s2a.planner.object_grasps import ObjectGrasps, object_grasps
from s2a.robot.spec import GripperSpec
from s2a.scene.usd.sim_scene import SimBody


class GraspCache:
    """Grasps of one free object by one gripper, found once for each way up, and number of points, and contact."""

    def __init__(self, body: SimBody, gripper: GripperSpec, seed: int = 0) -> None:
        """Take the object, the gripper, and the seed of the points."""
        self._hulls, self._center = [c.mesh for c in body.colliders], np.array(body.mass.center)
        self._gripper, self._seed = gripper, seed
        self._found: dict[tuple[object, ...], ObjectGrasps] = {}

    def __call__(self, samples: int, contact: Contact, up: np.ndarray) -> ObjectGrasps:
        """Return what `object_grasps` does; `up` is a unit vector in the body's frame, shape [3]."""
        key = (samples, contact, *up.round(6))
        if key not in self._found:
            self._found[key] = object_grasps(self._hulls, self._center, self._gripper, self._seed, samples, contact, up)
        return self._found[key]
