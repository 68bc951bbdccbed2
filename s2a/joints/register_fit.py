"""Joints fitted by least squares, and the candidates from which the fit starts."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.joints.register_surface import SPACING, Cloud, OrientedMesh, Patch, connected, match
from s2a.scene.articulation import transform
from s2a.scene.geometry.planes import across
from s2a.scene.scene import Joint

ALIKE = 0.75  # Cosine between normals from which a match counts
REACHES = (0.025, 0.015, 0.01, 0.006)  # [m] Distances beyond which a match counts nothing, from coarse to fine
STEPS = 6  # Gauss-Newton steps at each of them
SMALL = 1e-6  # [m] or [rad] Step of the central difference
# [m] Standard deviation of the distance between two scans of one surface, as they lie in one frame: of a front, and
# of what stands across it, handles and edges, which each scan shows from other sides: 1 to 2.5 mm off,
# all of a handle alike
NOISE, SIDE_NOISE = 0.002, 0.005
FLAT = 0.95  # Cosine to the front's normal from which surface is of the front
# [m] Within which the errors of a scan are one, of fronts and of what stands across them:
# samples so near tell nothing new
CORRELATION, SIDE_CORRELATION = 0.05, 0.15
# [rad] Standard deviation of the angle by which a front stands askew to its slide, or its hinge to the front: even
# gaps, 1 mm over 0.4 m. The shift and the turn of a plain front within its own plane are hardly seen, and with them
# the axis' direction
SQUARE = 0.0025


@dataclass(frozen=True, eq=False)
class JointFit:
    """A joint as the scans show it."""

    joint: Joint  # its limits from 0 to the coordinate of the open scan
    # inverse covariance of the unknowns, J^T W J with what is known before, shape [unknown unknown]
    information: np.ndarray
    count: int  # number of residuals in use
    rms: float  # of them [m]

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the unknowns [rad], [m]: see `changed_joint`, shape [unknown]."""
        return np.sqrt(np.diag(np.linalg.inv(self.information + 1e-6 * np.eye(len(self.information)))))


def changed_joint(joint: Joint, x: np.ndarray) -> Joint:
    """Return a joint after a step of its unknowns: two angles of the axis [rad], (two shifts [m],) the coordinate's change."""
    u, v = across(np.array(joint.axis))
    axis = Rotation.from_rotvec(x[0] * u + x[1] * v).apply(joint.axis)
    origin = np.array(joint.origin) + (x[2] * u + x[3] * v if joint.kind == "revolute" else 0.0)
    return Joint(joint.kind, tuple(axis / np.linalg.norm(axis)), tuple(origin), (0.0, joint.limits[1] + x[-1]))


def unknowns(joint: Joint) -> int:
    """Return the number of unknowns."""
    return 5 if joint.kind == "revolute" else 3


def twists(joint: Joint) -> np.ndarray:
    """Return the derivative of the part's open pose by the unknowns, as small motions (turn, shift), shape [6 unknown]."""
    count = unknowns(joint)
    inverse = np.linalg.inv(transform(joint, joint.limits[1]))
    columns = np.empty((6, count))
    for i in range(count):
        ahead, back = (changed_joint(joint, s * SMALL * np.eye(count)[i]) for s in (1, -1))
        rate = (transform(ahead, ahead.limits[1]) - transform(back, back.limits[1])) @ inverse / (2 * SMALL)
        columns[:, i] = rate[2, 1], rate[0, 2], rate[1, 0], *rate[:3, 3]
    return columns


