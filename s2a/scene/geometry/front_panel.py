"""The front panel behind a handle: its border, a recessed pull in it, and the finger gap before it."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from s2a.scene.geometry import mesh_ops as ops
from s2a.scene.geometry.convex import box, contains, subtract
from s2a.scene.geometry.planes import fit_plane, min_area_rectangle, plane_axes
from s2a.scene.scene import Mesh

SEARCH_RADIUS = 0.04  # [m] Search radius for the panel around the handle
SAMPLES = 40000  # Points sampled on a panel
MOST = 0.4  # Fraction of a panel's surface that faces outwards; of a lid, whose edge faces the gripper, a tenth does
STRAY = 0.004  # [m] What stands out of the front by more than this, close to the handle, is no front
FLUSH = 0.003  # [m] What stands out of the front by less than this is no handle


def front_behind(front: Mesh, region: Mesh, frame: np.ndarray) -> tuple[np.ndarray, float] | None:
    """Return the plane behind a handle as outward normal and offset [m], or None where no front was scanned.

    `frame`: the handle's grasp frame, axes as columns: z into the furniture.
    """
    outwards = -frame[:, 2]
    points = _facing(front, outwards)
    points = points[near_region(points, region, frame, SEARCH_RADIUS)]
    return _middle_plane(points, outwards) if len(points) >= 20 else None


def slab(mesh: Mesh, outwards: np.ndarray, thickness: float) -> Mesh | None:
    """Return a flat front as one solid piece behind its plane, or None if it is not flat or has a shape of its own.

    Args:
        mesh: a front as scanned: its outer surface, a strip of its sides, holes where a handle occluded it.
        outwards: unit direction out of the furniture, shape [3].
        thickness: of the piece [m].
    """
    points = _facing(mesh, outwards)
    if len(points) < MOST * SAMPLES:
        return None
    normal, offset = _middle_plane(points, outwards)
    flat = np.abs(points @ normal - offset) < STRAY
    axes = plane_axes(normal, points[flat])
    across = points[flat] @ axes[:, :2]
    turn = min_area_rectangle(across)
    low, high = np.quantile(across @ turn, [0.003, 0.997], axis=0)
    facing = mesh.face_areas.sum() * len(points) / SAMPLES
    if flat.mean() < 0.85 or facing * flat.mean() < 0.7 * np.prod(high - low):
        return None
    axes[:, :2] = axes[:, :2] @ turn
    center = axes[:, :2] @ ((low + high) / 2) + normal * (offset - thickness / 2)
    return box(center, axes, np.array([*(high - low), thickness]))


def patch(handle: Mesh, front: Mesh, frame: np.ndarray, plane: tuple[np.ndarray, float], thickness: float) -> Mesh:
    """Return a solid piece [m] of the front behind a handle, where the scanner often saw nothing.

    It reaches STRAY beyond the handle where the front goes on, and ends with it where it is at the front's border.
    """
    frame = facing_frame(frame, plane[0])
    low, high = np.quantile(handle.vertices @ frame[:, :2], [0.01, 0.99], axis=0)
    beside = ops.centroids(front)
    beside = beside[(np.abs(beside @ plane[0] - plane[1]) < STRAY) & near_region(beside, handle, frame, SEARCH_RADIUS)]
    across = beside @ frame[:, :2]
    low = low - STRAY * (across < low - STRAY).any(axis=0)
    high = high + STRAY * (across > high + STRAY).any(axis=0)
    center = frame @ np.array([*(low + high) / 2, thickness / 2 - plane[1]])
    return box(center, frame, np.array([*(high - low), thickness]))


def _facing(mesh: Mesh, outwards: np.ndarray) -> np.ndarray:
    """Return points on the faces that look outwards [m], shape [point 3], evenly spread by area."""
    points, faces = ops.sample_with_faces(mesh, SAMPLES, seed=0)
    return points[ops.normals(mesh)[faces] @ outwards > 0.7]


def _middle_plane(points: np.ndarray, outwards: np.ndarray) -> tuple[np.ndarray, float]:
    """Return normal and offset of the plane through most of the points."""
    normal, offset = outwards, float(np.median(points @ outwards))
    for tolerance in (2 * STRAY, STRAY, STRAY):
        inside = np.abs(points @ normal - offset) < tolerance
        if inside.sum() < 10:
            break
        normal, offset = fit_plane(points[inside], np.ones(inside.sum()), outwards)
    return normal, offset


def front_coordinate(plane: tuple[np.ndarray, float], frame: np.ndarray, point: np.ndarray) -> float:
    """Return where the line through a point [3] along a frame's z axis meets a plane, as coordinate on it [m]."""
    normal, offset = plane
    z = frame[:, 2]
    return float((offset - normal @ (point - z * (point @ z))) / (normal @ z))


