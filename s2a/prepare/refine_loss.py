"""The loss of a room's joints and its gradient, by Warp's tape: a table of terms, and paths of parts through a grid of distances.

Every joint has five parameters, relative to its annotation: `TILT` turns its axis by small angles [rad] about two directions
across it, `SHIFT` moves its line along the same directions [m], `ZERO` is the coordinate at which it is closed [m] or [rad].
Every piece of furniture has a frame, turned by three small angles [rad]. Positions are scene coordinates [m], float64.
"""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import warp as wp

from s2a.core.bounds import Fraction, NotNegative, Positive
from s2a.prepare.refine_front import Faces
from s2a.scene.articulation import open_limit
from s2a.scene.geometry.mesh_ops import centroids, keep, normals, sample
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Joint, Mesh

# Kinds of terms: what a value is of. See `Term`
AXIS, LINE, ALONG_FRAME, FACE, LEVEL, PRIOR, FLUSH = (wp.constant(kind) for kind in range(7))
TILT, SHIFT, ZERO = (0, 1), (2, 3), 4  # Where the parameters of a joint are among its five
COUNT = 5  # Parameters of a joint


@wp.struct
class Joints:
    """Annotated joints: kind 0 is a slide; `first` and `second` lie across the axis."""

    kind: wp.array(dtype=int)
    axis: wp.array(dtype=wp.vec3d)
    origin: wp.array(dtype=wp.vec3d)
    first: wp.array(dtype=wp.vec3d)
    second: wp.array(dtype=wp.vec3d)


@wp.struct
class Terms:
    """Columns of `Term`."""

    kind: wp.array(dtype=int)
    joint: wp.array(dtype=int)
    frame: wp.array(dtype=int)
    index: wp.array(dtype=int)
    direction: wp.array(dtype=wp.vec3d)
    point: wp.array(dtype=wp.vec3d)
    expected: wp.array(dtype=wp.float64)
    sigma: wp.array(dtype=wp.float64)
    cut: wp.array(dtype=wp.float64)


@wp.struct
class Paths:
    """Points at a coordinate each, and the grids of distances: those of grid g begin at `start[g]`."""

    joint: wp.array(dtype=int)
    grid: wp.array(dtype=int)
    point: wp.array(dtype=wp.vec3d)
    slack: wp.array(dtype=wp.float64)
    coordinate: wp.array(dtype=wp.float64)
    weight: wp.array(dtype=wp.float64)
    low: wp.array(dtype=wp.vec3d)
    cell: wp.array(dtype=wp.float64)
    shape: wp.array(dtype=wp.vec3i)
    start: wp.array(dtype=int)
    distance: wp.array(dtype=wp.float64)


@wp.func
def _axis(joints: Joints, values: wp.array2d(dtype=wp.float64), i: int) -> wp.vec3d:
    return wp.normalize(joints.axis[i] + values[i, 0] * joints.first[i] + values[i, 1] * joints.second[i])


@wp.func
def _origin(joints: Joints, values: wp.array2d(dtype=wp.float64), i: int) -> wp.vec3d:
    return joints.origin[i] + values[i, 2] * joints.first[i] + values[i, 3] * joints.second[i]


@wp.func
def _moved(kind: int, axis: wp.vec3d, origin: wp.vec3d, point: wp.vec3d, q: wp.float64) -> wp.vec3d:
    if kind == 0:
        return point + q * axis
    arm = point - origin
    along = wp.dot(arm, axis) * axis
    return origin + along + wp.cos(q) * (arm - along) + wp.sin(q) * wp.cross(axis, arm)


@wp.func
def _robust(residual: wp.float64, cut: wp.float64) -> wp.float64:
    half = wp.float64(0.5)
    if cut > wp.float64(0.0):
        return half * cut * cut * wp.log(wp.float64(1.0) + residual * residual / (cut * cut))
    return half * residual * residual


