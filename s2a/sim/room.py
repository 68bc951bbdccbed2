"""A simulation-ready room -> Newton: what is active moves, all else is static, and only colliders near its path are loaded."""

from __future__ import annotations

import logging
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import newton
import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, Vt
from scipy.spatial import ConvexHull, QhullError
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.errors import InputError
from s2a.scene.articulation import displace, open_limit
from s2a.scene.geometry.convex import column, cut_free, sweep
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh
from s2a.scene.usd.joints import write_joint
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stage import ROOT, read_mesh, world_points

_log = logging.getLogger(__name__)

LEVEL = 0.05  # Rise of a floor over its width, at most
# [m] Above a resting point, from where what carries it is looked for: hulls of scans overlap by millimetres
RAISED = 0.02
BESIDE = 0.05  # [m] What is so near to the path of what moves is needed though the arm does not reach it


FLAT = 1e-9  # Slope of a face up to which it is upright


@dataclass(frozen=True)
class Workspace:
    """Where something can be touched."""

    # of the paths of all that moves, and of the space between the robot's shoulder and them [m], shape [point 3]
    points: np.ndarray
    shoulder: np.ndarray  # of the robot [m], shape [3]
    reach: float  # of its arm [m]
    # points of what is free to fall, where it stands [m], shape [point 3]
    resting: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))

    @cached_property
    def _ball(self) -> tuple[np.ndarray, float]:
        """Centre [m] and radius [m] of a ball around the points."""
        center = (self.points.min(axis=0) + self.points.max(axis=0)) / 2.0
        return center, float(np.linalg.norm(self.points - center, axis=1).max())

    def may_need(self, planes: np.ndarray) -> bool:
        """Return False only where no point is as near to a hull, of planes [plane 4], as what a world may need."""
        center, radius = self._ball
        return _distance(center[None], planes) - radius <= BESIDE

    def planned_along(self, points: np.ndarray, resting: np.ndarray) -> Workspace:
        """Return it with the points [point 3] that a plan passes, and those of what it puts somewhere [point 3]."""
        return replace(
            self, points=np.concatenate([self.points, points]), resting=np.concatenate([self.resting, resting])
        )


def drop_far(stage: Usd.Stage, colliders: Sequence[Usd.Prim], space: Workspace, room: str) -> None:
    """Deactivate, in the stage's edit target, all colliders but the ground, those in the arm's reach and those beside a path.

    The ground is what carries anything that is free to fall, and every level structure below the robot's shoulder: without
    it what falls would fall forever. However many are needed are loaded; 60 cost 7 % of a step where nothing touches them.

    `colliders`: those of the static room and of frozen bodies; `space`: where something can be touched.
    """
    planes = [_planes(prim) for prim in colliders]
    ground = _carrying(space.resting, planes)
    loaded = 0
    for prim, hull, carries in zip(colliders, planes, ground.tolist(), strict=True):
        reached = _distance(space.shoulder[None], hull) <= space.reach
        beside = space.may_need(hull) and _distance(space.points, hull) <= BESIDE
        structure = bool(prim.GetAttribute("s2a:structure").Get())
        if reached or beside or carries or (structure and _is_floor(world_points(prim), space)):
            loaded += 1
        else:
            prim.SetActive(False)
    _log.info("%s: %d of %d static colliders are loaded", room, loaded, len(colliders))


def static_colliders(stage: Usd.Stage, roots: Sequence[str]) -> list[Usd.Prim]:
    """Return the active colliders below some prims."""
    prims = (prim for root in roots if (top := stage.GetPrimAtPath(root)) for prim in Usd.PrimRange(top))
    return [prim for prim in prims if prim.HasAPI(UsdPhysics.CollisionAPI)]


def _planes(prim: Usd.Prim) -> np.ndarray:
    """Return the planes of a collider's hull, outside where n.x + d > 0, shape [plane 4]; of its bounding box if it is flat."""
    points = world_points(prim)
    try:
        return ConvexHull(points).equations
    except (QhullError, ValueError):
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        return np.concatenate([np.c_[np.eye(3), -high], np.c_[-np.eye(3), low]])


