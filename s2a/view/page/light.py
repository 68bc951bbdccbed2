"""The light of a page, and the brightness that it gives to surfaces: baked into their colours, they need no shading per pixel.

Without a graphics processor the shading of pixels takes most of the time of an image.
"""

from __future__ import annotations

import numpy as np

from s2a.scene.scene import Mesh

AMBIENT = 2.2
"""Intensity of the light from everywhere: the scan's colours hold its light already, so that it is most of the light."""
LIGHTS = (("above", 1.3, (1.0, 2.0, 4.0)), ("aside", 0.6, (-3.0, -1.0, 1.0)))
"""Name, intensity and place of the other lights, which are far away."""
BRIGHTEST = (AMBIENT + sum(intensity for _, intensity, _ in LIGHTS)) / np.pi
"""What no surface exceeds."""


def brightness(mesh: Mesh) -> np.ndarray:
    """Return the fraction of its own linear colour with which each vertex reflects the page's light, shape [vertex].

    A diffuse surface (Lambert) reflects light of intensity 1 with its colour over pi, as three.js reckons.
    """
    normals = vertex_normals(mesh)
    total = np.full(len(normals), AMBIENT)
    for _, intensity, place in LIGHTS:
        total += intensity * np.maximum(normals @ (np.array(place) / np.linalg.norm(place)), 0.0)
    return total / np.pi


def vertex_normals(mesh: Mesh) -> np.ndarray:
    """Return the mean normal of the faces at each vertex, weighted by their areas, shape [vertex 3]; 0 where there is none."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    facing, count = np.cross(b - a, c - a), len(mesh.vertices)
    sums = [sum(np.bincount(corner, column, count) for corner in mesh.faces.T) for column in facing.T]
    normals = np.stack(sums, axis=1) if len(mesh.faces) else np.zeros((count, 3))
    return normals / np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
