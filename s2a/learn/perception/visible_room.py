"""The surfaces of a room at the scanned pose, for rays of a camera."""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import Forest, first_hits
from s2a.scene.mesh import Mesh
from s2a.scene.usd.sim_scene import SimRoom, in_scene

SAME = 1e-4
"""[m] A ray meets a triangle at the same distance in two search trees, but for rounding."""


class VisibleRoom:
    """The visuals of a room, as one surface and one a body; search trees are made once and shared."""

    def __init__(self, room: SimRoom) -> None:
        """Take a room that was read with its visuals."""
        self._surfaces = {
            body.id: Mesh(in_scene(body, body.visual), body.visual.faces)
            for body in (*room.bodies.values(), *room.free.values())
            if len(body.visual.faces)
        }
        static = Mesh(room.static_visual.vertices, room.static_visual.faces)
        self._all = Forest([merge([static, *self._surfaces.values()])])

    def surface(self, part: str) -> Mesh | None:
        """Return the surface of what moves with a part, scene coordinates [m]; None where it has none."""
        return self._surfaces.get(part)

    def hits(self, start: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """Return the distances at which rays meet the room [m], shape [ray]; inf where they do not.

        Args:
            start: where all rays begin [m], shape [3].
            directions: unit vectors, shape [ray 3].
        """
        return first_hits(self._all, np.broadcast_to(start, directions.shape), directions)

    def shows(self, part: str, start: np.ndarray, directions: np.ndarray, hits: np.ndarray) -> np.ndarray:
        """Return which rays meet a part first, shape [ray]; `hits` is what `hits` returned for them."""
        own = first_hits(Forest([self._surfaces[part]]), np.broadcast_to(start, directions.shape), directions)
        return own <= hits + SAME
