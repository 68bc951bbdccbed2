"""How far convex hulls are from the true handle that they stand for, asked from both sides, and what they fill behind it.

`symmetric_error` is the published error of a handle. It is the larger one of two means [mm]:

- `true_mm`: from points on the true handle to the surface of the union of all hulls of the part. Too much, too little, and
  a missing piece count.
- `hull_mm`: from points on the surface of that union to the true surface of the part. These are the points of the handle's own
  hulls, and of other hulls (the front's) those that are nearer to the true handle than to anything else of the furniture.
  What hulls add counts.

Either takes the points that a finger can touch: a ball as thick as a fingertip (FINGER_DEPTH) rests on them without reaching
into anything else, of the true furniture for `true_mm`; of the hulls and of the furniture's other parts for `hull_mm`. POINTS
points are spread evenly by area, before the untouchable ones are left out; a surface that no finger can touch has no error
(None), and without any hull the error is infinite. Hulls count as far as MARGIN around the true handle's bounding box. Space
that hulls close, so that no finger reaches their surface there, is measured by `filled_behind` and by the fill ratio of the
fingers' own space (collider_table.py).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import trimesh

from s2a.scene.geometry.convex import contains, hull
from s2a.scene.geometry.front_panel import FINGER_DEPTH, fraction_inside
from s2a.scene.geometry.mesh_ops import centroids, keep, merge, normals, sample_with_faces
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Mesh

POINTS = 6000
"""Spread over each of both surfaces."""
RADIUS = FINGER_DEPTH / 2
"""[m] Of the ball that touches."""
REST = 0.95
"""A ball rests on a point if nothing is nearer to its centre than this fraction of its radius."""
MARGIN = 0.03
"""[m] Hulls count as far as this around the true handle's bounding box."""
GRID = 0.0025
"""[m] Edge of the triangles into which hulls are cut before those inside of other hulls are dropped."""
INSIDE = 1e-5
"""[m] Whether a face lies in another hull is asked this far before and behind it: faces of hulls often coincide."""
COLUMNS = 6000
"""Points spread in the box behind a handle."""


@dataclass(frozen=True)
class TrueHandle:
    """What was really there.

    Attributes:
        handle: surface of the parts that are grasped.
        rest: surface of what they are fixed to, as far as it moves with them.
        others: surface of the furniture's other parts.
    """

    handle: Mesh
    rest: Mesh
    others: Mesh


@dataclass(frozen=True)
class HandleError:
    """The error of a handle [mm], None where no finger can touch a surface; see the module."""

    true_mm: float | None
    hull_mm: float | None

    @property
    def symmetric_mm(self) -> float | None:
        """The larger one."""
        return max((value for value in (self.true_mm, self.hull_mm) if value is not None), default=None)


def symmetric_error(own: Sequence[Mesh], other: Sequence[Mesh], true: TrueHandle) -> HandleError:
    """Return the error of a handle's own hulls and of the other hulls of its part."""
    touched = touchable(*_spread(true.handle), [true.handle, true.rest, true.others])
    hulls, owners = union_surface([*own, *other], true.handle.bounds + [[-MARGIN], [MARGIN]])
    if not len(hulls.faces):
        return HandleError(math.inf if len(touched) else None, None)
    points, faces = sample_with_faces(hulls, POINTS, 0)
    chosen = distances(points, true.handle) < distances(points, merge([true.rest, true.others]))
    chosen |= owners[faces] < len(own)
    stand_out = touchable(points[chosen], normals(hulls)[faces[chosen]], [hulls, true.others])
    gaps = distances(touched, hulls), distances(stand_out, merge([true.handle, true.rest]))
    return HandleError(*(1e3 * float(gap.mean()) if len(gap) else None for gap in gaps))


