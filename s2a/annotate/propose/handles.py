"""What may be handles on a patch of a plane's image: what stands out of it, or has another colour.

A laser shows handles by their shape. A phone smears them over a centimetre and more, so that relief and colour count together;
there the gaps between fronts, whose colour is another too, and what runs over from beyond a patch's border are told apart.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.annotate.propose.cells import CellBox, hull
from s2a.annotate.propose.config import ProposeConfig
from s2a.annotate.propose.layers import Layer

BORDER = 0.012
"""[m] What differs this near to a patch's border is the border."""
MIN_BLOB = 1.5e-4
"""[m^2] Smaller blobs are noise."""
MAX_RELIEF = 0.08
"""[m] What stands out by more is an object, or a wall."""
FAINT = 0.5
"""Of the contrast of a patch's clearest handle: shadows have less."""
PATTERN = 25
"""Blobs in one patch from which on they are ribs, slots or print."""
RING, AROUND = 3, 0.6
"""Cells around a blob, and the fraction of them that are plain front, from which on it is a handle on it."""
JOINED, BAR = {True: 0.07, False: 0.06}, 1.6
"""[m] Gap between two blobs on a line that are one handle, in a sharp scan or not; length over width of one of them at least."""
SMEARED_RELIEF = 0.008
"""[m] Relief that counts as much as `contrast` where a scan smears handles; its planes wave by 3 mm."""
GRAIN = 8.0
"""Contrast counts from this multiple of a patch's median on: wood has a grain."""
SURE = 2.5
"""Multiple of the least relief and contrast, together, that a handle reaches somewhere where a scan smears it."""
THIN, ALONG, DASHED = 3, 12, 0.35
"""A gap between fronts is up to so many cells wide, and goes on for so many cells on both sides, so much of which shows."""
BEYOND, OUTSIDE = 3, 0.25
"""Cells beyond a blob, and the fraction of them out of the patch from which on it lies at the border."""
SAME, AS_STRONG, SHARE = 0.85, 0.7, 0.5
"""Cosine of two differences of colour, and ratio of their lengths, from which on one is of the other; and the share of cells."""
TINT = 0.3
"""Cosine between the differences of colour of two handles of one piece of furniture."""
SQUARE = np.ones((3, 3), bool)


@dataclass(frozen=True, eq=False)
class Mark:
    """A blob that may be a handle.

    Attributes:
        box: the rectangle around it.
        cells: how many of its cells differ from the patch.
        relief: height by which it stands out [m].
        strength: difference of its colour from what is around it, Euclidean in RGB.
        tint: its colour less that of the patch, RGB, shape [3].
    """

    box: CellBox
    cells: int
    relief: float
    strength: float
    tint: np.ndarray


def handles(
    layer: Layer, box: CellBox, color: np.ndarray, within: np.ndarray, config: ProposeConfig
) -> list[tuple[CellBox, float]]:
    """Return rectangles around what may be handles, and how far each stands out [m].

    Args:
        layer: the plane's image.
        box: rectangle around the patch.
        color: RGB of the patch, shape [3].
        within: cells that the patch fills, shape [row column].
        config: what is a handle.
    """
    edge = int(round(BORDER / config.cell))
    view = np.s_[int(box.bottom) + edge : int(box.top) - edge, int(box.left) + edge : int(box.right) - edge]
    if min(layer.relief[view].shape) < 3:
        return []
    inner = ndimage.binary_erosion(within, SQUARE)
    score = layer.relief / config.relief if layer.sharp else _score(layer, view, config)
    found = list(_marks(layer, view, score, inner, color, config))
    if layer.sharp:
        return [(mark.box, mark.relief) for mark in found]
    gone = [mark for mark in found if _is_gap(mark.box, score[view], view) or _smeared(layer, mark, inner, color)]
    clear = _of_one_tint([mark for mark in found if mark not in gone])
    clearest = max((mark.strength for mark in clear), default=0.0)
    strong = 2 * config.relief
    return [(m.box, m.relief) for m in clear if m.strength >= FAINT * clearest or m.relief > strong]


def _score(layer: Layer, view: tuple[slice, slice], config: ProposeConfig) -> np.ndarray:
    """Return how much the cells of a patch differ by relief and colour together, 1 from where it counts, shape [row column]."""
    seen = ndimage.binary_closing(np.pad(~np.isnan(layer.height[view]), 4, mode="edge"), SQUARE)[4:-4, 4:-4]
    contrast = max(GRAIN * float(np.median(layer.odd[view])), config.contrast)
    score = np.zeros_like(layer.odd)
    both = np.hypot(layer.odd[view] / contrast, np.maximum(layer.relief[view], 0.0) / SMEARED_RELIEF)
    score[view] = np.where(ndimage.binary_erosion(seen, SQUARE, border_value=1), both, 0.0)
    return score


