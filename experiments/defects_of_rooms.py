"""Defects of what a simulation-ready room holds, in all its copies: functions of a room and a part's id.

Their names say what they do; `CHANGES` lists them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import SimRoom

Change = Callable[[SimRoom, str], SimRoom]


def joint_of(room: SimRoom, part: str, **changes: object) -> SimRoom:
    """Return the room with another joint of a part, in all its copies."""
    found = room.articulations[part]
    return with_articulation(room, part, joint=replace(found.joint, **changes))


def with_articulation(room: SimRoom, part: str, **changes: object) -> SimRoom:
    """Return the room with a changed articulation."""
    return replace(room, articulations={**room.articulations, part: replace(room.articulations[part], **changes)})


def with_body(room: SimRoom, body: str, **changes: object) -> SimRoom:
    """Return the room with a changed body."""
    return replace(room, bodies={**room.bodies, body: replace(room.bodies[body], **changes)})


def moved(mesh: Mesh, displacement: np.ndarray) -> Mesh:
    """Return a mesh shifted by a displacement [m]."""
    return Mesh((mesh.vertices + displacement).astype(np.float32), mesh.faces, mesh.colors)


def outward(room: SimRoom, part: str) -> np.ndarray:
    """Return the direction against the gripper's approach, shape [3]."""
    return -Rotation.from_quat(room.articulations[part].grasp.orientation).apply([0.0, 0.0, 1.0])


def axis_flipped(room: SimRoom, part: str) -> SimRoom:
    return joint_of(room, part, axis=tuple(-x for x in room.articulations[part].joint.axis))


def limits_negated(room: SimRoom, part: str) -> SimRoom:
    low, high = room.articulations[part].joint.limits
    return joint_of(room, part, limits=(-high, -low))


def limits_doubled(room: SimRoom, part: str) -> SimRoom:
    low, high = room.articulations[part].joint.limits
    return joint_of(room, part, limits=(2 * low, 2 * high))


def axis_tilted(room: SimRoom, part: str) -> SimRoom:
    axis = np.array(room.articulations[part].joint.axis)
    other = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    turned = Rotation.from_rotvec(np.radians(15.0) * other / np.linalg.norm(other)).apply(axis)
    return joint_of(room, part, axis=tuple(turned))


def origin_off(room: SimRoom, part: str) -> SimRoom:
    joint = room.articulations[part].joint
    across = np.cross(joint.axis, outward(room, part))
    toward = np.array(room.articulations[part].grasp.point) - joint.origin
    across = across * np.sign(across @ toward or 1.0)
    return joint_of(room, part, origin=tuple(np.array(joint.origin) + 0.1 * across / np.linalg.norm(across)))


def wrong_kind(room: SimRoom, part: str) -> SimRoom:
    joint = room.articulations[part].joint
    if joint.kind == "prismatic":
        return with_articulation(room, part, joint=Joint("revolute", (0.0, 0.0, 1.0), joint.origin, (0.0, 1.57)))
    return with_articulation(room, part, joint=Joint("prismatic", tuple(outward(room, part)), joint.origin, (0.0, 0.4)))


def colliders_moved(
    room: SimRoom, part: str, displacement: Callable[[SimRoom, str], np.ndarray], handle: bool = False
) -> SimRoom:
    shift, body = displacement(room, part), room.bodies[part]
    hulls = [replace(c, mesh=moved(c.mesh, shift)) if c.part != part or not handle else c for c in body.colliders]
    return with_body(room, part, colliders=tuple(hulls))


def up(room: SimRoom, part: str) -> np.ndarray:
    return np.array([0.0, 0.0, 0.008])


def out(room: SimRoom, part: str) -> np.ndarray:
    return 0.008 * outward(room, part)


def along(room: SimRoom, part: str) -> np.ndarray:
    return 0.008 * Rotation.from_quat(room.articulations[part].grasp.orientation).apply([1.0, 0.0, 0.0])


def without_colliders(room: SimRoom, part: str, handle: bool) -> SimRoom:
    """Remove the handle's colliders, or all others of the part."""
    hulls = tuple(c for c in room.bodies[part].colliders if (c.part != part) != handle)
    return with_body(room, part, colliders=hulls)


def no_room(room: SimRoom, part: str) -> SimRoom:
    return replace(room, static_colliders=())


def no_cabinet(room: SimRoom, part: str) -> SimRoom:
    for body in room.carriers(part):
        room = with_body(room, body, colliders=())
    return room


