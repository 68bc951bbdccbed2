"""A furnished room: walls with openings, floor and ceiling, places for a scanner; the annotator's list of its parts.

Room frame: inner corner of the bounding rectangle at the origin, x along the width, y along the depth, z up, metres.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from s2a.homes.solids import (
    PLAIN,
    Color,
    Piece,
    Surface,
    at,
    box,
    chance,
    integer,
    join,
    painted,
    pick,
    rotation,
    translation,
)
from s2a.scene.scene import Part, Scene

Size = tuple[float, float, float]  # Inner width, depth and height of a room [m]
Hole = tuple[float, float, float, float]  # Opening of a wall, in the wall's frame: y from, y to, z from, z to [m]


@dataclass(frozen=True)
class Room:
    """A furnished room, and from where it is scanned."""

    pieces: tuple[Piece, ...]  # objects, the articulated ones first
    scanners: np.ndarray  # positions of the scanner, the most important first [m], shape [pose 3]
    size: Size  # inner width, depth and height [m]
    yaw: float = 0.0  # rotation of the room about z against the scene [rad]

    def turned(self, yaw: float) -> Room:
        """Return the room at a yaw [rad], its smallest inner corner moved to the origin of the scene."""
        width, depth, _ = self.size
        turn = rotation((0.0, 0.0, yaw))
        corners = np.array([(0, 0, 0), (width, 0, 0), (0, depth, 0), (width, depth, 0)]) @ turn[:3, :3].T
        move = translation(-corners.min(axis=0)) @ turn
        scanners = self.scanners @ move[:3, :3].T + move[:3, 3]
        return replace(self, pieces=tuple(p.moved(move) for p in self.pieces), scanners=scanners, yaw=yaw)


def wall(
    length: float, height: float, holes: tuple[Hole, ...], color: Color, ends: tuple[float, float] = (0.1, 0.1)
) -> Surface:
    """Return a wall along y, 0.1 m thick, its face at x = 0, with holes beside each other [m].

    WEST's y is the room's y; NORTH's is its x; EAST's runs from (width, depth) back to the corner; SOUTH's from (width, 0) back.

    Args:
        length: along y, without its ends.
        height: up to the ceiling.
        holes: in the order of their y.
        color: of its paint.
        ends: how far it goes on beyond y = 0 and y = length, into the corners of the room.
    """
    slab, top = (-0.1, 0.0), height + 0.1
    edges = [-ends[0], *(y for hole in holes for y in hole[:2]), length + ends[1]]
    rest = [box(slab, y, (-0.1, top), color) for y in zip(edges[::2], edges[1::2], strict=True)]
    rest += [box(slab, (left, right), (high, top), color) for left, right, _, high in holes]
    return join(*rest, *(box(slab, (left, right), (-0.1, low), color) for left, right, low, _ in holes if low > 0))


# A corner that is cut off: 0 to 3 for (0, 0), (width, 0), (width, depth), (0, depth); its extent along x and y [m]
Notch = tuple[int, float, float]
THICK = 0.1  # Of walls, floor and ceiling [m]


@dataclass(frozen=True)
class Side:
    """One wall: its frame has the face at x = 0, x into the room, y along the wall from 0 to its length."""

    pose: np.ndarray  # of that frame, shape [4 4]
    length: float  # [m]
    height: float  # [m]
    # how far its slab goes on beyond y = 0 and y = length [m]; negative at corners that stand out into the room
    ends: tuple[float, float]


@dataclass(frozen=True)
class Outline:
    """The empty room."""

    size: tuple[float, float, float]  # of the bounding rectangle, and the ceiling's height [m]
    notches: tuple[Notch, ...]  # corners that do not belong to the room
    # index of the wall with a sloped ceiling above it, the wall's height, and how far the slope reaches [m], or None
    slope: tuple[int, float, float] | None = None

    @property
    def corners(self) -> np.ndarray:
        """Corners of the floor, counter-clockwise, shape [corner 2]."""
        width, depth, _ = self.size
        points: list[tuple[float, float]] = []
        cut = {index: (a, b) for index, a, b in self.notches}
        for index, (x, y) in enumerate(((0.0, 0.0), (width, 0.0), (width, depth), (0.0, depth))):
            if index not in cut:
                points.append((x, y))
                continue
            a, b = cut[index]
            inner = (x + (a if x == 0 else -a), y + (b if y == 0 else -b))
            along_y, along_x = (x, inner[1]), (inner[0], y)
            points += [along_y, inner, along_x] if index in (0, 2) else [along_x, inner, along_y]
        return np.array(points)

    @property
    def sides(self) -> list[Side]:
        """The walls, counter-clockwise; wall i begins at corner i."""
        corners, walls = self.corners, []
        count = len(corners)
        ahead = np.roll(corners, -1, axis=0) - corners
        for i in range(count):
            length = float(np.linalg.norm(ahead[i]))
            normal = np.array((-ahead[i][1], ahead[i][0])) / length
            end = corners[(i + 1) % count]
            bends = [_cross(ahead[i], ahead[(i + 1) % count]), _cross(ahead[i - 1], ahead[i])]
            ends = tuple(THICK if bend > 0 else -THICK * (k == 0) for k, bend in enumerate(bends))
            yaw = float(np.degrees(np.arctan2(normal[1], normal[0])))
            height = self.slope[1] if self.slope is not None and self.slope[0] == i else self.size[2]
            walls.append(Side(at(end[0], end[1], 0.0, yaw), length, height, (ends[0], ends[1])))
        return walls

    @property
    def solids(self) -> np.ndarray:
        """Boxes of what is not room within the bounding rectangle: notches, the space above a slope, shape [box 2 3]."""
        width, depth, height = self.size
        boxes = []
        for index, a, b in self.notches:
            x = (0.0, a) if index in (0, 3) else (width - a, width)
            y = (0.0, b) if index in (0, 1) else (depth - b, depth)
            boxes.append([(x[0], y[0], 0.0), (x[1], y[1], height)])
        if self.slope is not None:
            boxes += _staircase(self, *self.slope)
        return np.array(boxes, float).reshape(-1, 2, 3)

    def contains(self, points: np.ndarray, margin: float) -> np.ndarray:
        """Return whether points [point 2] lie in the room, so far from its walls [m]."""
        inside = np.all((points > margin) & (points < np.array(self.size[:2]) - margin), axis=1)
        for low, high in self.solids[: len(self.notches), :, :2]:
            inside = inside & ~np.all((points > low - margin) & (points < high + margin), axis=1)
        return np.asarray(inside)


def outline(rng: np.random.Generator, area: tuple[float, float], height: tuple[float, float], plain: float) -> Outline:
    """Return the drawn shape of a room.

    Args:
        rng: all that is drawn.
        area: of the floor from, to [m^2].
        height: of the ceiling from, to [m].
        plain: probability of a rectangle.
    """
    floor, ratio = rng.uniform(*area), rng.uniform(1.0, 1.65)
    width, depth = (floor * ratio) ** 0.5, (floor / ratio) ** 0.5
    if chance(rng, 0.5):
        width, depth = depth, width
    high = rng.uniform(*height)
    if chance(rng, plain) or min(width, depth) < 2.3:
        slope = (integer(rng, 0, 3), rng.uniform(1.0, 1.6), rng.uniform(0.7, 1.3)) if chance(rng, 0.25) else None
        return Outline((width, depth, high), (), slope if min(width, depth) > 2.8 else None)
    # What is cut off is given back.
    grow = rng.uniform(1.04, 1.1)
    width, depth = width * grow, depth * grow
    first = integer(rng, 0, 3)
    a, b = width * rng.uniform(0.15, 0.4), depth * rng.uniform(0.15, 0.4)
    if chance(rng, 0.7):
        return Outline((width, depth, high), ((first, a, b),))
    second = (first + 1) % 4  # an alcove between two notches of the same depth
    bay = min(a, 0.28 * width), min(b, 0.28 * depth)
    return Outline((width, depth, high), ((first, *bay), (second, *bay)))


def structure(room: Outline, holes: dict[int, list[Hole]], paint: Color, ground: tuple[Color, int]) -> list[Piece]:
    """Return walls, floor and ceiling.

    Args:
        room: its shape.
        holes: the openings of each wall by its index, in the wall's frame.
        paint: of the walls.
        ground: colour and texture of the floor.
    """
    pieces = [
        Piece("wall", wall(side.length, side.height, tuple(holes.get(i, ())), paint, side.ends)).moved(side.pose)
        for i, side in enumerate(room.sides)
    ]
    slabs = _slabs(room.corners)
    pieces.append(Piece("floor", join(*(box(x, y, (-THICK, 0.0), *ground) for x, y in slabs))))
    height = room.size[2]
    above = [box(x, y, (height, height + THICK), (240, 240, 236), PLAIN) for x, y in slabs]
    if room.slope is not None:
        above.append(_sloped(room, *room.slope))
    pieces.append(Piece("ceiling", join(*above)))
    return pieces


def _slabs(corners: np.ndarray) -> list[tuple[tuple[float, float], tuple[float, float]]]:
    """Return rectangles that cover the floor and the walls around it: one for each span of x between two corners."""
    cuts = np.unique(corners[:, 0].round(6))
    ends = np.roll(corners, -1, axis=0)
    level = np.abs(corners[:, 1] - ends[:, 1]) < 1e-9
    slabs = []
    for left, right in zip(cuts[:-1], cuts[1:], strict=True):
        middle = (left + right) / 2
        over = (
            level & (np.minimum(corners[:, 0], ends[:, 0]) < middle) & (np.maximum(corners[:, 0], ends[:, 0]) > middle)
        )
        y = corners[over, 1]
        x = (left - THICK * (left == cuts[0]), right + THICK * (right == cuts[-1]))
        slabs.append((x, (float(y.min()) - THICK, float(y.max()) + THICK)))
    return slabs


def _sloped(room: Outline, index: int, low: float, reach: float) -> Surface:
    """Return the slab of a slope that begins at a height above a wall and meets the ceiling so far into the room [m]."""
    side, high = room.sides[index], room.size[2]
    y = (-THICK, side.length + THICK)
    # Its lower face continues behind the wall, so that no gap is left.
    fall = (high - low) / reach
    section = [
        (-THICK, low - THICK * fall),
        (reach, high),
        (reach, high + THICK),
        (-THICK, low - THICK * fall + 2 * THICK),
    ]
    vertices = [(x, b, z) for b in y for x, z in section]
    quads = [(0, 1, 2, 3), (7, 6, 5, 4), (0, 4, 5, 1), (1, 5, 6, 2), (2, 6, 7, 3), (3, 7, 4, 0)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return painted(vertices, faces, (240, 240, 236)).moved(side.pose)


def _staircase(room: Outline, index: int, low: float, reach: float) -> list[list[tuple[float, float, float]]]:
    """Return boxes that together enclose the space above a slope, in the room's frame."""
    side, high, steps = room.sides[index], room.size[2], 12
    stairs = []
    for i in range(steps):
        x = reach * i / steps, reach * (i + 1) / steps
        corners = np.array([(a, b, 0.0) for a in x for b in (0.0, side.length)])
        moved = corners @ side.pose[:3, :3].T + side.pose[:3, 3]
        bottom = low + (high - low) * i / steps
        stairs.append([(*moved.min(axis=0)[:2], bottom), (*moved.max(axis=0)[:2], high)])
    return stairs


