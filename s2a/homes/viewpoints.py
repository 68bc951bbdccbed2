"""Viewpoints of a scanner in a furnished room, chosen in free air for the most unseen handles and surface."""

from __future__ import annotations

import numpy as np

from s2a.homes.catalog import cad, catalog
from s2a.homes.outline import Outline
from s2a.homes.solids import Piece
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh

FREE = 0.3
"""[m] Least distance of a scanner from everything."""
CANDIDATES = 60
HANDLE_POINTS, SURFACE_POINTS = 8, 700
"""Points on each handle, and on all surface, whose visibility is asked for."""
HANDLE_WEIGHT = 6.0
"""What a point of a handle counts, in points of any surface."""
STEEP = 1.05
"""[rad] Below the horizon a tripod hides what is steeper."""


def viewpoints(pieces: list[Piece], room: Outline, count: int, rng: np.random.Generator) -> np.ndarray:
    """Return positions of a scanner, the most important first [m], shape [pose 3].

    Raises:
        ValueError: the room has no free air to stand in.
    """
    entries = catalog(tuple(pieces))
    surface, owners = cad(entries)
    mesh = ray_mesh(surface.vertices, surface.faces)
    places = _candidates(mesh, room, rng)
    if not len(places):
        raise ValueError("no place in the room is far enough from everything for a scanner")
    centroids = surface.vertices[surface.faces].mean(axis=1)
    handles = [entry.number for entry in entries if entry.piece.style is not None]
    asked = [rng.choice(np.flatnonzero(owners == number), HANDLE_POINTS) for number in handles]
    asked.append(rng.choice(len(centroids), SURFACE_POINTS))
    points = centroids[np.concatenate(asked)]
    weights = np.ones(len(points))
    weights[: len(handles) * HANDLE_POINTS] = HANDLE_WEIGHT
    seen = np.stack([_seen(mesh, place, points) for place in places])
    return places[_greedy(seen, weights, count)]


def _candidates(mesh: object, room: Outline, rng: np.random.Generator) -> np.ndarray:
    """Return places in free air at the height of a tripod or a hand, shape [place 3]."""
    width, depth, _ = room.size
    places = rng.uniform((0.0, 0.0, 1.2), (width, depth, 1.75), size=(12 * CANDIDATES, 3))
    places = places[room.contains(places[:, :2], FREE)]
    if not len(places):
        return places
    return places[nearest_faces(mesh, places)[1] > FREE][:CANDIDATES]


def _seen(mesh: object, place: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return whether a scanner at a place sees each point, shape [point]."""
    rays = points - place
    far = np.linalg.norm(rays, axis=1)
    hits = first_hits(mesh, np.broadcast_to(place, points.shape), rays / far[:, None])
    return (hits > far - 0.004) & (np.arcsin(np.clip(-rays[:, 2] / far, -1, 1)) < STEEP)


def _greedy(seen: np.ndarray, weights: np.ndarray, count: int) -> list[int]:
    """Return the rows that together see most: a point seen once more counts half as much each time."""
    chosen: list[int] = []
    worth = weights.copy()
    for _ in range(min(count, len(seen))):
        gain = seen @ worth
        gain[chosen] = -1.0
        chosen.append(int(np.argmax(gain)))
        worth = np.where(seen[chosen[-1]], 0.4 * worth, worth)
    return chosen
