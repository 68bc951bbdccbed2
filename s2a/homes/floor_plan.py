"""Placing furniture by rules: nothing in anything else, all that opens opens into free space, somebody can stand before it.

Every group of pieces is a set of boxes parallel to the room's axes: what it fills, what its parts sweep from closed to open, and
where one has to stand to open them. A place is taken if no box of what it fills meets a box of any kind of the others, or the
other way round; two fronts may sweep the same space. Room frame as in `s2a.homes.room`, metres.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2a.homes.room import Outline, Side
from s2a.homes.solids import Piece, at
from s2a.scene.articulation import displace

CLEAR = 0.012  # [m] Least distance between what two groups fill, and between what one fills and another sweeps
STEPS = 9  # Poses of a part from closed to open whose boxes cover its path
NO_BOXES = np.empty((0, 2, 3))


@dataclass(frozen=True)
class Boxes:
    """What a group of pieces takes up, each shape [box 2 3] [m]."""

    filled: np.ndarray  # by pieces and by what stands on them
    swept: np.ndarray  # by parts that open
    stands: np.ndarray  # where somebody stands to open them

    @property
    def groups(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """What is filled, what is swept and where one stands."""
        return self.filled, self.swept, self.stands

    def moved(self, transform: np.ndarray) -> Boxes:
        """Return the smallest boxes around these after a rigid motion, shape [4 4]."""
        return Boxes(*(_moved(boxes, transform) for boxes in self.groups))


def measured(pieces: Sequence[Piece], stand: float) -> Boxes:
    """Return what a group takes up in its own frame; floor before its fronts stays free so deep [m], where it has fronts."""
    filled = [_around(thing) for piece in pieces for thing in _apart(piece)]
    swept, stands = [], []
    for piece in pieces:
        paths = [_path(part) for part in _jointed(piece)]
        swept += [box for path in paths for box in path]
        if stand and paths:
            low = np.min([path[0][0] for path in paths], axis=0)
            high = np.max([path[0][1] for path in paths], axis=0)
            stands.append(_before(piece, low, high, stand))
    return Boxes(np.array(filled), _stack(swept), _stack(stands))


def before_wall(boxes: Boxes) -> Boxes:
    """Return what of boxes stands out of a wall whose face is at x = 0."""
    cut = []
    for group in boxes.groups:
        low, high = group[:, 0].copy(), group[:, 1]
        low[:, 0] = np.maximum(low[:, 0], CLEAR + 0.002)
        cut.append(np.stack([low, high], axis=1)[high[:, 0] > low[:, 0]])
    return Boxes(*cut)


def _before(piece: Piece, low: np.ndarray, high: np.ndarray, stand: float) -> np.ndarray:
    """Return the box before the fronts of a piece on the side to which it faces, shape [2 3]."""
    ahead = piece.pose[:2, 0]
    corners = np.array([(low[0], low[1]), (high[0], high[1])])
    reach = np.array([[min(0.0, stand * a) for a in ahead], [max(0.0, stand * a) for a in ahead]])
    if abs(ahead[0]) > abs(ahead[1]):
        corners[:, 0] = high[0] if ahead[0] > 0 else low[0]
        reach[:, 1] = (0.02, -0.02)
    else:
        corners[:, 1] = high[1] if ahead[1] > 0 else low[1]
        reach[:, 0] = (0.02, -0.02)
    return np.array([(*(corners[0] + reach[0]), 0.08), (*(corners[1] + reach[1]), 1.9)])


def _path(part: Piece) -> list[np.ndarray]:
    """Return the boxes around a part at several poses from closed to open, each shape [2 3]."""
    assert part.joint is not None
    points = np.concatenate([thing.surface.vertices for thing in _all(part)])
    lower, upper = part.joint.limits
    poses = [displace(points, part.joint, q) for q in np.linspace(lower, upper, STEPS)]
    return [np.stack([p.min(axis=0), p.max(axis=0)]) for p in poses]


def _around(piece: Piece) -> np.ndarray:
    points = np.concatenate([thing.surface.vertices for thing in _all(replace(piece, contents=()))])
    return np.stack([points.min(axis=0), points.max(axis=0)])


def _apart(piece: Piece) -> list[Piece]:
    """Return a piece, and what stands in or on it, as separate things; what its drawers hold is within it anyway."""
    return [piece, *piece.contents]


def _all(piece: Piece) -> list[Piece]:
    return [piece, *(below for part in (*piece.children, *piece.contents) for below in _all(part))]


def _jointed(piece: Piece) -> list[Piece]:
    return [part for part in _all(piece) if part.joint is not None]


def _moved(boxes: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """Return the boxes around moved boxes, shape [box 2 3]."""
    middle, half = boxes.mean(axis=1), (boxes[:, 1] - boxes[:, 0]) / 2
    middle = middle @ transform[:3, :3].T + transform[:3, 3]
    half = half @ np.abs(transform[:3, :3]).T
    return np.stack([middle - half, middle + half], axis=1)


def _stack(boxes: list[np.ndarray]) -> np.ndarray:
    return np.array(boxes) if boxes else NO_BOXES


def meet(some: np.ndarray, others: np.ndarray, margin: float) -> bool:
    """Return whether any box of one set is nearer to one of another set than a margin [m]."""
    low = some[:, None, 0] - margin < others[None, :, 1]
    high = others[None, :, 0] - margin < some[:, None, 1]
    return bool((low & high).all(axis=2).any())


class Crowded(Exception):
    """A piece of furniture that a room needs has no place in it."""


class FloorPlan:
    """A room that is being furnished.

    Attributes:
        room: its shape.
        rng: where places come from.
        pieces: what was placed.
    """

    def __init__(self, room: Outline, rng: np.random.Generator) -> None:
        self.room, self.rng = room, rng
        self.pieces: list[Piece] = []
        self.taken = Boxes(room.solids, NO_BOXES, NO_BOXES)

    def put(self, pieces: Sequence[Piece], pose: np.ndarray, stand: float = 0.0, built_in: bool = False) -> bool:
        """Place a group at a pose if there is room for it, and return whether there was.

        Args:
            pieces: the group, in its own frame: back at x = 0.
            pose: of that frame in the room, shape [4 4].
            stand: depth of the floor that stays free before its fronts [m].
            built_in: whether it lies in a wall, as doors and windows do; only what stands out of the wall counts.
        """
        boxes = measured(pieces, stand)
        return self._take(pieces, before_wall(boxes) if built_in else boxes, pose)

    def against(
        self,
        pieces: Sequence[Piece],
        stand: float = 0.0,
        sides: Iterable[int] | None = None,
        askew: float = 1.2,
        gap: float = 0.008,
        attempts: int = 10,
    ) -> np.ndarray | None:
        """Place a group with its back to a wall and return its pose, shape [4 4], or None where no wall has room for it.

        Args:
            pieces: the group, in its own frame: back at x = 0.
            stand: depth of the floor that stays free before its fronts [m].
            sides: walls that are tried, in any order; all by default.
            askew: largest yaw against the wall [deg].
            gap: between wall and group [m].
            attempts: places at each wall.
        """
        boxes, walls = measured(pieces, stand), self.room.sides
        low, high = boxes.filled[:, 0].min(axis=0), boxes.filled[:, 1].max(axis=0)
        chosen = list(range(len(walls)) if sides is None else sides)
        for index in self.rng.permutation(chosen).tolist():
            side = walls[index]
            slack = side.length - (high[1] - low[1]) - 0.03
            for _ in range(attempts if slack > 0 else 0):
                yaw = self.rng.uniform(-askew, askew)
                away = gap - low[0] + abs(np.sin(np.radians(yaw))) * max(abs(low[1]), high[1])
                # Corners are where furniture stands most often.
                along = slack * float(np.clip(self.rng.uniform(-0.25, 1.25), 0.0, 1.0)) + 0.015 - low[1]
                pose = side.pose @ at(away, along, 0.0, yaw)
                if self._take(pieces, boxes, pose):
                    return pose
        return None

    def anywhere(
        self, pieces: Sequence[Piece], stand: float = 0.0, attempts: int = 20, z: float = 0.0
    ) -> np.ndarray | None:
        """Place a group anywhere on the floor, level with a wall, and return its pose, or None."""
        boxes = measured(pieces, stand)
        for _ in range(attempts):
            yaw = 90.0 * int(self.rng.integers(4)) + self.rng.uniform(-2, 2)
            x, y = self.rng.uniform((0.2, 0.2), np.array(self.room.size[:2]) - 0.2)
            pose = at(x, y, z, yaw)
            if self._take(pieces, boxes, pose):
                return pose
        return None

    def need(self, pose: np.ndarray | None) -> np.ndarray:
        """Return a pose that must not be None; Crowded: it is None."""
        if pose is None:
            raise Crowded
        return pose

    def free(self, boxes: Boxes) -> bool:
        """Return whether boxes in the room's frame have room."""
        taken = self.taken
        if not self._within(np.concatenate([boxes.filled, boxes.swept, boxes.stands])):
            return False
        return not (
            meet(boxes.filled, taken.filled, CLEAR)
            or meet(boxes.filled, taken.swept, CLEAR)
            or meet(boxes.swept, taken.filled, CLEAR)
            or meet(boxes.filled, taken.stands, 0.0)
            or meet(boxes.stands, taken.filled, 0.0)
        )

    def _within(self, boxes: np.ndarray) -> bool:
        low, high = np.zeros(3), np.array(self.room.size)
        return bool((boxes[:, 0, :2] >= low[:2]).all() and (boxes[:, 1] <= high).all())

    def _take(self, pieces: Sequence[Piece], boxes: Boxes, pose: np.ndarray) -> bool:
        there = boxes.moved(pose)
        if not self.free(there):
            return False
        self.pieces += [piece.moved(pose) for piece in pieces]
        self.taken = Boxes(*(np.concatenate(pair) for pair in zip(self.taken.groups, there.groups, strict=True)))
        return True

    def side(self, index: int) -> Side:
        """Return a wall."""
        return self.room.sides[index]

    def some_side(self) -> int:
        """Return the index of a wall; long ones more often."""
        lengths = np.array([side.length for side in self.room.sides]) ** 2
        return int(self.rng.choice(len(lengths), p=lengths / lengths.sum()))
