"""Reduction of millions of even triangles to a scan's uneven ones: large on planes, small on detail."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pyfqmr
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from s2a.core.bounds import Above, CountFromZero, NotNegative
from s2a.homes.surface_nets import Net


@dataclass(frozen=True)
class ThinConfig:
    """How the fused surface is thinned out.

    Attributes:
        merge: vertices of flat groups of this many voxels' edge (1, 2 or 4) become one before quadric decimation.
        bend: a group is flat if its normals deviate by no more than this from their mean on average [deg].
        max_thickness: and if it is no thicker than this along its mean normal [m].
        keep: fraction of the fused surface's vertices that is left in the end.
        min_faces: disconnected components with fewer faces than this, before decimation, are dropped.
    """

    merge: Literal[1, 2, 4]
    bend: NotNegative
    max_thickness: NotNegative
    keep: Annotated[float, Above(0.0, 1.0)]
    min_faces: CountFromZero


def thin(net: Net, config: ThinConfig) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices [m], shape [vertex 3], float32, and faces, shape [face 3], int32, of the thinned surface."""
    vertices, faces = merge_flat(net, config)
    vertices, faces = drop_small_components(vertices, faces, config.min_faces)
    wanted = int(2 * config.keep * len(net.points))
    simplify = pyfqmr.Simplify()
    simplify.setMesh(vertices.astype(np.float64), faces)
    simplify.simplify_mesh(target_count=min(wanted, len(faces)), aggressiveness=5, preserve_border=True, verbose=False)
    vertices, faces, _ = simplify.getMesh()
    return _compact(vertices.astype(np.float32), faces.astype(np.int32))


def merge_flat(net: Net, config: ThinConfig) -> tuple[np.ndarray, np.ndarray]:
    """Replace the vertices of each flat group of cells by their mean; merging vertices can open no crack."""
    sizes = [size for size in (2, 4) if size <= config.merge]
    owner = np.arange(len(net.points))
    for size in sizes:
        group = _groups(net.cells, size)
        flat = _flat(net, group, config)
        # The first vertex of a group stands for it; groups of 4 overrule the groups of 2 inside them.
        first = np.full(group.max() + 1, len(owner))
        np.minimum.at(first, group, np.arange(len(owner)))
        owner = np.where(flat[group], first[group], owner)
    owner = _renumbered(owner)
    total = np.stack([np.bincount(owner, net.points[:, i]) for i in range(3)], axis=1)
    vertices = (total / np.bincount(owner)[:, None]).astype(np.float32)
    faces = owner[net.faces].astype(np.int32)
    a, b, c = faces.T
    return vertices, faces[(a != b) & (b != c) & (c != a)]


def _groups(cells: np.ndarray, size: int) -> np.ndarray:
    """Return the group of each vertex's cell, shape [vertex]: its block of 4^3 voxels, or its eighth of it."""
    block, place = cells // 64, cells % 64
    eighth = (place // 32) * 4 + (place // 8) % 2 * 2 + (place // 2) % 2
    return _renumbered(block if size == 4 else block * 8 + eighth)


def _renumbered(numbers: np.ndarray) -> np.ndarray:
    """Return whole numbers without gaps, in the same order: np.unique's inverse, without sorting."""
    used = np.zeros(int(numbers.max()) + 1, bool)
    used[numbers] = True
    return (np.cumsum(used) - 1)[numbers]


def _flat(net: Net, group: np.ndarray, config: ThinConfig) -> np.ndarray:
    """Whether each group of vertices lies in a plane, shape [group]."""
    count = np.bincount(group)
    normal = np.stack([np.bincount(group, net.normals[:, i]) for i in range(3)], axis=1) / count[:, None]
    length = np.linalg.norm(normal, axis=1)
    normal /= np.maximum(length, 1e-9)[:, None]
    height = np.einsum("ij,ij->i", net.points, normal[group].astype(np.float32))
    mean = np.bincount(group, height) / count
    spread = np.sqrt(np.maximum(np.bincount(group, (height - mean[group]) ** 2) / count, 0.0))
    return (length > np.cos(np.radians(config.bend))) & (spread < config.max_thickness / 2)


def drop_small_components(vertices: np.ndarray, faces: np.ndarray, min_faces: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh without connected components of fewer than `min_faces` faces."""
    edges = np.concatenate([faces[:, :2], faces[:, 1:]])
    graph = coo_array((np.ones(len(edges), bool), edges.T), shape=(len(vertices), len(vertices)))
    _, piece = connected_components(graph, directed=False)
    big = np.bincount(piece[faces[:, 0]], minlength=piece.max() + 1) >= min_faces
    return _compact(vertices, faces[big[piece[faces[:, 0]]]])


def _compact(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the mesh without unused vertices."""
    used = np.zeros(len(vertices), bool)
    used[faces] = True
    return vertices[used], (np.cumsum(used) - 1).astype(np.int32)[faces]
