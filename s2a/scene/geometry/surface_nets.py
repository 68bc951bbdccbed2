"""The zero level of a sparse distance field as a triangle mesh: naive surface nets, thinned.

One vertex a cell that the surface crosses, one quad an edge that it crosses; only cells whose eight corners were observed.
Thinning turns millions of even triangles into a scan's uneven ones: large on planes, small on detail.
"""

from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pyfqmr
import warp as wp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from s2a.core.bounds import Above, CountFromZero, NotNegative
from s2a.core.workers import chunks, in_parallel

UNKNOWN = 1.0e9  # Value of a voxel that nothing observed


@dataclass
class Field:
    """A sparse field in blocks of 4 x 4 x 4 voxels."""

    voxel: float  # edge of a voxel [m]
    origin: wp.vec3  # centre of voxel (0, 0, 0) [m]
    table: wp.array  # row of each block in `blocks`, or -1, shape [block_x block_y block_z]
    blocks: wp.array  # coordinates of the stored blocks, shape [block 3]
    distance: wp.array  # weighted sum of distances, later their mean [m], shape [block * 64]; positive is free
    weight: wp.array  # sum of weights, shape [block * 64]


@wp.func
def mark_blocks(p: wp.vec3, block: float, reach: float, table: wp.array3d(dtype=int)):
    """Mark the blocks of edge `block` within `reach` of a place [m]; nothing where it is two blocks from the table's border."""
    for axis in range(3):
        if p[axis] < 2.0 * block + reach or p[axis] > float(table.shape[axis] - 2) * block - reach:
            return
    for i in range(int((p[0] - reach) / block), int((p[0] + reach) / block) + 1):
        for j in range(int((p[1] - reach) / block), int((p[1] + reach) / block) + 1):
            for k in range(int((p[2] - reach) / block), int((p[2] + reach) / block) + 1):
                table[i, j, k] = 1


