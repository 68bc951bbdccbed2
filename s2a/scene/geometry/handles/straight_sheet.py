"""Bent sheets that are the same all along their length (edge pulls): a lip before the front, and the wall that carries it.

Noise that neighbouring points share averages out along a straight handle only if it is fitted as a whole: its lip and its wall
are planes, each through the middle of what a scan shows of it, where patches follow every swell, and bridge the corner inside.
"""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.convex import hull
from s2a.scene.geometry.mesh_ops import normals, sample_with_faces
from s2a.scene.scene import Mesh

SAMPLES = 20000
"""Points sampled on a sheet."""
SHEET = 0.002
"""[m] Thickness of a sheet; a scan shows its outer face alone."""
FLAT = 0.8
"""Cosine of the largest angle between a face of the lip or of the wall and the direction in which it looks."""
OPEN = 0.5
"""Cosine to its other side of faces that are no lip's."""
HEAD = 0.006
"""[m] Depth from the outermost point within which a lip lies."""
CORNER = 0.003
"""[m] So near to an edge a scan rounds it off."""
BINS = 12
"""Pieces along a sheet whose medians are compared."""
MIN_POINTS = 20
"""A piece with fewer points says nothing."""
KNOWN = 0.7
"""Fraction of the pieces that show a straight lip or wall at least."""
LIKE = 0.002
"""[m] How far a straight sheet may seem to swell: noise is shared by neighbouring points."""
ALONG = 0.9
"""Fraction of a sheet's length along which its lip is straight; of a cup's, which is a bowl, a part."""
STEP = 0.001
"""[m] Places across a lip at which its depth is asked."""
DRAWN = 0.0015
"""[m] Where a lip lies so much deeper than its plane it has ended, and a skirt goes on into its shadow."""
LEAN = 0.35
"""Largest slope of a wall against the front's normal; a steeper one is none."""


def straight_sheet(
    region: Mesh, frame: np.ndarray, opening: np.ndarray, front: float, border: float | None
) -> list[Mesh] | None:
    """Return the lip and the wall of a straight sheet, or None if it is not the same all along.

    Args:
        region: the handle as scanned; its faces look outwards.
        frame: axes as columns [3 3]: x along it, z into the furniture, along the front's normal.
        opening: direction across it towards which it is open [3].
        front: coordinate of the front along z [m].
        border: where its wall ends on the other side, coordinate along `opening` [m]; None: where the scan shows it.
    """
    axes = np.stack([frame[:, 0], opening, frame[:, 2]], axis=1)
    points, faces = sample_with_faces(region, SAMPLES, seed=0)
    if not len(points):
        return None
    local, facing = points @ axes, (normals(region) @ axes)[faces]
    face = float(np.quantile(local[facing[:, 2] < -FLAT, 2], 0.1)) if (facing[:, 2] < -FLAT).any() else np.inf
    on_lip = (facing[:, 2] < -FLAT) & (local[:, 2] < face + HEAD / 2)
    lip = _line(local[on_lip, 0], local[on_lip, 2])
    if lip is None:
        return None
    deep = local[:, 2] - np.polyval(lip, local[:, 0])
    if border is None:
        beside = (facing[:, 1] < -FLAT) & (deep > CORNER) & (local[:, 2] < front)
        wall = _wall(local[beside], deep[beside])
    else:
        wall = np.array([0.0, 0.0, border])
    if wall is None:
        return None
    ends = np.quantile(local[on_lip, 0], [0.005, 0.995])
    if np.ptp(ends) < ALONG * np.ptp(np.quantile(local[:, 0], [0.005, 0.995])):
        return None
    begin = wall[2] + wall[0] * ends.mean() + CORNER
    before = facing[:, 1] > -OPEN
    edge = lip_end(local[before, 1], deep[before], begin)
    return _pieces(axes, ends, lip, wall, edge, front)


def lip_end(across: np.ndarray, deep: np.ndarray, begin: float) -> float:
    """Return where a lip ends [m]: from its outermost place on, where it falls back behind its plane; beyond is a skirt.

    Args:
        across: coordinate of points towards the opening [m], shape [point].
        deep: how far they are behind the lip's plane [m], shape [point].
        begin: a place on the lip [m].
    """
    near = across > begin
    last = float(np.quantile(across[near], 0.99)) if near.any() else begin
    places = np.arange(begin, last, STEP)
    shown = [np.abs(across - place) < STEP for place in places]
    depths = np.array([np.median(deep[here]) if here.sum() >= MIN_POINTS else np.inf for here in shown])
    if not np.isfinite(depths).any():
        return last
    first = int(np.argmin(depths))
    ended = np.flatnonzero(depths[first:] > DRAWN)
    return float(places[first + ended[0]]) if len(ended) else last


def _line(along: np.ndarray, values: np.ndarray) -> np.ndarray | None:
    """Return the line (slope, offset) through values [m] over places along a sheet [m]; None if most do not lie on one."""
    if len(along) < BINS * MIN_POINTS:
        return None
    start, end = np.quantile(along, [0.005, 0.995])
    edges = np.linspace(start, end, BINS + 1)
    piece = np.clip(np.searchsorted(edges, along) - 1, 0, BINS - 1)
    known = np.array([k for k in range(BINS) if (piece == k).sum() >= MIN_POINTS])
    if len(known) < KNOWN * BINS:
        return None
    places, medians = np.array([(np.median(along[piece == k]), np.median(values[piece == k])) for k in known]).T
    line = np.polyfit(places, medians, 1)
    return line if (np.abs(np.polyval(line, places) - medians) < LIKE).mean() > KNOWN else None


def _wall(points: np.ndarray, deep: np.ndarray) -> np.ndarray | None:
    """Return the wall's outer side through points [point 3], so `deep` behind the lip, as a + b x + c deep: (b, c, a)."""
    line = _line(points[:, 0], points[:, 1])
    if line is None:
        return None
    rest = points[:, 1] - np.polyval(line, points[:, 0])
    lean = _line(deep, rest)
    if lean is None or abs(lean[0]) > LEAN:
        lean = np.array([0.0, float(np.median(rest))])
    return np.array([line[0], lean[0], line[1] + lean[1]])


def _pieces(
    axes: np.ndarray, ends: np.ndarray, lip: np.ndarray, wall: np.ndarray, edge: float, front: float
) -> list[Mesh]:
    """Return lip and wall as convex hulls."""
    lips, walls = [], []
    for x in ends:
        face = float(np.polyval(lip, x))
        side = wall[0] * x + wall[2]
        lips += [(x, y, z) for y in (side, edge) for z in (face, face + SHEET)]
        foot = side + wall[1] * (front - face)
        walls += [(x, y, face) for y in (side, side + SHEET)] + [(x, y, front) for y in (foot, foot + SHEET)]
    pieces = [hull(np.array(corners) @ axes.T) for corners in (lips, walls)]
    return [piece for piece in pieces if piece is not None]
