"""A simulation-ready room -> Newton: what is active moves, all else is static, and only colliders that matter are loaded."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import newton
import numpy as np
from pxr import Usd
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.articulation import displace, open_limit
from s2a.geometry.convex import column
from s2a.scene import Mesh
from s2a.sim.freezing import WELDED, freeze, kept_bodies, owner
from s2a.sim.nearby import Workspace, drop_far, static_colliders
from s2a.usd.sim_scene import SimRoom
from s2a.usd.sim_stage import open_physics
from s2a.usd.stage import ROOT

PEDESTAL = f"{ROOT}/static/colliders/pedestal_00"
"""Label of the column under a robot that does not stand on the floor."""
GAP = 0.002
"""[m] Between a pedestal and the robot's base."""
OVERLAPPING = -2
"""Collision group of what must not collide with each other, but with all else."""
STOPS = 9
"""Coordinates of a joint at which the path of its part is taken."""
APPROACH = 0.2
"""[m] Straight path of the gripper before the grasp."""


def add_room(
    builder: newton.ModelBuilder,
    room: SimRoom,
    stage: Usd.Stage,
    active: Sequence[str],
    *,
    space: Workspace | None = None,
    static: bool = True,
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
        options: of `ModelBuilder.add_usd`.
    """
    kept = kept_bodies(room, active)
    freeze(stage, room, kept)
    still = [f"{ROOT}/static", *(f"{ROOT}/{i}" for i in (*room.bodies, *room.free) if i not in kept)]
    if not static:
        for path in still:
            if prim := stage.GetPrimAtPath(path):
                prim.SetActive(False)
    if space is not None:
        welded = [f"{ROOT}/{carrier}/{WELDED}{i}" for carrier in kept for i in room.bodies]
        drop_far(stage, static_colliders(stage, [*still, *welded]), space, stage.GetRootLayer().realPath)
    first = builder.shape_count
    builder.add_usd(stage, load_visual_shapes=False, **options)
    _filter(builder, room, active, first)


def workspace(room: SimRoom, active: Sequence[str], base: np.ndarray, robot_name: str) -> Workspace:
    """Return where a robot at a base pose (7-vector) and the active bodies of a room can touch something."""
    paths, held = [], []
    for i in active:
        body = (room.bodies | room.free)[i]
        points = np.concatenate([c.mesh.vertices.astype(np.float64) for c in body.colliders] or [np.zeros((0, 3))])
        points = Rotation.from_quat(body.orientation).apply(points) + body.position if len(points) else points
        if i not in room.articulations:
            paths.append(points)
            held.append(np.array([body.position]))
            continue
        joint, grasp = room.articulations[i].joint, room.articulations[i].grasp
        back = Rotation.from_quat(grasp.orientation).as_matrix()[:, 2] * APPROACH
        for q in np.linspace(0.0, open_limit(joint), STOPS):
            paths.append(displace(points, joint, q))
            held.append(displace(np.array([grasp.point, grasp.point - back]), joint, q))
    spec = robot.load(robot_name).base
    shoulder = base[:3] + [0.0, 0.0, spec.shoulder_height]
    return Workspace.around(np.concatenate(paths), np.concatenate(held), shoulder, spec.reach)


def pedestal(base: np.ndarray, height: float, radius: float) -> Mesh | None:
    """Return the upright column under a base pose (7-vector), just not touching it; None on the floor."""
    return column(base[:3] - [0.0, 0.0, height], radius, height - GAP) if height > GAP else None


def add_pedestal(builder: newton.ModelBuilder, mesh: Mesh, *, collides: bool = True) -> None:
    """Add what the robot stands on as a static convex hull."""
    hull = newton.Mesh(mesh.vertices, mesh.faces.ravel(), compute_inertia=False)
    shape = builder.default_shape_cfg.copy()
    shape.has_shape_collision = collides
    builder.add_shape_convex_hull(-1, mesh=hull, cfg=shape, label=PEDESTAL)


def _filter(builder: newton.ModelBuilder, room: SimRoom, active: Sequence[str], first: int) -> None:
    """Switch off contacts between active parts and the bodies that they overlap on their paths, from a shape index on.

    By a collision group: the file's pairs are of bodies, which frozen ones are no longer, and filtered pairs with static shapes
    are dropped in silence where Newton 1.8 cannot express all of a world's pairs as MuJoCo's masks.
    """
    parts = [part for part in active if part in room.articulations and room.articulations[part].filtered]
    overlapping = {*parts, *(other for part in parts for other in room.articulations[part].filtered)}
    for shape in range(first, builder.shape_count):
        if owner(builder.shape_label[shape]) in overlapping:
            builder.shape_collision_group[shape] = OVERLAPPING


__all__ = ["PEDESTAL", "add_pedestal", "add_room", "open_physics", "pedestal", "workspace"]