@wp.kernel
def sum_terms(
    joints: Joints,
    frames: wp.array(dtype=wp.mat33d),
    terms: Terms,
    values: wp.array2d(dtype=wp.float64),
    turns: wp.array2d(dtype=wp.float64),
    loss: wp.array(dtype=wp.float64),
):
    """Add up the terms."""
    tid = wp.tid()
    i = terms.joint[tid]
    f = terms.frame[tid]
    k = terms.index[tid]
    kind = terms.kind[tid]
    direction = terms.direction[tid]
    value = wp.float64(0.0)
    if kind == AXIS:
        value = wp.dot(_axis(joints, values, i), direction)
    elif kind == LINE:
        axis = _axis(joints, values, i)
        origin = _origin(joints, values, i)
        value = wp.dot(origin + wp.dot(terms.point[tid] - origin, axis) * axis, direction)
    elif kind == ALONG_FRAME or kind == FACE:
        turn = wp.vec3d(turns[f, 0], turns[f, 1], turns[f, 2])
        side = wp.vec3d(frames[f][0, k], frames[f][1, k], frames[f][2, k])
        side = wp.normalize(side + wp.cross(turn, side))
        if kind == ALONG_FRAME:
            direction = _axis(joints, values, i)
        value = wp.dot(direction, side)
    elif kind == LEVEL:
        value = turns[f, k]
    elif kind == PRIOR:
        value = values[i, k]
    else:
        axis = _axis(joints, values, i)
        origin = _origin(joints, values, i)
        value = wp.dot(_moved(joints.kind[i], axis, origin, terms.point[tid], values[i, 4]), direction)
    wp.atomic_add(loss, 0, _robust((value - terms.expected[tid]) / terms.sigma[tid], terms.cut[tid]))


@wp.func
def _corner(paths: Paths, g: int, x: int, y: int, z: int) -> wp.float64:
    size = paths.shape[g]
    return paths.distance[paths.start[g] + (x * size[1] + y) * size[2] + z]


@wp.kernel
def sum_paths(joints: Joints, paths: Paths, values: wp.array2d(dtype=wp.float64), loss: wp.array(dtype=wp.float64)):
    """Add up the squared depths of points within the rest of the scan."""
    tid = wp.tid()
    i = paths.joint[tid]
    g = paths.grid[tid]
    q = paths.coordinate[tid]
    place = _moved(joints.kind[i], _axis(joints, values, i), _origin(joints, values, i), paths.point[tid], q)
    at = (place - paths.low[g]) / paths.cell[g]
    size = paths.shape[g]
    x = int(wp.floor(at[0]))
    y = int(wp.floor(at[1]))
    z = int(wp.floor(at[2]))
    if x >= 0 and y >= 0 and z >= 0 and x < size[0] - 1 and y < size[1] - 1 and z < size[2] - 1:
        u = at[0] - wp.float64(x)
        v = at[1] - wp.float64(y)
        w = at[2] - wp.float64(z)
        low = wp.lerp(_corner(paths, g, x, y, z), _corner(paths, g, x + 1, y, z), u)
        side = wp.lerp(_corner(paths, g, x, y + 1, z), _corner(paths, g, x + 1, y + 1, z), u)
        top = wp.lerp(_corner(paths, g, x, y, z + 1), _corner(paths, g, x + 1, y, z + 1), u)
        far = wp.lerp(_corner(paths, g, x, y + 1, z + 1), _corner(paths, g, x + 1, y + 1, z + 1), u)
        depth = -wp.lerp(wp.lerp(low, side, v), wp.lerp(top, far, v), w) - paths.slack[tid]
        if depth > wp.float64(0.0):
            wp.atomic_add(loss, 0, wp.float64(0.5) * paths.weight[tid] * depth * depth)


