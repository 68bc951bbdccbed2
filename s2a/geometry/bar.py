"""Handles that are bars: their cross-section along their length, and pieces that leave room for fingers behind them.

No scanner sees the back of a bar. Fusion draws its surface on into the shadow behind it, in skirts that hang from its
edges and may reach the front, so only its outermost few millimetres say how thick it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import HalfspaceIntersection, QhullError

from s2a.geometry.convex import hull
from s2a.geometry.surfaces import sample
from s2a.scene import Mesh

SAMPLES = 40000
"""Points by which a bar is asked."""
HEAD = 0.006
"""[m] Depth from the outermost point within which a scan shows a bar as it is."""
SHALLOWEST = 0.008
"""[m] Least depth of a bar; scans may show its outer face alone."""
GAP = 0.021
"""[m] Space that fingers need behind a bar: a Franka finger's pad is 18.5 mm long."""
SPAN = 0.5
"""Share of a bar's length, in its middle, that stands free of posts."""
MARGIN = 0.001
"""[m] How far a bar may be thicker farther in than at its head."""
SIDES = 16
"""Of a prism that stands for a piece of a bar."""
TAIL = 0.03
"""Share of the points that may stand out of it in each direction."""
LIKE = 0.002
"""[m] Slices whose sections differ by less, from noise, become one piece."""
FEW = 40
"""A slice with fewer points says nothing."""


@dataclass(frozen=True)
class Profile:
    """A bar's section in slices along x, in a frame whose z axis looks into the furniture.

    Attributes:
        edges: where slices begin and end along x [m], shape [slice + 1].
        low: lower end of the bar across its length [m], shape [slice].
        high: upper end [m], shape [slice].
        face: its outermost z [m], shape [slice].
    """

    edges: np.ndarray
    low: np.ndarray
    high: np.ndarray
    face: np.ndarray

    @property
    def thickness(self) -> float:
        """Thickness across the bar in its middle half [m]."""
        quarter = len(self.low) // 4
        middle = slice(quarter, len(self.low) - quarter)
        return float(np.median((self.high - self.low)[middle]))

    @property
    def length(self) -> float:
        """Length of the bar [m]."""
        return float(self.edges[-1] - self.edges[0])


def bar_profile(region: Mesh, frame: np.ndarray, slices: int) -> Profile | None:
    """Return the section of a handle along its length, or None if it is too short for a bar or has holes.

    Args:
        region: the handle as scanned.
        frame: axes as columns [3 3]: x along it, y across it, z into the furniture.
        slices: number of slices.
    """
    points = sample(region, SAMPLES, seed=0) @ frame
    if not len(points):
        return None
    start, end = np.quantile(points[:, 0], [0.005, 0.995])
    edges = np.linspace(start, end, slices + 1)
    found = []
    for first, last in zip(edges, edges[1:], strict=False):
        here = points[(points[:, 0] >= first) & (points[:, 0] < last)]
        if len(here) < FEW:
            return None
        face = np.quantile(here[:, 2], 0.02)
        head = here[here[:, 2] < face + HEAD]
        found.append([*np.quantile(head[:, 1], [0.02, 0.98]), face])
    low, high, face = median_filter(np.array(found).T, size=(1, 3), mode="nearest")
    profile = Profile(edges, low, high, face)
    return profile if profile.length > 2.5 * profile.thickness else None


def bar_pieces(region: Mesh, frame: np.ndarray, profile: Profile, front: float) -> list[Mesh] | None:
    """Return a bar as convex pieces along its length, or None if it stands too near the front for fingers.

    The middle of the bar ends where fingers need space; towards its ends a slice that reaches the front is a post.
    Neighbouring slices of like section become one piece.

    Args:
        region: the handle as scanned.
        frame: the profile's axes as columns [3 3].
        profile: its section.
        front: coordinate of the front along z [m].
    """
    if front - np.median(profile.face) < SHALLOWEST + 0.6 * GAP:
        return None
    points = sample(region, SAMPLES, seed=0) @ frame
    sections = [_section(points, profile, k, front) for k in range(len(profile.low))]
    supports = [_support(section) for section in sections]
    pieces = []
    for first, last in _alike(supports):
        piece = _prism(np.concatenate(sections[first:last]), profile.edges[first], profile.edges[last])
        if piece is not None:
            pieces.append(Mesh(piece.vertices @ frame.T, piece.faces))
    return pieces


def _section(points: np.ndarray, profile: Profile, k: int, front: float) -> np.ndarray:
    """Return what a scan shows of a bar (or of its post) in one slice as points (y, z), without skirts."""
    first, last = profile.edges[k : k + 2]
    low, high, face = profile.low[k], profile.high[k], profile.face[k]
    here = points[(points[:, 0] >= first) & (points[:, 0] < last)][:, 1:]
    here = here[(here[:, 0] > low - MARGIN) & (here[:, 0] < high + MARGIN)]
    in_middle = abs((first + last) / 2 - profile.edges.mean()) < SPAN * profile.length / 2
    is_free = in_middle or here[:, 1].max() < front - HEAD
    back = max(face + SHALLOWEST, front - GAP) if is_free else front
    least = face + SHALLOWEST if is_free else front
    return np.concatenate([here[here[:, 1] < back], [[low, least], [high, least]]])


def _support(section: np.ndarray) -> np.ndarray:
    """Return how far points (y, z) reach in each of SIDES directions [m], without the share TAIL that stands out most.

    Noise stands out; a plain hull would be as thick as its worst points.
    """
    return np.quantile(section @ _directions().T, 1 - TAIL, axis=0)


def _directions() -> np.ndarray:
    angles = 2 * np.pi * np.arange(SIDES) / SIDES
    return np.stack([np.cos(angles), np.sin(angles)], axis=1)


def _alike(supports: list[np.ndarray]) -> list[tuple[int, int]]:
    """Return runs (first, last + 1) of neighbouring slices whose sections differ by LIKE at most."""
    runs, first = [], 0
    for k in range(1, len(supports) + 1):
        if k == len(supports) or np.ptp(supports[first : k + 1], axis=0).max() > LIKE:
            runs.append((first, k))
            first = k
    return runs


def _prism(section: np.ndarray, first: float, last: float) -> Mesh | None:
    """Return the prism from x = first to last [m] around points (y, z)."""
    planes = np.concatenate([_directions(), -_support(section)[:, None]], axis=1)
    try:
        found = HalfspaceIntersection(planes, np.median(section, axis=0))
    except QhullError:
        return None
    corners = np.unique(found.intersections.round(6), axis=0)
    ends = [np.insert(corners, 0, x, axis=1) for x in (first, last)]
    return hull(np.concatenate(ends))