def _distance(points: np.ndarray, planes: np.ndarray) -> float:
    """Return how far the nearest of some points [point 3] is from a hull [m], at least; 0 if one is inside."""
    return max(0.0, float((points @ planes[:, :3].T + planes[:, 3]).max(axis=1).min()))


def _carrying(points: np.ndarray, planes: Sequence[np.ndarray]) -> np.ndarray:
    """Return which hulls are the first below any of some points [point 3], shape [hull]."""
    carrying = np.zeros(len(planes), bool)
    if len(points) and len(planes):
        fall = np.stack([_fall(points + [0.0, 0.0, RAISED], p) for p in planes], axis=1)
        first = fall.argmin(axis=1)
        carrying[first[np.isfinite(fall.min(axis=1))]] = True
    return carrying


def _fall(points: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return how far points [point 3] are above a hull [m], shape [point]; 0 within it, inf where they would miss it."""
    value, slope = points @ planes[:, :3].T + planes[:, 3], planes[:, 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        at = value / slope
    enter = np.where(slope > FLAT, at, -np.inf).max(axis=1)
    leave = np.where(slope < -FLAT, at, np.inf).min(axis=1)
    beside = ((np.abs(slope) <= FLAT) & (value > 0.0)).any(axis=1)
    return np.where(beside | (enter > leave) | (leave < 0.0), np.inf, np.maximum(enter, 0.0))


def _is_floor(points: np.ndarray, space: Workspace) -> bool:
    """Return whether the points [point 3] of a structure's hull are of a level one below the shoulder."""
    size = np.ptp(points, axis=0)
    thickness = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)[2][2]
    level = np.abs(thickness[2]) >= 1.0 / np.hypot(1.0, LEVEL) and size[2] < size[:2].min()
    return bool(level and points[:, 2].max() < space.shoulder[2])


WELDED = "frozen_"  # Before the id of a frozen part: the prim below its carrier that takes its colliders


def kept_bodies(room: SimRoom, active: Sequence[str]) -> tuple[str, ...]:
    """Return the bodies of a world: the active ones and those that carry them.

    Raises:
        InputError: an active one is neither an articulated part nor a free object of the room.
    """
    for i in active:
        if i not in room.articulations and i not in room.free:
            possible = ", ".join([*room.articulations, *room.free])
            raise InputError(
                f"{i!r} neither moves on a joint nor lies free in room {room.name!r}; possible: {possible}"
            )
    # A drawer inside of a door moves with it.
    carriers = {c for i in active if i in room.articulations for c in room.carriers(i) if c in room.fixed}
    return tuple(i for i in (*room.bodies, *room.free) if i in carriers or i in active)


def carrier_of(room: SimRoom, body: str, bodies: Collection[str]) -> str | None:
    """Return the nearest kept body that carries a body; None for one that stands in the room or lies free."""
    return next((c for c in room.carriers(body) if c in bodies), None) if body in room.articulations else None


def freeze(stage: Usd.Stage, room: SimRoom, bodies: Collection[str]) -> None:
    """Freeze, in the session layer of a stage, all bodies that are not kept, at their scanned pose.

    What hangs on a kept body becomes part of that, anything else becomes static.
    """
    stage.SetEditTarget(stage.GetSessionLayer())
    for i in (*room.bodies, *room.free):
        prim = stage.GetPrimAtPath(f"{ROOT}/{i}")
        if prim.HasAPI(UsdPhysics.FilteredPairsAPI):  # Newton knows no frozen bodies
            pairs = UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel()
            pairs.SetTargets([path for path in pairs.GetTargets() if i in bodies and path.name in bodies])
        joint = stage.GetPrimAtPath(f"{ROOT}/joints/{i}")
        carrier = carrier_of(room, i, bodies)
        if i in bodies:
            if carrier is not None:  # of a drawer inside of a frozen door: the cabinet that this one hangs on
                UsdPhysics.Joint(joint).GetBody0Rel().SetTargets([f"{ROOT}/{carrier}"])
            continue
        if joint:
            joint.SetActive(False)
        if carrier is None:
            for api in (UsdPhysics.RigidBodyAPI, UsdPhysics.ArticulationRootAPI, UsdPhysics.MassAPI):
                prim.RemoveAPI(api)
        else:
            welded = UsdGeom.Xform.Define(stage, f"{ROOT}/{carrier}/{WELDED}{i}").GetPrim()
            welded.GetReferences().AddInternalReference(f"{ROOT}/{i}/colliders")
            prim.SetActive(False)