@dataclass(frozen=True, kw_only=True)
class RefineConfig:
    """How far furniture and annotations are trusted. Standard deviations unless said otherwise.

    Attributes:
        worse: increase of an axis's error that is tolerated where the annotation was accurate [rad].
        regret: weight of a larger increase, as an axis error [rad]; corrections are shortened accordingly.
    """

    # of an axis or a front against its furniture's [rad]. 0.2 deg; fitted fronts hang up to 0.3 deg askew: 2 mm
    # over 0.4 m, and their slides and hinges with them
    parallel: Positive = 0.0035
    # of furniture against gravity [rad]. 0.1 deg; furniture is put up with a spirit level: 1 mm over 0.6 m
    level: Positive = 0.0017
    # of an axis against its own front [rad]. 0.05 deg; a slide against its own front's normal,
    # a hinge against its plane
    hang: Positive = 0.0009
    # of a hinge line's distance from the edge, in the front's plane [m]. A hinge turns about the edge of its
    # front, or up to a leaf's thickness within
    edge: Positive = 0.006
    inset: float = 0.0  # mean of that distance, into the front [m]. The mean of that
    depth: Positive = 0.006  # of a hinge line's distance from the front's face [m]. The same across the front
    # of closed fronts of one piece of furniture from one plane [m]. Closed fronts of one cabinet: doors lie 1.5
    # mm before drawers, and rubber stops are 2 mm
    flush: Positive = 0.004
    # largest distance of a front before the others that is taken for standing ajar [m]. What stands farther
    # before the other fronts is another cabinet's, or open
    ajar: Positive = 0.1
    # of the annotated axes where a room has too few joints to tell, each of two components [rad]. 1 deg;
    # annotators err by 0.2 (conf/annotator/careful.yaml) to 1.3 (hasty.yaml) in each direction
    axis: Positive = 0.0175
    # annotated lines err by so much per error of their axis [m/rad]: both come from two points that someone
    # picked. M/rad, 10 mm per degree: a line drawn through two points 0.8 m apart
    arm: Positive = 0.57
    zero: Positive = 0.05  # of the closed coordinate of a slide [m]
    zero_angle: Positive = 0.1  # the same of a hinge [rad]
    penetration: Positive = 0.003  # of a part into the rest of the scan on its path [m]. Of the whole front at once
    cut: Positive = 2.5  # residual from which a term counts less and less, in standard deviations
    # largest fraction of the annotation's standard deviation that is left where a direction counts as known. The
    # scan halves the annotation's variance
    known: Fraction = 0.7
    worse: NotNegative
    regret: NotNegative
    sure: Positive = 4.0  # a closed coordinate is changed from so many standard deviations on


@dataclass(frozen=True)
class Term:
    """One residual, (value - expected) / sigma, with a robust loss."""

    # what the value is: AXIS: axis . direction; LINE: the point of the axis nearest to `point`, . direction [m];
    # ALONG_FRAME: axis . the frame's axis `index`; FACE: direction . the frame's axis `index`; LEVEL: the frame's
    # turn `index` [rad]; PRIOR: the joint's parameter `index`; FLUSH: `point`, fixed to the part, moved to the
    # closed coordinate, . direction [m]
    kind: int
    joint: int  # number of the joint
    sigma: float  # standard deviation, in the unit of the value
    frame: int = 0  # number of the frame
    index: int = 0  # see `kind`
    direction: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)  # unit, shape [3]
    point: Sequence[float] | np.ndarray = (0.0, 0.0, 0.0)  # shape [3], [m]
    expected: float = 0.0  # of the value
    cut: float = 0.0  # number of sigmas from which a residual counts less and less (Cauchy); 0: none


@dataclass(frozen=True)
class PartPath:
    """Points of a part on its way, and the distance to what is around it."""

    joint: int  # number of the joint
    points: np.ndarray  # of the part in the scanned pose [m], shape [point 3]
    slack: np.ndarray  # depth that each may have within the rest without a loss [m], shape [point]
    coordinates: np.ndarray  # of the path, [m] or [rad], shape [step]
    low: np.ndarray  # lowest corner of the grid [m], shape [3]
    cell: float  # width of its cells [m]
    # to the rest of the scan at the grid's corners [m], negative behind its surface, shape [x y z]
    distance: np.ndarray
    weight: float  # of the mean squared depth of all points and steps [1/m^2]


