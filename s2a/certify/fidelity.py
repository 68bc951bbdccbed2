"""Do the colliders of a sim.usd lie where the scanned surface is, and the other way round?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2a.certify.check import Check, check_bound
from s2a.core.ranges import Fraction, Positive
from s2a.scene.geometry.mesh_ops import keep, merge, normals, sample, sample_with_faces
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import PREPARE_AGAIN, SimRoom

POINTS, ROOM_POINTS = 4000, 100_000
"""Samples of a body's surface, and of the room's, of which only the nearest are asked."""
SEEN, SEEN_HANDLE = 0.15, 0.05
"""Smallest fraction of a surface's area, by the squared cosine of its normals, that tells of a shift along a direction; of the
small surface of a handle, whose ends are scanned."""
FACING = 0.8
"""Cosine from which a hull's face stands for a scanned one: the other side of a thin sheet does not."""


@dataclass(frozen=True)
class FidelityConfig:
    """Bounds on the distance between colliders and scanned surface.

    Attributes:
        cover: a point of the surface is covered where a collider is this near [m].
        max_uncovered: fraction of a body's surface that may be uncovered.
        max_uncovered_room: the same for what is fixed around the part, whose colliders are cut for the gripper and the path.
        around: how far from the grasp point the room is asked [m].
        max_excess: how far a collider may reach from its body's surface [m].
        max_shift: how far a body's colliders may be shifted against its surface [m].
    """

    cover: Positive
    max_uncovered: Fraction
    max_uncovered_room: Fraction
    around: Positive
    max_excess: Positive
    max_shift: Positive


def scanned(room: SimRoom, body: str) -> Mesh:
    """Return the surface of a body as it was scanned, without what was added to it, in scene coordinates."""
    visual, added = room.bodies[body].visual, room.bodies[body].completed
    return keep(visual, np.arange(len(visual.faces) - added))


def collider_fidelity(room: SimRoom, part: str, config: FidelityConfig) -> list[Check]:
    """Return the checks of a part's colliders, of what carries it, and of the room around it.

    Args:
        room: with visuals.
        part: id of the articulated part.
        config: bounds.
    """
    found = []
    for body in (part, *room.carriers(part)):
        surface = scanned(room, body)
        hulls = [collider.mesh for collider in room.bodies[body].colliders]
        path = f"/scene/{body}"
        if surface.face_areas.sum() <= 1e-4:
            if body == part:
                message = "nothing of it was scanned, and so nothing vouches for its joint and colliders"
                found.append(Check("cover_part", "fail", prim=path, message=message, remedy=PREPARE_AGAIN))
            continue  # an anchor, which nobody can see
        bound = config.max_uncovered if body == part else config.max_uncovered_room
        found.append(_cover(f"cover_{'part' if body == part else 'cabinet'}", path, surface, hulls, bound, config))
        if body == part:  # what carries it has walls that nobody sees
            found.append(_excess(path, room.bodies[body].visual, hulls, config))
            found.append(_shifted("collider_shift", path, shift(surface, hulls), config))
            moved = shift(room.articulations[part].grasp.region, hulls, SEEN_HANDLE)
            found.append(_shifted("handle_shift", f"{path}/region", moved, config))
    return [*found, _room(room, part, config)]


def uncovered(points: np.ndarray, hulls: Sequence[Mesh], cover: float) -> float:
    """Return the fraction of points [point 3] that are farther than `cover` [m] from every hull and inside of none."""
    if not hulls:
        return 1.0
    whole = merge(list(hulls))
    near = nearest_faces(ray_mesh(whole.vertices, whole.faces), points, cover)[0] >= 0
    left = points[~near]
    inside = np.zeros(len(left), bool)
    for hull in hulls:
        low, high = hull.bounds
        box = ((left > low) & (left < high)).all(axis=1)
        if box.any():
            normal, corner = normals(hull), hull.vertices[hull.faces[:, 0]].astype(float)
            inside[box] |= ((left[box] @ normal.T - np.einsum("ij,ij->i", normal, corner)) < 0.0).all(axis=1)
    return float((~inside).sum() / len(points))


