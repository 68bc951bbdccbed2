"""Scene -> simulation-ready scene: one part to open, everything else immovable, colliders that a hand can use."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.articulation import lever_arm
from s2a.geometry.mesh_ops import merge
from s2a.geometry.simplify import DecimateConfig, Decimated, decimate_room
from s2a.geometry.sweep import deepest, sweep
from s2a.prepare.base_pose import BaseConfig, find_base
from s2a.prepare.colliders.cabinet import CarcassConfig, freeze, hand_corridor
from s2a.prepare.colliders.free import LooseConfig, lift_all
from s2a.prepare.colliders.room import RoomConfig, pedestal, room_colliders
from s2a.prepare.colliders.target import ColliderConfig, Handle, find_handle, target_colliders
from s2a.prepare.grasp import find_grasp
from s2a.prepare.interior import carcass_walls, drawer_box
from s2a.prepare.mass import MassConfig, box_mass, moving_mass
from s2a.prepare.target import target_joint
from s2a.ranges import NotNegative
from s2a.robot.spec import RobotSpec
from s2a.scene import Mesh, Scene
from s2a.usd.sim_scene import Collider, Grasp, SimBody, SimScene

PEDESTAL = "pedestal"
"""Id of what the robot stands on, where that is not the floor."""
CLASH = 1e-4
"""[m] Colliders of target and carcass that overlap by less touch at most."""


@dataclass(frozen=True)
class PrepareConfig:
    """How a scene is prepared.

    Attributes:
        friction: dry friction of the target's joint as a force at the grasp point [N]; holds a drawer whose annotated axis
            is not quite level.
        interior: whether a drawer gets the open box behind its front, and its furniture the back and sides, where a scan
            cannot show them.
        base: where the robot may stand.
        decimate: the immovable room's looks.
        colliders: the target's convex pieces.
        carcass: those of the furniture around it.
        room: those of the immovable room.
        mass: what the target weighs.
        loose: objects that are lifted out of the room.
    """

    friction: NotNegative
    interior: bool
    base: BaseConfig
    decimate: DecimateConfig
    colliders: ColliderConfig
    carcass: CarcassConfig
    room: RoomConfig
    mass: MassConfig
    loose: LooseConfig


def prepare(
    scene: Scene, target: str, config: PrepareConfig, free: Sequence[str] = (), spec: RobotSpec | None = None
) -> SimScene:
    """Return what a simulator needs to open one part of a room.

    The target moves with its descendants against its carcass, whose other fronts are frozen, or against an empty anchor.

    Args:
        scene: the room.
        target: id of the part to open.
        config: how.
        free: ids of objects that lie about freely instead of being one with the room.
        spec: the robot that is to open it; None: robot.DEFAULT.

    Raises:
        InputError: the target is unknown, does not move, has limits that no robot can use, or has no surface; an object
            cannot be lifted out.
    """
    spec = spec or robot.load(robot.DEFAULT)
    joint, grasp = target_joint(scene, target), find_grasp(scene, target, spec)
    moving, frozen, room = split(scene, target)
    loose = lift_all(scene, free, target, config.loose)
    room = tuple(i for i in room if not any(i in thing.members for thing in loose))
    spaces = [space for thing in loose for space in thing.space]
    body, handle = _target(scene, target, grasp, config)
    way = sweep(merge([body.visual, *(c.mesh for c in body.colliders)]), joint, config.room.clearance)
    base = find_base(scene, target, grasp, moving, way, config.base, spec)
    stand = pedestal(base.position, base.pedestal, spec.base.radius)
    looks = _on_stand(decimate_room(scene, room, config.decimate), stand)
    keep_free = [*way, *spaces]
    pieces, trimmed = room_colliders(
        scene, room, base.position, grasp.point, keep_free, config.room, spec.base.shoulder_height
    )
    pieces = (*(Collider(PEDESTAL, mesh) for mesh in stand), *(thing.support for thing in loose), *pieces)
    corridor = hand_corridor(handle, grasp, config.carcass)
    walls = carcass_walls(scene, target, frozen) if config.interior else []
    carcass = _completed(freeze(scene, target, frozen, [corridor, *spaces], config.carcass), walls)
    clash = deepest([c.mesh for c in body.colliders], [c.mesh for c in carcass.colliders], joint)
    return SimScene(
        name=scene.name,
        carcass=carcass,
        target=body,
        joint=joint,
        grasp=grasp,
        static_visual=looks.mesh,
        static_colliders=pieces[: config.room.pieces],
        base_position=base.position,
        base_orientation=base.orientation,
        friction=config.friction * lever_arm(joint, np.array(grasp.point)),
        base_reason=base.reason,
        base_free=base.free,
        robot=spec.name,
        notes=_notes(body, carcass.id, trimmed, clash, len(walls)),
        filtered=clash > CLASH,
        static_parts=looks.parts,
        static_face_part=looks.face_part,
        reductions=looks.reductions,
        free=tuple(thing.body for thing in loose),
    )


def _target(scene: Scene, target: str, grasp: Grasp, config: PrepareConfig) -> tuple[SimBody, Handle]:
    """Return the moving body, with the box behind a drawer's front where it is asked for, and its handle."""
    moving = (target, *scene.descendants(target))
    handle, others = find_handle(scene, target, Rotation.from_quat(grasp.orientation).as_matrix())
    inside = drawer_box(scene, target) if config.interior else []
    visual = merge([*(scene.parts[i].mesh for i in moving), *inside])
    colliders = target_colliders(scene, target, handle, others, config.colliders)
    colliders += tuple(Collider(target, piece) for piece in inside)
    mass, source = moving_mass(scene, moving, config.mass)
    completed = sum(len(piece.faces) for piece in inside)
    return SimBody(target, visual, colliders, box_mass(visual, mass, handle.frame, source), completed), handle


