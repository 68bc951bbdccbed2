"""The axes of a file by name."""

from __future__ import annotations

import numpy as np

AXES = {
    f"{sign}{name}": direction
    for name, axis in zip("xyz", np.eye(3), strict=True)
    for sign, direction in (("+", axis), ("-", -axis))
}
"""Directions by name: "+x" to "-z"."""


def sideways(up: str) -> list[str]:
    """Return the axes across an up axis: the possible fronts."""
    return [name for name, axis in AXES.items() if abs(axis @ AXES[up]) < 0.5]