def _cross(a: np.ndarray, b: np.ndarray) -> float:
    return float(a[0] * b[1] - a[1] * b[0])


# Floors: wood, tiles, carpet
GROUNDS: tuple[tuple[Color, int], ...] = (
    ((164, 134, 100), 1),
    ((176, 172, 164), 3),
    ((140, 146, 150), 3),
    ((120, 118, 122), 2),
    ((196, 170, 130), 1),
)


def paints(rng: np.random.Generator) -> tuple[Color, tuple[Color, int]]:
    """Return the colour of walls, and colour and texture of a floor."""
    tone = rng.integers(196, 236)
    red, green, blue = np.clip(tone + rng.integers(-16, 12, 3), 0, 245).tolist()
    return (red, green, blue), pick(rng, GROUNDS)


@dataclass(frozen=True)
class Entry:
    """One annotated part."""

    number: int  # 1-based, unique in the scene
    label: str  # as the data set writes it ("drawer.2.1"); objects without moving parts carry only their name
    parent: int | None  # number of the part it belongs to, or None
    piece: Piece  # its shape and joint, in the scene
    articulated: bool  # Its object has moving parts, hence belongs to Articulate3D's annotation
    carrier: int | None = None  # number of the part in or on which it lies and with which it moves, or None

    @property
    def part_id(self) -> str:
        """The part's id in a Scene: its name and number."""
        return f"{self.piece.name.replace(' ', '_')}_{self.number}"


