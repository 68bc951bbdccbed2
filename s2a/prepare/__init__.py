"""Scene -> simulation-ready scene: one part to open, everything else immovable, colliders that a hand can use."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.geometry.convex import hull
from s2a.geometry.decompose import vhacd
from s2a.geometry.surfaces import merge
from s2a.prepare.colliders import ColliderConfig, target_colliders
from s2a.prepare.decimate import DecimateConfig, decimate_room
from s2a.prepare.mass import MassConfig, box_mass, moving_mass
from s2a.prepare.pose import base_pose, find_grasp
from s2a.prepare.room import RoomConfig, room_colliders
from s2a.scene import Joint, Mesh, Scene
from s2a.usd.simready import Collider, Mass, SimBody, SimScene


@dataclass(frozen=True)
class PrepareConfig:
    """How a scene is prepared.

    Attributes:
        base_distance: horizontal distance of the robot's base from the grasp point [m] (0.55 in the paper).
        decimate: the immovable room's looks.
        colliders: the target's convex pieces.
        room: the immovable room's convex pieces.
        mass: what to assume where no mass is annotated.
    """

    base_distance: float
    decimate: DecimateConfig
    colliders: ColliderConfig
    room: RoomConfig
    mass: MassConfig


def prepare(scene: Scene, target: str, config: PrepareConfig) -> SimScene:
    """Return what a simulator needs to open one part of a room.

    The target moves with all its descendants against its carcass, whose other drawers and doors are frozen into it. A target
    without a parent moves against an empty anchor.

    Raises:
        InputError: the target is unknown, does not move, or has no surface.
    """
    joint, grasp = scene.joint(target), find_grasp(scene, target)
    moving = (target, *scene.descendants(target))
    carcass = scene.root(target)
    frozen = () if carcass == target else tuple(i for i in (carcass, *scene.descendants(carcass)) if i not in moving)
    room = tuple(i for i in scene.parts if i not in moving and i not in frozen)
    position, orientation = base_pose(scene, target, config.base_distance)
    visual = merge([scene.parts[i].mesh for i in moving])
    mass = box_mass(visual, moving_mass(scene, moving, config.mass), Rotation.from_quat(grasp.orientation).as_matrix())
    colliders = target_colliders(scene, target, config.colliders)
    swept = sweep(visual, joint)
    return SimScene(
        name=scene.name,
        carcass=_carcass(scene, target, frozen, config),
        target=SimBody(target, visual, colliders, mass),
        joint=joint,
        grasp=grasp,
        static_visual=decimate_room([scene.parts[i] for i in room], config.decimate),
        static_colliders=room_colliders(scene, room, np.array(position), np.array(grasp.point), swept, config.room),
        base_position=position,
        base_orientation=orientation,
    )


def sweep(mesh: Mesh, joint: Joint, step: float = 0.2) -> list[Mesh]:
    """Return convex pieces that cover the way of a mesh from one limit of its joint to the other.

    A turn is covered in steps of at most `step` [rad], each by the hull of its two ends.
    """
    lower, upper = joint.limits
    count = 1 if joint.kind == "prismatic" else max(1, int(np.ceil((upper - lower) / step)))
    whole = hull(mesh.vertices)
    if whole is None:
        return []
    poses = [displace(whole.vertices, joint, q) for q in np.linspace(lower, upper, count + 1)]
    covers = [hull(np.concatenate(ends)) for ends in zip(poses, poses[1:], strict=False)]
    return [cover for cover in covers if cover is not None]


def displace(points: np.ndarray, joint: Joint, coordinate: float) -> np.ndarray:
    """Return points [point 3] moved along a joint from its zero to a coordinate [m] or [rad]."""
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    if joint.kind == "prismatic":
        return points + coordinate * axis
    return Rotation.from_rotvec(coordinate * axis).apply(points - origin) + origin


def _carcass(scene: Scene, target: str, frozen: tuple[str, ...], config: PrepareConfig) -> SimBody:
    """Return the body that the target moves against: its object with all else that belongs to it, or an anchor."""
    if not frozen:
        center = scene.joint(target).origin
        return SimBody(f"{target}_anchor", merge([]), (), Mass(1.0, center, (0.01, 0.01, 0.01)))
    visual = merge([scene.parts[i].mesh for i in frozen])
    colliders = [
        Collider(i, piece)
        for i in frozen
        for piece in vhacd(scene.parts[i].mesh, config.room.part_pieces, config.room.resolution, config.room.max_vertices)
    ]
    return SimBody(frozen[0], visual, tuple(colliders), box_mass(visual, config.mass.carcass, np.eye(3)))
