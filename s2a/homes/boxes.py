"""Boxes around furniture, parallel to the axes: filled space, swept space of parts, standing room before them. Metres."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2a.homes.solids import Piece
from s2a.scene.articulation import displace

CLEAR = 0.012
"""[m] Least distance between what two groups fill, and between what one fills and another sweeps."""
STEPS = 9
"""Poses of a part from closed to open whose boxes cover its path."""
NO_BOXES = np.empty((0, 2, 3))


@dataclass(frozen=True)
class Boxes:
    """What a group of pieces takes up, each shape [box 2 3] [m].

    Attributes:
        filled: by pieces and by what stands on them.
        swept: by parts that open.
        stands: where somebody stands to open them.
    """

    filled: np.ndarray
    swept: np.ndarray
    stands: np.ndarray

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
    """Return a piece with all its parts and all that lies in them."""
    return [piece, *(below for part in (*piece.children, *piece.contents) for below in _all(part))]


def _jointed(piece: Piece) -> list[Piece]:
    """Return the parts of a piece that move."""
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