def excess(surface: Mesh, hulls: Sequence[Mesh]) -> tuple[float, int]:
    """Return how far the corners of hulls reach from a surface at most [m], and the index of that hull."""
    tree = ray_mesh(surface.vertices, surface.faces)
    far = [float(nearest_faces(tree, hull.vertices, 10.0)[1].max()) for hull in hulls]
    return (max(far), int(np.argmax(far))) if far else (0.0, 0)


def shift(surface: Mesh, hulls: Sequence[Mesh], seen: float = SEEN, reach: float = 0.03) -> float:
    """Return how far hulls are shifted against a surface [m], least squares over its normals.

    Point-to-plane alignment (Chen and Medioni 1992) by one translation; directions that fewer than `seen` of the surface tell of
    count as not shifted.

    Args:
        surface: as scanned.
        hulls: of the same body.
        seen: see SEEN.
        reach: points farther from every hull tell nothing [m].
    """
    if not hulls:
        return 0.0
    whole = merge(list(hulls))
    points, faces = sample_with_faces(surface, POINTS, seed=0)
    face, _ = nearest_faces(ray_mesh(whole.vertices, whole.faces), points, reach)
    near = face >= 0
    normal = normals(whole)[face[near]]
    cosine = np.einsum("ij,ij->i", normal, normals(surface)[faces[near]])
    same, opposite = cosine > FACING, cosine < -FACING
    facing = same if same.sum() >= opposite.sum() else opposite  # some scans have their faces the wrong way round
    normal, points = normal[facing], points[near][facing]
    corner = whole.vertices[whole.faces[face[near][facing], 0]].astype(float)
    along = np.einsum("ij,ij->i", corner - points, normal)
    if len(along) < POINTS // 20:
        return 0.0
    values, axes = np.linalg.eigh(normal.T @ normal / len(normal))
    told = values > seen
    moved = (axes[:, told].T @ (normal.T @ along / len(normal))) / values[told]
    return float(np.linalg.norm(moved))


def _cover(name: str, path: str, surface: Mesh, hulls: Sequence[Mesh], bound: float, config: FidelityConfig) -> Check:
    value = uncovered(sample(surface, POINTS, seed=0), hulls, config.cover)
    message = f"of the scanned surface is farther than {1000 * config.cover:.0f} mm from any of {len(hulls)} colliders"
    return check_bound(
        name, value, bound, "", prim=path, message=message, remedy="add the missing colliders; " + PREPARE_AGAIN
    )


def _excess(path: str, surface: Mesh, hulls: Sequence[Mesh], config: FidelityConfig) -> Check:
    value, which = excess(surface, hulls)
    prim = f"{path}/colliders/hull_{which:02d}" if hulls else path
    message = "from a collider's corner to the nearest scanned surface"
    remedy = "a collider stands where nothing is; " + PREPARE_AGAIN
    return check_bound("collider_excess", value, config.max_excess, "m", prim=prim, message=message, remedy=remedy)


def _shifted(name: str, path: str, value: float, config: FidelityConfig) -> Check:
    message = "between the colliders and the scanned surface"
    remedy = "put the colliders where the surface is; " + PREPARE_AGAIN
    return check_bound(name, value, config.max_shift, "m", prim=path, message=message, remedy=remedy)


def _room(room: SimRoom, part: str, config: FidelityConfig) -> Check:
    """Ask whether what is fixed around a part has colliders."""
    visual, point = room.static_visual, np.array(room.articulations[part].grasp.point)
    points = sample(visual, ROOM_POINTS, seed=0) if visual.face_areas.sum() > 1e-4 else np.zeros((0, 3))
    near = points[np.linalg.norm(points - point, axis=1) < config.around]
    hulls = [c.mesh for c in room.static_colliders]
    hulls = [
        h for h in hulls if (h.bounds[0] < point + config.around).all() and (h.bounds[1] > point - config.around).all()
    ]
    value = uncovered(near, hulls, config.cover) if len(near) else 0.0
    message = f"of the room within {config.around:g} m is farther than {1000 * config.cover:.0f} mm from any collider"
    return check_bound(
        "cover_room", value, config.max_uncovered_room, "", prim="/scene/static", message=message,
        remedy="add the missing colliders; " + PREPARE_AGAIN,
    )  # fmt: skip
