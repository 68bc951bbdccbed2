"""From what the network sees of a plane to fronts: rectangles, how they open, and their handles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.annotate.propose.cells import CellBox
from s2a.annotate.propose.config import ProposeConfig
from s2a.annotate.propose.layers import Layer
from s2a.annotate.propose.network import COARSE, MOTIONS, FrontNetwork, Motion, image

SEEN = 0.5
"""Probability from which on a cell is a front's, or a handle's."""
AGREES = 0.5
"""Intersection over union of two cells' rectangles from which on they are of one front."""
NEAR = 0.05
"""[m] A cell's word on a side counts half as much at this distance as beside it: what is near is seen well."""


@dataclass(frozen=True, eq=False)
class SeenFront:
    """A front on a plane's image.

    Attributes:
        box: its rectangle.
        motion: how it opens, of MOTIONS.
        score: probability, 0 to 1, times the fraction of its cells that agree about the rectangle.
        handle: rectangle around its handle; None where none is seen.
    """

    box: CellBox
    motion: Motion
    score: float
    handle: CellBox | None


def fronts(layer: Layer, floor: float, network: FrontNetwork, config: ProposeConfig) -> Iterator[SeenFront]:
    """Yield the fronts that a network sees on a plane, with a score of `min_score` or more."""
    probability, sides, motion, handle = network.see(image(layer, floor))
    rows, columns = np.nonzero(probability > SEEN)
    p = probability[rows, columns]
    away = sides[:, rows, columns] / config.cell
    middle = COARSE * (np.stack([columns, rows]) + 0.5)
    boxes = np.concatenate([middle - away[:2], middle + away[2:]])
    sure = p * np.sqrt(_balance(away[0], away[2]) * _balance(away[1], away[3]))
    left = np.ones(len(p), bool)
    while left.any():
        best = np.argmax(np.where(left, sure, -1.0))
        group = left & (_overlap(boxes, boxes[:, best]) > AGREES)
        weight = p[group] / (away[:, group] * config.cell + NEAR)
        box = (boxes[:, group] * weight).sum(axis=1) / weight.sum(axis=1)
        within = (middle > box[:2, None]).all(axis=0) & (middle < box[2:, None]).all(axis=0)
        agree = within & (_overlap(boxes, box) > AGREES)
        score = float(p[agree].sum() / (box[2:] - box[:2]).prod() * COARSE**2)
        opens = MOTIONS[int(np.argmax(motion[:, rows[group], columns[group]].mean(axis=1)))]
        left &= ~group
        left[best] = False  # also where its rectangle has no area
        if score < config.min_score:
            continue
        left &= ~within  # those that are wrong about their rectangle
        found = CellBox(*map(float, box))
        held = _handle(handle, found)
        yield SeenFront(found, _opposite(opens, found, held), score, held)


def _opposite(motion: Motion, box: CellBox, handle: CellBox | None) -> Motion:
    """Return a motion, that of a door as its handle says, which is seen more surely than its hinge."""
    if handle is None or motion not in (("hinge", "left"), ("hinge", "right")):
        return motion
    return ("hinge", "left") if handle.middle[0] > box.middle[0] else ("hinge", "right")


def _balance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return 1 for cells in the middle between two sides, 0 at one of them."""
    return np.asarray(np.minimum(one, other) / np.maximum(np.maximum(one, other), 1e-6))


def _overlap(boxes: np.ndarray, one: np.ndarray) -> np.ndarray:
    """Return the intersection over union of rectangles (left, bottom, right, top), shape [4 box], with one."""
    one = one[:, None]
    shared = (np.minimum(boxes[2:], one[2:]) - np.maximum(boxes[:2], one[:2])).clip(min=0.0).prod(axis=0)
    both = (boxes[2:] - boxes[:2]).prod(axis=0) + (one[2:] - one[:2]).prod(axis=0) - shared
    return np.asarray(shared / np.maximum(both, 1e-9))


def _handle(probability: np.ndarray, box: CellBox) -> CellBox | None:
    """Return the rectangle around the blob that is most of a handle."""
    area = np.zeros_like(probability)
    cells = tuple(slice(max(one.start, 0), one.stop) for one in box.cells)
    area[cells] = probability[cells]
    labels, count = ndimage.label(ndimage.binary_closing(area > SEEN, np.ones((3, 3))))
    if not count:
        return None
    best = 1 + int(np.argmax(ndimage.sum_labels(area, labels, np.arange(1, count + 1))))
    rows, columns = ndimage.find_objects(labels)[best - 1]
    return CellBox(columns.start, rows.start, columns.stop, rows.stop)