def cut_colliders(prims: Sequence[Usd.Prim], obstacles: Sequence[Mesh]) -> None:
    """Cut colliders free of obstacles in the edit target of their stage; deactivate those of which nothing is left."""
    for prim in prims:
        whole = read_mesh(prim)
        left: Mesh | None = whole
        for obstacle in obstacles:
            left = None if left is None else next(iter(cut_free(left, obstacle)), None)
        if left is None:
            prim.SetActive(False)
        elif left is not whole:
            mesh = UsdGeom.Mesh(prim)
            mesh.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(left.vertices))
            mesh.GetFaceVertexCountsAttr().Set(Vt.IntArray(len(left.faces), 3))
            mesh.GetFaceVertexIndicesAttr().Set(Vt.IntArray.FromNumpy(left.faces.ravel()))


def owner(label: str) -> str:
    """Return the body that a collider belonged to before it was frozen, from the path of its prim."""
    names = label.split("/")  # "", "scene", body, "colliders" or WELDED + part, hull
    return names[3].removeprefix(WELDED) if len(names) > 3 and names[3].startswith(WELDED) else names[2]


PEDESTAL = f"{ROOT}/static/colliders/pedestal_00"  # Label of the column under a robot that does not stand on the floor
GAP = 0.002  # [m] Between a pedestal and the robot's base
CLEARANCE = 0.003  # [m] Between the path of an active part and what is frozen: a physics step at 1 m/s is 4 mm
STOPS = 9  # Coordinates of a joint at which the path of its part is taken
APPROACH = 0.2  # [m] Straight path of the gripper before the grasp
LOCKED = (0.0, 1e-5)  # [m or rad] Limits of a joint that only fills a place; equal ones would be no joint


def add_room(
    builder: newton.ModelBuilder,
    room: SimRoom,
    stage: Usd.Stage,
    active: Sequence[str],
    *,
    space: Workspace | None = None,
    static: bool = True,
    both_kinds: Sequence[str] = (),
    **options: Any,
) -> None:
    """Add a room to a builder.

    Args:
        builder: gets it.
        room: the room.
        stage: the same, opened by `open_physics`; its session layer is changed.
        active: ids of the articulated parts and free objects that move.
        space: of the colliders, only those near this are loaded; None: all.
        static: Load what does not move, besides the furniture that active parts hang on.
        both_kinds: articulated parts that get a slide and a hinge, in this order; that which is not theirs is locked.
        options: of `ModelBuilder.add_usd`.
    """
    bodies = kept_bodies(room, active)
    freeze(stage, room, bodies)
    for part in both_kinds:
        _add_other_kind(stage, room, part)
    still = [f"{ROOT}/static", *(f"{ROOT}/{i}" for i in (*room.bodies, *room.free) if i not in bodies)]
    if not static:
        for path in still:
            if prim := stage.GetPrimAtPath(path):
                prim.SetActive(False)
    _clear_paths(stage, room, active, bodies)
    if space is not None:
        welded = [f"{ROOT}/{carrier}/{WELDED}{i}" for carrier in bodies for i in room.bodies]
        colliders = static_colliders(stage, [*still, *welded])
        drop_far(stage, colliders, space, stage.GetRootLayer().realPath)
    builder.add_usd(stage, load_visual_shapes=False, **options)


