"""The free range of a joint: the swept path of a part against every other surface of the scan."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.articulation import displace, open_limit
from s2a.scene.geometry.mesh_ops import merge, normals, sample
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh, visible_distance
from s2a.scene.scene import Mesh, Scene

POINTS = 600
"""Points of a part whose paths are followed."""
STEPS = 24
"""Straight sections of each path: 4 degrees of a quarter turn."""
CONTACT = 0.03
"""[m] Length of path on which touching the rest tells nothing: ragged borders, seals, and the gap around a part."""
GRAZING = 0.5
"""Sine of 30 degrees: what meets a face at less slides along its surface; axes are off by a few degrees, faces by 20."""


@dataclass(frozen=True)
class Sweep:
    """How far a part gets.

    Attributes:
        blocked: fraction of its points whose path to the open limit runs through the rest of the scan.
        free: coordinate up to which no more than the tolerated fraction of points is blocked [m] or [rad], not negative.
        full: coordinate of the open limit, not negative.
        obstacles: ids of the parts in the way and the fraction of the points that each of them stops, largest first.
    """

    blocked: float
    free: float
    full: float
    obstacles: tuple[tuple[str, float], ...]


def moved_parts(scene: Scene, part: str) -> set[str]:
    """Return the ids of all that moves with a part: its body, and what is jointed to it."""
    return {part, *scene.descendants(part)}


def sweep(surface: ScanSurface, part: str, tolerated: float) -> Sweep:
    """Follow the points of a part from the scanned pose to its open limit through the rest of the scan.

    Args:
        surface: the room.
        part: id of a jointed part.
        tolerated: fraction of points that may be blocked: noise and ragged borders.
    """
    scene, joint = surface.scene, surface.scene.joint(part)
    mine = moved_parts(scene, part)
    own = merge([Mesh(m.vertices, m.faces) for m in (scene.parts[i].mesh for i in sorted(mine))])
    points, limit = sample(own, POINTS, 0), open_limit(joint)
    if not len(points):
        return Sweep(0.0, abs(limit), abs(limit), ())
    paths = np.stack([displace(points, joint, q) for q in np.linspace(0.0, limit, STEPS + 1)])
    rest = np.flatnonzero(np.array([i not in mine for i in surface.ids])[surface.owner] & _near(surface.mesh, paths))
    if not len(rest):
        return Sweep(0.0, abs(limit), abs(limit), ())
    tree = ray_mesh(surface.mesh.vertices, surface.mesh.faces[rest])
    facing = normals(Mesh(surface.mesh.vertices, surface.mesh.faces[rest]))
    stopped, places = _stops(tree, facing, paths)
    shares = [(stopped <= step).mean() for step in range(STEPS)]
    free = next((step for step, share in enumerate(shares) if share > tolerated), STEPS)
    hit = stopped < STEPS
    face = nearest_faces(tree, places[hit])[0] if hit.any() else np.empty(0, int)
    owners, counts = np.unique(surface.owner[rest[face]], return_counts=True)
    order = np.argsort(-counts)
    obstacles = tuple((surface.ids[owners[i]], float(counts[i] / len(points))) for i in order)
    return Sweep(float(hit.mean()), abs(limit) * free / STEPS, abs(limit), obstacles)


def _near(mesh: Mesh, paths: np.ndarray) -> np.ndarray:
    """Return which faces of a mesh reach into the box around paths [step point 3], shape [face]."""
    low, high = paths.min(axis=(0, 1)), paths.max(axis=(0, 1))
    corners = mesh.vertices[mesh.faces]
    return ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)


def _stops(tree: RayMesh, facing: np.ndarray, paths: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the section in which each path first runs into a surface (STEPS: none), shape [point], and where, [point 3].

    Args:
        tree: the rest of the scan.
        facing: unit normals of its faces, shape [face 3].
        paths: of the points [m], shape [step point 3].
    """
    sections = np.diff(paths, axis=0)
    length = np.linalg.norm(sections, axis=2)
    direction = sections / np.maximum(length, 1e-9)[..., None]
    travelled = np.cumsum(length, axis=0) - length
    start = paths[:-1]
    way = visible_distance(tree, start.reshape(-1, 3), direction.reshape(-1, 3), float(length.max()))[0]
    way = way.reshape(length.shape)
    met = (way < 0.999 * length) & (travelled + way > CONTACT)  # a ray without a hit returns its reach, rounded
    places = start[met] + way[met][:, None] * direction[met]
    if len(places):
        met[met] = np.abs(np.einsum("ij,ij->i", facing[nearest_faces(tree, places)[0]], direction[met])) > GRAZING
    first = np.where(met.any(axis=0), met.argmax(axis=0), len(sections))
    index = np.minimum(first, len(sections) - 1), np.arange(paths.shape[1])
    return first, start[index] + way[index][:, None] * direction[index]
