"""A home from a random stream: its shape, doors and windows, furniture by the rules of its kind, scanner positions."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from s2a.core.errors import InputError
from s2a.homes import room_kinds
from s2a.homes.fittings import doors, lamps, sockets, windows
from s2a.homes.floor_plan import Crowded, FloorPlan
from s2a.homes.fronts import Palette, random_palette
from s2a.homes.room import Outline, Room, cad, catalog, moves, outline, paints, structure
from s2a.homes.solids import Piece, Range, integer
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh

FREE = 0.3  # [m] Least distance of a scanner from everything
CANDIDATES = 60
HANDLE_POINTS, SURFACE_POINTS = 8, 700  # Points on each handle, and on all surface, whose visibility is asked for
HANDLE_WEIGHT = 6.0  # What a point of a handle counts, in points of any surface
STEEP = 1.05  # [rad] Below the horizon a tripod hides what is steeper
ATTEMPTS = 80  # Rooms that are begun before a kind of room is given up
SCANNERS = 24  # Positions of a scanner; a tripod stands at the first few, a hand-held one passes all


@dataclass(frozen=True)
class Kind:
    """One kind of room."""

    area: Range  # of the floor [m^2]
    plain: float  # probability of a rectangle
    doors: tuple[int, int]  # least and largest number
    windows: tuple[int, int]  # least and largest number
    # places what makes it such a room; raises Crowded where something has no place
    furnish: Callable[[FloorPlan, Palette], None]


# Kinds of rooms; floor areas as in flats and offices (DIN 283, ASR A1.2)
HOMES: Mapping[str, Kind] = {
    "office": Kind((10, 18), 0.6, (1, 1), (1, 2), room_kinds.office),
    "bedroom": Kind((10, 17), 0.5, (1, 1), (1, 2), room_kinds.bedroom),
    "kitchen": Kind((10, 18), 0.6, (1, 1), (1, 1), room_kinds.kitchen),
    "bathroom": Kind((5.5, 10), 0.75, (1, 1), (0, 1), room_kinds.bathroom),
    "living_room": Kind((14, 25), 0.4, (1, 2), (1, 2), room_kinds.living_room),
    "dining_room": Kind((11, 18), 0.5, (1, 2), (1, 2), room_kinds.dining_room),
    "hallway": Kind((5.5, 12), 0.4, (2, 3), (0, 1), room_kinds.hallway),
    "laundry": Kind((5, 9), 0.8, (1, 1), (0, 1), room_kinds.laundry),
    "study": Kind((8.5, 14), 0.5, (1, 1), (1, 2), room_kinds.study),
    "workshop": Kind((11, 20), 0.7, (1, 1), (0, 1), room_kinds.workshop),
}


def stream(name: str, seed: int) -> np.random.Generator:
    """Return the random stream of a room; rooms of different kinds share no draws: not one palette and one door ten times."""
    return np.random.default_rng([seed, *name.encode()])


def home(name: str, seed: int) -> Room:
    """Return the room that `s2a sample` scans, before it is turned in its scene."""
    return furnish(name, stream(name, seed).spawn(1)[0])


def furnish(name: str, rng: np.random.Generator) -> Room:
    """Return a furnished room of a kind.

    `name`: a key of HOMES.

    Raises:
        InputError: no attempt found a place for all that such a room needs.
    """
    kind = HOMES[name]
    for attempt in rng.spawn(ATTEMPTS):
        shape = outline(attempt, kind.area, (2.35, 3.0), kind.plain)
        plan = FloorPlan(shape, attempt)
        try:
            return _furnished(plan, kind)
        except Crowded:
            continue
    raise InputError(f"no {name} could be furnished in {ATTEMPTS} attempts; take another seed")


def _furnished(plan: FloorPlan, kind: Kind) -> Room:
    """Return a room of one attempt; raises Crowded."""
    rng, colors = plan.rng, random_palette(plan.rng)
    holes = doors(plan, colors, integer(rng, *kind.doors))
    windows(plan, colors, holes, integer(rng, *kind.windows))
    kind.furnish(plan, colors)
    sockets(plan)
    lamps(plan)
    paint, ground = paints(rng)
    pieces = sorted([*plan.pieces, *structure(plan.room, holes, paint, ground)], key=lambda p: not moves(p))
    scanners = viewpoints(pieces, plan.room, SCANNERS, rng)
    if len(scanners) < 6:
        raise Crowded
    return Room(tuple(pieces), scanners, plan.room.size)


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
    samples = [rng.choice(np.flatnonzero(owners == number), HANDLE_POINTS) for number in handles]
    samples.append(rng.choice(len(centroids), SURFACE_POINTS))
    points = centroids[np.concatenate(samples)]
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