def plate(room: SimRoom, part: str) -> SimRoom:
    """A collider that stands 114 mm off the scanned surface."""
    body = room.bodies[part]
    extra = replace(body.colliders[0], mesh=moved(body.colliders[0].mesh, 0.114 * outward(room, part)))
    return with_body(room, part, colliders=(*body.colliders, extra))


def visual_moved(room: SimRoom, part: str) -> SimRoom:
    return with_body(room, part, visual=moved(room.bodies[part].visual, 0.02 * outward(room, part)))


def mass_of(room: SimRoom, part: str, **changes: object) -> SimRoom:
    mass = room.bodies[part].mass
    return with_body(room, part, mass=replace(mass, **changes))


def scaled_inertia(room: SimRoom, part: str) -> SimRoom:
    return mass_of(room, part, inertia=tuple(1e4 * x for x in room.bodies[part].mass.inertia))


def based(
    room: SimRoom, part: str, turn: float = 0.0, displacement: tuple[float, float] = (0.0, 0.0), **changes: object
) -> SimRoom:
    """Move all bases of a part by a displacement before the handle and to its side [m], and turn them [rad]."""
    bases = {}
    for name, base in room.articulations[part].bases.items():
        ahead = Rotation.from_quat(base.orientation).apply([1.0, 0.0, 0.0])
        side = np.cross([0.0, 0.0, 1.0], ahead)
        place = np.array(base.position) + displacement[0] * ahead + displacement[1] * side
        facing = (Rotation.from_euler("z", turn) * Rotation.from_quat(base.orientation)).as_quat()
        bases[name] = replace(base, position=tuple(place), orientation=tuple(facing), **changes)
    return with_articulation(room, part, bases=bases)


def grasp_of(room: SimRoom, part: str, roll: float = 0.0, displacement: float = 0.0, region: bool = False) -> SimRoom:
    grasp = room.articulations[part].grasp
    turn = Rotation.from_quat(grasp.orientation) * Rotation.from_euler("z", roll)
    shift = displacement * np.array([0.0, 0.0, 1.0])
    surface = moved(grasp.region, shift) if region else grasp.region
    changed = replace(
        grasp, orientation=tuple(turn.as_quat()), point=tuple(np.array(grasp.point) + shift), region=surface
    )
    return with_articulation(room, part, grasp=changed)


CHANGES: dict[str, Change] = {
    "axis_flipped": axis_flipped,
    "limits_negated": limits_negated,
    "limits_doubled": limits_doubled,
    "axis_tilted_15_deg": axis_tilted,
    "origin_10cm_off": origin_off,
    "wrong_kind": wrong_kind,
    "colliders_8mm_up": partial(colliders_moved, displacement=up),
    "colliders_8mm_out": partial(colliders_moved, displacement=out),
    "handle_8mm_along": partial(colliders_moved, displacement=along, handle=True),
    "handle_8mm_up": partial(colliders_moved, displacement=up, handle=True),
    "no_handle_colliders": partial(without_colliders, handle=True),
    "no_front_colliders": partial(without_colliders, handle=False),
    "no_room_colliders": no_room,
    "no_cabinet_colliders": no_cabinet,
    "plate_114mm_off": plate,
    "visual_20mm_off": visual_moved,
    "mass_0": partial(mass_of, mass=0.0),
    "mass_1e4": partial(mass_of, mass=1e4),
    "mass_1g": partial(mass_of, mass=0.001),
    "inertia_1e4": scaled_inertia,
    "inertia_triangle": partial(mass_of, inertia=(0.1, 0.1, 0.5)),
    "center_5m_off": partial(mass_of, center=(5.0, 5.0, 5.0)),
    "base_100m_off": partial(based, displacement=(-100.0, 0.0)),
    "base_outside_2m_back": partial(based, displacement=(-2.0, 0.0)),
    "base_turned_round": partial(based, turn=np.pi),
    "base_in_furniture": partial(based, displacement=(0.6, 0.0)),
    "base_1m_aside": partial(based, displacement=(0.0, 1.0)),
    "base_not_free": partial(based, free=False),
    "grasp_rolled_90": partial(grasp_of, roll=np.pi / 2),
    "grasp_10cm_off": partial(grasp_of, displacement=0.1),
    "grasp_and_region_10cm_off": partial(grasp_of, displacement=0.1, region=True),
}
"""Changes of what a room holds, in all its copies."""
