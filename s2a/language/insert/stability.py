"""The drop test of an inserted object: its convex hulls are released at the candidate pose, among the room's triangles."""

import itertools
from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from itertools import groupby
from typing import Annotated, Any

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.bounds import AtLeast, Count, Fraction
from s2a.language.ask import Record
from s2a.language.insert.describe import RoomState
from s2a.language.insert.drop_test import DropTestConfig, drop_test
from s2a.language.insert.fit import COLLISION, Pose, moved_into_contact, placement_conflict, reaching_into
from s2a.language.insert.poses import CandidatePose, PoseConfig
from s2a.language.insert.supports import nearby
from s2a.scene.geometry.convex import hull, one_hull
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.scene import Mesh, Scene

# (upright object, candidate pose, room) -> results with the key `problem`, empty if the object stays
StabilityCheck = Callable[[Mesh, CandidatePose, Scene], Record]
UP_HOLDS = np.radians(15.0)  # Largest tilt at which what rests still has its up [rad]
STRAYED = 0.15  # Largest way from where it was put to where it rests [m]
LIFT = 0.003  # Height from which it is put down again [m]
DOWN = np.array([0.0, 0.0, -1.0])


def stable_pose(
    room: RoomState,
    object: Mesh,
    candidates: Iterable[CandidatePose],
    check: Callable[[CandidatePose], dict[str, Any]],
    accept: Callable[[CandidatePose], str],
    config: PoseConfig,
    reasons: list[str],
) -> CandidatePose | None:
    """Return the first candidate pose at which an object stays; on each support, failing that, one in which it rests.

    Args:
        room: the room.
        object: upright, in metres.
        candidates: the candidate poses, those of one support after each other.
        check: the drop test; its results have `problem`, and `rest` where the object came to rest elsewhere.
        accept: the objection to a pose whose object stays, such as an unheeded wish; empty if there is none.
        config: of the search.
        reasons: receives why candidates were passed over, one line a support.
    """
    for _, group in groupby(candidates, key=lambda one: (one.target, one.choice, one.surface.get("height"))):
        resting: list[CandidatePose] = []
        problems: list[str] = []
        for candidate in group:
            result = check(candidate)
            problem = result["problem"] or accept(candidate)
            if not problem:
                return candidate
            problems.append(problem)
            rest = result.get("rest") if result["problem"] else None
            if rest is not None and candidate.choice.relation != "hanging":
                resting.append(at_rest(candidate, rest))
        for candidate in resting:
            again = put_down(room, object, candidate, config)
            if again is None:
                continue
            result = check(again)
            if not (result["problem"] or accept(again)):
                return again
        worst = max(problems, key=problems.count)
        count = f" at all {len(problems)} places" if len(problems) > 1 else ""
        reasons.append(f"{candidate.choice.relation} {candidate.target}: {worst}{count}")
    return None


def rests_upright(tilt: float, drift: float) -> bool:
    """Return True if an object that came to rest, tilted by some [rad] and off by some [m], is as it was meant."""
    return tilt <= UP_HOLDS and drift <= STRAYED


def at_rest(candidate: CandidatePose, rest: dict[str, Any]) -> CandidatePose:
    """Return a candidate at the pose in which its object came to rest.

    `rest`: `about`, the point [m] about which it turned; `turn`, xyzw; `shift` of that point [m].
    """
    turn, about = Rotation.from_quat(rest["turn"]), np.array(rest["about"])
    position = about + rest["shift"] + turn.apply(np.array(candidate.pose.position) - about)
    quaternion = (turn * Rotation.from_quat(candidate.pose.quaternion)).as_quat()
    pose = replace(candidate.pose, position=tuple(position.tolist()), quaternion=tuple(quaternion.tolist()))
    return replace(candidate, pose=pose)


def put_down(room: RoomState, object: Mesh, candidate: CandidatePose, config: PoseConfig) -> CandidatePose | None:
    """Return a resting candidate lifted out of what it sank into and lowered again; None if it is in conflict there."""
    lifted = candidate.pose.shifted(-LIFT * DOWN)
    low, high = lifted.moved(object).bounds + [[-0.05], [0.05]]
    local = nearby(room.scene, low, high)
    pose: Pose | None = moved_into_contact(lifted, object, local, DOWN, 4 * LIFT, config.contact_gap)
    if pose is None:
        return None
    volumes = reaching_into(room.volumes, low, high, room.scene, candidate.target)
    for _ in range(6):
        pose = pose.rounded()
        conflict = placement_conflict(room.scene, pose.moved(object), local, volumes, config.swept_volume_tolerance)
        if conflict is None:
            return replace(candidate, pose=pose)
        if conflict != COLLISION:
            return None
        pose = pose.shifted(-config.contact_gap * DOWN)
    return None


FOOT = 0.03  # The foot of an object, as a fraction of its height
SAMPLES = 4000  # Points sampled on the surface, besides the vertices
QUERY_RADIUS = 0.05  # Triangles of the room within this distance of the object take part in its drop test [m]

# Least cosine between the vertical and one of an object's axes, below which it lies on no side
ASLANT = float(np.cos(np.radians(25.0)))

# How an object lies, by its own axis that is vertical, front first, and whether that points down
LYING = (("on its back", "on its front"), ("on its side", "on its side"), ("the way up it was put", "upside down"))


@dataclass(frozen=True)
class HullsConfig:
    """Convex hulls that represent an object in its drop test."""

    min_fill_fraction: Fraction = 0.85  # volume over that of the convex hull from which one hull represents the object
    slices: Count = 6  # number of horizontal slices above the foot, one convex hull each
    max_vertices: Annotated[int, AtLeast(4)] = 4000  # largest number of vertices of a hull


def drop_check(hulls: HullsConfig, config: DropTestConfig) -> StabilityCheck:
    """Return a check that drops an object at a candidate pose and reports whether it stays there.

    The hulls of an object are made once and kept for its other candidate poses.
    """
    pieces: dict[int, tuple[Mesh, list[Mesh]]] = {}  # with the mesh, or another might get its address

    def check(object: Mesh, candidate: CandidatePose, scene: Scene) -> Record:
        if id(object) not in pieces:
            pieces[id(object)] = object, _hulls(object, hulls)
        moved = [candidate.pose.moved(piece) for piece in pieces[id(object)][1]]
        low, high = candidate.pose.moved(object).bounds
        hangs_on = -candidate.normal if candidate.choice.relation == "hanging" else None
        result = drop_test(moved, nearby(scene, low - QUERY_RADIUS, high + QUERY_RADIUS), config, hangs_on)
        unstable = np.isfinite(result.drift) and (result.tilt > config.tilt or result.drift > config.drift)
        values = {name: round(value, 5) if isinstance(value, float) else value for name, value in vars(result).items()}
        values.pop("rest")
        rest = result.rest
        if rest is not None and rests_upright(result.tilt, result.drift):
            values["rest"] = rest
        elif rest is not None and result.tilt > config.tilt:
            turned = Rotation.from_quat(rest["turn"]) * Rotation.from_quat(candidate.pose.quaternion)
            values["problem"] = f"{result.problem} and comes to rest {lying(turned)}"
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
    pieces = [hull(piece, config.max_vertices) for piece in slices if len(piece)]
    return [piece for piece in pieces if piece is not None]


def _volume(mesh: Mesh) -> float:
    """Return the volume enclosed by a surface [m^3]; an estimate if it is open."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    return abs(float(np.einsum("ij,ij->", a, np.cross(b, c)))) / 6.0
