"""Textures -> colours of vertices: faces are split where the texture holds more than their corners' colours."""

from dataclasses import dataclass, replace

import numpy as np

from s2a.scan.source import SourceMesh, sample

# Levels of 255 by which a texture must differ from the blend of a face's corners to be worth a split: just visible
DETAIL = 12.0
_ROUNDS = 14
_FINEST = 32  # points along an edge at which a texture is compared; a 1 cm texel then misses nothing up to 32 cm
_CHUNK = 200_000  # points sampled at once


@dataclass(frozen=True)
class Baked:
    """A connected mesh with colours, in the file's unit."""

    vertices: np.ndarray  # shape [vertex 3], float64; each position once, in the order of first use
    faces: np.ndarray  # shape [face 3], int64; the parts of a split face follow one another
    colors: np.ndarray  # RGB, shape [vertex 3], uint8
    source_face: np.ndarray  # face of the file that each face is, or is a part of; ascending, shape [face]


def bake(mesh: SourceMesh, texel: float) -> Baked:
    """Merge vertices by position, split faces along edges longer than `texel` where the texture has detail, and colour them.

    An edge is split for both faces beside it, so that the surface stays connected.

    `texel`: length of the edges to aim at where there is detail, in the file's unit.
    """
    mesh = merged(mesh)
    source_face = np.arange(len(mesh.faces))
    checked = np.zeros(len(mesh.faces), dtype=bool)  # found without detail
    for _ in range(_ROUNDS):
        edges, long = _long_edges(mesh, texel)
        ask = np.flatnonzero(~checked & long.any(axis=1))
        detailed = np.zeros(len(mesh.faces), dtype=bool)
        detailed[ask] = _detail(mesh, ask, texel)
        checked[ask] = ~detailed[ask]
        wanted = np.unique(edges[long & detailed[:, None]])
        if not len(wanted):
            break
        mesh, parent = _split(mesh, edges, wanted)
        source_face, checked = source_face[parent], checked[parent]
    colors = _vertex_colors(mesh)
    return Baked(mesh.vertices, mesh.faces, colors, source_face)


def merged(mesh: SourceMesh) -> SourceMesh:
    """Return the mesh with each position once (seams of textures double vertices), and without vertices of no face.

    Positions are compared in float32, the precision of scans, from a corner of the mesh on: map coordinates of a room (UTM) would
    round to half a metre.
    """
    used, corner = np.unique(mesh.faces, return_inverse=True)
    points = mesh.vertices[used]
    low = points.min(axis=0)
    near = np.where(np.abs(low) > np.ptp(points, axis=0).max(), points - low, points)
    _, first, group = np.unique(near.astype(np.float32), axis=0, return_index=True, return_inverse=True)
    order = np.argsort(first)
    rank = np.empty(len(order), dtype=np.int64)
    rank[order] = np.arange(len(order))
    faces = rank[group.ravel()][corner.reshape(-1, 3)]
    return replace(mesh, vertices=points[first[order]], faces=faces)


