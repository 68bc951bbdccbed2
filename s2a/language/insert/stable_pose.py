"""Stable poses of an object: tilt margins by up axis, concavities at its ends, and cross-sections along its axes."""

import numpy as np
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a.scene.geometry.mesh_ops import normals, sample
from s2a.scene.geometry.mesh_query import RayMesh, kept_ray_mesh, visible_distance
from s2a.scene.scene import Mesh

# Directions by name: "+x" to "-z"
AXES = {
    f"{sign}{name}": direction
    for name, axis in zip("xyz", np.eye(3), strict=True)
    for sign, direction in (("+", axis), ("-", -axis))
}


def sideways(up: str) -> list[str]:
    """Return the axes across an up axis: the possible fronts."""
    return [name for name, axis in AXES.items() if abs(axis @ AXES[up]) < 0.5]


FOOT = 0.02  # Height of the support polygon as a fraction of the longest side: few objects are quite flat below
EXACT = 0.002  # The same, for the exact resting pose
STEADY = 0.05  # Smallest tilt margin of a stable pose, as a fraction of a right angle
ASKEW = 0.966  # Cosine of 15 deg: largest angle between an axis of the file and the up axis of a stable pose
TRIED = 12  # Faces of the convex hull that are tested as support, the largest first
SLICES = 5
SAMPLES = 5000
GRID = 24  # Points along a side of the grid over each end
DEEP = 0.25  # Smallest depth of a concavity, as a fraction of the extent
SIDEWAYS = 8  # Directions in which a concavity must be bounded, except one


def tilt_margins(mesh: Mesh) -> dict[str, float]:
    """Return the tilt margin for each up axis, "+x" to "-z": the tilt before the object falls, as a fraction of a right angle.

    As a share of a right angle: 0 does not stand at all, a cube has 0.5, a thin plate almost 1. Weight is where the surface is.
    An axis on which it does not stand may be 15 deg off the axis on which it does: of many files the axes are not its own.
    """
    points, middle = _weighed(mesh)
    downs = _faces(points).round(2)  # independent of the last digits
    downs /= np.linalg.norm(downs, axis=1, keepdims=True)
    margins = {}
    for name, axis in AXES.items():
        firm = _tilt(points, middle, axis, FOOT)
        if firm < STEADY:
            firm = max([firm, *[_tilt(points, middle, -down, FOOT) for down in _near(downs, axis)]])
        margins[name] = round(firm, 2)
    return margins


def tilt_margin(mesh: Mesh, up: np.ndarray) -> float:
    """Return how far an object may be tilted before it falls with a direction up [3], as a fraction of a right angle."""
    points, middle = _weighed(mesh)
    return _tilt(points, middle, up, FOOT)


def settled_axis(mesh: Mesh, axis: np.ndarray) -> np.ndarray:
    """Return the up direction of the resting pose after release with an axis up [3], unit, shape [3].

    That is the face of its hull nearest to level on which it stays, not more than 15 deg off; the axis itself if there is none.
    One on which it stands firmly is preferred: a photo frame stands on its strut, not on its bottom edge alone.
    """
    points, middle = _weighed(mesh)
    directions = [axis, *[-down for down in sorted(_near(_faces(points), axis), key=lambda down: down @ axis)]]
    margins = [_tilt(points, middle, direction, EXACT) for direction in directions]
    for least in (STEADY, 0.5 * STEADY):
        for direction, margin in zip(directions, margins, strict=True):
            if margin >= least:
                return direction
    return axis