@wp.func
def voxel_place(blocks: wp.array(dtype=wp.vec3i), tid: int):
    """Return the coordinates of a stored voxel."""
    b = blocks[tid // 64]
    k = tid % 64
    return wp.vec3i(b[0] * 4 + k // 16, b[1] * 4 + (k // 4) % 4, b[2] * 4 + k % 4)


@wp.func
def voxel_index(table: wp.array3d(dtype=int), i: int, j: int, k: int):
    """Storage index of a voxel, or -1 (a block is always two blocks away from the table's border)."""
    row = table[i // 4, j // 4, k // 4]
    if row < 0:
        return -1
    return row * 64 + (i % 4) * 16 + (j % 4) * 4 + k % 4


@wp.func
def voxel_value(table: wp.array3d(dtype=int), values: wp.array(dtype=float), i: int, j: int, k: int):
    """Return the value of a voxel; UNKNOWN where none is stored."""
    index = voxel_index(table, i, j, k)
    if index < 0:
        return UNKNOWN
    return values[index]


@dataclass(frozen=True)
class Net:
    """A fused surface before it is thinned out."""

    points: np.ndarray  # [m], shape [vertex 3], float32
    normals: np.ndarray  # unit vectors towards free space, shape [vertex 3], float32
    faces: np.ndarray  # vertex indices, counter-clockwise seen from free space, shape [face 3], int32
    # storage index of each vertex's cell, ascending, shape [vertex]; cell // 64 is its block of 4 x 4 x 4
    cells: np.ndarray


@wp.kernel
def _crossings(
    blocks: wp.array(dtype=wp.vec3i),
    table: wp.array3d(dtype=int),
    values: wp.array(dtype=float),
    first: int,
    kinds: wp.array(dtype=wp.uint8),
):
    """Bit 0: the cell holds a vertex. Bits 1 to 3: its edge along x, y, z crosses the surface."""
    tid = first + wp.tid()
    if values[tid] == UNKNOWN:
        return
    c = voxel_place(blocks, tid)
    inside = values[tid] < 0.0
    kind = int(0)
    observed = bool(True)
    for corner in range(1, 8):
        v = voxel_value(table, values, c[0] + corner // 4, c[1] + (corner // 2) % 2, c[2] + corner % 2)
        if v == UNKNOWN:
            observed = False
        elif (v < 0.0) != inside:
            kind = kind | 1
            if corner == 4:
                kind = kind | 2
            if corner == 2:
                kind = kind | 4
            if corner == 1:
                kind = kind | 8
    if not observed:
        kind = kind & 14
    kinds[tid] = wp.uint8(kind)


@wp.kernel
def _vertices(
    blocks: wp.array(dtype=wp.vec3i),
    table: wp.array3d(dtype=int),
    values: wp.array(dtype=float),
    cells: wp.array(dtype=int),
    origin: wp.vec3,
    voxel: float,
    points: wp.array(dtype=wp.vec3),
    normals: wp.array(dtype=wp.vec3),
):
    """The mean of the places where a cell's edges cross the surface, and the field's gradient."""
    tid = wp.tid()
    c = voxel_place(blocks, cells[tid])
    total = wp.vec3(0.0, 0.0, 0.0)
    gradient = wp.vec3(0.0, 0.0, 0.0)
    count = float(0.0)
    for corner in range(8):
        a = wp.vec3i(corner // 4, (corner // 2) % 2, corner % 2)
        va = voxel_value(table, values, c[0] + a[0], c[1] + a[1], c[2] + a[2])
        for axis in range(3):
            if a[axis] == 0:
                b = a
                b[axis] = 1
                vb = voxel_value(table, values, c[0] + b[0], c[1] + b[1], c[2] + b[2])
                gradient[axis] = gradient[axis] + vb - va
                if (va < 0.0) != (vb < 0.0):
                    place = wp.vec3(float(a[0]), float(a[1]), float(a[2]))
                    place[axis] = va / (va - vb)
                    total += place
                    count += 1.0
    points[tid] = origin + voxel * (wp.vec3(float(c[0]), float(c[1]), float(c[2])) + total / count)
    normals[tid] = wp.normalize(gradient)


@wp.kernel
def _quads(
    blocks: wp.array(dtype=wp.vec3i),
    table: wp.array3d(dtype=int),
    values: wp.array(dtype=float),
    edges: wp.array(dtype=int),
    axis: int,
    vertex: wp.array(dtype=int),
    quads: wp.array2d(dtype=int),
):
    """The four cells around an edge that crosses the surface, counter-clockwise seen from free space; -1: no such vertex."""
    tid = wp.tid()
    c = voxel_place(blocks, edges[tid])
    for corner in range(4):
        side = corner
        if values[edges[tid]] > 0.0:
            side = 3 - corner
        o = wp.vec3i(0, 0, 0)
        if side == 1 or side == 2:
            o[(axis + 1) % 3] = 1
        if side >= 2:
            o[(axis + 2) % 3] = 1
        index = voxel_index(table, c[0] - o[0], c[1] - o[1], c[2] - o[2])
        quads[tid, corner] = -1
        if index >= 0:
            quads[tid, corner] = vertex[index]


def extract(field: Field) -> Net:
    """Return the surface between free and filled space of a fused field."""
    stored = [field.blocks, field.table, field.distance]
    kind = _all_crossings(stored, len(field.distance))
    cells = np.flatnonzero(kind & 1).astype(np.int32)
    placed = in_parallel(lambda some: _places(stored, field, cells[some]), chunks(len(cells)))
    points, normals = (np.concatenate(part) for part in zip(*placed, strict=True))
    vertex = np.full(len(kind), -1, np.int32)
    vertex[cells] = np.arange(len(cells), dtype=np.int32)
    index = wp.array(vertex, dtype=int, device="cpu", copy=False)
    per_axis = in_parallel(lambda axis: _axis_quads(stored, np.flatnonzero(kind & (2 << axis)), axis, index), range(3))
    quads = np.concatenate(per_axis)
    return Net(points, normals, _split(points, quads), cells)


def _all_crossings(stored: list, count: int) -> np.ndarray:
    """Return the kind of each cell, shape [voxel]."""
    kinds = wp.zeros(count, dtype=wp.uint8, device="cpu")

    def mark(some: slice) -> None:
        wp.launch(_crossings, some.stop - some.start, inputs=[*stored, some.start], outputs=[kinds], device="cpu")

    in_parallel(mark, chunks(count))
    return kinds.numpy()


def _places(stored: list, field: Field, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices of cells [m] and their normals, shape [cell 3] each."""
    points, normals = (wp.empty(len(cells), dtype=wp.vec3, device="cpu") for _ in range(2))
    inputs = [*stored, wp.array(cells, dtype=int, device="cpu"), field.origin, field.voxel]
    wp.launch(_vertices, len(cells), inputs=inputs, outputs=[points, normals], device="cpu")
    return points.numpy(), normals.numpy()


def _axis_quads(stored: list, edges: np.ndarray, axis: int, vertex: wp.array) -> np.ndarray:
    """Return the complete quads around the crossed edges along one axis, shape [quad 4]."""
    quads = wp.empty((len(edges), 4), dtype=int, device="cpu")
    inputs = [*stored, wp.array(edges.astype(np.int32), dtype=int, device="cpu"), axis, vertex]
    wp.launch(_quads, len(edges), inputs=inputs, outputs=[quads], device="cpu")
    rows = quads.numpy()
    return rows[(rows >= 0).all(axis=1)]


def _split(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Return two triangles a quad, cut along the shorter diagonal, shape [2 quad 3]."""
    parts = [quads[some] for some in chunks(len(quads))]
    cut_ac = np.concatenate(in_parallel(lambda part: _is_shorter(points, part), parts))
    a, b, c, d = quads.T
    first = np.stack([a, b, np.where(cut_ac, c, d)], axis=1)
    second = np.stack([np.where(cut_ac, a, b), c, d], axis=1)
    return np.concatenate([first, second])


def _is_shorter(points: np.ndarray, quads: np.ndarray) -> np.ndarray:
    """Whether a quad's first diagonal is no longer than its second, shape [quad]."""
    a, b, c, d = (points[corner] for corner in quads.T)
    return ((a - c) ** 2).sum(axis=1) <= ((b - d) ** 2).sum(axis=1)


@dataclass(frozen=True, kw_only=True)
class ThinConfig:
    """How the fused surface is thinned out.

    Attributes:
        merge: vertices of flat groups of this many voxels' edge (1, 2 or 4) become one before quadric decimation.
        max_thickness: and if it is no thicker than this along its mean normal [m].
        keep: fraction of the fused surface's vertices that is left in the end.
        min_faces: disconnected components with fewer faces than this, before decimation, are dropped.
    """

    merge: Literal[1, 2, 4]
    # a group is flat if its normals deviate by no more than this from their mean on average [deg]
    bend: NotNegative = 8.0
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