def fit(
    joint: Joint,
    part: Cloud,
    closed: OrientedMesh,
    moved: Cloud,
    opened: OrientedMesh,
    spacing: tuple[float, float],
    front: np.ndarray,
) -> JointFit:
    """Return the joint by least squares from a start.

    Args:
        joint: the start, its origin near the part.
        part: samples of the part in the closed scan.
        closed: the closed scan.
        moved: samples of the part in the open scan.
        opened: the open scan, in the closed one's frame.
        spacing: mean distance of the samples of each [m].
        front: normal of the part's front in the closed scan, shape [3]; a slide's direction is near it.
    """
    every = np.repeat(np.array(spacing), [len(part), len(moved)])
    for reach in REACHES:
        for _ in range(STEPS):
            rows, residuals, weights, flat = _system(joint, part, closed, moved, opened, reach, front)
            noise = np.where(flat, NOISE * CORRELATION, SIDE_NOISE * SIDE_CORRELATION)
            scale = (every / noise) ** 2  # an inverse variance for as many samples as lie within a correlation length
            information = rows.T @ (rows * (scale * weights)[:, None])
            gradient = rows.T @ (scale * weights * residuals)
            slope, error = square(joint, front)
            information[:2, :2] += slope.T @ slope / SQUARE**2
            gradient[:2] += slope.T @ error / SQUARE**2
            step = np.linalg.solve(information + 1e-6 * np.eye(len(information)), -gradient)
            joint = changed_joint(joint, np.clip(step, -0.03, 0.03))
            if np.abs(step).max() < 1e-5:
                break
    used = weights > 0
    rms = float(np.sqrt(np.average(residuals[used] ** 2, weights=weights[used]))) if used.any() else np.inf
    return JointFit(joint, information, int(used.sum()), rms)


