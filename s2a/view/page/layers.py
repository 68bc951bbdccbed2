"""The layers of a page as meshes and arrows, each with the jointed part that it moves with."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from s2a.scene.articulation import open_limit, opening_sign
from s2a.scene.geometry.convex import column
from s2a.scene.geometry.mesh_ops import centroids, keep, merge, painted, vertex_normals
from s2a.scene.geometry.regions import PlaneConfig, RegionConfig, horizontal_planes
from s2a.scene.scene import Joint, Mesh
from s2a.view.page.room import Extra, PageRoom, hue

SURFACES, BY_PART, GRASPS, AXES = "surfaces", "colours by part", "grasp regions", "joint axes"
COLLIDERS, WALLS = "colliders", "colliders of walls"
SUPPORTS, REACH = "supports", "reach"
# What can be shown and hidden, by its caption
LAYERS = (SURFACES, BY_PART, COLLIDERS, WALLS, GRASPS, AXES, SUPPORTS, REACH)
LARGE = (SUPPORTS, REACH)  # Layers that repeat much of the surfaces: a file does without them
LIFT = 0.003  # [m] A region is drawn so far above the surface that it lies on, lest both flicker
MARGIN = 0.08  # [m] A hinge's axis is drawn so far beyond the ends of its part
MIN_ARROW = 0.1  # [m] An arrow is so long at least
REGION_COLOR = (255, 96, 32)
SUPPORT_COLOR = (40, 150, 220)
# Of what is within reach, and of a base from which the arm reaches along the part's whole path, or does not
REACH_COLOR, FREE_COLOR, NOT_FREE_COLOR = (250, 190, 40), (40, 160, 70), (190, 40, 40)
STILL = "room"  # Name of what moves with no joint


@dataclass(frozen=True)
class Node:
    """A mesh of a layer."""

    layer: str  # one of LAYERS
    name: str  # of the node within its layer
    mover: str | None  # id of the jointed part that it moves with, or None
    mesh: Mesh  # in scene coordinates, at the scanned pose; it has a face at least


@dataclass(frozen=True)
class Arrow:
    """The axis of a joint."""

    name: str  # id of the part that it moves
    mover: str | None  # id of the jointed part that carries it, or None
    ends: np.ndarray  # foot and tip [m], scene coordinates, shape [2 3], with the joint's carrier at its scanned pose


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


def supports(room: PageRoom) -> Iterator[Node]:
    """Yield the level surfaces of what stands still that look up: those on which `s2a insert` puts objects, occupied or not."""
    sizes = RegionConfig()
    levels = [_level(part.surface, sizes.plane, sizes.min_area) for part in room.parts.values() if part.mover is None]
    yield from _merged(SUPPORTS, [(None, painted(lifted(mesh), SUPPORT_COLOR)) for mesh in levels])


def reach(room: PageRoom) -> Iterator[Node]:
    """Yield a column where each robot stands, up to its shoulder, and all surfaces, at the scanned pose, within an arm's length.

    A surface counts if the middle of its face is no farther from a shoulder than the stretched arm; what is in between is not
    asked for.
    """
    pieces: list[tuple[str | None, Mesh]] = []
    for stand in room.stands:
        post = column(stand.position, stand.radius, float(stand.shoulder[2] - stand.position[2]))
        pieces.append((None, painted(post, FREE_COLOR if stand.free else NOT_FREE_COLOR)))
    for part in room.parts.values():
        if len(part.surface.faces):
            near = keep(part.surface, within_reach(room, centroids(part.surface)))
            pieces.append((part.mover, painted(lifted(near, 2 * LIFT), REACH_COLOR)))  # above supports
    yield from _merged(REACH, pieces)


def within_reach(room: PageRoom, points: np.ndarray) -> np.ndarray:
    """Return which points [point 3] [m] the stretched arm of any robot comes to, shape [point]."""
    near = np.zeros(len(points), bool)
    for stand in room.stands:
        near |= np.linalg.norm(points - stand.shoulder, axis=1) <= stand.reach
    return near


def _level(mesh: Mesh, planes: PlaneConfig, min_area: float) -> Mesh:
    """Return the level patches of a surface that look up and have an area [m^2]."""
    if not len(mesh.faces):
        return mesh
    patches = [plane.faces for plane in horizontal_planes(mesh, planes)]
    large = [faces for faces in patches if mesh.face_areas[faces].sum() >= min_area]
    return keep(mesh, np.concatenate([np.zeros(0, int), *large]))


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
    return Mesh(mesh.vertices + height * vertex_normals(mesh.vertices, mesh.faces), mesh.faces, mesh.colors)


def _hulls(room: PageRoom) -> Iterator[tuple[Extra, Mesh]]:
    for number, hull in enumerate(room.colliders):
        yield hull, painted(hull.mesh, hue(number))


def _merged(layer: str, pieces: list[tuple[str | None, Mesh]]) -> Iterator[Node]:
    """Yield one node for all pieces that move with the same joint."""
    groups: dict[str | None, list[Mesh]] = {}
    for mover, mesh in pieces:
        if len(mesh.faces):
            groups.setdefault(mover, []).append(mesh)
    for mover, meshes in groups.items():
        yield Node(layer, mover or STILL, mover, merge(meshes))


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
