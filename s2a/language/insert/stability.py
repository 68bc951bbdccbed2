"""The drop test of an inserted object: its convex hulls are released at the candidate pose, among the room's triangles."""

from __future__ import annotations

import itertools
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.bounds import AtLeast, Count, Fraction
from s2a.language.insert.context import StabilityCheck
from s2a.language.insert.drop_test import DropTestConfig, drop_test
from s2a.language.insert.place.candidate_poses import CandidatePose
from s2a.language.insert.place.supports import nearby
from s2a.language.insert.settle import rests_upright
from s2a.language.llm.ask import Record
from s2a.scene.geometry.convex import hull, one_hull
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.scene import Mesh, Scene

__all__ = ["HullsConfig", "DropTestConfig", "drop_check"]

FOOT = 0.03
"""The foot of an object, as a fraction of its height."""
SAMPLES = 4000
"""Points sampled on the surface, besides the vertices."""
QUERY_RADIUS = 0.05
"""Triangles of the room within this distance of the object take part in its drop test [m]."""

ASLANT = float(np.cos(np.radians(25.0)))
"""Least cosine between the vertical and one of an object's axes, below which it lies on no side."""

LYING = (("on its back", "on its front"), ("on its side", "on its side"), ("the way up it was put", "upside down"))
"""How an object lies, by its own axis that is vertical, front first, and whether that points down."""


@dataclass(frozen=True)
class HullsConfig:
    """Convex hulls that represent an object in its drop test.

    Attributes:
        min_fill_fraction: volume over that of the convex hull from which one hull represents the object.
        slices: number of horizontal slices above the foot, one convex hull each.
        max_vertices: largest number of vertices of a hull.
    """

    min_fill_fraction: Fraction
    slices: Count
    max_vertices: Annotated[int, AtLeast(4)]


def drop_check(hulls: HullsConfig, config: DropTestConfig) -> StabilityCheck:
    """Return a check that drops an object at a candidate pose and reports whether it stays there.

    The hulls of an object are made once and kept for its other candidate poses.
    """
    known: dict[int, tuple[Mesh, list[Mesh]]] = {}  # with the mesh, or another might get its address

    def check(object: Mesh, candidate: CandidatePose, scene: Scene) -> Record:
        if id(object) not in known:
            known[id(object)] = object, _hulls(object, hulls)
        moved = [candidate.pose.moved(piece) for piece in known[id(object)][1]]
        low, high = candidate.pose.moved(object).bounds
        hangs_on = -candidate.normal if candidate.choice.relation == "hanging" else None
        found = drop_test(moved, nearby(scene, low - QUERY_RADIUS, high + QUERY_RADIUS), config, hangs_on)
        unstable = np.isfinite(found.drift) and (found.tilt > config.tilt or found.drift > config.drift)
        values = {name: round(value, 5) if isinstance(value, float) else value for name, value in vars(found).items()}
        values.pop("rest")
        rest = found.rest
        if rest is not None and rests_upright(found.tilt, found.drift):
            values["rest"] = rest
        elif rest is not None and found.tilt > config.tilt:
            turned = Rotation.from_quat(rest["turn"]) * Rotation.from_quat(candidate.pose.quaternion)
            values["problem"] = f"{found.problem} and comes to rest {lying(turned)}"
        return {**values, "unstable": bool(unstable)}

    return check


def lying(turned: Rotation) -> str:
    """Return in words how an object lies that was upright with its front along +x and has been turned since."""
    up = turned.inv().apply([0.0, 0.0, 1.0])
    axis = int(np.abs(up).argmax())
    if abs(up[axis]) < ASLANT:
        return "aslant"
    return LYING[axis][int(up[axis] < 0)]


def _hulls(object: Mesh, config: HullsConfig) -> list[Mesh]:
    """Return the convex hulls of an upright object: one if it fills that, else its foot and horizontal slices.

    Convex decomposition took one to three seconds, and its hulls follow a surface to a voxel only, on which a bottle leans.
    Slices are exact where the object stands; they fill concavities and the space between legs.
    """
    single = one_hull(object, config.max_vertices)
    if not single or _volume(object) > config.min_fill_fraction * _volume(single[0]):
        return single
    low, high = object.bounds[:, 2].astype(np.float64)
    points = np.concatenate([object.vertices, sample(object, SAMPLES, seed=0)])
    edges = np.array([0.0, *np.linspace(FOOT, 1.0, config.slices + 1)]) * (high - low) + low
    slices = [points[(points[:, 2] >= a) & (points[:, 2] <= b)] for a, b in itertools.pairwise(edges)]
    found = [hull(piece, config.max_vertices) for piece in slices if len(piece)]
    return [piece for piece in found if piece is not None]


def _volume(mesh: Mesh) -> float:
    """Return the volume enclosed by a surface [m^3]; an estimate if it is open."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