def _on_stand(looks: Decimated, stand: Sequence[Mesh]) -> Decimated:
    """Return how the room looks with what the robot stands on, if that is not the floor."""
    if not stand:
        return looks
    faces = sum(len(mesh.faces) for mesh in stand)
    face_part = np.concatenate([looks.face_part, np.full(faces, len(looks.parts), np.int32)])
    return replace(looks, mesh=merge([looks.mesh, *stand]), parts=(*looks.parts, PEDESTAL), face_part=face_part)


def _notes(body: SimBody, carcass: str, trimmed: tuple[str, ...], clash: float, walls: int) -> tuple[str, ...]:
    """Return in words what was done so that nothing is in the way of the target."""
    cut = [f"cut where {body.id} moves or the robot stands: {', '.join(trimmed)}"] if trimmed else []
    apart = f"no contact between {body.id} and {carcass}: their colliders overlap by {1000 * clash:.1f} mm on its way"
    added = [f"box behind the front of {body.id} added: it was not scanned"] if body.completed else []
    added += [f"{walls} of back and sides of {carcass} added: they were not scanned"] if walls else []
    return (*cut, *added, *([apart] if clash > CLASH else []))


def _completed(carcass: SimBody, walls: Sequence[Mesh]) -> SimBody:
    """Return a carcass with walls that were not scanned."""
    visual = merge([carcass.visual, *walls])
    colliders = (*carcass.colliders, *(Collider(carcass.id, wall) for wall in walls))
    return replace(carcass, visual=visual, colliders=colliders, completed=sum(len(wall.faces) for wall in walls))


def split(scene: Scene, target: str) -> tuple[tuple[str, ...], tuple[str, ...], tuple[str, ...]]:
    """Return the ids of what moves with the target, of the rest of its object (root first), and of the room."""
    moving = (target, *scene.descendants(target))
    root = scene.root(target)
    frozen = () if root == target else tuple(i for i in (root, *scene.descendants(root)) if i not in moving)
    return moving, frozen, tuple(i for i in scene.parts if i not in moving and i not in frozen)
