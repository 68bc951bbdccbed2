"""Operations on meshes: merge, subset, weld, normals, sampling."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from s2a.scene.scene import Mesh, crosses

GREY = 180  # Colour of a surface without colours, once it is merged with coloured ones


@dataclass(frozen=True, eq=False)
class TriangleSurface:
    """A surface of triangles, and what follows for each of them."""

    vertices: np.ndarray  # [m], shape [vertex 3], float64
    faces: np.ndarray  # vertex indices, shape [face 3]

    @cached_property
    def _crosses(self) -> np.ndarray:
        return np.concatenate([np.zeros((0, 3)), *crosses(self.vertices, self.faces)])

    @cached_property
    def areas(self) -> np.ndarray:
        """Area of each face [m^2], shape [face]."""
        return 0.5 * np.linalg.norm(self._crosses, axis=1)

    @cached_property
    def normals(self) -> np.ndarray:
        """Unit normal of each face, shape [face 3]; zero without area."""
        return self._crosses / np.maximum(2.0 * self.areas, 1e-15)[:, None]

    @cached_property
    def centroids(self) -> np.ndarray:
        """Middle of each face [m], shape [face 3]."""
        return self.vertices[self.faces].mean(axis=1)


def merge(meshes: Sequence[Mesh]) -> Mesh:
    """Return one mesh of several, in their order; grey where a mesh without colours meets coloured ones."""
    if not meshes:
        return Mesh(np.empty((0, 3)), np.empty((0, 3)))
    # As Python's integers: NumPy's own would widen the faces to 64 bits.
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)]).tolist()
    vertices = np.concatenate([mesh.vertices for mesh in meshes])
    faces = np.concatenate([mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)])
    if all(mesh.colors is None for mesh in meshes):
        return Mesh(vertices, faces)
    colors = [np.full(mesh.vertices.shape, GREY) if mesh.colors is None else mesh.colors for mesh in meshes]
    return Mesh(vertices, faces, np.concatenate(colors))


def painted(mesh: Mesh, color: tuple[int, int, int]) -> Mesh:
    """Return a mesh in one colour."""
    return Mesh(mesh.vertices, mesh.faces, np.tile(np.array(color, np.uint8), (len(mesh.vertices), 1)))


def keep(mesh: Mesh, faces: np.ndarray) -> Mesh:
    """Return the faces chosen by a mask or by indices [face], with the vertices that they use."""
    chosen = mesh.faces[faces]
    used = np.zeros(len(mesh.vertices), bool)
    used[chosen] = True
    number = np.cumsum(used) - 1  # without sorting, a tenth of the time of np.unique
    colors = None if mesh.colors is None else mesh.colors[used]
    return Mesh(mesh.vertices[used], number[chosen], colors)


def within(mesh: Mesh, low: np.ndarray, high: np.ndarray) -> Mesh:
    """Return the faces of a mesh whose bounding boxes meet a box with these corners [m], shape [3] each."""
    if not len(mesh.faces) or (mesh.bounds[0] > high).any() or (mesh.bounds[1] < low).any():
        return merge([])
    # A bit for each side of the box: a face has it where one of its corners is not beyond that side.
    bits = np.zeros(len(mesh.vertices), np.uint8)
    for axis in range(3):
        bits |= (mesh.vertices[:, axis] >= low[axis]).astype(np.uint8) << (2 * axis)
        bits |= (mesh.vertices[:, axis] <= high[axis]).astype(np.uint8) << (2 * axis + 1)
    a, b, c = mesh.faces.T
    return keep(mesh, (bits[a] | bits[b] | bits[c]) == 0b111111)


def components(mesh: Mesh) -> np.ndarray:
    """Return the number of the connected component of every face; faces are connected by common vertices.

    With numpy alone, since scans are read without the extra that brings SciPy: every vertex learns the lowest one that it is
    connected to, from its faces and from those that it points to.
    """
    lowest, before = np.arange(len(mesh.vertices)), np.empty(0, int)
    while not np.array_equal(lowest, before):
        before, low = lowest, lowest[mesh.faces].min(axis=1)
        lowest = lowest.copy()
        for corner in mesh.faces.T:
            np.minimum.at(lowest, before[corner], low)
            np.minimum.at(lowest, corner, low)
        lowest = lowest[lowest]
    return np.unique(lowest[mesh.faces[:, 0]], return_inverse=True)[1]


def weld(mesh: Mesh) -> Mesh:
    """Return a mesh in which vertices at bitwise the same place are one, as they were before it was cut into parts."""
    # Sorting the bits as two integers takes a third of the time of np.unique on rows; adding 0 makes -0 the same as 0.
    bits = (mesh.vertices + np.float32(0.0)).view(np.uint32).astype(np.uint64)
    plane, height = bits[:, 0] << np.uint64(32) | bits[:, 1], bits[:, 2]
    order = np.lexsort((height, plane))
    new = np.ones(len(order), bool)
    new[1:] = (np.diff(plane[order]) != 0) | (np.diff(height[order]) != 0)
    same = np.empty(len(order), np.int64)
    same[order] = np.cumsum(new) - 1
    first = order[new]
    colors = None if mesh.colors is None else mesh.colors[first]
    return Mesh(mesh.vertices[first], same[mesh.faces], colors)


def centroids(mesh: Mesh) -> np.ndarray:
    """Return the middle of each face [m], shape [face 3], float64."""
    return mesh.vertices[mesh.faces].mean(axis=1, dtype=np.float64)


def normals(mesh: Mesh, chosen: np.ndarray | None = None) -> np.ndarray:
    """Return the unit normal of each face, or of those chosen, shape [face 3], float64; zero for a face without area."""
    faces = mesh.faces if chosen is None else mesh.faces[chosen]
    facing, start = np.zeros((len(faces), 3)), 0
    for cross in crosses(mesh.vertices, faces):
        length = np.linalg.norm(cross, axis=1, keepdims=True)
        np.divide(cross, length, out=facing[start : start + len(cross)], where=length > 0)
        start += len(cross)
    return facing


def vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the mean normal of the faces at each vertex, weighted by their areas, shape [vertex 3]; 0 where there is none."""
    cross = np.concatenate([np.zeros((0, 3)), *crosses(vertices, faces)])
    total = np.stack([np.bincount(faces.ravel(), np.repeat(cross[:, i], 3), len(vertices)) for i in range(3)], axis=1)
    return total / np.maximum(np.linalg.norm(total, axis=1, keepdims=True), 1e-12)


