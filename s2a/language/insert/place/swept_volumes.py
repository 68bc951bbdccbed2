"""Swept volumes of articulations: the space that drawers and doors need to open."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.scene.geometry.convex import halfspaces
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.regions import Region
from s2a.scene.geometry.sweep import sweep
from s2a.scene.scene import Mesh, Scene


@dataclass(frozen=True)
class SweptVolume:
    """A convex hull of a section of a part's swept volume.

    Attributes:
        part: id of the moving part.
        hull: convex hull of one section of its travel.
        planes: the hull's planes (nx, ny, nz, d), inside where n.x + d <= 0 [m], shape [plane 4].
    """

    part: str
    hull: Mesh
    planes: np.ndarray


def swept_volumes(scene: Scene) -> list[SweptVolume]:
    """Return the swept volumes of all articulated parts of a scene."""
    found = []
    for part_id in scene.movable:
        mesh = merge([Mesh(scene.parts[i].mesh.vertices, scene.parts[i].mesh.faces) for i in scene.members(part_id)])
        if len(mesh.faces):
            found += [SweptVolume(part_id, piece, halfspaces(piece)) for piece in sweep(mesh, scene.joint(part_id))]
    return found


def reaching_into(
    volumes: list[SweptVolume], low: np.ndarray, high: np.ndarray, scene: Scene, carrier: str | None = None
) -> list[SweptVolume]:
    """Return the swept volumes that reach into a box [m].

    Args:
        volumes: swept volumes of the scene's parts.
        low: the box's lower corner.
        high: its upper corner.
        scene: the room.
        carrier: id of the part that carries the object; it and its ancestors move along and do not count.
    """
    carriers = _carriers(scene, carrier)
    return [
        volume
        for volume in volumes
        if volume.part not in carriers and (volume.hull.bounds[0] < high).all() and (volume.hull.bounds[1] > low).all()
    ]


def intersects(volume: SweptVolume, points: np.ndarray, slack: float) -> bool:
    """Return True if any of the points [point 3] is deeper than `slack` [m] in a swept volume."""
    low, high = volume.hull.bounds
    near = points[((points > low) & (points < high)).all(axis=1)]
    return bool((near @ volume.planes[:, :3].T + volume.planes[:, 3] < -slack).all(axis=1).any())


def heights_within(volume: SweptVolume, places: np.ndarray, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the interval along the normal [m] in which lines through places [point 3] are inside; empty: first > last."""
    first, last = np.full(len(places), -np.inf), np.full(len(places), np.inf)
    outside = np.zeros(len(places), bool)
    # Plane by plane: a table of all places and planes does not fit the cache.
    for plane, slope in zip(volume.planes, volume.planes[:, :3] @ normal, strict=True):
        rest = -(places @ plane[:3] + plane[3])
        if slope < -1e-9:
            np.maximum(first, rest / slope, out=first)
        elif slope > 1e-9:
            np.minimum(last, rest / slope, out=last)
        else:
            outside |= rest < 0
    return np.where(outside, np.inf, first), np.where(outside, -np.inf, last)


def fill(layers: np.ndarray, edges: np.ndarray, region: Region, pad: int, volume: SweptVolume, slack: float) -> None:
    """Mark the cells over a region that a swept volume occupies, up to a tolerance.

    Args:
        layers: occupied cells by layer, shape [layer row column]; changed.
        edges: heights of the layers' borders above the region [m], shape [layer + 1].
        region: the region below the grid.
        pad: cells added on each side of the region.
        volume: swept volume of the part.
        slack: tolerance [m].
    """
    corners = region.places(volume.hull.vertices.astype(np.float64))[:, :2] + pad
    first = np.clip(np.floor(corners.min(axis=0)).astype(int), 0, layers.shape[1:])
    last = np.clip(np.ceil(corners.max(axis=0)).astype(int), 0, layers.shape[1:])
    if (last <= first).any():
        return
    cells = np.stack(np.meshgrid(*map(np.arange, first, last), indexing="ij"), axis=-1).reshape(-1, 2)
    low, high = heights_within(volume, region.points(cells - pad + 0.5), region.normal)
    for layer, bottom, top in zip(layers, edges, edges[1:], strict=False):
        inside = (low + slack < top) & (high - slack > bottom) & (high - low > 2 * slack)
        layer[tuple(cells[inside].T)] = True


def _carriers(scene: Scene, part_id: str | None) -> set[str]:
    """Return a part and its ancestors."""
    found: set[str] = set()
    while part_id is not None:
        found.add(part_id)
        part_id = scene.parts[part_id].parent
    return found
