"""Least squares over a joint: its axis, origin and coordinate, by point-to-plane residuals of both scans with a robust loss.

A joint has as many unknowns as can be seen: a hinge five (two of its direction, two of its place across it, its angle), a slide
three (two of its direction, its length). The Jacobian is analytic up to the joint's own transform, whose derivative by each
unknown is a central difference of `articulation.transform`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.joints.register_rooms import turned
from s2a.joints.register_surface import Cloud, OrientedMesh, match
from s2a.scene.articulation import transform
from s2a.scene.scene import Joint

ALIKE = 0.75
"""Cosine between normals from which a match counts."""
REACHES = (0.025, 0.015, 0.01, 0.006)
"""[m] Distances beyond which a match counts nothing, from coarse to fine."""
STEPS = 6
"""Gauss-Newton steps at each of them."""
SMALL = 1e-6
"""[m] or [rad] Step of the central difference."""
NOISE, SIDE_NOISE = 0.002, 0.005
"""[m] Standard deviation of the distance between two scans of one surface, as they lie in one frame: of a front, and of what
stands across it, handles and edges, which each scan shows from other sides: 1 to 2.5 mm off, all of a handle alike."""
FLAT = 0.95
"""Cosine to the front's normal from which surface is of the front."""
CORRELATION, SIDE_CORRELATION = 0.05, 0.15
"""[m] Within which the errors of a scan are one, of fronts and of what stands across them: samples so near tell nothing new."""
SQUARE = 0.0025
"""[rad] Standard deviation of the angle by which a front stands askew to its slide, or its hinge to the front: even gaps, 1 mm
over 0.4 m. The shift and the turn of a plain front within its own plane are hardly seen, and with them the axis' direction."""


@dataclass(frozen=True, eq=False)
class JointFit:
    """A joint as the scans show it.

    Attributes:
        joint: its limits from 0 to the coordinate of the open scan.
        information: inverse covariance of the unknowns, J^T W J with what is known before, shape [unknown unknown].
        count: number of residuals in use.
        rms: of them [m].
    """

    joint: Joint
    information: np.ndarray
    count: int
    rms: float

    @property
    def deviations(self) -> np.ndarray:
        """Standard deviations of the unknowns [rad], [m]: see `changed_joint`, shape [unknown]."""
        return np.sqrt(np.diag(np.linalg.inv(self.information + 1e-6 * np.eye(len(self.information)))))


def changed_joint(joint: Joint, x: np.ndarray) -> Joint:
    """Return a joint after a step of its unknowns: two angles of the axis [rad], (two shifts [m],) the coordinate's change."""
    u, v = across(np.array(joint.axis))
    axis = turned(x[0] * u + x[1] * v) @ np.array(joint.axis)
    origin = np.array(joint.origin) + (x[2] * u + x[3] * v if joint.kind == "revolute" else 0.0)
    return Joint(joint.kind, tuple(axis / np.linalg.norm(axis)), tuple(origin), (0.0, joint.limits[1] + x[-1]))


def across(axis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors across an axis and each other, shape [3] each."""
    u = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    u /= np.linalg.norm(u)
    return u, np.cross(axis, u)


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
            known, error = square(joint, front)
            information[:2, :2] += known.T @ known / SQUARE**2
            gradient[:2] += known.T @ error / SQUARE**2
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
