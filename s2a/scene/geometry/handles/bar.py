"""Handles that are bars: their cross-section along their length, and how deep they are.

No scanner sees the back of a bar. Fusion draws its surface on into the shadow behind it, in skirts that hang from its
edges and may reach the front, so only its outermost few millimetres say how thick it is. How deep it is, its sides say:
the shadows that all scanners share draw in behind it. Often only one side has been seen, a bar's upper one from above, and
the other is a skirt throughout. A bar is symmetric: what the side that flares out least shows counts for both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter

from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.scene import Mesh

SAMPLES = 40000
"""Points by which a bar is asked."""
HEAD = 0.006
"""[m] Depth from the outermost point within which a scan shows a bar as it is."""
FLANK = 0.009
"""[m] Depth within which its sides are as far apart as they are."""
SHALLOWEST = 0.008
"""[m] Least depth of a bar; scans may show its outer face alone."""
GAP = 0.021
"""[m] Space behind any bar, since people's fingers go there: what a scan shows nearer to the front is a shadow."""
SPAN = 0.5
"""Share of a bar's length, in its middle, that stands free but for a short post."""
MARGIN = 0.001
"""[m] How far from a bar's edges its surface still is its own."""
UNEVEN = 0.0005
"""[m] How much more one side of a bar may flare out than the other that is like it."""
LIKE = 0.002
"""[m] Slices whose sections differ by less, from noise, become one piece; so much may a straight bar seem to bend."""
DRAWN = 0.0011
"""[m] A side that draws in by more has ended, and only its shadow goes on."""
SEEN = 0.3
"""Share of a side's densest points with which it goes on; fewer are a post's."""
STEP = 0.001
"""[m] Depths at which sides are asked."""
MIN_POINTS = 40
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
    heads = [_head(points[(points[:, 0] >= a) & (points[:, 0] < b)]) for a, b in zip(edges, edges[1:], strict=False)]
    if any(len(head) < MIN_POINTS for head in heads):
        return None
    ends = [head[head[:, 2] < head[:, 2].min() + HEAD, 0] for head in (heads[0], heads[-1])]
    edges[0], edges[-1] = np.quantile(ends[0], 0.005), np.quantile(ends[1], 0.995)
    found = np.array([_section_bounds(head) for head in heads]).T
    profile = Profile(edges, *(_straight(values) for values in median_filter(found, size=(1, 3), mode="nearest")))
    return profile if profile.length > 2.5 * profile.thickness else None


def _head(points: np.ndarray) -> np.ndarray:
    """Return the points of a slice that lie within FLANK of its outermost, shape [point 3]; none where too few are there."""
    if len(points) < MIN_POINTS:
        return points[:0]
    return points[points[:, 2] < np.quantile(points[:, 2], 0.02) + FLANK]


def _section_bounds(head: np.ndarray) -> tuple[float, float, float]:
    """Return lower end, upper end and face [m] of a bar's section.

    Both its edges round off alike: the side that flares out more than the other one is a skirt.
    """
    face = float(head[:, 2].min())
    low, high = np.quantile(head[:, 1], [0.02, 0.98])
    upper = head[head[:, 2] < face + HEAD / 2]
    inner_low, inner_high = np.quantile(upper[:, 1], [0.02, 0.98]) if len(upper) >= MIN_POINTS / 2 else (low, high)
    flares = np.array([inner_low - low, inner_high - high]) * [1, -1]
    below, above = np.minimum(flares, flares.min() + UNEVEN)
    return float(inner_low - below), float(inner_high + above), face


def _straight(values: np.ndarray) -> np.ndarray:
    """Return values along a bar [m], shape [slice], on the line through most of them where they are near it."""
    places = np.arange(len(values))
    a, b = np.triu_indices(len(values), 1)
    slope = np.median((values[b] - values[a]) / (b - a))  # Theil and Sen's
    line = slope * places + np.median(values - slope * places)
    return np.where(np.abs(values - line) < LIKE, line, values)


def bar_depth(points: np.ndarray, profile: Profile, front: float) -> float:
    """Return how deep a bar is [m]: where its truer side draws in or ends, at least SHALLOWEST, with GAP behind it.

    The side that flares out less is the truer one, of two alike the one that ends first. A side that ends sooner than any
    bar is deep says nothing.

    Args:
        points: of its surface in the profile's frame [m], shape [point 3].
        profile: its section.
        front: coordinate of the front along z [m].
    """
    slices = np.clip(np.searchsorted(profile.edges, points[:, 0]) - 1, 0, len(profile.low) - 1)
    in_middle = np.abs(points[:, 0] - profile.edges.mean()) < SPAN * profile.length / 2
    out = points[:, 1] - ((profile.low + profile.high) / 2)[slices]
    deep = points[:, 2] - profile.face[slices]
    deepest = max(SHALLOWEST, front - GAP - float(np.median(profile.face)))
    depths = np.arange(SHALLOWEST / 2, deepest, STEP)
    sides = [_side_end(out[in_middle] * side, deep[in_middle], depths) for side in (-1, 1)]
    sides = [(end, flare) for end, flare in sides if end > SHALLOWEST]
    least = min((flare for _, flare in sides), default=0.0)
    return min((end for end, flare in sides if flare <= least + UNEVEN), default=SHALLOWEST)


def _side_end(out: np.ndarray, deep: np.ndarray, depths: np.ndarray) -> tuple[float, float]:
    """Return the depth [m] at which a side, `out` of the middle [point], draws in or ends, and how far it flares out [m]."""
    reaches: list[float] = []
    most = MIN_POINTS / SEEN
    for depth in depths:
        here = out[(np.abs(deep - depth) < STEP) & (out > 0)]
        most = max(most, len(here))
        if len(here) < SEEN * most:
            break
        reaches.append(float(np.quantile(here, 0.75)))
        if reaches[-1] < max(reaches) - DRAWN:
            break
    else:
        depth = depths[-1] if len(depths) else SHALLOWEST
    return float(depth), max(reaches) - reaches[0] if reaches else 0.0
