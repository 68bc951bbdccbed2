"""Doors and windows: openings of a wall, found from their lever, which stands out."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy import ndimage

from s2a.annotate.propose.cells import CellBox
from s2a.annotate.propose.config import ProposeConfig
from s2a.annotate.propose.layers import Layer

MIN_WALL = (1.2, 1.6)
"""[m] Width and height of the plane of a wall, at least."""
LEVER = (0.02, 0.085)
"""[m] A lever stands out of its wall by so much."""
LEVER_SIZE = (0.03, 0.25)
"""[m] Length of a lever."""
LEVER_HEIGHT = (0.8, 1.9)
"""[m] Over the floor."""
WALL_COLOR = 30.0
"""Difference of colour, Euclidean in RGB, up to which a cell of the plane is plain wall."""
SIZE = ((0.35, 1.7), (0.45, 2.3))
"""[m] Width and height of an opening."""
AT_FLOOR, MIN_DOOR = 0.3, 1.8
"""[m] What begins lower is a door, and so high at least; else it is what stands before the wall."""
BAND = 5
"""Rows, or columns, beside each other of which an opening's are."""
FRAME = 0.035
"""[m] Width of a window's fixed frame, which surrounds its leaves."""
LEAVES = 0.25
"""A lever so near to the middle, as a fraction of the width, closes one of two leaves."""


def leaves(layer: Layer, floor: float, config: ProposeConfig) -> Iterator[tuple[CellBox, CellBox]]:
    """Yield rectangle and lever of each door and window of a plane that is a wall; none of other planes."""
    height, width = layer.height.shape
    if width * config.cell < MIN_WALL[0] or height * config.cell < MIN_WALL[1]:
        return
    seen = ~np.isnan(layer.height)
    color = np.median(layer.color[seen], axis=0)
    wall = seen & (np.linalg.norm(np.where(seen[..., None], layer.color, 0.0) - color, axis=-1) < WALL_COLOR)
    wall = ndimage.binary_opening(ndimage.binary_closing(np.pad(wall, 3), np.ones((3, 3)))[3:-3, 3:-3], np.ones((5, 5)))
    for lever in _levers(layer, floor, config):
        box = _around(~wall, lever)
        sides = np.array(box.sides) * config.cell
        low = layer.low[1] + box.bottom * config.cell - floor
        if low < AT_FLOOR and sides[1] < MIN_DOOR:
            continue
        if all(low <= side <= high for side, (low, high) in zip(sides, SIZE, strict=True)):
            leaf = box if low < AT_FLOOR else _framed(box, lever, FRAME / config.cell)
            yield _leaf(leaf, lever), lever


def _levers(layer: Layer, floor: float, config: ProposeConfig) -> Iterator[CellBox]:
    out = (layer.relief > LEVER[0]) & (layer.relief < LEVER[1])
    labels, _ = ndimage.label(ndimage.binary_closing(np.pad(out, 2), np.ones((3, 3)))[2:-2, 2:-2], np.ones((3, 3)))
    for where in ndimage.find_objects(labels):
        lever = CellBox(where[1].start, where[0].start, where[1].stop, where[0].stop)
        up = layer.low[1] + lever.middle[1] * config.cell - floor
        if LEVER_SIZE[0] <= max(lever.sides) * config.cell <= LEVER_SIZE[1] and LEVER_HEIGHT[0] < up < LEVER_HEIGHT[1]:
            yield lever


def _around(free: np.ndarray, lever: CellBox) -> CellBox:
    """Return the rectangle of what is no wall around a lever: first the width at its height, then the height."""
    x, y = (int(value) for value in lever.middle)
    rows = free[max(y - BAND, 0) : y + BAND + 1].mean(axis=0) > 0.5
    left, right = _run(rows, x)
    middle, half = (left + right) // 2, max((right - left) // 4, 1)
    columns = free[:, middle - half : middle + half + 1].mean(axis=1) > 0.5
    bottom, top = _run(columns, y)
    return CellBox(left, bottom, right, top)


def _run(free: np.ndarray, at: int) -> tuple[int, int]:
    """Return first and end of the run of true values around a place."""
    if not free[at]:
        return at, at
    blocked = np.flatnonzero(~free)
    below, above = blocked[blocked < at], blocked[blocked > at]
    return int(below[-1]) + 1 if len(below) else 0, int(above[0]) if len(above) else len(free)


def _framed(box: CellBox, lever: CellBox, frame: float) -> CellBox:
    """Return what a fixed frame surrounds; all of a box whose lever would be on the frame, which looks like the wall then."""
    x, y = lever.middle
    inner = CellBox(box.left + frame, box.bottom + frame, box.right - frame, box.top - frame)
    inside = inner.left + 1 <= x <= inner.right - 1 and inner.bottom + 1 <= y <= inner.top - 1
    return inner if inside else box


def _leaf(box: CellBox, lever: CellBox) -> CellBox:
    """Return the leaf that a lever closes: the whole opening, or one half where the lever is in its middle."""
    x = lever.middle[0]
    aside = (x - box.left) / box.width - 0.5
    if abs(aside) > LEAVES:
        return box
    middle = (box.left + box.right) / 2
    return (
        CellBox(middle, box.bottom, box.right, box.top) if aside > 0 else CellBox(box.left, box.bottom, middle, box.top)
    )