def facing_frame(frame: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return a frame [3 3] turned so that its z axis looks into a front of this outward normal [3], its x axis along as before.

    A hinged part moves at its handle aslant to its front, by as much as the handle stands out; handles stand square on fronts.
    """
    z = -normal / np.linalg.norm(normal)
    x = frame[:, 0] - z * (z @ frame[:, 0])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def near_region(points: np.ndarray, region: Mesh, frame: np.ndarray, distance: float) -> np.ndarray:
    """Return which points lie before, behind or beside a handle, seen along its z axis, within a distance [m]."""
    across = points @ frame[:, :2]
    low, high = np.quantile(region.vertices @ frame[:, :2], [0.01, 0.99], axis=0)
    return ((across > low - distance) & (across < high + distance)).all(axis=1)


def reassign_border(front: Mesh, region: Mesh, frame: np.ndarray, plane: tuple[np.ndarray, float]) -> tuple[Mesh, Mesh]:
    """Give every face at the border between front and handle to the side that it belongs to.

    Annotators cut along triangles, and one or two of them land on the wrong side; as front, they would pull its hull
    across the gap behind the handle.

    Returns:
        The front without what stands out of it close to the handle, and the handle with that and without what is front.
    """
    normal, offset = plane
    out = ops.centroids(front) @ normal - offset
    stray = near_region(ops.centroids(front), region, frame, SEARCH_RADIUS / 2) & (out > STRAY)
    strays = ops.keep(front, stray)
    handle_out = ops.centroids(region) @ normal - offset
    own = handle_out > FLUSH
    if region.face_areas[own].sum() < 0.5 * region.face_areas.sum():
        return front, region  # a recessed cup lies behind its front's plane
    handle = ops.keep(region, own)
    if len(strays.faces):
        reach = cKDTree(handle.vertices).query(ops.centroids(strays))[0] < 2 * STRAY
        handle = ops.merge([handle, ops.keep(strays, reach)])
    return ops.keep(front, ~stray), handle


SHALLOWEST = 0.006  # [m] Pockets that are not so deep give no hold: a fingertip's edge is rounded, and scans are noisy
WALL = 0.004  # [m] Thickness of the walls and the floor as colliders
FACING = 0.7  # Of a face's normal with the front's, from which on it is the pocket's floor; less: a wall
AHEAD = 0.02  # [m] How far before the front the space of the pocket is kept free


@dataclass(frozen=True)
class Pocket:
    """A rectangular pocket."""

    frame: np.ndarray  # axes as columns [3 3], square on the front: x and y along its sides, z into it
    center: np.ndarray  # of its opening, on the front's plane [m], shape [3]
    size: np.ndarray  # of its opening along x and y [m], shape [2]
    depth: float  # of its floor behind the front's plane [m]

    def space(self, wall: float = 0.0, floor: float = 0.0) -> Mesh:
        """Return the space within it and before it as a piece, wider by a wall [m] and deeper by a floor [m]."""
        ahead, deep = AHEAD, self.depth + floor
        size = np.array([*(self.size + 2 * wall), ahead + deep])
        return box(self.center + self.frame[:, 2] * (deep - ahead) / 2, self.frame, size)


def find_pocket(region: Mesh, frame: np.ndarray, plane: tuple[np.ndarray, float]) -> Pocket | None:
    """Return the pocket that a grasp region lines, or None where most of it is not behind the front.

    `frame`: its grasp frame, axes as columns: x and y along the pocket's sides, z into the furniture; `plane`: of the
    front, as outward normal and offset [m].
    """
    normal, offset = plane
    frame = facing_frame(frame, normal)
    middle, areas = ops.centroids(region), region.face_areas
    behind = offset - middle @ normal
    if areas[behind > FLUSH].sum() < 0.5 * areas.sum():
        return None
    floor = (behind > FLUSH) & (ops.normals(region) @ normal > FACING)
    if areas[floor].sum() < 0.25 * areas.sum():
        return None
    depth = ops.weighted_quantile(behind[floor], areas[floor], 0.5)
    if depth < SHALLOWEST:
        return None
    # A scan's walls lean: half-way down they stand where the true ones do.
    deep = offset - region.vertices @ normal > 0.5 * depth
    low, high = ops.extents(ops.keep(region, deep[region.faces].all(axis=1)), frame[:, :2])
    center = frame[:, :2] @ (low + high) / 2 + normal * offset
    return Pocket(frame, center, high - low, depth)


def pocketed(piece: Mesh, pocket: Pocket) -> list[Mesh]:
    """Return a piece of the front without a pocket and its walls, as convex pieces."""
    return subtract(piece, pocket.space(WALL, WALL))


def pocket_hulls(pocket: Pocket) -> list[Mesh]:
    """Return walls and floor of a pocket as convex pieces."""
    deep = pocket.depth + WALL
    center = pocket.center + pocket.frame[:, 2] * deep / 2
    return subtract(box(center, pocket.frame, np.array([*(pocket.size + 2 * WALL), deep])), pocket.space())


FINGER_WIDTH = 0.02  # [m] Width of the space that is kept free for a finger of any gripper, along the handle
# [m] Its extent across the handle, on either side; certify measures with the boxes of the robot's own fingers
FINGER_DEPTH = 0.015
CLEARANCE = 0.002  # [m] What fingers keep from the front; a scan is not surer than that
GAP_SAMPLES = 20000  # Points by which a handle is asked


@dataclass(frozen=True)
class FingerSpace:
    """Where the fingers are while they hold a handle: boxes in the scene, none if the handle lies flat on the front."""

    # the space between bar and front; None if the region reaches the front there (a knob, a webbed bar)
    behind: Mesh | None
    beside: tuple[Mesh, ...]  # the two spaces across the bar, from its outer face to the front

    @property
    def boxes(self) -> tuple[Mesh, ...]:
        """All spaces."""
        return self.beside if self.behind is None else (self.behind, *self.beside)


def finger_space(region: Mesh, point: np.ndarray, frame: np.ndarray, front: float) -> FingerSpace:
    """Return where the fingers go.

    Args:
        region: the grasp region as scanned, mostly open at its back.
        point: where it is grasped [m], shape [3].
        frame: grasp frame's axes as columns [3 3]: x along the region, y across, z into the furniture.
        front: coordinate along z of the front's surface behind the region [m].
    """
    local = ops.sample(region, GAP_SAMPLES, seed=0) @ frame
    middle = point @ frame
    here = local[np.abs(local[:, 0] - middle[0]) < FINGER_WIDTH / 2]
    if len(here) < 50:
        return FingerSpace(None, ())
    (low, face), (high, back) = np.quantile(here[:, 1:], [0.01, 0.99], axis=0)
    end = front - CLEARANCE
    if end - face < 2 * CLEARANCE:
        return FingerSpace(None, ())

    def space(y: tuple[float, float], z: tuple[float, float]) -> Mesh:
        center = np.array([middle[0], np.mean(y), np.mean(z)])
        return box(frame @ center, frame, np.array([FINGER_WIDTH, y[1] - y[0], z[1] - z[0]]))

    margin = CLEARANCE / 2
    below, above = (low - margin - FINGER_DEPTH, low - margin), (high + margin, high + margin + FINGER_DEPTH)
    beside = (space(below, (face, end)), space(above, (face, end)))
    reaches_front = back - face > 0.75 * (front - face)
    return FingerSpace(None if reaches_front else space((low, high), (back + margin, end)), beside)


def fraction_inside(hulls: Sequence[Mesh], points: np.ndarray) -> float:
    """Return the share of points [point 3] that lie in any of the hulls, 0 to 1."""
    inside = np.zeros(len(points), bool)
    for piece in hulls:
        inside |= contains(piece, points)
    return float(inside.mean()) if len(points) else 0.0
