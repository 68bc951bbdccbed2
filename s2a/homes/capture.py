"""A furnished room as a scanner sees it: the scan, its colours, and the part that an annotator gives each face to."""

from __future__ import annotations

import numpy as np

from s2a.homes.annotate import AnnotationConfig, face_numbers
from s2a.homes.appearance import vertex_colors
from s2a.homes.room import Room
from s2a.homes.scanner import ScannerConfig, scan
from s2a.homes.sight import sighted, vertex_normals
from s2a.homes.solids import Surface, rotation
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh

LUMINANCE = (0.2126, 0.7152, 0.0722)
"""Weights of red, green and blue (ITU-R BT.709)."""
LIGHT = 0.3
"""Luminance from which on a surface returns enough infrared light; a pixel value of 76 of 255."""


class Capture:
    """What one scanner sees of one room.

    Attributes:
        surface: the clean room in the scene.
        room: the furnished room in the scene.
        config: the scanner.
    """

    def __init__(self, surface: Surface, room: Room, config: ScannerConfig, paint: np.random.Generator) -> None:
        self.surface, self.room, self.config, self._paint = surface, room, config, paint
        self._turn = rotation((0.0, 0.0, -room.yaw))[:3, :3]
        self._clean = surface.moved(rotation((0.0, 0.0, -room.yaw)))
        # Rays are fastest where walls are parallel to the axes.
        self._mesh = ray_mesh(self._clean.vertices, self._clean.faces)
        self._places = room.scanners[: config.poses]

    def scan(self, errors: np.random.Generator) -> Mesh:
        """Return the coloured scan, in the scene."""
        bounds = np.stack([self.surface.vertices.min(axis=0), self.surface.vertices.max(axis=0)])
        dropout = swallowed(self.surface, self.config.dark)
        arguments = (self._mesh, dropout, self.room.yaw, self._places, bounds, self.config, errors)
        vertices, faces = scan(*arguments)
        return Mesh(vertices, faces, self.colors(vertices, vertex_normals(vertices, faces)))

    def colors(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the colours [point 3] of points of the scan [point 3] with normals [point 3], in the scene."""
        seen = self._seen(points, normals)
        return vertex_colors(seen, self._clean, nearest_faces(self._mesh, seen)[0], self._paint)

    def numbers(self, mesh: Mesh, owners: np.ndarray, config: AnnotationConfig, rng: np.random.Generator) -> np.ndarray:
        """Return the part that an annotator gives each face of the scan to, shape [face].

        Args:
            mesh: the scan.
            owners: the part of each face of the clean room.
            config: the annotator's errors.
            rng: where they come from.
        """
        corners = (mesh.vertices @ self._turn.T)[mesh.faces].mean(axis=1)
        if self.config.colors == "camera":
            normals = vertex_normals(mesh.vertices, mesh.faces)[mesh.faces].mean(axis=1)
            corners = self._sighted(corners, normals)
        return face_numbers(self._mesh, owners, corners, config, rng)

    def _seen(self, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the true points, in the room's frame, that are seen at points of the scan, in the scene."""
        inside = points @ self._turn.T
        return self._sighted(inside, normals) if self.config.colors == "camera" else inside

    def _sighted(self, inside: np.ndarray, normals: np.ndarray) -> np.ndarray:
        return sighted(self._mesh, inside, normals @ self._turn.T, self._places @ self._turn.T)


def swallowed(surface: Surface, dark: float) -> np.ndarray:
    """Return the fraction of rays that each face swallows, shape [face], float32; see `ScannerConfig.dark`."""
    luminance = surface.colors @ np.array(LUMINANCE, np.float32) / 255.0
    return np.maximum(surface.dropout, dark * np.clip(1.0 - luminance / LIGHT, 0.0, 1.0)).astype(np.float32)
