"""A simulation-ready room -> Newton: what is active moves, all else is static, and only colliders that matter are loaded."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace
from typing import Any

import newton
import numpy as np
from pxr import Usd, UsdGeom, UsdPhysics, Vt
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.errors import InputError
from s2a.scene.articulation import displace, open_limit
from s2a.scene.geometry.convex import column, cut_free, sweep
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh
from s2a.scene.usd.joints import write_joint
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.sim_stage import open_physics
from s2a.scene.usd.stage import ROOT, read_mesh
from s2a.sim.nearby import Missing, Workspace, drop_far, static_colliders

WELDED = "frozen_"
"""Before the id of a frozen part: the prim below its carrier that takes its colliders."""


def kept_bodies(room: SimRoom, active: Sequence[str]) -> tuple[str, ...]:
    """Return the bodies of a world: the active ones and those that carry them.

    Raises:
        InputError: an active one is neither an articulated part nor a free object of the room.
    """
    for i in active:
        if i not in room.articulations and i not in room.free:
            known = ", ".join([*room.articulations, *room.free])
            raise InputError(f"{i!r} neither moves on a joint nor lies free in room {room.name!r}; possible: {known}")
    # A drawer inside of a door moves with it.
    carriers = {c for i in active if i in room.articulations for c in room.carriers(i) if c in room.fixed}
    return tuple(i for i in (*room.bodies, *room.free) if i in carriers or i in active)


def carrier_of(room: SimRoom, body: str, kept: Collection[str]) -> str | None:
    """Return the nearest kept body that carries a body; None for one that stands in the room or lies free."""
    return next((c for c in room.carriers(body) if c in kept), None) if body in room.articulations else None


def freeze(stage: Usd.Stage, room: SimRoom, kept: Collection[str]) -> None:
    """Freeze, in the session layer of a stage, all bodies that are not kept, at their scanned pose.

    What hangs on a kept body becomes part of that, anything else becomes static.
    """
    stage.SetEditTarget(stage.GetSessionLayer())
    for i in (*room.bodies, *room.free):
        prim = stage.GetPrimAtPath(f"{ROOT}/{i}")
        if prim.HasAPI(UsdPhysics.FilteredPairsAPI):  # Newton knows no frozen bodies
            pairs = UsdPhysics.FilteredPairsAPI(prim).GetFilteredPairsRel()
            pairs.SetTargets([path for path in pairs.GetTargets() if i in kept and path.name in kept])
        joint = stage.GetPrimAtPath(f"{ROOT}/joints/{i}")
        carrier = carrier_of(room, i, kept)
        if i in kept:
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


PEDESTAL = f"{ROOT}/static/colliders/pedestal_00"
"""Label of the column under a robot that does not stand on the floor."""
GAP = 0.002
"""[m] Between a pedestal and the robot's base."""
CLEARANCE = 0.003
"""[m] Between the path of an active part and what is frozen: a physics step at 1 m/s is 4 mm."""
STOPS = 9
"""Coordinates of a joint at which the path of its part is taken."""
APPROACH = 0.2
"""[m] Straight path of the gripper before the grasp."""
LOCKED = (0.0, 1e-5)
"""[m or rad] Limits of a joint that only fills a place; equal ones would be no joint."""


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
) -> Missing | None:
    """Add a room to a builder; return what of it is left out though the arm can touch it.

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
    kept = kept_bodies(room, active)
    freeze(stage, room, kept)
    for part in both_kinds:
        _add_other_kind(stage, room, part)
    still = [f"{ROOT}/static", *(f"{ROOT}/{i}" for i in (*room.bodies, *room.free) if i not in kept)]
    if not static:
        for path in still:
            if prim := stage.GetPrimAtPath(path):
                prim.SetActive(False)
    _clear_paths(stage, room, active, kept)
    missing = None
    if space is not None:
        welded = [f"{ROOT}/{carrier}/{WELDED}{i}" for carrier in kept for i in room.bodies]
        found = static_colliders(stage, [*still, *welded])
        missing = drop_far(stage, found, space, stage.GetRootLayer().realPath)
    builder.add_usd(stage, load_visual_shapes=False, **options)
    return missing


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
    return Workspace.around(np.concatenate(paths), np.concatenate(held), shoulder, spec.reach, np.concatenate(resting))


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


def _clear_paths(stage: Usd.Stage, room: SimRoom, active: Sequence[str], kept: Sequence[str]) -> None:
    """Cut static hulls of frozen bodies free of the paths of the active parts that overlap them, in the session layer.

    A filter would not do: Newton 1.8 drops filtered pairs with static shapes in silence where not all pairs of a world fit into
    MuJoCo's masks.
    """
    for part in active:
        found = room.articulations.get(part)
        others = [i for i in found.filtered if i not in kept] if found else []
        prims = static_colliders(stage, [f"{ROOT}/{i}" for i in others])
        if found and prims:
            surface = merge([collider.mesh for collider in room.bodies[part].colliders])
            cut_colliders(prims, sweep(surface, found.joint, CLEARANCE))


__all__ = ["PEDESTAL", "add_pedestal", "add_room", "open_physics", "pedestal", "workspace"]