def workspace(room: SimRoom, active: Sequence[str], base: np.ndarray, robot_name: str) -> Workspace:
    """Return where a robot at a base pose (7-vector) and the active bodies of a room can touch something."""
    paths, held, resting = [], [], [np.zeros((0, 3))]
    for i in active:
        body = (room.bodies | room.free)[i]
        points = np.concatenate([c.mesh.vertices.astype(np.float64) for c in body.colliders] or [np.zeros((0, 3))])
        points = Rotation.from_quat(body.orientation).apply(points) + body.position if len(points) else points
        if i not in room.articulations:
            paths.append(points)
            resting.append(points)
            held.append(np.array([body.position]))
            continue
        joint, grasp = room.articulations[i].joint, room.articulations[i].grasp
        back = Rotation.from_quat(grasp.orientation).as_matrix()[:, 2] * APPROACH
        for q in np.linspace(0.0, open_limit(joint), STOPS):
            paths.append(displace(points, joint, q))
            held.append(displace(np.array([grasp.point, grasp.point - back]), joint, q))
    spec = robot.load(robot_name).base
    shoulder = base[:3] + [0.0, 0.0, spec.shoulder_height]
    # The arm leads the grasp points while the surfaces move.
    arm = shoulder + np.linspace(0.0, 1.0, 7)[:, None, None] * (np.concatenate(held) - shoulder)
    points = np.concatenate([*paths, arm.reshape(-1, 3)])
    return Workspace(points, shoulder, spec.reach, resting=np.concatenate(resting))


def pedestal(base: np.ndarray, height: float, radius: float) -> Mesh | None:
    """Return the upright column under a base pose (7-vector), just not touching it; None on the floor."""
    return column(base[:3] - [0.0, 0.0, height], radius, height - GAP) if height > GAP else None


def add_pedestal(builder: newton.ModelBuilder, mesh: Mesh, *, collides: bool = True) -> None:
    """Add what the robot stands on as a static convex hull."""
    hull = newton.Mesh(mesh.vertices, mesh.faces.ravel(), compute_inertia=False)
    shape = builder.default_shape_cfg.copy()
    shape.has_shape_collision = collides
    builder.add_shape_convex_hull(-1, mesh=hull, cfg=shape, label=PEDESTAL)


def _add_other_kind(stage: Usd.Stage, room: SimRoom, part: str) -> None:
    """Add a locked joint of the other kind to a part, in the session layer. Newton makes one joint with two axes of both."""
    joint, prim = room.articulations[part].joint, stage.GetPrimAtPath(f"{ROOT}/joints/{part}")
    parent, child = (
        str(body.GetTargets()[0])
        for body in (UsdPhysics.Joint(prim).GetBody0Rel(), UsdPhysics.Joint(prim).GetBody1Rel())
    )
    locked = replace(joint, kind="revolute" if joint.kind == "prismatic" else "prismatic", limits=LOCKED)
    write_joint(stage, f"{prim.GetPath()}_locked", locked, parent, child)


def _clear_paths(stage: Usd.Stage, room: SimRoom, active: Sequence[str], bodies: Sequence[str]) -> None:
    """Cut static hulls of frozen bodies free of the paths of the active parts that overlap them, in the session layer.

    A filter would not do: Newton 1.8 drops filtered pairs with static shapes in silence where not all pairs of a world fit into
    MuJoCo's masks.
    """
    for part in active:
        moving = room.articulations.get(part)
        others = [i for i in moving.filtered if i not in bodies] if moving else []
        prims = static_colliders(stage, [f"{ROOT}/{i}" for i in others])
        if moving and prims:
            surface = merge([collider.mesh for collider in room.bodies[part].colliders])
            cut_colliders(prims, sweep(surface, moving.joint, CLEARANCE))
