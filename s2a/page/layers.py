"""The layers of a page as meshes and arrows, each with the jointed part that it moves with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from s2a.articulation import open_limit, opening_sign
from s2a.geometry.mesh_ops import merge, painted
from s2a.page.light import vertex_normals
from s2a.page.palette import hue
from s2a.page.room import Extra, PageRoom
from s2a.scene import Joint, Mesh

SURFACES, BY_PART, GRASPS, AXES = "surfaces", "colours by part", "grasp regions", "joint axes"
COLLIDERS, WALLS = "colliders", "colliders of walls"
LAYERS = (SURFACES, BY_PART, COLLIDERS, WALLS, GRASPS, AXES)
"""What can be shown and hidden, by its caption."""
LIFT = 0.003
"""[m] A region is drawn so far above the surface that it lies on, lest both flicker."""
MARGIN = 0.08
"""[m] A hinge's axis is drawn so far beyond the ends of its part."""
MIN_ARROW = 0.1
"""[m] An arrow is so long at least."""
REGION_COLOR = (255, 96, 32)
STILL = "room"
"""Name of what moves with no joint."""


@dataclass(frozen=True)
class Node:
    """A mesh of a layer.

    Attributes:
        layer: one of LAYERS.
        name: of the node within its layer.
        mover: id of the jointed part that it moves with, or None.
        mesh: in scene coordinates, at the scanned pose; it has a face at least.
    """

    layer: str
    name: str
    mover: str | None
    mesh: Mesh


@dataclass(frozen=True)
class Arrow:
    """The axis of a joint.

    Attributes:
        name: id of the part that it moves.
        mover: id of the jointed part that carries it, or None.
        ends: foot and tip [m], scene coordinates, shape [2 3], with the joint's carrier at its scanned pose.
    """

    name: str
    mover: str | None
    ends: np.ndarray


def surfaces(room: PageRoom) -> Iterator[Node]:
    """Yield the surfaces as scanned, one node for all parts that move with the same joint."""
    if room.boxes:
        return
    yield from _merged(SURFACES, [(part.mover, part.surface) for part in room.parts.values()])


def colored(room: PageRoom) -> Iterator[Node]:
    """Yield the surfaces, each part in a colour of its own, one node for all that move with the same joint."""
    colors = [(part.mover, painted(part.surface, hue(i))) for i, part in enumerate(room.parts.values())]
    yield from _merged(BY_PART, colors)


def colliders(room: PageRoom) -> Iterator[Node]:
    """Yield the collision hulls, each in a colour of its own, but for the structure's, which hide the room."""
    yield from _merged(COLLIDERS, [(hull.mover, mesh) for hull, mesh in _hulls(room) if not hull.structure])


def walls(room: PageRoom) -> Iterator[Node]:
    """Yield the collision hulls of walls, floor and ceiling."""
    yield from _merged(WALLS, [(hull.mover, mesh) for hull, mesh in _hulls(room) if hull.structure])


def grasps(room: PageRoom) -> Iterator[Node]:
    """Yield the grasp regions, a little above their surface."""
    regions = [(region.mover, painted(lifted(region.mesh), REGION_COLOR)) for region in room.grasps]
    yield from _merged(GRASPS, regions)


def arrows(room: PageRoom) -> Iterator[Arrow]:
    """Yield the axes of the joints.

    A slide's arrow leads from the middle of its part as far as that opens; a hinge's runs along the part, in the direction
    about which it opens right-handed.
    """
    for part_id, joint in room.joints.items():
        moved = [room.parts[i].surface for i in room.parts if room.parts[i].mover == part_id]
        points = np.concatenate([np.zeros((0, 3)), *(mesh.vertices for mesh in moved)])
        ends = axis_arrow(joint, points if len(points) else np.array([joint.origin]))
        yield Arrow(part_id, room.carriers[part_id], ends)


def lifted(mesh: Mesh, height: float = LIFT) -> Mesh:
    """Return a mesh whose vertices are moved along their normals [m]."""
    return Mesh(mesh.vertices + height * vertex_normals(mesh), mesh.faces, mesh.colors)


def _hulls(room: PageRoom) -> Iterator[tuple[Extra, Mesh]]:
    for number, hull in enumerate(room.colliders):
        yield hull, painted(hull.mesh, hue(number))


def _merged(layer: str, pieces: list[tuple[str | None, Mesh]]) -> Iterator[Node]:
    """Yield one node for all pieces that move with the same joint."""
    groups: dict[str | None, list[Mesh]] = {}
    for mover, mesh in pieces:
        if len(mesh.faces):
            groups.setdefault(mover, []).append(mesh)
    for mover, found in groups.items():
        yield Node(layer, mover or STILL, mover, merge(found))


def axis_arrow(joint: Joint, points: np.ndarray) -> np.ndarray:
    """Return foot and tip of the arrow of a joint [m], shape [2 3]; points [point 3] are those of its part."""
    axis, middle = np.array(joint.axis), points.mean(axis=0)
    if joint.kind == "prismatic":
        way = open_limit(joint) * axis
        length = np.linalg.norm(way)
        return np.stack([middle, middle + (way if length > MIN_ARROW else opening_sign(joint) * MIN_ARROW * axis)])
    origin = np.array(joint.origin)
    along = (points - origin) @ axis
    low, high = along.min() - MARGIN, along.max() + MARGIN
    return origin + np.outer([low, high] if opening_sign(joint) > 0 else [high, low], axis)
