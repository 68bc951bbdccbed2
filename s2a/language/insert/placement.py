"""The plan that a script carries out: which object, where, how large."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from pxr import Gf, Sdf

from s2a.core.errors import InputError
from s2a.scene.scene import Vec3
from s2a.scene.usd.stage import RESERVED

MAX_LABEL = 200
POSITION, ORIENTATION, SCALE = 5, 7, 6
"""Decimals of a position [m] and of a quaternion, and digits of a scale: no more than a model can copy."""


@dataclass(frozen=True)
class Placement:
    """One object in the room.

    Attributes:
        part_id: what its prim will be called; new in the stage.
        label: what it is, in plain words.
        reference: path of its USD file, relative to the overlay's folder, with / between folders.
        position: of its origin, world frame [m].
        orientation: unit quaternion xyzw, object to world.
        scale: factor on its size.

    Raises:
        InputError: one of them is not so.
    """

    part_id: str
    label: str
    reference: str
    position: Vec3
    orientation: tuple[float, float, float, float]
    scale: float

    def __post_init__(self) -> None:
        if not Sdf.Path.IsValidIdentifier(self.part_id) or self.part_id in RESERVED or self.part_id.startswith("_"):
            raise InputError(f"id {self.part_id!r} cannot name a prim; use letters, digits and _, a letter first")
        folders = self.reference.split("/")
        if (
            not self.reference.isprintable()
            or set('@\\:"[]') & set(self.reference)
            or ".." in folders
            or not folders[0]
        ):
            raise InputError(f"reference {self.reference!r}: give a plain path below the overlay's folder")
        if not all(map(math.isfinite, (*self.position, *self.orientation, self.scale))) or not self.scale > 0.0:
            raise InputError(
                f"{self.part_id}: its pose {self.position}, {self.orientation}, {self.scale} is not finite"
            )
        if abs(math.hypot(*self.orientation) - 1.0) > 1e-6:
            raise InputError(f"{self.part_id}: its orientation {self.orientation} is not of unit length")
        check_label(self.label)

    def matrix(self) -> np.ndarray:
        """Return the transform from object to world, shape [4 4], for column vectors, as USD makes it of these numbers.

        USD takes the angle from w, which in a rounded quaternion of a small turn is off by more than its other numbers.
        """
        x, y, z, w = self.orientation
        turn = Gf.Matrix4d(Gf.Rotation(Gf.Quatd(w, x, y, z)), Gf.Vec3d(*self.position))
        matrix = np.array(turn).T
        matrix[:3, :3] *= self.scale
        return matrix


def check_label(label: str) -> None:
    """Raise an InputError unless a label can stand in a stage, a script and a line of a terminal."""
    if not label.strip() or not label.isprintable() or len(label) > MAX_LABEL:
        given = f"{label[:40]!r}..." if len(label) > MAX_LABEL else repr(label)
        raise InputError(
            f"label {given} is empty, not printable or longer than {MAX_LABEL} letters; name the object in plain words"
        )