def _long_edges(mesh: SourceMesh, texel: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a number of each face's edges 01, 12, 20, the same from both sides, and which are longer than `texel`."""
    ends = np.sort(np.stack([mesh.faces, np.roll(mesh.faces, -1, axis=1)], axis=2), axis=2)
    lengths = np.linalg.norm(mesh.vertices[ends[..., 0]] - mesh.vertices[ends[..., 1]], axis=2)
    return ends[..., 0] * len(mesh.vertices) + ends[..., 1], lengths > texel


def _detail(mesh: SourceMesh, chosen: np.ndarray, texel: float) -> np.ndarray:
    """Return which of some faces have a texture that their corners' colours do not tell, shape [chosen]."""
    detailed = np.zeros(len(chosen), dtype=bool)
    textured = np.array([material.texture is not None for material in mesh.materials] + [False])[mesh.material[chosen]]
    corners = mesh.vertices[mesh.faces[chosen]]
    size = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    steps = 2 ** np.ceil(np.log2(np.clip(size / texel, 2, _FINEST))).astype(int)
    for count in np.unique(steps[textured]) if textured.any() else ():
        weights = _grid(int(count))
        mine = np.flatnonzero(textured & (steps == count))
        for chunk in np.array_split(mine, max(1, len(mine) * len(weights) // _CHUNK)):
            detailed[chunk] = _differs(mesh, chosen[chunk], weights)
    return detailed


def _differs(mesh: SourceMesh, faces: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return which faces' colours differ from the blend of their corners at points with the weights [point 3]."""
    uv, given = mesh.uv[faces], mesh.colors[faces]
    corners = sample(uv, given, mesh.material[faces], mesh.materials)
    there = sample(weights @ uv, weights.astype(np.float32) @ given, mesh.material[faces], mesh.materials)
    differs: np.ndarray = np.abs(there - weights @ corners).max(axis=(1, 2)) > DETAIL
    return differs


def _grid(count: int) -> np.ndarray:
    """Return barycentric weights of points that divide each edge into `count`, shape [point 3]."""
    i, j = np.meshgrid(np.arange(count + 1), np.arange(count + 1), indexing="ij")
    inside = i + j <= count
    return np.stack([count - i - j, i, j], axis=-1)[inside] / count


def _split(mesh: SourceMesh, edges: np.ndarray, wanted: np.ndarray) -> tuple[SourceMesh, np.ndarray]:
    """Cut edges in the middle; return the mesh, and the face that each of its faces was."""
    place = np.minimum(np.searchsorted(wanted, edges), len(wanted) - 1)
    cut = wanted[place] == edges
    low, high = np.divmod(wanted, len(mesh.vertices))
    middle = (mesh.vertices[low] + mesh.vertices[high]) / 2
    six = np.concatenate([mesh.faces, len(mesh.vertices) + place], axis=1)  # corners, then middles of 01, 12, 20
    pieces, owners = _pieces(cut)
    blend = np.concatenate([np.eye(3), (np.eye(3) + np.roll(np.eye(3), 1, axis=1)) / 2])[pieces]
    split = replace(
        mesh,
        vertices=np.concatenate([mesh.vertices, middle]),
        faces=np.take_along_axis(six[owners], pieces, axis=1),
        uv=blend @ mesh.uv[owners],
        colors=(blend @ mesh.colors[owners]).astype(np.float32),
        material=mesh.material[owners],
    )
    return split, owners


def _pieces(cut: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the triangles that replace each face, as positions 0..2 (corners) and 3..5 (middles), and their faces."""
    code = cut @ np.array([1, 2, 4])
    table = {0: [(0, 1, 2)], 7: [(0, 3, 5), (3, 1, 4), (5, 4, 2), (3, 4, 5)]}
    for turn in range(3):  # the edge from corner `turn` on is cut, alone or with the next one
        a, b, c = ((turn + k) % 3 for k in range(3))
        table[1 << a] = [(a, 3 + a, c), (3 + a, b, c)]
        table[1 << a | 1 << b] = [(3 + a, b, 3 + b), (a, 3 + a, 3 + b), (a, 3 + b, c)]
    pieces, owners = [], []
    for key, triangles in table.items():
        mine = np.flatnonzero(code == key)
        for triangle in triangles:
            pieces.append(np.broadcast_to(np.array(triangle), (len(mine), 3)))
            owners.append(mine)
    owner = np.concatenate(owners)
    order = np.argsort(owner, kind="stable")
    return np.concatenate(pieces)[order], owner[order]


def _vertex_colors(mesh: SourceMesh) -> np.ndarray:
    """Return the mean colour of the corners that meet at each vertex, shape [vertex 3], uint8."""
    corners = sample(mesh.uv, mesh.colors, mesh.material, mesh.materials).reshape(-1, 3)
    count = np.bincount(mesh.faces.ravel(), minlength=len(mesh.vertices))
    total = [np.bincount(mesh.faces.ravel(), corners[:, i], len(mesh.vertices)) for i in range(3)]
    return np.clip(np.round(np.stack(total, axis=1) / count[:, None]), 0, 255).astype(np.uint8)
