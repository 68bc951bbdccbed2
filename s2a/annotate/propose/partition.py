"""A patch with several handles is divided into one front for each: by the lines that show, and halfway between handles."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.ndimage import median_filter

from s2a.annotate.propose.cells import CellBox
from s2a.annotate.propose.layers import Layer

EVIDENCE = 4.0
"""Deviations of the line's profile that count as much as lying right in the middle between two handles."""
STRONG = 60.0
"""Difference of colour (RGB, summed) that counts no more if it is larger: a handle's, along a part of a line."""
BESIDE = 1
"""Cells around a handle that do not count as line either."""
PARTS = 4
"""A line shows in each of so many parts of its length."""
EQUAL = 0.15
"""Handles lie at equal distances, up to this fraction: their fronts are equal."""
WIDE, CLEAR = 3.0, 6.0
"""Width over height of a drawer with two handles, and deviations of a line's profile that divide it."""
FULL, RAGGED = 0.95, 0.3
"""Fraction of a box that a patch fills, from which on it stays as it is; and of the fullest row or column, of what ends one."""
GAP = 9
"""Cells over which a profile is compared: a line is narrower."""


@dataclass(frozen=True)
class Cut:
    """A straight cut through a box.

    Attributes:
        axis: 0 for an upright cut between left and right, 1 for a level one.
        place: column or row.
        score: how much speaks for it.
        line: deviations by which a line shows there.
    """

    axis: int
    place: float
    score: float
    line: float


def divide(layer: Layer, box: CellBox, blobs: list[CellBox], within: np.ndarray) -> list[tuple[CellBox, list[CellBox]]]:
    """Return boxes with one handle each; two that no cut divides are one front's.

    Args:
        layer: the plane's image.
        box: rectangle around a patch.
        blobs: its handles.
        within: cells that the patch fills, shape [row column]: what it leaves free of a half is cut off.
    """
    if len(blobs) < 2:
        return [(box, blobs)]
    cuts = [cut for axis in (0, 1) for cut in _cuts(layer, box, blobs, axis)]
    if not cuts or (_pair(box, blobs) and max(cut.line for cut in cuts) < CLEAR):
        return [(box, blobs)]
    best = max(cuts, key=lambda cut: cut.score)
    found = []
    for part in _halves(box, best):
        inside = [blob for blob in blobs if _holds(part, blob)]
        found += divide(layer, _shrunk(part, within), inside, within)
    return found


def _pair(box: CellBox, blobs: list[CellBox]) -> bool:
    """Return whether two level handles lie like those of one wide drawer."""
    if len(blobs) != 2 or box.width < WIDE * box.height or any(blob.width < blob.height for blob in blobs):
        return False
    x = (blobs[0].middle[0] + blobs[1].middle[0]) / 2
    y = abs(blobs[0].middle[1] - blobs[1].middle[1])
    return bool(abs(x - box.middle[0]) < 0.1 * box.width and y < 0.2 * box.height)


def _cuts(layer: Layer, box: CellBox, blobs: list[CellBox], axis: int) -> list[Cut]:
    """Return the best cut in each interval that no handle crosses."""
    profile = _profile(layer, box, blobs, axis)
    first, length = (box.left, box.width) if axis == 0 else (box.bottom, box.height)
    rows = _rows(blobs, axis)
    usual = _regular(rows, first, length)
    found = []
    for index, ((_, low), (high, _)) in enumerate(pairwise(rows)):
        places = np.arange(int(np.ceil(low)), int(high) + 1)
        middle, half = (low + high) / 2, max((high - low) / 2, 1.0)
        middle = middle if usual is None else float(np.clip(usual[index], low, high))
        line = profile[np.clip(places - int(first), 0, len(profile) - 1)]
        score = line / EVIDENCE + 1.0 - 0.7 * np.abs(places - middle) / half
        best = int(np.argmax(score))
        found.append(Cut(axis, float(places[best]), float(score[best] + (high - low) / length), float(line[best])))
    return found


