"""The colours of an object's sides: a picture, a book or a box has its print in front."""

from __future__ import annotations

import numpy as np

from s2a.geometry.mesh_ops import normals
from s2a.insert.axes import AXES
from s2a.scene import Mesh

FACES = 0.7
"""Smallest component of a face's normal along an axis for the face to belong to that side."""


def colour_spread(mesh: Mesh) -> dict[str, float]:
    """Return for each axis, "+x" to "-z", the spread of the colours seen from there, 0 to 255; empty without colours.

    That is the standard deviation over the faces that look that way, by area, as the root mean square of the channels.
    """
    if mesh.colors is None or not len(mesh.faces):
        return {}
    colors = mesh.colors[mesh.faces][:, :, :3].astype(np.float64).mean(axis=1)
    looks, areas = normals(mesh), np.asarray(mesh.face_areas, np.float64)
    return {name: _spread(colors, areas * (looks @ axis > FACES)) for name, axis in AXES.items()}


def _spread(colors: np.ndarray, weights: np.ndarray) -> float:
    """Return the weighted standard deviation of colours [face 3]."""
    if weights.sum() <= 0.0:
        return 0.0
    away = colors - np.average(colors, axis=0, weights=weights)
    return round(float(np.sqrt(np.average((away**2).mean(axis=1), weights=weights))), 1)