def sample(mesh: Mesh, count: int, seed: int) -> np.ndarray:
    """Return points spread evenly over a surface by area [m], shape [count 3], float64; the same for the same seed."""
    return sample_with_faces(mesh, count, seed)[0]


def sample_with_faces(mesh: Mesh, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what `sample` does, and the index of the face that each point lies on, shape [count]."""
    random = np.random.default_rng(seed)
    total = mesh.face_areas.sum()
    if not total > 0:
        return np.empty((0, 3)), np.empty(0, int)
    chosen = random.choice(len(mesh.faces), count, p=mesh.face_areas / total)
    u, v = np.sort(random.random((2, count)), axis=0)
    weights = np.stack([u, v - u, 1 - v], axis=1)
    return np.einsum("pk,pkd->pd", weights, mesh.vertices[mesh.faces[chosen]].astype(np.float64)), chosen


def weighted_quantile(values: np.ndarray, weights: np.ndarray, fraction: float) -> float:
    """Return the first of some values up to which a fraction of the weights lies."""
    order = np.argsort(values, kind="stable")
    total = np.cumsum(weights[order])
    return float(values[order][min(np.searchsorted(total, fraction * total[-1]), len(values) - 1)])


def extents(mesh: Mesh, axes: np.ndarray, tail: float = 0.005) -> tuple[np.ndarray, np.ndarray]:
    """Return the lowest and highest coordinates [m] of a surface along the columns of `axes` [3 axis], shape [axis] each.

    Leaves out `tail` of the area at either end: single stray triangles are common at the borders of annotations.
    """
    along, weights = mesh.vertices[mesh.faces.ravel()] @ axes, np.repeat(mesh.face_areas, 3)
    low, high = ([weighted_quantile(values, weights, end) for values in along.T] for end in (tail, 1 - tail))
    return np.array(low), np.array(high)


BLOCK = 4  # Texels along a triangle's edge in the texture


def bake(faces: np.ndarray, colors: np.ndarray | None) -> tuple[np.ndarray, np.ndarray]:
    """Turn colours per vertex into a texture, because simulators give a mesh one colour or a texture.

    Every triangle gets a block of BLOCK x BLOCK texels, in which its corners' colours blend.

    Args:
        faces: shape [face 3].
        colors: RGB, shape [vertex 3], uint8; None is grey.

    Returns:
        Texture coordinates of the corners, shape [3 face, 2], v upwards; texture RGBA [size size 4], uint8.
    """
    corners = np.full((len(faces), 3, 3), 170.0) if colors is None else colors[faces].astype(float)
    side = int(np.ceil(np.sqrt(max(1, len(faces)))))
    step = np.arange(BLOCK) / (BLOCK - 1)
    u, v = np.meshgrid(step, step)
    weights = np.stack([np.clip(1.0 - u - v, 0.0, 1.0), u, v])
    blocks = np.einsum("fck,cij->fijk", corners, weights / weights.sum(axis=0))
    padded = np.zeros((side * side, BLOCK, BLOCK, 3))
    padded[: len(faces)] = blocks
    image = padded.reshape(side, side, BLOCK, BLOCK, 3).swapaxes(1, 2).reshape(side * BLOCK, side * BLOCK, 3)
    texture = np.concatenate([image, np.full((*image.shape[:2], 1), 255.0)], axis=2).round().astype(np.uint8)
    index = np.arange(len(faces))
    first = np.stack([index % side, index // side], axis=1)[:, None] * BLOCK + 0.5
    texels = first + np.array([[0, 0], [1, 0], [0, 1]]) * (BLOCK - 1)
    uv = texels.reshape(-1, 2) / (side * BLOCK)
    return np.stack([uv[:, 0], 1.0 - uv[:, 1]], axis=1).astype(np.float32), texture