def _rows(blobs: list[CellBox], axis: int) -> list[tuple[float, float]]:
    """Return the ends of the rows, or columns, of handles, between which a cut fits."""
    found: list[tuple[float, float]] = []
    for low, high in sorted((blob.left, blob.right) if axis == 0 else (blob.bottom, blob.top) for blob in blobs):
        if found and low <= found[-1][1] + 1:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return found


def _regular(rows: list[tuple[float, float]], first: float, length: float) -> np.ndarray | None:
    """Return the places of the cuts of equal fronts, None where handles lie at other distances."""
    apart = np.diff([(low + high) / 2 for low, high in rows])
    equal = length / len(rows)
    if not len(apart) or (np.abs(apart - equal) > EQUAL * equal).any():
        return None
    return first + equal * np.arange(1, len(rows))


def _profile(layer: Layer, box: CellBox, blobs: list[CellBox], axis: int) -> np.ndarray:
    """Return how much each column, or row, of a box differs from those beside it, in deviations of all; handles do not count."""
    rows, columns = slice(int(box.bottom), int(box.top)), slice(int(box.left), int(box.right))
    image = np.concatenate([layer.color[rows, columns], 2e4 * layer.height[rows, columns, None]], axis=-1)
    plain = np.ones(image.shape[:2], bool)
    for b in blobs:
        low, left = max(int(b.bottom - box.bottom) - BESIDE, 0), max(int(b.left - box.left) - BESIDE, 0)
        plain[low : int(b.top - box.bottom) + BESIDE, left : int(b.right - box.left) + BESIDE] = False
    if axis == 1:  # the cut runs along the first axis
        image, plain = np.swapaxes(image, 0, 1), plain.T
    seen = np.where(np.isnan(image), np.nanmedian(image, axis=(0, 1)), image)
    off = np.minimum(np.abs(seen - median_filter(seen, size=(1, GAP, 1), mode="nearest")).sum(axis=-1), STRONG)
    mean = np.min([_mean(off[part], plain[part]) for part in np.array_split(np.arange(len(off)), PARTS)], axis=0)
    scatter = 1.4826 * float(np.median(np.abs(mean - np.median(mean)))) + 1e-6
    return np.asarray(np.clip((mean - np.median(mean)) / scatter, 0.0, 2 * EVIDENCE))


def _mean(off: np.ndarray, plain: np.ndarray) -> np.ndarray:
    """Return the mean along the first axis of what is plain; where too little is, as if there were a line."""
    count = plain.sum(axis=0)
    return np.where(count > len(off) / 4, (off * plain).sum(axis=0) / np.maximum(count, 1), STRONG)


def _halves(box: CellBox, cut: Cut) -> tuple[CellBox, CellBox]:
    if cut.axis == 0:
        return CellBox(box.left, box.bottom, cut.place, box.top), CellBox(cut.place, box.bottom, box.right, box.top)
    return CellBox(box.left, box.bottom, box.right, cut.place), CellBox(box.left, cut.place, box.right, box.top)


def _shrunk(box: CellBox, within: np.ndarray) -> CellBox:
    """Return what a patch fills of a box."""
    mask = within[box.cells]
    if not mask.any() or mask.mean() > FULL:
        return box
    (left, right), (bottom, top) = (
        (low + some[0], low + some[-1] + 1)
        for low, some in (
            (int(first), np.flatnonzero(filled > RAGGED * filled.max()))
            for first, filled in ((box.left, mask.mean(axis=0)), (box.bottom, mask.mean(axis=1)))
        )
    )
    return CellBox(max(left, box.left), max(bottom, box.bottom), min(right, box.right), min(top, box.top))


def _holds(box: CellBox, other: CellBox) -> bool:
    x, y = other.middle
    return box.left <= x < box.right and box.bottom <= y < box.top