def catalog(pieces: tuple[Piece, ...]) -> list[Entry]:
    """Number the parts of articulated objects, object by object and level by level, then all other objects."""
    entries: list[Entry] = []
    for index, piece in enumerate((piece for piece in pieces if moves(piece)), start=1):
        level: list[tuple[Piece, str, int | None]] = [(piece, str(index), None)]
        while level:
            below: list[tuple[Piece, str, int | None]] = []
            for part, path, parent in level:
                entries.append(Entry(len(entries) + 1, f"{part.name}.{path}", parent, part, True))
                below += [(child, f"{path}.{i}", entries[-1].number) for i, child in enumerate(part.children, start=1)]
            level = below
    loose: list[tuple[Piece, int | None]] = [(piece, None) for piece in pieces if not moves(piece)]
    loose += [(thing, entry.number) for entry in entries for thing in entry.piece.contents]
    for piece, carrier in loose:
        entries.append(Entry(len(entries) + 1, piece.name, None, piece, False, carrier))
        on = len(entries)
        entries += [
            Entry(on + i, thing.name, None, thing, False, on) for i, thing in enumerate(piece.contents, start=1)
        ]
    return entries


def moves(piece: Piece) -> bool:
    """Whether a piece or any part of it has a joint."""
    return piece.joint is not None or any(moves(child) for child in piece.children)


