"""Distance between two surfaces, by points sampled on both."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh
from s2a.scene.scene import Mesh


@dataclass(frozen=True)
class Deviation:
    """Distances between two surfaces [m], each the larger one of both directions.

    Attributes:
        mean: of all sampled points.
        p99: 99th percentile.
        max: maximum.
    """

    mean: float
    p99: float
    max: float


def deviation(a: Mesh, b: Mesh, count: int, seed: int = 0, tree: RayMesh | None = None) -> Deviation:
    """Return the distance between two surfaces, the larger of a to b and b to a; inf if one is empty.

    Args:
        a: a surface.
        b: another one.
        count: points sampled on either, evenly by area.
        seed: of the points.
        tree: `ray_mesh` of a, if it exists.
    """
    empty = [not mesh.face_areas.any() for mesh in (a, b)]
    if any(empty):
        return Deviation(*(0.0 if all(empty) else math.inf,) * 3)
    there = nearest_faces(ray_mesh(b.vertices, b.faces), sample(a, count, seed))[1]
    back = nearest_faces(tree or ray_mesh(a.vertices, a.faces), sample(b, count, seed))[1]
    both = [(float(d.mean()), float(np.quantile(d, 0.99)), float(d.max())) for d in (there, back)]
    return Deviation(*(max(pair) for pair in zip(*both, strict=True)))
