"""Closed solids from partially scanned surfaces."""

from __future__ import annotations

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from s2a.scene.geometry.mesh_ops import keep, weld
from s2a.scene.scene import Mesh


def border(faces: np.ndarray) -> np.ndarray:
    """Return the directed edges [edge 2] that no face traverses in the opposite direction, as often as they are missing.

    They form closed loops, whatever the surface: the border of a border is nothing.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forward = edges[:, 0] < edges[:, 1]
    pairs, which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    net = np.bincount(which.reshape(-1), weights=np.where(forward, 1.0, -1.0), minlength=len(pairs)).astype(int)
    turned = np.where(net[:, None] > 0, pairs, pairs[:, ::-1])
    return np.repeat(turned, np.abs(net), axis=0)


def loops(edges: np.ndarray) -> list[np.ndarray]:
    """Return directed edges [edge 2] as closed loops of vertices; each edge is walked once."""
    onwards: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        onwards.setdefault(start, []).append(end)
    found = []
    while onwards:
        first = here = next(iter(onwards))
        walk: list[int] = []
        while here != first or not walk:
            walk.append(here)
            ends = onwards[here]
            after = ends.pop()
            if not ends:
                del onwards[here]
            here = after
        found.append(np.array(walk))
    return found


def drop_small_components(mesh: Mesh, min_area_fraction: float) -> Mesh:
    """Return a surface without the connected components below a fraction of its area."""
    corners = mesh.faces[:, [0, 1]], mesh.faces[:, [1, 2]]
    rows, columns = np.concatenate([edge for edge in corners]).T
    links = coo_array((np.ones(len(rows)), (rows, columns)), shape=(len(mesh.vertices),) * 2)
    piece = connected_components(links, directed=False)[1][mesh.faces[:, 0]]
    area = np.bincount(piece, weights=mesh.face_areas)
    return keep(mesh, area[piece] >= min_area_fraction * area.sum())


def close(mesh: Mesh, ground: float, near: float) -> Mesh:
    """Return a closed solid that stands flat on horizontal ground.

    A border that comes near the ground is extruded straight down to it: it runs around the underside and the sides that were
    not seen. Every other hole is closed by a fan around its middle.

    Args:
        mesh: a surface, faces outwards; vertices below the ground are extracted to it.
        ground: height of the ground [m].
        near: borders this close to the ground are closed along it [m].
    """
    mesh = weld(mesh)
    points = np.array(mesh.vertices, np.float64)
    points[:, 2] = np.maximum(points[:, 2], ground)
    colors = np.full(points.shape, 180, np.uint8) if mesh.colors is None else mesh.colors
    faces, added, tints, count = [mesh.faces], [points], [colors], len(points)
    for loop in loops(border(mesh.faces)):
        middle, tint = points[loop].mean(axis=0), colors[loop].mean(axis=0, keepdims=True).astype(np.uint8)
        after = np.roll(loop, -1)
        if points[loop, 2].min() < ground + near:
            middle[2], foot = ground, np.arange(count, count + len(loop))
            added, tints = [*added, points[loop] * [1, 1, 0] + [0, 0, ground]], [*tints, colors[loop]]
            beyond = np.roll(foot, -1)
            faces += [np.stack([after, loop, foot], axis=1), np.stack([after, foot, beyond], axis=1)]
            count, loop, after = count + len(loop), foot, beyond
        faces.append(np.stack([after, loop, np.full(len(loop), count)], axis=1))
        added, tints = [*added, middle[None]], [*tints, tint]
        count += 1
    return Mesh(np.concatenate(added), np.concatenate(faces), np.concatenate(tints))