def clean_scene(name: str, entries: list[Entry]) -> Scene:
    """Return the exact scene: CAD surfaces, true joints; graspable are the deepest parts below each joint."""
    by_number = {entry.number: entry for entry in entries}
    parts = {
        entry.part_id: Part(
            label=entry.piece.name,
            mesh=entry.piece.surface.mesh,
            parent=None if entry.parent is None else by_number[entry.parent].part_id,
            motion=entry.piece.joint or "fixed",
            graspable=_graspable(entry, entries),
        )
        for entry in entries
    }
    return Scene(name, parts)


def _graspable(entry: Entry, entries: list[Entry]) -> bool:
    """Whether a part is where a hand takes hold: it moves or lies below a part that moves, and has no parts itself."""
    by_number = {other.number: other for other in entries}
    if any(other.parent == entry.number for other in entries):
        return False
    while entry.piece.joint is None and entry.parent is not None:
        entry = by_number[entry.parent]
    return entry.piece.joint is not None


def cad(entries: list[Entry]) -> tuple[Surface, np.ndarray]:
    """Return the surfaces of all parts as one, and the number of the part that each face belongs to, shape [face]."""
    surfaces = [entry.piece.surface for entry in entries]
    return join(*surfaces), np.repeat([entry.number for entry in entries], [len(s.faces) for s in surfaces])


def part_truth(entry: Entry, ids: Mapping[int, str]) -> dict[str, Any]:
    """Return the exact facts about one part: label, style, size, pose, joint, what carries it, a handle's family and lengths."""
    joint = entry.piece.joint
    facts: dict[str, Any] = {
        "label": entry.label,
        "style": entry.piece.style,
        "size": entry.piece.size.tolist(),
        "pose": entry.piece.pose.tolist(),
    }
    if joint is not None:
        facts["joint"] = {"kind": joint.kind, "axis": joint.axis, "origin": joint.origin, "limits": joint.limits}
    if entry.carrier is not None:
        facts["carrier"] = ids[entry.carrier]
    if entry.piece.facts:
        facts["facts"] = dict(entry.piece.facts)
    return facts


def handle_of(truth: Mapping[str, Any]) -> str | None:
    """Return the family of a part's handle, or its style where no family is known; None: it has none. `truth`: of part_truth."""
    family: str | None = truth.get("facts", {}).get("family", truth["style"])
    return family
