"""A soft body: its settings, tetrahedra that are simulated, and the finer surface that is shown with them."""

import itertools
from dataclasses import dataclass
from pathlib import Path

import newton
import numpy as np
from pxr import Usd
from scipy.ndimage import label
from scipy.spatial import cKDTree

from s2a.core.bounds import Count, Fraction, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.scene.scene import Mesh, Vec3


@dataclass(frozen=True)
class SoftShape:
    """How an asset is made a soft body.

    Attributes:
        length: its longest extent [m]. The torso, 56 mm wide, then fits between fingers that open 80 mm.
        cells: number of cells of the simulated grid along that. With 10 its legs fall off; with the asset's own 30 a step takes
            three times as long.
        fill: least fraction of a cell that the asset fills for the cell to be simulated.
    """

    length: Positive = 0.14
    cells: Count = 15
    fill: Fraction = 0.4


@dataclass(frozen=True)
class SoftConfig:
    """A soft body and how it is simulated."""

    shape: SoftShape = SoftShape()  # of the body
    density: Positive = 100.0  # [kg/m^3]. 29 g; a plush toy of that size weighs 30 to 60 g
    # the material's modulus mu [Pa]. As foam rubber; with 30000 the fingers press the torso to a third of its width
    shear: Positive = 50000.0
    bulk: Positive = 50000.0  # its modulus lambda [Pa]
    damping: NotNegative = 1.0  # of its deformation [Pa s]
    particle_radius: Positive = 0.002  # by which the vertices stand off what they touch [m]
    # of a vertex on what it touches [N/m]. A pad, 17 mm wide, presses on two to four vertices; with 2000 it went
    # through the outer ones, and hooked the bear
    contact_stiffness: Positive = 20000.0
    contact_damping: NotNegative = 0.001  # likewise [N s/m]
    # coefficient between the body and everything. Rubber on cloth; as the pads have on all else
    friction: NotNegative = 1.0
    # below which friction is viscous [m/s]: a grip creeps by this times the fraction of friction it uses. With
    # 0.01 a held bear creeps out of the gripper within seconds
    friction_speed: Positive = 0.001
    contact_gap: Positive = 0.005  # up to which vertices are looked at for contact [m]
    substeps: Count = 8  # of a control step; even
    iterations: Count = 5  # of VBD in a substep
    arm_iterations: Count = 20  # of MuJoCo's solver and of its line search
    grip_stiffness: Positive = 2000.0  # position gain of the finger joints [N/m]. As the robot's own
    # with which each finger presses at most [N]. Thirty times the bear's weight; the robot's own 70 N would flatten it
    grip_force: Positive = 10.0


# Newton's teddy bear: tetrahedra that fill a grid of cubes
BEAR = Path(newton.__file__).parent / "examples/assets/bear.usd"
FUR = (150, 95, 45)
SAMPLES = 500  # Points in each tetrahedron of an asset that tell which cells it fills


@dataclass(frozen=True)
class SoftBody:
    """A soft body at rest; its frame has its origin at the centre of mass, z up as it stands."""

    vertices: np.ndarray  # of the tetrahedra [m], shape [vertex 3]
    tets: np.ndarray  # their corners, shape [tet 4], of positive volume
    volume: float  # [m^3]
    boxes: tuple[Mesh, ...]  # the simulated cells as few boxes: what a rigid body of the same shape collides with
    surface: Mesh  # what is shown
    owner: np.ndarray  # tetrahedron that each vertex of the surface follows, shape [surface vertex]
    weights: np.ndarray  # of its corners, sum 1, shape [surface vertex 4]; negative or above 1 outside of it

    @property
    def vertex_volumes(self) -> np.ndarray:
        """Return the volume that each vertex stands for: a quarter of its tetrahedra [m^3], shape [vertex]."""
        share = np.repeat(volumes(self.vertices, self.tets) / 4.0, 4)
        return np.bincount(self.tets.ravel(), share, len(self.vertices))

    def shown(self, particles: np.ndarray) -> Mesh:
        """Return the surface that goes with positions of the vertices [vertex 3]."""
        corners = particles[self.tets[self.owner]]
        points = np.einsum("vc,vci->vi", self.weights, corners)
        return Mesh(points, self.surface.faces, self.surface.colors)

    def inertia(self, density: float) -> Vec3:
        """Return the moments about the frame's axes at rest [kg m^2]."""
        squares = density * self.vertex_volumes @ self.vertices**2
        return tuple(float(squares.sum() - each) for each in squares)  # type: ignore[return-value]


def volumes(vertices: np.ndarray, tets: np.ndarray) -> np.ndarray:
    """Return the signed volumes of tetrahedra [tet 4], shape [tet]."""
    a, b, c, d = (vertices[tets[:, k]] for k in range(4))
    return np.einsum("ti,ti->t", b - a, np.cross(c - a, d - a)) / 6.0


