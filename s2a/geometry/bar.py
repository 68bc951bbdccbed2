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
    """Return one convex piece a slice of a bar, or None if it stands too near the front for fingers.

    The middle of the bar ends where fingers need space; towards its ends a slice that reaches the front is a post.

    Args:
        region: the handle as scanned.
        frame: the profile's axes as columns [3 3].
        profile: its section.
        front: coordinate of the front along z [m].
    """
    if front - np.median(profile.face) < SHALLOWEST + 0.6 * GAP:
        return None
    points = sample(region, SAMPLES, seed=0) @ frame
    middle, reach = profile.edges.mean(), SPAN * profile.length / 2
    pieces = []
    for k, (first, last) in enumerate(zip(profile.edges, profile.edges[1:], strict=False)):
        low, high, face = profile.low[k], profile.high[k], profile.face[k]
        here = points[(points[:, 0] >= first) & (points[:, 0] < last)][:, 1:]
        here = here[(here[:, 0] > low - MARGIN) & (here[:, 0] < high + MARGIN)]
        is_free = abs((first + last) / 2 - middle) < reach or here[:, 1].max() < front - HEAD
        back = max(face + SHALLOWEST, front - GAP) if is_free else front
        least = face + SHALLOWEST if is_free else front
        here = np.concatenate([here[here[:, 1] < back], [[low, least], [high, least]]])
        piece = _prism(here, first, last)
        if piece is not None:
            pieces.append(Mesh(piece.vertices @ frame.T, piece.faces))
    return pieces


def _prism(section: np.ndarray, first: float, last: float, sides: int = 16, tail: float = 0.03) -> Mesh | None:
    """Return the prism from x = first to last [m] around points (y, z), without the share `tail` that stands out most.

    Noise stands out; a plain hull would be as thick as its worst points.
    """
    angles = 2 * np.pi * np.arange(sides) / sides
    normals = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    bounds = np.quantile(section @ normals.T, 1 - tail, axis=0)
    inside = np.median(section, axis=0)
    try:
        found = HalfspaceIntersection(np.concatenate([normals, -bounds[:, None]], axis=1), inside)
    except QhullError:
        return None
    corners = np.unique(found.intersections.round(6), axis=0)
    ends = [np.insert(corners, 0, x, axis=1) for x in (first, last)]
    return hull(np.concatenate(ends))