def square(joint: Joint, front: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much an axis is askew to a front, and the derivative by its two angles, shape [error 2] and [error].

    A slide goes along the front's normal [3]: two errors. A hinge is parallel to the front: one.
    """
    u, v = across(np.array(joint.axis))
    if joint.kind == "prismatic":  # a turn about u takes the axis towards -v, one about v towards u
        return np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([-(u @ front), -(v @ front)])
    return np.array([[-(v @ front), u @ front]]), np.array([np.array(joint.axis) @ front])


def _system(
    joint: Joint, part: Cloud, closed: OrientedMesh, moved: Cloud, opened: OrientedMesh, reach: float, front: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return the Jacobian [residual unknown], the residuals [m], their weights, and which are of the front."""
    motion = transform(joint, joint.limits[1])
    there = part.moved(motion)
    ahead = match(there, opened, reach)
    back = match(moved.moved(np.linalg.inv(motion)), closed, reach)
    back_normal = back.normal @ motion[:3, :3].T
    points = np.concatenate([there.points, moved.points])
    normals = np.concatenate([ahead.normal, -back_normal])
    residuals = np.concatenate([ahead.offset, back.offset])
    gaps = np.concatenate([ahead.gap, back.gap])
    good = np.concatenate([(m.alike > ALIKE) & m.inner for m in (ahead, back)])
    weights = np.where(good, (1 - np.clip(gaps / reach, 0, 1) ** 2) ** 2, 0.0)
    # A front has one normal: those of its noisy triangles would seem to know its shift within its own plane.
    facing = normals @ (motion[:3, :3] @ front)
    flat = np.abs(facing) > FLAT
    normals = np.where(flat[:, None], np.sign(facing)[:, None] * (motion[:3, :3] @ front), normals)
    rows = np.concatenate([np.cross(points, normals), normals], axis=1) @ twists(joint)
    return rows, np.where(good, residuals, 0.0), weights, flat


PARALLEL = np.radians(4.0)  # [rad] Patches at a smaller angle are parallel: what is between them is a slide
MIN_SLIDE = 0.04  # [m] A slide is longer
MAX_SLIDE = 1.2  # [m] And shorter
MAX_TURN = 2.6  # [rad] A hinge turns less
# Cosine to the vertical beyond which nothing slides: what seems to is a floor below something that opened over it
UPRIGHT = 0.9
NEAR_AXIS = 0.12  # [m] A hinge is not farther from the patch that it turns
# [m] How far a hinge may lie behind the crossing of both planes, or before it
SETBACKS = np.arange(-0.06, 0.0601, 0.01)
REACH = 0.025  # [m] A moved point explains surface within this distance
START_ALIKE = 0.8  # Cosine between normals from which it does
POINTS = 400  # Points of a patch that are tried
# Fraction of a patch that a joint has to explain, or MIN_FRONT of it: a drawer's front beside a door's in one plane
MIN_FRACTION = 0.2
MIN_FRONT = 0.02  # [m^2] Smallest front


@dataclass(frozen=True, eq=False)
class Start:
    """A joint that could be."""

    joint: Joint  # in the closed scan's frame, its limits from 0 to the coordinate of the open scan
    patch: int  # index of the closed patch
    area: float  # surface that it explains [m^2]
    fraction: float  # of the patch

    @property
    def q(self) -> float:
        """Coordinate in the open scan [m] or [rad]."""
        return self.joint.limits[1]


def starts(closed: list[Patch], opened: list[Patch], surface: OrientedMesh) -> list[Start]:
    """Return the joints that explain enough of a patch, the most surface first.

    Args:
        closed: patches that only the closed scan shows.
        opened: patches that only the open scan shows.
        surface: what only the open scan shows, all of it.
    """
    joints = []
    for index, patch in enumerate(closed):
        cloud = patch.cloud[np.linspace(0, len(patch.cloud) - 1, min(POINTS, len(patch.cloud))).astype(int)]
        for other in opened:
            best = None
            for joint in _joints(patch, other):
                motion = transform(joint, joint.limits[1])
                fraction = float(explained(cloud, motion, surface, REACH, START_ALIKE).mean())
                if fraction >= min(MIN_FRACTION, MIN_FRONT / patch.area) and (best is None or fraction > best.fraction):
                    best = Start(joint, index, fraction * patch.area, fraction)
            if best is not None:
                joints.append(best)
    return sorted(joints, key=lambda start: -start.area)


def front_of(start: Start, patch: Patch, surface: OrientedMesh) -> Patch:
    """Return what a joint explains of a patch, its largest connected piece: fronts beside each other in a plane come as one."""
    matches = match(patch.cloud.moved(transform(start.joint, start.q)), surface, REACH)
    pieces = connected(patch.cloud[matches.alike > START_ALIKE], int(MIN_FRONT / SPACING**2))
    return max(pieces, key=lambda piece: piece.area) if pieces else patch


def explained(
    cloud: Cloud, motion: np.ndarray, surface: OrientedMesh, reach: float, alike: float = ALIKE
) -> np.ndarray:
    """Return how well each point of a cloud, moved [4 4], lies on a surface, shape [point]: 1 exactly, 0 beyond `reach` [m].

    `alike` is the cosine between normals from which a point counts.
    """
    matches = match(cloud.moved(motion), surface, reach)
    return np.where(matches.alike > alike, 1.0 - (np.minimum(matches.gap, reach) / reach) ** 2, 0.0)


def _joints(patch: Patch, other: Patch) -> Iterator[Joint]:
    """Yield joints that take the plane of a patch to that of another."""
    axis = np.cross(patch.normal, other.normal)
    sine, cosine = float(np.linalg.norm(axis)), float(patch.normal @ other.normal)
    if np.arctan2(sine, cosine) < PARALLEL:
        way = float((other.centre - patch.centre) @ patch.normal)
        if MIN_SLIDE < abs(way) < MAX_SLIDE and abs(patch.normal[2]) < UPRIGHT:
            direction = np.sign(way) * patch.normal
            axis = direction / np.linalg.norm(direction)
            yield Joint("prismatic", tuple(axis), tuple(patch.centre), (0.0, abs(way)))
        return
    axis /= sine
    angle = float(np.arctan2(sine, cosine))
    bisector = patch.normal + other.normal
    length = float(np.linalg.norm(bisector))
    if angle > MAX_TURN:
        return
    planes = np.stack([patch.normal, other.normal, axis])
    offsets = np.array([patch.normal @ patch.centre, other.normal @ other.centre, axis @ patch.centre])
    crossing = np.linalg.solve(planes, offsets)
    for setback in SETBACKS:
        origin = crossing - setback * bisector / length
        if np.linalg.norm(np.cross(axis, patch.cloud.points - origin), axis=1).min() < NEAR_AXIS:
            yield Joint("revolute", tuple(axis), tuple(origin), (0.0, angle))
