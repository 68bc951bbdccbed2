"""Fixed bodies: the furniture that articulated parts move against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.core.bounds import AtLeast, Count, Positive
from s2a.core.cache import pack, recall, unpack
from s2a.prepare.mass import annotated_mass, box_mass
from s2a.prepare.part_hulls import Handle
from s2a.prepare.room_hulls import cut_all
from s2a.prepare.target import Target
from s2a.robot.spec import GripperSpec
from s2a.scene.articulation import opening_direction
from s2a.scene.geometry.convex import box, one_hull, vhacd
from s2a.scene.geometry.front_panel import CLEARANCE, slab
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Scene
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody

BODY_MARGIN = 0.01
"""[m] On either side of the gripper's body that stays free: the arm's error, and that of a handle's axis."""


@dataclass(frozen=True)
class CabinetConfig:
    """How furniture with articulated parts becomes convex hulls.

    Attributes:
        hulls: largest number of hulls of the cabinet's own surface; each part that is fixed to it gets one more.
        thickness: of the front of a frozen drawer or door, inwards from its outer surface [m].
        resolution: voxels of the decomposition.
        max_vertices: largest number of vertices of a hull.
        density: mass by the volume of its bounding box [kg/m^3], where none is annotated; without effect on a body that is
            fixed to the world, but a simulator needs a number.
        corridor: width, height and length [m] of the gripper's path to the handle, which no hull may block: along the
            handle, across it, and outwards from where fingers end before the front. Behind the fingers it is as high as the
            gripper's body, if that is higher.
    """

    hulls: Count
    thickness: Positive
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)]
    density: Positive
    corridor: tuple[Positive, Positive, Positive]


def anchor(target: Target) -> SimBody:
    """Return the empty fixed body of an articulated part that belongs to no furniture."""
    return SimBody(f"{target.id}_anchor", merge([]), (), Mass(1.0, target.joint.origin, (0.01, 0.01, 0.01)))


def cabinet_body(
    scene: Scene, members: Sequence[str], obstacles: Sequence[Mesh], walls: Sequence[Mesh], config: CabinetConfig
) -> SimBody:
    """Return the fixed body of a piece of furniture.

    Args:
        scene: the room.
        members: ids of its parts, the object first; a joint among them is frozen.
        obstacles: convex hulls that none of its own may reach into, such as the gripper's path to a handle.
        walls: what was not scanned of it.
        config: how fine.
    """
    visual = merge([*(scene.parts[i].mesh for i in members), *walls])
    found = []
    for i in members:
        found += [Collider(i, part) for hull in _hulls(scene, i, config) for part in cut_all(hull, obstacles)]
    found += [Collider(members[0], wall) for wall in walls]
    completed = sum(len(wall.faces) for wall in walls)
    scanned = merge([scene.parts[i].mesh for i in members])
    size = np.ptp(scanned.bounds, axis=0) if len(scanned.vertices) else np.zeros(3)
    estimate = config.density * float(np.prod(np.maximum(size, 0.1)))
    mass = annotated_mass(scene, members) or estimate
    return SimBody(members[0], visual, tuple(found), box_mass(scanned, mass, np.eye(3)), completed)


def _hulls(scene: Scene, part: str, config: CabinetConfig) -> list[Mesh]:
    """Return a flat front as a slab, a cabinet as several hulls, anything else as one."""
    mesh, motion = scene.parts[part].mesh, scene.parts[part].motion
    if isinstance(motion, Joint) and len(mesh.faces):
        front = slab(mesh, opening_direction(motion, mesh.bounds.mean(axis=0)), config.thickness)
        if front is not None:
            return [front]
    if scene.parts[part].parent is None:
        fineness = (config.hulls, config.resolution, config.max_vertices)
        return unpack(recall("cabinet", [mesh, repr(fineness)], lambda: pack(vhacd(mesh, *fineness))))
    return one_hull(mesh, config.max_vertices)


def gripper_corridor(handle: Handle, target: Target, config: CabinetConfig, gripper: GripperSpec) -> list[Mesh]:
    """Return the boxes through which the gripper comes to the handle.

    The first, for its fingers, goes outwards from where they end before the front; the other, for its body, from behind them. A
    worktop that stands out less stays whole.
    """
    along, across, length = config.corridor
    end, found = handle.front - CLEARANCE, []
    behind, body = gripper.tip_ahead + gripper.body_behind, gripper.body_box[1] + 2 * BODY_MARGIN
    for high, gap in ((across, 0.0), (max(across, body), behind)):
        middle = handle.frame.T @ target.point
        middle[2] = end - (gap + length) / 2
        found.append(box(handle.frame @ middle, handle.frame, np.array([along, high, length - gap])))
    return found
