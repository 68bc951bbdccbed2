"""What leans: things that would fall over on their own stand with their back against a wall."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.insert.place.stable_pose import tilt_margin
from s2a.scene import Mesh

LEAN = np.radians(10.0)
"""Angle at which things lean [rad]: a guitar, a broom, a board; friction holds their feet up to about 40 deg."""
SHAKY = 0.11
"""Tilt margin below which a thing is leaned, as a share of a right angle: 10 deg."""
TALL = 3.0
"""Height over depth from which a thing is leaned."""


def slender(object: Mesh) -> bool:
    """Return True for an upright object that is tall, shallow and easily tipped: nobody stands it up on its own."""
    deep, _, high = np.ptp(object.bounds, axis=0)
    return bool(high > TALL * deep and high > 0.4 and tilt_margin(object, np.array([0.0, 0.0, 1.0])) < SHAKY)


def leaned(turn: np.ndarray) -> np.ndarray:
    """Return a rotation from the object's frame to the scene's, shape [3 3], tilted backwards so that its top is behind."""
    return np.asarray(turn @ Rotation.from_euler("y", -LEAN).as_matrix())
