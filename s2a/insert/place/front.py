"""The side of a piece of furniture from which people come to it."""

from __future__ import annotations

import numpy as np

from s2a.geometry.line_of_sight import visible_distance
from s2a.geometry.mesh_ops import normals
from s2a.geometry.mesh_query import ray_mesh
from s2a.insert.place.supports import nearby
from s2a.scene import Mesh, Scene
from s2a.usd.boxes import silhouette, upright_box

CLOSE, REACH = 0.1, 0.6
"""Distance over which a wall's closeness fades, and length of the rays that look for one [m]."""
INWARD = 0.15
"""Weight of the direction to the middle of the room; what a wall is close to has its back there."""
SHOWN = 2.0
"""Weight of the mean normal of its surface."""
ALONG = (-0.35, 0.0, 0.35)
"""Places of rays along a side, in widths from its middle."""
UP = (0.25, 0.5, 0.75)
"""Heights of rays, in heights."""


def front(scene: Scene, own: set[str], mesh: Mesh) -> np.ndarray:
    """Return the horizontal direction in which a thing faces, unit, shape [2].

    Of the four sides of its upright box it is the one across from what is close behind, if anything is; of several or none the
    one that looks most towards the middle of the room. A chair before a desk covers only some of the rays to that side. What a
    scan shows of a thing is its front more than its back, which nobody walked around.

    Args:
        scene: the room.
        own: ids of the parts that make up the thing.
        mesh: their surface [m].
    """
    bounds = np.array([part.mesh.bounds for part in scene.parts.values() if len(part.mesh.vertices)])
    middle = (bounds[:, 0].min(axis=0) + bounds[:, 1].max(axis=0))[:2] / 2
    box = upright_box(silhouette(mesh.vertices))
    sides = np.array([(np.cos(box.yaw + a), np.sin(box.yaw + a)) for a in np.arange(4) * np.pi / 2])
    others = [i for i in scene.parts if i not in own]
    around = nearby(scene, mesh.bounds[0] - REACH, mesh.bounds[1] + REACH, others)
    closeness = np.zeros(4)
    if len(around.faces):
        asked = ray_mesh(around.vertices, around.faces)
        for i, side in enumerate(sides):
            depth, width = (box.size[0], box.size[1]) if i % 2 == 0 else (box.size[1], box.size[0])
            across = np.array([-side[1], side[0]])
            starts = [
                [*(np.array(box.center[:2]) + 0.45 * depth * side + a * width * across), mesh.bounds[0, 2] + u * box.size[2]]
                for a in ALONG
                for u in UP
            ]
            seen, _ = visible_distance(asked, np.array(starts), np.append(side, 0.0), REACH)
            gaps = np.maximum(seen - 0.05 * depth, 0.0)
            closeness[i] = np.exp(-gaps / CLOSE).mean()
    inward = middle - np.array(box.center[:2])
    inward /= max(float(np.linalg.norm(inward)), 1e-9)
    areas = mesh.face_areas
    shown = (normals(mesh)[:, :2] * areas[:, None]).sum(axis=0) / max(float(areas.sum()), 1e-9)
    return np.asarray(sides[np.argmax(np.roll(closeness, 2) - closeness + sides @ (INWARD * inward + SHOWN * shown))])
