"""The body that the target moves against: its piece of furniture, with all other drawers and doors shut for good."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from s2a.cache import pack, recall, unpack
from s2a.geometry.convex import box
from s2a.geometry.decompose import one_hull, vhacd
from s2a.geometry.handles.finger_gap import CLEARANCE
from s2a.geometry.handles.panel import slab
from s2a.geometry.mesh_ops import merge
from s2a.prepare.colliders.room import cut_all
from s2a.prepare.colliders.target import Handle
from s2a.prepare.grasp import opening_direction
from s2a.prepare.mass import box_mass
from s2a.ranges import AtLeast, Count, Positive
from s2a.scene import Joint, Mesh, Scene
from s2a.usd.sim_scene import Collider, Grasp, Mass, SimBody


@dataclass(frozen=True)
class CarcassConfig:
    """How the furniture around the target becomes convex pieces.

    Attributes:
        pieces: largest number of pieces of the carcass's own surface; each frozen part gets one more.
        thickness: of a frozen front, inwards from its outer surface [m].
        resolution: voxels of the decomposition.
        max_vertices: largest number of vertices of a piece.
        mass: [kg]; without effect on a body that is fixed to the world, but a simulator needs a number.
        corridor: width, height and length [m] of the hand's way to the handle, which no piece may block: along the
            handle, across it, and outwards from where fingers end before the front.
    """

    pieces: Count
    thickness: Positive
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)]
    mass: Positive
    corridor: tuple[Positive, Positive, Positive]


def freeze(scene: Scene, target: str, frozen: Sequence[str], spaces: Sequence[Mesh], config: CarcassConfig) -> SimBody:
    """Return the immovable body of the target's furniture, or an empty anchor where it belongs to none.

    Args:
        scene: the room.
        target: the part that moves.
        frozen: ids of all other parts of its object, the object first.
        spaces: convex pieces into which nothing may reach, such as the hand's way to the handle.
        config: how fine.
    """
    if not frozen:
        return SimBody(f"{target}_anchor", merge([]), (), Mass(1.0, scene.joint(target).origin, (0.01, 0.01, 0.01)))
    visual = merge([scene.parts[i].mesh for i in frozen])
    found = []
    for i in frozen:
        free = [cut_all(piece, spaces) for piece in _pieces(scene, i, config)]
        found += [Collider(i, piece) for piece in free if piece is not None]
    return SimBody(frozen[0], visual, tuple(found), box_mass(visual, config.mass, np.eye(3)))


def _pieces(scene: Scene, part: str, config: CarcassConfig) -> list[Mesh]:
    """Return a flat front as a slab, a carcass as several hulls, anything else as one."""
    mesh, motion = scene.parts[part].mesh, scene.parts[part].motion
    if isinstance(motion, Joint) and len(mesh.faces):
        front = slab(mesh, opening_direction(motion, mesh.bounds.mean(axis=0)), config.thickness)
        if front is not None:
            return [front]
    if scene.parts[part].parent is None:
        fineness = (config.pieces, config.resolution, config.max_vertices)
        return unpack(recall("carcass", [mesh, repr(fineness)], lambda: pack(vhacd(mesh, *fineness))))
    return one_hull(mesh, config.max_vertices)


def hand_corridor(handle: Handle, grasp: Grasp, config: CarcassConfig) -> Mesh:
    """Return the box through which the hand comes to the handle: outwards from where its fingers end before the front."""
    along = handle.frame.T @ np.array(grasp.point)
    along[2] = handle.front - CLEARANCE - config.corridor[2] / 2
    return box(handle.frame @ along, handle.frame, np.array(config.corridor))