def read_asset(path: Path) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return vertices [vertex 3], tetrahedra [tet 4] and surface triangles [face 3] of a USD file's mesh with `tetraIndices`.

    Raises:
        InputError: there is no such mesh in it.
    """
    stage = Usd.Stage.Open(str(path))
    prim = next((p for p in stage.Traverse() if p.GetAttribute("tetraIndices").HasValue()), None)
    if prim is None:
        raise InputError(f"{path}: no mesh has tetraIndices; give a file with tetrahedra, such as {BEAR}")
    tets, faces = (np.array(prim.GetAttribute(name).Get(), int) for name in ("tetraIndices", "faceVertexIndices"))
    return np.array(prim.GetAttribute("points").Get(), float), tets.reshape(-1, 4), faces.reshape(-1, 3)


def soft_body(shape: SoftShape, path: Path = BEAR) -> SoftBody:
    """Return the soft body of an asset: cells of its bounding box that it fills, six tetrahedra each.

    Raises:
        InputError: the asset has no tetrahedra, or so few cells are left that it falls apart.
    """
    points, tets, faces = read_asset(path)
    points = points * (shape.length / np.ptp(points, axis=0).max())
    cell = shape.length / shape.cells
    filled, low = _filled(points, tets, cell, shape.fill)
    if (parts := int(label(filled)[1])) != 1:  # cells hang together by faces
        raise InputError(
            f"soft.shape.cells={shape.cells}: the body falls into {parts} parts; give more cells, or less fill"
        )
    cells = np.argwhere(filled)
    nodes = (cells[:, None, None] + KUHN).reshape(-1, 3)
    used, corners = np.unique(nodes, axis=0, return_inverse=True)
    vertices, corners = low + used * cell, corners.reshape(-1, 4)
    center = low + (cells.mean(axis=0) + 0.5) * cell  # cells are alike
    boxes = tuple(_box(low + a * cell - center, low + b * cell - center) for a, b in _merged(filled))
    surface = Mesh(points - center, faces, np.tile(np.array(FUR, np.uint8), (len(points), 1)))
    owner, weights = _embedded(surface.vertices, vertices - center, corners, cells * cell + low - center + cell / 2)
    return SoftBody(vertices - center, corners, len(cells) * cell**3, boxes, surface, owner, weights)


def _kuhn() -> np.ndarray:
    """Return the corners of the six tetrahedra that a cube is cut into, alike in neighbours, shape [6 4 3]."""
    corners = []
    for order in itertools.permutations(range(3)):
        steps = np.concatenate([np.zeros((1, 3), int), np.cumsum(np.eye(3, dtype=int)[list(order)], axis=0)])
        right = np.linalg.det((steps[1:] - steps[0]).astype(float)) > 0
        corners.append(steps if right else steps[[0, 2, 1, 3]])
    return np.array(corners)


KUHN = _kuhn()


def _filled(points: np.ndarray, tets: np.ndarray, cell: float, fill: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which cells are simulated [x y z], and the corner of the first [3]; the grid stands on the lowest point."""
    low, size = points.min(axis=0), np.ptp(points, axis=0)
    count = np.ceil(size / cell - 1e-6).astype(int)
    low = low - (count * cell - size) * [0.5, 0.5, 0.0]
    weights = np.random.default_rng(0).dirichlet(np.ones(4), SAMPLES)
    inside = np.einsum("sc,tci->tsi", weights, points[tets]).reshape(-1, 3)
    share = np.repeat(np.abs(volumes(points, tets)) / SAMPLES, SAMPLES)
    index = np.clip(((inside - low) / cell).astype(int), 0, count - 1)
    volume = np.zeros(count)
    np.add.at(volume, tuple(index.T), share)
    return volume >= fill * cell**3, low


def _merged(filled: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return filled cells as boxes, from corner to corner in cells: the largest one left, again and again."""
    left, boxes = filled.copy(), []
    while left.any():
        first, last = max((_grown(left, np.array(at)) for at in np.argwhere(left)), key=lambda b: np.prod(b[1] - b[0]))
        left[tuple(slice(a, b) for a, b in zip(first, last, strict=True))] = False
        boxes.append((first, last))
    return boxes


def _grown(filled: np.ndarray, first: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the largest filled box that grows from a cell by one axis after the other."""
    best = (first, first + 1)
    for order in itertools.permutations(range(3)):
        last = first + 1
        for axis in order:
            while last[axis] < filled.shape[axis]:
                more = last + np.eye(3, dtype=int)[axis]
                if not filled[tuple(slice(a, b) for a, b in zip(first, more, strict=True))].all():
                    break
                last = more
        if np.prod(last - first) > np.prod(best[1] - best[0]):
            best = (first, last)
    return best


def _box(low: np.ndarray, high: np.ndarray) -> Mesh:
    corners = np.array(list(itertools.product(*zip(low, high, strict=True))))
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    return Mesh(corners, np.array(faces))


def _embedded(
    points: np.ndarray, vertices: np.ndarray, tets: np.ndarray, middles: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return for points [point 3] the tetrahedra they are in, or of the nearest cell are least outside of, and their weights."""
    _, cell = cKDTree(middles).query(points)
    choices = 6 * cell[:, None] + np.arange(6)
    corners = vertices[tets[choices]]
    edges = np.swapaxes(corners[:, :, 1:] - corners[:, :, :1], -1, -2)
    rest = np.linalg.solve(edges, (points[:, None] - corners[:, :, 0])[..., None])[..., 0]
    weights = np.concatenate([1.0 - rest.sum(axis=-1, keepdims=True), rest], axis=-1)
    best = weights.min(axis=-1).argmax(axis=1)
    at = np.arange(len(points))
    return choices[at, best], weights[at, best]
