"""The side of a piece of furniture from which people come to it."""

from __future__ import annotations

import numpy as np

from s2a.language.insert.place.supports import middle_of, nearby, target_mesh
from s2a.scene.geometry.line_of_sight import visible_distance
from s2a.scene.geometry.mesh_ops import normals
from s2a.scene.geometry.mesh_query import ray_mesh
from s2a.scene.scene import Joint, Mesh, Scene
from s2a.scene.usd.boxes import Box, silhouette, upright_box

OPENS, HIGH, BACKED, LONG, SHOWN, INWARD = 1.5, 1.0, 1.0, 0.5, 2.0, 0.15
"""Weights of what tells the front: what opens there, what is high behind, a wall behind, a long side, the surface, the middle of
the room."""
ELONGATED = 2.0
"""What is longer than this many widths is used from a long side: counters and desks, and not toilets."""
TOP = 0.75
"""What is above this fraction of the height is high."""
CLOSE, REACH = 0.1, 0.6
"""Distance over which a wall's closeness fades, and length of the rays that look for one [m]."""
ALONG, UP = (-0.35, 0.0, 0.35), (0.25, 0.5, 0.75)
"""Places of these rays along a side, in widths from its middle, and their heights, in heights."""


def front(scene: Scene, part_id: str) -> np.ndarray:
    """Return the horizontal direction in which a thing faces, unit, shape [2]: of the four of its upright box the likeliest.

    Drawers and doors are in front. Sofas, chairs, beds and toilets are highest behind. Furniture has its back to a wall that is
    close; a chair before a desk covers only some of the rays to that side. What is long is used from a long side. A scan shows a
    front more than a back, which nobody walked around. Where nothing else tells, it looks towards the middle of the room.

    Args:
        scene: the room.
        part_id: the thing; its descendants belong to it.
    """
    own = [part_id, *scene.descendants(part_id)]
    mesh = target_mesh(scene, part_id)
    box = upright_box(silhouette(mesh.vertices))
    sides = np.array([(np.cos(box.yaw + a), np.sin(box.yaw + a)) for a in np.arange(4) * np.pi / 2])
    closeness = _closeness(scene, own, mesh, box, sides)
    inward = middle_of(scene)[:2] - box.center[:2]
    inward /= max(float(np.linalg.norm(inward)), 1e-9)
    shown = (normals(mesh)[:, :2] * mesh.face_areas[:, None]).sum(axis=0) / max(float(mesh.face_areas.sum()), 1e-9)
    places = _normalised(mesh.vertices, box, sides)
    low, high = mesh.bounds[:, 2]
    top = np.quantile(places[mesh.vertices[:, 2] > low + TOP * (high - low)], (0.05, 0.95), axis=0).mean(axis=0)
    score = BACKED * (np.roll(closeness, 2) - closeness) + sides @ (INWARD * inward + SHOWN * shown)
    if max(box.size[:2]) > ELONGATED * min(box.size[:2]):
        score[[0, 2] if box.size[0] < box.size[1] else [1, 3]] += LONG
    score += OPENS * _opening(scene, own, box, sides) - HIGH * np.array([*top, *-top])
    return np.asarray(sides[np.argmax(score)])


def _normalised(points: np.ndarray, box: Box, sides: np.ndarray) -> np.ndarray:
    """Return horizontal places in a box, -1 to 1 along its two axes, shape [point 2]."""
    half = np.maximum(np.array(box.size[:2]) / 2, 1e-6)
    return np.asarray((points[:, :2] - box.center[:2]) @ sides[:2].T / half)


def _opening(scene: Scene, own: list[str], box: Box, sides: np.ndarray) -> np.ndarray:
    """Return for each side how much of what opens is there or slides there, -1 to 1, shape [4]."""
    found = []
    for part in (scene.parts[i] for i in own):
        if not isinstance(part.motion, Joint) or not len(part.mesh.vertices):
            continue
        if part.motion.kind == "prismatic":
            way = 1.0 if sum(part.motion.limits) >= 0.0 else -1.0
            found.append(way * sides[:2] @ np.array(part.motion.axis)[:2])
        else:
            places = _normalised(part.mesh.vertices, box, sides)
            found.append((places.min(axis=0) + places.max(axis=0)) / 2)
    along = np.mean(found, axis=0) if found else np.zeros(2)
    return np.array([*along, *-along])


def _closeness(scene: Scene, own: list[str], mesh: Mesh, box: Box, sides: np.ndarray) -> np.ndarray:
    """Return for each side how close other things are there, 1 where they touch, shape [4]."""
    others = [i for i in scene.parts if i not in own]
    around = nearby(scene, mesh.bounds[0] - REACH, mesh.bounds[1] + REACH, others)
    closeness = np.zeros(4)
    if not len(around.faces):
        return closeness
    asked, low = ray_mesh(around.vertices, around.faces), float(mesh.bounds[0, 2])
    for i, side in enumerate(sides):
        depth, width = box.size[i % 2], box.size[1 - i % 2]
        across = np.array([-side[1], side[0]])
        level = np.array(box.center[:2]) + 0.45 * depth * side
        starts = [[*(level + a * width * across), low + u * box.size[2]] for a in ALONG for u in UP]
        seen, _ = visible_distance(asked, np.array(starts), np.append(side, 0.0), REACH)
        closeness[i] = np.exp(-np.maximum(seen - 0.05 * depth, 0.0) / CLOSE).mean()
    return closeness
