"""Patches of one colour in a plane's image, and the blobs in them that may be handles."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.annotate.propose.cells import CellBox, hull
from s2a.annotate.propose.config import ProposeConfig
from s2a.annotate.propose.layers import Layer, smooth
from s2a.annotate.surface import connected

HOLES = 2
"""Cells of a gap in what was scanned that does not divide a patch."""
ENDS = 0.02
"""Fraction of a patch's cells beyond each side of its rectangle."""
BORDER = 0.012
"""[m] What differs this near to a patch's border is the border."""
MIN_BLOB = 1.5e-4
"""[m^2] Smaller blobs are noise."""
MIN_PAINTED, PAINTED = 0.05, 1.8
"""[m] and multiple of its width: length from which on what is in the colours alone may be a handle."""
MAX_RELIEF = 0.08
"""[m] What stands out by more is an object, or a wall."""
FAINT = 0.5
"""Of the contrast of a patch's clearest handle: lines and shadows have less."""
PATTERN = 25
"""Blobs in one patch from which on they are ribs, slots or print."""
THIN = 0.011
"""[m] A line of one cell is a gap between two fronts."""
RING, AROUND = 3, 0.6
"""Cells around a blob, and the fraction of them that are plain front, from which on it is a handle on it."""
ALIKE = 3.0
"""Ratio of the lengths of two handles of one piece of furniture, at most."""
JOINED, BAR = 0.07, 1.6
"""[m] Gap between two blobs on a line that are one handle, and length over width of one of them at least."""


@dataclass(frozen=True, eq=False)
class ColorPatch:
    """A rectangle of one colour, with what may be handles in it.

    Attributes:
        box: the rectangle.
        color: RGB, shape [3].
        blobs: rectangles around what may be handles.
        relief: height by which each blob stands out [m].
    """

    box: CellBox
    color: np.ndarray
    blobs: tuple[CellBox, ...]
    relief: tuple[float, ...]


def patches(layer: Layer, config: ProposeConfig) -> Iterator[ColorPatch]:
    """Yield the patches of a plane that are rectangles, and small enough not to be a wall."""
    labels, count = _labels(layer, config)
    for number, where in enumerate(ndimage.find_objects(labels), start=1):
        if where is None:
            continue
        mask = labels[where] == number
        if mask.sum() * config.cell**2 < np.prod(config.min_front):
            continue
        box = _box(mask, where)
        sides = np.array([box.width, box.height]) * config.cell
        if (sides < config.min_front).any() or (sides > config.max_patch).any():
            continue
        whole = ndimage.binary_closing(np.pad(mask, 6), np.ones((9, 9)))[6:-6, 6:-6]
        if ndimage.binary_fill_holes(whole).sum() < config.min_fill * box.width * box.height:
            continue
        color = np.nanmedian(layer.color[where][mask], axis=0)
        blobs = _alike(list(_blobs(layer, box, color, config)))
        yield ColorPatch(box, color, tuple(b for b, _ in blobs), tuple(r for _, r in blobs))


def _surrounded(piece: CellBox, plain: np.ndarray) -> float:
    """Return the fraction of the cells around a blob that are plain front: books and moulding have other neighbours."""
    ring = np.zeros_like(plain)
    for by, value in ((RING, True), (1, False)):
        rows = slice(max(int(piece.bottom) - by, 0), int(piece.top) + by)
        ring[rows, max(int(piece.left) - by, 0) : int(piece.right) + by] = value
    return float(plain[ring].mean()) if ring.any() else 0.0


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


def _blobs(layer: Layer, box: CellBox, color: np.ndarray, config: ProposeConfig) -> Iterator[tuple[CellBox, float]]:
    """Yield what stands out of a patch, or has another colour, and has the size of a handle; and how far it stands out [m]."""
    edge = int(round(BORDER / config.cell))
    rows = slice(int(box.bottom) + edge, int(box.top) - edge)
    columns = slice(int(box.left) + edge, int(box.right) - edge)
    if rows.stop - rows.start < 3 or columns.stop - columns.start < 3:
        return
    seen = ~np.isnan(layer.height[rows, columns])
    local = layer.relief[rows, columns]
    odd = np.where(
        np.linalg.norm(layer.color[rows, columns] - color, axis=-1) < config.contrast, 0.0, layer.odd[rows, columns]
    )
    odd = np.zeros_like(odd) if layer.sharp else odd
    out = local > config.relief * (1 if layer.sharp else 2)
    marked = out | (odd > config.contrast)
    labels, _ = ndimage.label(ndimage.binary_closing(np.pad(marked, 2), np.ones((3, 3)))[2:-2, 2:-2], np.ones((3, 3)))
    pieces, found = [], []
    for number, where in enumerate(ndimage.find_objects(labels), start=1):
        if (labels[where] == number).sum() * config.cell**2 >= MIN_BLOB:
            pieces.append(CellBox(where[1].start, where[0].start, where[1].stop, where[0].stop))
    if len(pieces) > PATTERN:
        return
    for piece in _joined(pieces, JOINED / config.cell, np.array(config.max_handle) / config.cell):
        long, short = sorted((piece.height * config.cell, piece.width * config.cell), reverse=True)
        inside = np.s_[int(piece.bottom) : int(piece.top), int(piece.left) : int(piece.right)]
        if long > config.max_handle[0] or short > config.max_handle[1]:
            continue
        strength = float(np.quantile(odd[inside][marked[inside]], 0.9))
        if not out[inside].any() and not _painted(long, short, strength, config.contrast):
            continue
        if _surrounded(piece, seen & ~marked) < AROUND:
            continue
        relief = float(np.quantile(local[inside][marked[inside]], 0.9))
        if relief > MAX_RELIEF:
            continue
        left, bottom = columns.start + piece.left, rows.start + piece.bottom
        found.append((CellBox(left, bottom, left + piece.width, bottom + piece.height), relief, strength))
    clearest = max((strength for _, _, strength in found), default=0.0)
    for blob, relief, strength in found:
        if strength >= FAINT * clearest or relief > config.relief * 2:
            yield blob, relief


def _painted(long: float, short: float, odd: float, contrast: float) -> bool:
    """Return whether a blob that is in the colours alone may be a bar, or a knob that is seen well; a line is a gap."""
    if long >= MIN_PAINTED and long > PAINTED * short and short > THIN:
        return odd > contrast
    return bool(THIN < short <= long < MIN_PAINTED and odd > 2 * contrast)


def _joined(pieces: list[CellBox], gap: float, largest: np.ndarray) -> list[CellBox]:
    """Return boxes, those on one line as one: a scan shows a bar in pieces. Two knobs beside each other are two."""
    found = list(pieces)
    while True:
        pairs = [
            (apart, a, b)
            for i, a in enumerate(found)
            for b in found[i + 1 :]
            if (apart := _apart(a, b)) <= gap and (sorted(hull((a, b)).sides, reverse=True) <= largest).all()
        ]
        if not pairs:
            return found
        _, a, b = min(pairs, key=lambda pair: pair[0])
        found = [piece for piece in found if piece is not a and piece is not b] + [hull((a, b))]


def _apart(a: CellBox, b: CellBox) -> float:
    """Return the gap between two pieces of one bar, infinite where they lie on no line of one of them [cells]."""
    level = min(a.top, b.top) - max(a.bottom, b.bottom)
    upright = min(a.right, b.right) - max(a.left, b.left)
    if level > 0 and upright > 0:
        return 0.0
    if level > 0 and max(a.width / a.height, b.width / b.height) >= BAR:
        return -upright
    if upright > 0 and max(a.height / a.width, b.height / b.width) >= BAR:
        return -level
    return np.inf
