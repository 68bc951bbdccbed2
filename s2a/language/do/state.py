"""The room between two skills: how far parts stand open and where free objects are, and the room's file in that state."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.scene.articulation import displace, lever_arm, open_limit, pose_at, transform
from s2a.scene.scene import Joint, Mesh, Vec3
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import Articulation, Collider, Quat, SimBody, SimRoom


@dataclass(frozen=True)
class RoomChange:
    """How a room differs from its file.

    Attributes:
        joints: coordinates of articulated parts [m or rad] by id; those left out are at zero.
        objects: poses of free objects (position, quaternion xyzw; shape [7]) by id; those left out stand as in the file.
    """

    joints: dict[str, float] = field(default_factory=dict)
    objects: dict[str, tuple[float, ...]] = field(default_factory=dict)

    def with_(self, other: RoomChange) -> RoomChange:
        """Return this state where the other says nothing."""
        return RoomChange({**self.joints, **other.joints}, {**self.objects, **other.objects})

    def plain(self) -> dict[str, object]:
        """Return the state as values for JSON, to 0.1 mm."""
        objects = {i: [round(float(x), 4) for x in pose] for i, pose in self.objects.items()}
        return {"joints": {i: round(q, 4) for i, q in self.joints.items()}, "objects": objects}


def opened_by(room: SimRoom, state: RoomChange) -> dict[str, float]:
    """Return the path by which each part's grasp point stands open [m], by id; negative where it is pushed past shut."""
    found = {}
    for part, q in state.joints.items():
        joint, point = room.articulations[part].joint, np.array(room.articulations[part].grasp.point)
        found[part] = float(q * np.copysign(1.0, open_limit(joint)) * lever_arm(joint, point))
    return found


def at_state(room: SimRoom, state: RoomChange, without: Collection[str] = ()) -> SimRoom:
    """Return a room as a state leaves it: what the file calls zero is where each part stands now.

    Hulls, surfaces, grasps and joints of a part that stands open are moved with it, and what hangs on it; its joint's limits
    are shifted. Base poses stay: they are of the shut part.

    Args:
        room: as in its file.
        state: how it differs.
        without: parts that are left as they are in the file, because an episode starts with them at their coordinate.
    """
    for part in room.articulations:  # parents come before children
        q = state.joints.get(part, 0.0)
        if q != 0.0 and part not in without:
            room = _displaced(room, part, q)
    free = dict(room.free)
    for i, pose in state.objects.items():
        free[i] = replace(free[i], position=_vector(pose[:3]), orientation=_quaternion(pose[3:]))
    return replace(room, free=free)


def write(room: SimRoom, state: RoomChange, without: Collection[str], path: Path) -> None:
    """Write a room as a state leaves it, to exactly this path, its visuals beside it; see `at_state`."""
    sim_stage.write(at_state(room, state, without), path)


def _displaced(room: SimRoom, part: str, q: float) -> SimRoom:
    """Return a room with a part, and what hangs on it, moved from zero to a coordinate, which is its new zero."""
    joint = room.articulations[part].joint
    moved = [part, *(i for i in room.articulations if part in room.carriers(i))]
    bodies = {i: _moved_body(body, joint, q) if i in moved else body for i, body in room.bodies.items()}
    joints = {i: _moved_part(each, joint, q) if i in moved else each for i, each in room.articulations.items()}
    low, high = joint.limits
    own = replace(joints[part], joint=replace(joint, limits=(low - q, high - q)))
    return replace(room, bodies=bodies, articulations={**joints, part: own})


def _moved_body(body: SimBody, joint: Joint, q: float) -> SimBody:
    turn = Rotation.from_matrix(transform(joint, q)[:3, :3])
    (center,) = displace(np.array([body.mass.center], float), joint, q)
    mass = replace(
        body.mass, center=_vector(center), axes=_quaternion((turn * Rotation.from_quat(body.mass.axes)).as_quat())
    )
    colliders = tuple(Collider(c.part, _moved_mesh(c.mesh, joint, q), c.structure) for c in body.colliders)
    return replace(body, visual=_moved_mesh(body.visual, joint, q), colliders=colliders, mass=mass)


def _moved_part(part: Articulation, joint: Joint, q: float) -> Articulation:
    """Return an articulation with its axis and grasp moved."""
    own, grasp = part.joint, part.grasp
    axis = transform(joint, q)[:3, :3] @ np.array(own.axis)
    (origin,) = displace(np.array([own.origin]), joint, q)
    pose = pose_at(joint, np.array([*grasp.point, *grasp.orientation]), q)
    moved = _moved_mesh(grasp.region, joint, q)
    held = replace(grasp, point=_vector(pose[:3]), orientation=_quaternion(pose[3:]), region=moved)
    return replace(
        part, joint=replace(own, axis=_vector(axis / np.linalg.norm(axis)), origin=_vector(origin)), grasp=held
    )


def _moved_mesh(mesh: Mesh, joint: Joint, q: float) -> Mesh:
    if not len(mesh.vertices):
        return mesh
    return replace(mesh, vertices=displace(np.asarray(mesh.vertices, float), joint, q).astype(np.float32))


def _vector(values: Iterable[float]) -> Vec3:
    x, y, z = map(float, values)
    return x, y, z


def _quaternion(values: Iterable[float]) -> Quat:
    x, y, z, w = map(float, values)
    return x, y, z, w
