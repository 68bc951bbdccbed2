"""Patches of one colour in a plane's image."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.annotate.propose.cells import CellBox
from s2a.annotate.propose.config import ProposeConfig
from s2a.annotate.propose.handles import handles
from s2a.annotate.propose.layers import Layer, smooth
from s2a.annotate.surface import connected

HOLES = 2
"""Cells of a gap in what was scanned that does not divide a patch."""
ENDS = 0.02
"""Fraction of a patch's cells beyond each side of its rectangle."""
PIECE = 0.5
"""Fraction of its rectangle that a patch covers at least: an L of fronts covers less than one front."""
NOTCH = 45
"""Cells: a handle at a patch's border cuts out less."""
ALIKE = 3.0
"""Ratio of the lengths of two handles of one piece of furniture, at most."""


@dataclass(frozen=True, eq=False)
class ColorPatch:
    """A surface of one colour, with what may be handles in it.

    Attributes:
        box: the rectangle around it.
        within: cells of the plane's image that it fills, shape [row column].
        blobs: rectangles around what may be handles.
        relief: height by which each blob stands out [m].
    """

    box: CellBox
    within: np.ndarray
    blobs: tuple[CellBox, ...]
    relief: tuple[float, ...]


def patches(layer: Layer, config: ProposeConfig) -> Iterator[ColorPatch]:
    """Yield the patches of a plane that fill most of a rectangle, and are small enough not to be a wall."""
    labels, _ = _labels(layer, config)
    for number, where in enumerate(ndimage.find_objects(labels), start=1):
        if where is None:
            continue
        mask = labels[where] == number
        if mask.sum() * config.cell**2 < np.prod(config.min_front):
            continue
        box = _box(mask, where)
        sides = np.array(box.sides) * config.cell
        if (sides < config.min_front).any() or (sides > config.max_patch).any():
            continue
        filled = ndimage.binary_fill_holes(ndimage.binary_closing(np.pad(mask, 6), np.ones((9, 9)))[6:-6, 6:-6])
        if filled.sum() < PIECE * box.width * box.height:
            continue
        within = np.zeros(labels.shape, bool)
        within[where] = _mended(filled)
        color = np.nanmedian(layer.color[where][mask], axis=0)
        blobs = _alike(handles(layer, box, color, within, config))
        yield ColorPatch(box, within, tuple(b for b, _ in blobs), tuple(r for _, r in blobs))


def _mended(filled: np.ndarray) -> np.ndarray:
    """Return a patch with what handles at its border cut out of it; the corner that an L lacks is no such notch."""
    padded = np.pad(filled, NOTCH)
    level, upright = (ndimage.binary_closing(padded, np.ones(shape)) for shape in ((1, NOTCH), (NOTCH, 1)))
    return np.asarray((level | upright)[NOTCH:-NOTCH, NOTCH:-NOTCH])


def _alike(blobs: list[tuple[CellBox, float]]) -> list[tuple[CellBox, float]]:
    """Return the blobs of a patch with about the length of most: one piece of furniture has one kind of handle."""
    if len(blobs) < 3:
        return blobs
    lengths = np.array([max(blob.width, blob.height) for blob, _ in blobs])
    usual = float(np.median(lengths))
    good = (lengths < ALIKE * usual) & (lengths > usual / ALIKE)
    return [blob for blob, same in zip(blobs, good, strict=True) if same]


def _labels(layer: Layer, config: ProposeConfig) -> tuple[np.ndarray, int]:
    """Return the number of the patch of each cell from 1 on, 0 for none, and how many there are."""
    seen = ~np.isnan(layer.height)
    color = np.stack([smooth(layer.color[..., k], seen) for k in range(3)], axis=-1)
    filled = ndimage.binary_closing(seen, np.ones((2 * HOLES + 1,) * 2)) & ~np.isnan(color[..., 0])
    index = np.full(seen.shape, -1)
    index[filled] = np.arange(filled.sum())
    pairs = []
    for one, other in ((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:])):
        near = np.linalg.norm(color[one] - color[other], axis=-1) < config.color
        good = filled[one] & filled[other] & near
        pairs.append(np.stack([index[one][good], index[other][good]], axis=1))
    number = connected(np.concatenate(pairs), int(filled.sum()))
    labels = np.zeros(seen.shape, int)
    labels[filled] = number + 1
    _part_colors(labels, color, config)
    return labels, int(labels.max(initial=0))


def _part_colors(labels: np.ndarray, color: np.ndarray, config: ProposeConfig) -> None:
    """Make patches of their own, in place, of the parts of patches whose colour is another: colours run into each other."""
    least = float(np.prod(config.min_front)) / config.cell**2
    count = int(labels.max(initial=0))
    for number, where in enumerate(ndimage.find_objects(labels), start=1):
        mask = labels[where] == number
        if mask.sum() < 2 * least:
            continue
        off = np.linalg.norm(color[where] - np.median(color[where][mask], axis=0), axis=-1) > 2 * config.color
        parts, found = ndimage.label(ndimage.binary_opening(mask & off, np.ones((3, 3))))
        for part in range(1, found + 1):
            if (parts == part).sum() >= least:
                count += 1
                labels[where][parts == part] = count


def _box(mask: np.ndarray, where: tuple[slice, ...]) -> CellBox:
    """Return the rectangle of a patch but for ragged ends."""
    ends = []
    for axis in (1, 0):
        total = np.cumsum(mask.sum(axis=1 - axis))
        first = np.searchsorted(total, ENDS / 2 * total[-1])
        last = np.searchsorted(total, (1 - ENDS / 2) * total[-1]) + 1
        ends.append((where[axis].start + float(first), where[axis].start + float(last)))
    return CellBox(ends[0][0], ends[1][0], ends[0][1], ends[1][1])