def _marks(
    layer: Layer,
    view: tuple[slice, slice],
    score: np.ndarray,
    inner: np.ndarray,
    color: np.ndarray,
    config: ProposeConfig,
) -> Iterator[Mark]:
    """Yield blobs of the size of a handle with plain front around them."""
    marked = np.zeros(score.shape, bool)
    marked[view] = score[view] > 1.0 if layer.sharp else ndimage.binary_opening(score[view] > 1.0, np.ones((2, 2)))
    labels, _ = ndimage.label(ndimage.binary_closing(marked, SQUARE) & inner, SQUARE)
    least = 1.0 if layer.sharp else SURE
    pieces = []
    for number, where in enumerate(ndimage.find_objects(labels), start=1):
        mine = labels[where] == number
        strong = (score[where][mine] > least).any() and marked[where][mine].any()
        if mine.sum() * config.cell**2 >= MIN_BLOB and strong:
            pieces.append(CellBox(where[1].start, where[0].start, where[1].stop, where[0].stop))
    if len(pieces) > PATTERN:
        return
    largest = np.array(config.max_handle) / config.cell
    plain = ~np.isnan(layer.height) & ~marked
    for piece in _joined(pieces, JOINED[layer.sharp] / config.cell, largest):
        inside = piece.cells
        if (sorted(piece.sides, reverse=True) > largest).any() or _surrounded(piece, plain[view], view) < AROUND:
            continue
        mark = marked[inside]
        relief, odd = (float(np.quantile(of[inside][mark], 0.9)) for of in (layer.relief, layer.odd))
        if relief <= MAX_RELIEF:
            known = layer.color[inside][mark & ~np.isnan(layer.height[inside])]
            tint = np.median(known, axis=0) - color if len(known) else np.zeros(3)
            yield Mark(piece, int(mark.sum()), relief, odd, tint)


def _surrounded(piece: CellBox, plain: np.ndarray, view: tuple[slice, slice]) -> float:
    """Return the fraction of the cells around a blob that are plain front: books and moulding have other neighbours."""
    ring = np.zeros_like(plain)
    for by, value in ((RING, True), (1, False)):
        low = max(int(piece.bottom) - view[0].start - by, 0), max(int(piece.left) - view[1].start - by, 0)
        high = int(piece.top) - view[0].start + by, int(piece.right) - view[1].start + by
        ring[low[0] : high[0], low[1] : high[1]] = value
    return float(plain[ring].mean()) if ring.any() else 0.0


def _is_gap(piece: CellBox, score: np.ndarray, view: tuple[slice, slice]) -> bool:
    """Return whether a blob is thin, and goes on on both sides: a gap between fronts, which a scan shows in dashes."""
    bottom, left = piece.bottom - view[0].start, piece.left - view[1].start
    for image, low, length, across, width in (
        (score, left, piece.width, bottom, piece.height),
        (score.T, bottom, piece.height, left, piece.width),
    ):
        if width > THIN:
            continue
        line = image[int(across) : int(across + width)].max(axis=0)
        ends = line[max(int(low) - ALONG, 0) : max(int(low) - 1, 0)], line[int(low + length) + 1 :][: ALONG - 1]
        if all(len(end) >= THIN and (end > 0.5).mean() > DASHED for end in ends):
            return True
    return False


def _smeared(layer: Layer, mark: Mark, inner: np.ndarray, color: np.ndarray) -> bool:
    """Return whether a blob at a patch's border has the colour of what lies beyond it, which a scan smears over the border."""
    blob = np.zeros(inner.shape, bool)
    blob[mark.box.cells] = True
    around = ndimage.binary_dilation(blob, SQUARE, iterations=BEYOND) & ~blob
    outside = around & ~inner
    beyond = layer.color[outside & ~np.isnan(layer.height)] - color
    if not len(beyond) or outside.sum() < OUTSIDE * around.sum():
        return False
    far, size = np.linalg.norm(beyond, axis=1), float(np.linalg.norm(mark.tint))
    return bool(((beyond @ mark.tint > SAME * far * size) & (far > AS_STRONG * size)).mean() > SHARE)


def _of_one_tint(marks: list[Mark]) -> list[Mark]:
    """Return the marks of the tint that most of their cells have: handles are alike, and what is left of gaps is not."""
    groups = [[m for m in marks if m.tint @ one.tint > TINT * _length(m) * _length(one)] for one in marks]
    return max(groups, key=lambda group: sum(m.cells for m in group), default=[])


def _length(mark: Mark) -> float:
    return float(np.linalg.norm(mark.tint))


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