def union_surface(hulls: Sequence[Mesh], bounds: np.ndarray) -> tuple[Mesh, np.ndarray]:
    """Return the outer surface of overlapping hulls between two corners [2 3] [m], and each face's hull, shape [face].

    It comes in triangles of GRID or less; its outline, and where hulls meet, is as ragged as that.
    """
    outer, owners = [], []
    for k, piece in enumerate(hulls):
        fine = _fine(piece, bounds)
        middle, step = centroids(fine), INSIDE * normals(fine)
        covered = np.zeros(len(middle), bool)
        for j, other in enumerate(hulls):
            if j != k and len(middle):
                covered |= contains(other, middle + step)
                if j < k:  # of two faces that coincide and look the same way, the first hull's stays
                    covered |= contains(other, middle - step)
        outer.append(keep(fine, ~covered))
        owners.append(np.full(len(outer[-1].faces), k))
    return merge(outer), np.concatenate([np.empty(0, int), *owners])


def _fine(piece: Mesh, bounds: np.ndarray) -> Mesh:
    """Return a surface in triangles with edges of GRID or less, as far as they lie between two corners [2 3] [m]."""
    vertices, faces = piece.vertices.astype(np.float64), piece.faces
    while True:
        corners = vertices[faces]
        faces = faces[((corners.min(axis=1) < bounds[1]) & (corners.max(axis=1) > bounds[0])).all(axis=1)]
        corners = vertices[faces]
        long = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1, initial=0.0) > GRID
        if not long.any():
            return Mesh(vertices, faces)
        vertices, faces = trimesh.remesh.subdivide(vertices, faces, np.flatnonzero(long))


def touchable(points: np.ndarray, facing: np.ndarray, around: Sequence[Mesh]) -> np.ndarray:
    """Return the points of a surface where a ball of RADIUS rests outside of all that is around it, shape [point 3].

    Args:
        points: on the surface [m], shape [point 3].
        facing: its unit normals there, outwards, shape [point 3].
        around: surfaces of solids, this one among them.
    """
    centres, free = points + RADIUS * facing, np.ones(len(points), bool)
    for solid in around:
        if len(solid.faces):
            nearest, gap = nearest_faces(ray_mesh(solid.vertices, solid.faces), centres)
            outside = np.einsum("ij,ij->i", centres - centroids(solid)[nearest], normals(solid)[nearest]) > 0
            free &= outside & (gap > REST * RADIUS)
    return points[free]


def _spread(surface: Mesh) -> tuple[np.ndarray, np.ndarray]:
    points, faces = sample_with_faces(surface, POINTS, 0)
    return points, normals(surface)[faces]


def behind(true: TrueHandle, frame: np.ndarray, front: float | None) -> np.ndarray:
    """Return points in the free space behind a handle: between it and the front, hidden by it from the room; shape [point 3].

    For handles of closed convex solids (not cups). COLUMNS points are spread over the handle's box before those are left out.

    Args:
        true: the handle.
        frame: axes as columns [3 3]: z into the furniture.
        front: coordinate of the true front along z [m]; None: no points.
    """
    if front is None:
        return np.empty((0, 3))
    local = true.handle.vertices.astype(np.float64) @ frame
    low, high = local.min(axis=0), local.max(axis=0)
    high[2] = front
    points = np.random.default_rng(0).uniform(low, np.maximum(low, high), (COLUMNS, 3)) @ frame.T
    body = merge([true.handle, true.rest])
    solids = trimesh.Trimesh(body.vertices, body.faces).split(only_watertight=False)
    pieces = [piece for solid in solids if (piece := hull(solid.vertices)) is not None]
    for piece in pieces:
        points = points[~contains(piece, points)]
    hidden = np.isfinite(
        first_hits(ray_mesh(true.handle.vertices, true.handle.faces), points, np.tile(-frame[:, 2], (len(points), 1)))
    )
    return points[hidden]


def filled_behind(hulls: Sequence[Mesh], points: np.ndarray) -> float | None:
    """Return the fraction of the points `behind` a handle that hulls fill [%]; None where nothing is behind it."""
    return 1e2 * fraction_inside(hulls, points) if len(points) else None


def distances(points: np.ndarray, surface: Mesh) -> np.ndarray:
    """Return the distance of points [point 3] from a surface [m], shape [point]; inf from one without faces."""
    return nearest_faces(ray_mesh(surface.vertices, surface.faces), points)[1]