def _weighed(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return an object's points [point 3] and the centroid of its surface, shape [3]."""
    middle = np.average(mesh.vertices[mesh.faces].mean(axis=1), axis=0, weights=mesh.face_areas)
    return mesh.vertices.astype(np.float64), middle


def _near(downs: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the largest of some downward normals [face 3] that are nearly opposite to an axis [3]."""
    return downs[-downs @ axis > ASKEW][:TRIED]


def concavities(mesh: Mesh) -> dict[str, float]:
    """Return for each axis, "+x" to "-z", the fraction of the outline seen from that end that is a bounded concavity.

    A cup has 0.7 at its mouth and 0 elsewhere; between the legs of a table turned over there is none.
    """
    tree = kept_ray_mesh(mesh)
    return {name: round(_concavity(mesh, tree, axis), 1) for name, axis in AXES.items()}


def grid_over(low: np.ndarray, high: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return a grid of points on the side of a box, from corner to corner [3], to which an axis [3] points, shape [point 3]."""
    up = int(np.abs(axis).argmax())
    across = [i for i in range(3) if i != up]
    middles = (np.stack(np.meshgrid(*[np.arange(GRID)] * 2), axis=-1).reshape(-1, 2) + 0.5) / GRID
    points = np.empty((len(middles), 3))
    points[:, across] = low[across] + middles * (high - low)[across]
    points[:, up] = high[up] if axis[up] > 0 else low[up]
    return points


def cross_sections(mesh: Mesh) -> dict[str, list[float]]:
    """Return for "x", "y" and "z" the fraction of the box's cross-section that each slice spans, from - to +.

    A bottle along y has about [0.8, 0.8, 0.8, 0.4, 0.1]: what a slice spans is the convex hull of its surface.
    """
    points = sample(mesh, SAMPLES, seed=0)
    low, high = mesh.bounds.astype(np.float64)
    sections = {}
    for axis, name in enumerate("xyz"):
        across = [i for i in range(3) if i != axis]
        box = max(float(np.prod((high - low)[across])), 1e-12)
        numbers = np.clip(SLICES * (points[:, axis] - low[axis]) / max(high[axis] - low[axis], 1e-12), 0, SLICES - 1)
        hulls = [_hull(points[numbers.astype(int) == i][:, across]) for i in range(SLICES)]
        sections[name] = [round(min(1.0, hull.volume / box), 1) if hull else 0.0 for hull in hulls]
    return sections


def _faces(points: np.ndarray) -> np.ndarray:
    """Return the outward normals of the faces of the convex hull of points [point 3], the largest first, shape [face 3]."""
    hull = _hull(points)
    if hull is None:
        return np.empty((0, 3))
    a, b, c = np.moveaxis(points[hull.simplices], 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    _, faces = np.unique(hull.equations[:, :3].round(2), axis=0, return_inverse=True)
    normals = np.stack([np.bincount(faces.ravel(), areas * part) for part in hull.equations[:, :3].T], axis=1)
    order = np.argsort(-np.bincount(faces.ravel(), areas), kind="stable")
    return normals[order] / np.linalg.norm(normals[order], axis=1, keepdims=True)


def _tilt(points: np.ndarray, middle: np.ndarray, up: np.ndarray, within: float) -> float:
    """Return the tilt margin of points [point 3], as a fraction of a right angle.

    Its foot is what is not higher than a share of its longest side.
    """
    level = np.linalg.svd(up[None])[2][1:].T
    height = points @ up
    low = points[height <= height.min() + within * max(float(np.ptp(points, axis=0).max()), 1e-12)]
    foot = _hull(low @ level)
    if foot is None:
        return 0.0
    edge = -float((foot.equations[:, :2] @ (middle @ level) + foot.equations[:, 2]).max())
    return max(0.0, float(np.arctan2(edge, middle @ up - height.min()) / (np.pi / 2)))


def _concavity(mesh: Mesh, tree: RayMesh, axis: np.ndarray) -> float:
    """Return the fraction of the outline seen from one end that is a bounded concavity."""
    low, high = mesh.bounds.astype(np.float64)
    up = int(np.abs(axis).argmax())
    extent, across = float((high - low)[up]), [i for i in range(3) if i != up]
    start = grid_over(low, high, axis) + 0.01 * extent * axis
    reach = 1.1 * extent
    depth, _ = visible_distance(tree, start, -axis, reach)
    seen = depth < reach
    deep = np.flatnonzero(seen & (depth > DEEP * extent))
    walls = np.zeros(len(deep), int)
    for angle in np.arange(SIDEWAYS) * 2 * np.pi / SIDEWAYS:
        sideways = np.zeros(3)
        sideways[across] = np.cos(angle), np.sin(angle)
        far = float(np.linalg.norm(high - low))
        away, _ = visible_distance(tree, start[deep] - 0.5 * depth[deep, None] * axis, sideways, far)
        walls += away < far
    return float((walls >= SIDEWAYS - 1).sum() / max(seen.sum(), 1))


def _hull(points: np.ndarray) -> ConvexHull | None:
    """Return the convex hull of points [point 2] or [point 3]; None if they all lie on one line, or in one plane."""
    try:
        return ConvexHull(points)
    except (QhullError, ValueError):
        return None


# Angle at which things lean [rad]: a guitar, a broom, a board; friction holds their feet up to about 40 deg
LEAN = np.radians(10.0)
SHAKY = 0.11  # Tilt margin below which a thing is leaned, as a share of a right angle: 10 deg
TALL = 3.0  # Height over depth from which a thing is leaned
LOWEST, SHAFT = 0.05, (0.1, 0.3)  # Heights of the foot and of the shaft above it, as fractions of an object's height
# A stand's area over that of the shaft above it, and its width over its length: that of a lamp, not the head of a
# broom
WIDER, SQUARE = 3.0, 0.5


# A panel's face: cosine of its normals to where it looks, length of their mean, area over that of the other face, and
# sine of its least lean
FACE, FLAT, ALIKE, LEANS = 0.85, 0.98, 0.6, 0.06


def slender(object: Mesh) -> bool:
    """Return True for an upright object that is tall, shallow and easily tipped: nobody stands it up on its own."""
    deep, _, high = np.ptp(object.bounds, axis=0)
    shaky = tilt_margin(object, np.array([0.0, 0.0, 1.0])) < SHAKY
    return bool(high > TALL * deep and high > 0.4 and shaky and not has_stand(object))


def has_stand(object: Mesh) -> bool:
    """Return True for an upright object on a foot made to stand on: as a floor lamp's, it is wider than the shaft above."""
    points = np.concatenate([sample(object, 4000, seed=0), object.vertices])
    height = (points[:, 2] - points[:, 2].min()) / max(float(np.ptp(points[:, 2])), 1e-9)
    foot = points[height < LOWEST, :2]
    shaft = points[(height > SHAFT[0]) & (height < SHAFT[1]), :2]
    sides = np.ptp(foot, axis=0)
    return bool(outline(foot) > WIDER * outline(shaft) and sides.min() > SQUARE * sides.max())


def outline(points: np.ndarray) -> float:
    """Return the area of the convex hull of points [point 2]; 0 where they have none."""
    hull = _hull(points)
    return 0.0 if hull is None else float(hull.volume)


def leans_forward(mesh: Mesh, up: np.ndarray, front: np.ndarray) -> bool:
    """Return True for a panel whose front looks down and whose back looks up: a photo on its strut that is taken for its back.

    `up`: unit direction, shape [3]; `front`: unit direction of what is taken for its front, across `up`, shape [3].
    """
    facing, areas = normals(mesh).astype(np.float64), mesh.face_areas.astype(np.float64)
    sides = [facing @ way > FACE for way in (front, -front)]
    ahead, behind = (float(areas[side].sum()) for side in sides)
    if min(ahead, behind) < ALIKE * max(ahead, behind) or not ahead:
        return False
    means = [np.average(facing[side], axis=0, weights=areas[side]) for side in sides]
    if min(np.linalg.norm(mean) for mean in means) < FLAT:  # a leaning rod or a banana has no face
        return False
    forward, backward = (float(mean @ up) for mean in means)
    return forward < -LEANS and backward > LEANS and abs(forward + backward) < LEANS


def leaned(turn: np.ndarray) -> np.ndarray:
    """Return a rotation from the object's frame to the scene's, shape [3 3], tilted backwards so that its top is behind."""
    return np.asarray(turn @ Rotation.from_euler("y", -LEAN).as_matrix())