class Loss:
    """The loss of a room's joints as a function of all parameters: joints [joint 5], then frames [frame 3], in one vector."""

    def __init__(self, joints: Sequence[Joint], normals: Sequence[np.ndarray], frames: Sequence[np.ndarray]) -> None:
        """Take the annotated joints, the normals of their fronts [3], and the axes of the frames as columns [3 3]."""
        sides = [across(np.array(joint.axis), normal) for joint, normal in zip(joints, normals, strict=True)]
        self.first, self.second = (np.array([side[k] for side in sides]).reshape(-1, 3) for k in (0, 1))
        self.joints, self._frames = tuple(joints), _array(frames, wp.mat33d)
        self._turns = len(frames)
        self._kernel_joints = Joints()
        self._kernel_joints.kind = _array([int(joint.kind == "revolute") for joint in joints], int)
        vectors = [joint.axis for joint in joints], [joint.origin for joint in joints], self.first, self.second
        for name, value in zip(("axis", "origin", "first", "second"), vectors, strict=True):
            setattr(self._kernel_joints, name, _array(value, wp.vec3d))
        self._launches: list[tuple[wp.Kernel, int, list]] = []

    @property
    def size(self) -> int:
        """Number of parameters."""
        return COUNT * len(self.joints) + 3 * self._turns

    def of(self, terms: Sequence[Term], paths: Sequence[PartPath] = ()) -> "Loss":
        """Take what is added up, and return itself."""
        self._launches = [(sum_terms, len(terms), [self._kernel_joints, self._frames, _terms(terms)])]
        if paths:
            table = _paths(paths)
            self._launches.append((sum_paths, len(table.joint), [self._kernel_joints, table]))
        return self

    def __call__(self, parameters: np.ndarray) -> tuple[float, np.ndarray]:
        """Return the loss and its gradient, shape [parameter]."""
        cut = COUNT * len(self.joints)
        values = _array(parameters[:cut].reshape(-1, COUNT), wp.float64, requires_grad=True)
        turns = _array(parameters[cut:].reshape(-1, 3), wp.float64, requires_grad=True)
        loss = wp.zeros(1, dtype=wp.float64, device="cpu", requires_grad=True)
        with wp.Tape() as tape:
            for kernel, count, inputs in self._launches:
                variables = [values, turns] if kernel is sum_terms else [values]
                wp.launch(kernel, dim=count, inputs=[*inputs, *variables, loss], device="cpu")
        tape.backward(loss)
        return float(loss.numpy()[0]), np.concatenate([values.grad.numpy().ravel(), turns.grad.numpy().ravel()])

    def hessian(self, parameters: np.ndarray, frame: Sequence[int], step: float = 1e-5) -> np.ndarray:
        """Return the second derivatives by central differences of the gradient, shape [parameter parameter].

        Joints meet only in the frames, so that one parameter of all joints, or of all frames, is moved at once.

        `frame`: number of each joint's frame.
        """
        count, cut = len(self.joints), COUNT * len(self.joints)
        hessian = np.zeros((self.size, self.size))
        of_joint = np.arange(cut).reshape(count, COUNT)
        of_frame = np.arange(cut, self.size).reshape(-1, 3)
        for k in range(COUNT):
            row = self._difference(parameters, of_joint[:, k], step)
            for i in range(count):
                hessian[of_joint[i], of_joint[i, k]] = row[of_joint[i]]
        for k in range(3):
            row = self._difference(parameters, of_frame[:, k], step)
            for i, f in enumerate(frame):
                hessian[of_joint[i], of_frame[f, k]] = hessian[of_frame[f, k], of_joint[i]] = row[of_joint[i]]
            for mine in of_frame:
                hessian[mine, mine[k]] = row[mine]
        return (hessian + hessian.T) / 2.0

    def _difference(self, parameters: np.ndarray, moved: np.ndarray, step: float) -> np.ndarray:
        """Return the derivative of the gradient along some parameters, all moved at once."""
        shift = np.zeros(self.size)
        shift[moved] = step
        return (self(parameters + shift)[1] - self(parameters - shift)[1]) / (2.0 * step)


