"""Fewer faces for what only has to be seen: the immovable room."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pyfqmr
from scipy.spatial import cKDTree

from s2a.geometry.surfaces import merge, weld
from s2a.scene import Mesh, Part


@dataclass(frozen=True)
class DecimateConfig:
    """How many faces of the immovable room are kept.

    Attributes:
        shell: share of the faces of walls, floor and ceiling, 0 to 1.
        other: share of the faces of everything else, 0 to 1.
        shell_labels: words that make a label one of a wall, floor or ceiling.
        aggressiveness: how fast the error bound grows from pass to pass; smaller is slower and more exact.
    """

    shell: float
    other: float
    shell_labels: tuple[str, ...]
    aggressiveness: float


def is_shell(label: str, shell_labels: tuple[str, ...]) -> bool:
    """Whether a label names a wall, the floor or the ceiling; "wall cabinet" and "floor lamp" do not."""
    words = label.lower().replace("_", " ").split()
    return bool(words) and words[-1] in shell_labels


def decimate_room(parts: list[Part], config: DecimateConfig) -> Mesh:
    """Return the parts as one mesh with fewer faces, colours carried over."""
    shell = [part.mesh for part in parts if is_shell(part.label, config.shell_labels)]
    other = [part.mesh for part in parts if not is_shell(part.label, config.shell_labels)]
    groups = ((shell, config.shell), (other, config.other))
    return merge([decimate(weld(merge(meshes)), ratio, config.aggressiveness) for meshes, ratio in groups if meshes])


def decimate(mesh: Mesh, ratio: float, aggressiveness: float) -> Mesh:
    """Return a mesh with a share of the faces, by quadric edge collapses; colours come from the nearest old vertex.

    Open borders are kept as they are where the ratio can be reached without touching them.
    """
    target = round(ratio * len(mesh.faces))
    if target >= len(mesh.faces) or len(mesh.faces) < 8:
        return mesh
    for preserve_border, effort in ((True, 1.0), (False, 1.0), (False, 2.0)):
        vertices, faces = _collapse(mesh, target, effort * aggressiveness, preserve_border)
        if len(faces) <= 1.01 * target:
            break
    return Mesh(vertices, faces, _nearest_colors(mesh, vertices))


def _collapse(mesh: Mesh, target: int, aggressiveness: float, preserve_border: bool) -> tuple[np.ndarray, np.ndarray]:
    simplify = pyfqmr.Simplify()
    simplify.setMesh(mesh.vertices.astype(np.float64), mesh.faces.copy())
    simplify.simplify_mesh(
        target_count=target, aggressiveness=aggressiveness, preserve_border=preserve_border, verbose=False
    )
    vertices, faces, _ = simplify.getMesh()
    return vertices, faces


def _nearest_colors(mesh: Mesh, vertices: np.ndarray) -> np.ndarray | None:
    if mesh.colors is None or not len(vertices):
        return None
    return mesh.colors[cKDTree(mesh.vertices).query(vertices)[1]]
