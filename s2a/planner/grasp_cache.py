"""Grasps of a free object that several searches for a plan share."""

from __future__ import annotations

import numpy as np

from s2a.planner.contact import Contact
from s2a.planner.object_grasps import ObjectGrasps, object_grasps
from s2a.robot.spec import GripperSpec
from s2a.usd.sim_scene import SimBody


class GraspCache:
    """Grasps of one free object, each found once, wherever it is to stand."""

    def __init__(self, body: SimBody, gripper: GripperSpec, seed: int = 0) -> None:
        """Take the object, the gripper, and the seed of the points."""
        self.seed = seed
        self._of = [c.mesh for c in body.colliders], np.array(body.mass.center), gripper, seed
        self._found: dict[tuple[object, ...], ObjectGrasps] = {}

    def __call__(self, samples: int, contact: Contact, up: np.ndarray) -> ObjectGrasps:
        """Return what `object_grasps` does."""
        key = (samples, contact, *up.round(6))
        if key not in self._found:
            self._found[key] = object_grasps(*self._of, samples, contact, up)
        return self._found[key]