def across(axis: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit directions across an axis, shape [3] each; the first lies in the plane with this normal, if one does.

    For a slide along the normal the first is level.
    """
    first = np.cross(axis, normal)
    if np.linalg.norm(first) < 0.3:
        first = np.cross(np.eye(3)[2] if abs(axis[2]) < 0.9 else np.eye(3)[0], axis)
    first /= np.linalg.norm(first)
    return first, np.cross(axis, first)


def _array(values: object, dtype: type, requires_grad: bool = False) -> wp.array:
    return wp.array(
        np.asarray(values, np.int32 if dtype is int else np.float64),
        dtype=dtype,
        device="cpu",
        requires_grad=requires_grad,
    )


def _terms(terms: Sequence[Term]) -> Terms:
    """Return a table of terms, a column for each attribute."""
    table = Terms()
    for name in ("kind", "joint", "frame", "index"):
        setattr(table, name, _array([getattr(term, name) for term in terms], int))
    for name in ("direction", "point"):
        setattr(table, name, _array([getattr(term, name) for term in terms], wp.vec3d))
    for name in ("expected", "sigma", "cut"):
        setattr(table, name, _array([getattr(term, name) for term in terms], wp.float64))
    return table


def _paths(paths: Sequence[PartPath]) -> Paths:
    """Return a table with a row for each point and step of each path."""
    table, counts = Paths(), [len(path.points) * len(path.coordinates) for path in paths]
    number = np.repeat(np.arange(len(paths)), counts)
    table.joint, table.grid = _array(np.array([path.joint for path in paths])[number], int), _array(number, int)
    rows = [np.tile(path.points, (len(path.coordinates), 1)) for path in paths]
    table.point = _array(np.concatenate(rows), wp.vec3d)
    table.slack = _array(np.concatenate([np.tile(path.slack, len(path.coordinates)) for path in paths]), wp.float64)
    steps = [np.repeat(path.coordinates, len(path.points)) for path in paths]
    table.coordinate = _array(np.concatenate(steps), wp.float64)
    weights = [path.weight / count for path, count in zip(paths, counts, strict=True)]
    table.weight = _array(np.repeat(weights, counts), wp.float64)
    table.low, table.cell = _array([path.low for path in paths], wp.vec3d), _array([p.cell for p in paths], wp.float64)
    shapes = np.array([path.distance.shape for path in paths], np.int32)
    table.shape = wp.array(shapes, dtype=wp.vec3i, device="cpu")
    table.start = _array(np.cumsum([0, *(path.distance.size for path in paths[:-1])]), int)
    table.distance = _array(np.concatenate([path.distance.ravel() for path in paths]), wp.float64)
    return table


CELL = 0.015  # [m] Width of a cell of the grid
# [m] The grid reaches this far beyond the front: what is hit there tells of the joint, what lies farther of the room
AROUND = 0.06
REACH = 0.03  # [m] Farther behind a surface there may be another object's back
POINTS = 100  # Points of a front that are followed
STEPS = (0.03, 0.1, 0.2, 0.4, 0.7, 1.0)  # Fractions of the range at which they are looked at
SLACK = 0.004  # [m] Twice a laser scan's noise, or the gap around a front
MOST = 400_000  # Cells of a grid; larger parts get wider cells


def path(faces: Faces, part: str, number: int, weight: float) -> PartPath | None:
    """Return the path of a part, or None where nothing lies around it. `weight`: of the mean squared depth [1/m^2]."""
    surface, scene, joint = faces.surface, faces.surface.scene, faces.surface.scene.joint(part)
    own = scene.parts[part].mesh
    if not own.face_areas.any() or not open_limit(joint):
        return None
    low, high = own.bounds
    low, high = low - AROUND, high + AROUND
    near = faces.near(low - REACH, high + REACH)
    rest = keep(Mesh(surface.mesh.vertices, surface.mesh.faces), near[~faces.own(part, near)])
    if len(rest.faces) < 20:
        return None
    cell = max(CELL, float((np.prod(high - low) / MOST) ** (1 / 3)))
    counts = np.ceil((high - low) / cell).astype(int) + 1
    places = low + cell * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1).reshape(-1, 3)
    distance = _distance(rest, surface.winding, places).reshape(counts)
    points = sample(own, POINTS, 0)
    slack = SLACK + np.maximum(0.0, -_distance(rest, surface.winding, points))
    return PartPath(number, points, slack, open_limit(joint) * np.array(STEPS), low, cell, distance, weight)


def _distance(rest: Mesh, winding: float, places: np.ndarray) -> np.ndarray:
    """Return the distance of places [place 3] to a surface [m], negative straight behind it, at most REACH, shape [place]."""
    tree = ray_mesh(rest.vertices, rest.faces)
    face, gap = nearest_faces(tree, places, REACH)
    distances = np.full(len(places), REACH)
    near = face >= 0
    away = places[near] - centroids(rest)[face[near]]
    height = winding * np.einsum("ij,ij->i", away, normals(rest)[face[near]])
    behind = (height < 0) & (gap[near] < -height + 1e-3)
    distances[near] = np.where(behind, -gap[near], gap[near])
    return distances
