"""A bar and its posts as convex hulls, which leave the finger gap behind them free."""

from __future__ import annotations

import numpy as np
from scipy.spatial import HalfspaceIntersection, QhullError

from s2a.scene.geometry.convex import hull
from s2a.scene.geometry.handles.bar import (
    GAP,
    HEAD,
    LIKE,
    MARGIN,
    MIN_POINTS,
    SAMPLES,
    SHALLOWEST,
    SPAN,
    UNEVEN,
    Profile,
    bar_depth,
)
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.scene import Mesh

MAX_POST_LENGTH = 0.3
"""Largest length of a post in the middle, as a fraction of the bar's length; a longer one is a web."""
SIDES = 16
"""Of a prism that stands for a piece of a bar."""
TAIL = 0.03
"""Fraction of the points that may be outside of it in each direction."""


def bar_hulls(
    region: Mesh, frame: np.ndarray, profile: Profile, front: float, ground: float | None = None
) -> list[Mesh] | None:
    """Return a bar as convex hulls along its length, or None if it stands too near the front for fingers.

    The bar ends where its sides do, and leaves fingers their space; posts join it to the front.
    Neighbouring slices of like section become one piece.

    Args:
        region: the handle as scanned.
        frame: the profile's axes as columns [3 3].
        profile: its section.
        front: coordinate of the front along z [m].
        ground: that of what the posts stand on [m], where it is not the front: a base plate.
    """
    if front - np.median(profile.face) < SHALLOWEST + 0.6 * GAP:
        return None
    points = sample(region, SAMPLES, seed=0) @ frame
    depth = bar_depth(points, profile, front)
    sections = [_section(points, profile, k, depth) for k in range(len(profile.low))]
    supports = np.array([_support(*section) for section in sections])
    pieces = []
    for first, last in _alike(supports):
        support = np.median(supports[first:last], axis=0)
        pieces.append(_prism(support, sections[first][1].mean(axis=0), profile.edges[first], profile.edges[last]))
    if ground is None or ground < np.median(profile.face) + depth:
        ground = front
    pieces += _posts(points, profile, depth, ground)
    return [Mesh(piece.vertices @ frame.T, piece.faces) for piece in pieces if piece is not None]


def _posts(points: np.ndarray, profile: Profile, depth: float, ground: float) -> list[Mesh | None]:
    """Return the posts between a bar and what it stands on: where its surface reaches that, and not as a skirt.

    A post is about as wide as the bar, a skirt hangs from one of its edges inwards. In the middle of a bar a post is short.
    What is seen of one side of a post counts for both: it is symmetric about the bar's middle.
    """
    slices = np.clip(np.searchsorted(profile.edges, points[:, 0]) - 1, 0, len(profile.low) - 1)
    middle = (profile.low + profile.high)[slices] / 2
    out = np.abs(points[:, 1] - middle)
    deep = (points[:, 2] > profile.face[slices] + depth + MARGIN) & (out < profile.thickness / 2 + MARGIN)
    reaches = np.zeros(len(profile.low) + 2, int)
    for k in range(len(profile.low)):
        here = deep & (slices == k)
        reaches[k + 1] = here.sum() >= MIN_POINTS and points[here, 2].max() > ground - HEAD
    posts: list[Mesh | None] = []
    for first, last in _short(np.flatnonzero(np.diff(reaches)).reshape(-1, 2).tolist(), len(profile.low)):
        here = deep & (slices >= first) & (slices < last)
        if _is_post(out[here], points[here, 1], profile, first, last):
            low, high = np.median(profile.low[first:last]), np.median(profile.high[first:last])
            spare = max(0.0, (high - low) / 2 - float(np.quantile(out[here], 0.9)))
            low, high = low + spare, high - spare
            back = float(np.median(profile.face[first:last])) + min(HEAD, depth)
            corners = np.array([[low, back], [high, back], [low, ground], [high, ground]])
            ends = np.quantile(points[here, 0], [TAIL, 1 - TAIL])
            posts.append(hull(np.concatenate([np.insert(corners, 0, x, axis=1) for x in ends])))
    return posts


def _short(runs: list[list[int]], count: int) -> list[tuple[int, int]]:
    """Return runs (first, last + 1) of slices, those longer than a middle post without what lies in the middle."""
    start, end = round((1 - SPAN) / 2 * count), round((1 + SPAN) / 2 * count)
    found = []
    for first, last in runs:
        is_web = last - first > MAX_POST_LENGTH * count and first < end and last > start
        found += [(first, min(last, start)), (max(first, end), last)] if is_web else [(first, last)]
    return [(first, last) for first, last in found if first < last]


def _is_post(out: np.ndarray, across: np.ndarray, profile: Profile, first: int, last: int) -> bool:
    """Return True if points behind slices first to last - 1, so far `out` of the bar's middle and `across` it [m], are a post."""
    if len(out) < MIN_POINTS:
        return False
    at_edge = np.quantile(out, 0.9) > 0.35 * profile.thickness
    count = len(profile.low)
    in_middle = last > (1 - SPAN) / 2 * count and first < (1 + SPAN) / 2 * count and first > 0 and last < count
    wide = np.ptp(np.quantile(across, [0.05, 0.95])) > 0.6 * profile.thickness
    return bool(at_edge and (wide or not in_middle))


def _section(points: np.ndarray, profile: Profile, k: int, depth: float) -> tuple[np.ndarray, np.ndarray]:
    """Return what a scan shows of a bar in one slice, without skirts, and its inner corners; both as points (y, z) [m]."""
    first, last = profile.edges[k : k + 2]
    low, high, face = profile.low[k], profile.high[k], profile.face[k]
    here = points[(points[:, 0] >= first) & (points[:, 0] < last)][:, 1:]
    here = here[(here[:, 0] > low - UNEVEN) & (here[:, 0] < high + UNEVEN)]
    back, head = face + depth, face + min(HEAD, depth)
    return here[here[:, 1] < back], np.array([[low, back], [high, back], [low, head], [high, head]])


def _support(section: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Return how far points (y, z) reach in each of SIDES directions [m], without the outermost fraction TAIL.

    Noise stands out; a plain hull would be as thick as its worst points. Corners count in full.
    """
    directions = _directions().T
    reach = (corners @ directions).max(axis=0)
    return np.maximum(reach, np.quantile(section @ directions, 1 - TAIL, axis=0)) if len(section) else reach


def _directions() -> np.ndarray:
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _alike(supports: np.ndarray) -> list[tuple[int, int]]:
    """Return runs (first, last + 1) of neighbouring slices whose sections differ by LIKE at most."""
    runs, first = [], 0
    for k in range(1, len(supports) + 1):
        if k == len(supports) or np.ptp(supports[first : k + 1], axis=0).max() > LIKE:
            runs.append((first, k))
            first = k
    return runs


def _prism(support: np.ndarray, inside: np.ndarray, first: float, last: float) -> Mesh | None:
    """Return the prism from x = first to last [m] whose section reaches so far in each direction, around a point (y, z)."""
    planes = np.concatenate([_directions(), -support[:, None]], axis=1)
    try:
        found = HalfspaceIntersection(planes, inside)
    except QhullError:
        return None
    corners = np.unique(found.intersections.round(6), axis=0)
    ends = [np.insert(corners, 0, x, axis=1) for x in (first, last)]
    return hull(np.concatenate(ends))
