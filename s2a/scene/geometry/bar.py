"""Handles that are bars: cross-section, depth, and the hulls of bar and posts that keep the finger gap free."""

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import median_filter
from scipy.spatial import HalfspaceIntersection, QhullError

from s2a.scene.geometry.convex import hull
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.scene import Mesh

SAMPLES = 40000  # Points by which a bar is asked
HEAD = 0.006  # [m] Depth from the outermost point within which a scan shows a bar as it is
FLANK = 0.009  # [m] Depth within which its sides are as far apart as they are
SHALLOWEST = 0.008  # [m] Least depth of a bar; scans may show its outer face alone
# [m] Space behind any bar, since people's fingers go there: what a scan shows nearer to the front is a shadow
GAP = 0.021
SPAN = 0.5  # Share of a bar's length, in its middle, that stands free but for a short post
MARGIN = 0.001  # [m] How far from a bar's edges its surface still is its own
UNEVEN = 0.0005  # [m] How much more one side of a bar may flare out than the other that is like it
# [m] Slices whose sections differ by less, from noise, become one piece; so much may a straight bar seem to bend
LIKE = 0.002
DRAWN = 0.0011  # [m] A side that draws in by more has ended, and only its shadow goes on
SEEN = 0.3  # Share of a side's densest points with which it goes on; fewer are a post's
STEP = 0.001  # [m] Depths at which sides are asked
MIN_POINTS = 40  # A slice with fewer points says nothing


@dataclass(frozen=True)
class Profile:
    """A bar's section in slices along x, in a frame whose z axis looks into the furniture."""

    edges: np.ndarray  # where slices begin and end along x [m], shape [slice + 1]
    low: np.ndarray  # lower end of the bar across its length [m], shape [slice]
    high: np.ndarray  # upper end [m], shape [slice]
    face: np.ndarray  # its outermost z [m], shape [slice]

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

    `frame`: axes as columns [3 3]: x along it, y across it, z into the furniture.
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
    bounds = np.array([_section_bounds(head) for head in heads]).T
    profile = Profile(edges, *(_straight(values) for values in median_filter(bounds, size=(1, 3), mode="nearest")))
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


# Largest length of a post in the middle, as a fraction of the bar's length; a longer one is a web
MAX_POST_LENGTH = 0.3
SIDES = 16  # Of a prism that stands for a piece of a bar
TAIL = 0.03  # Fraction of the points that may be outside of it in each direction


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
    ranges = []
    for first, last in runs:
        is_web = last - first > MAX_POST_LENGTH * count and first < end and last > start
        ranges += [(first, min(last, start)), (max(first, end), last)] if is_web else [(first, last)]
    return [(first, last) for first, last in ranges if first < last]


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
        section = HalfspaceIntersection(planes, inside)
    except QhullError:
        return None
    corners = np.unique(section.intersections.round(6), axis=0)
    ends = [np.insert(corners, 0, x, axis=1) for x in (first, last)]
    return hull(np.concatenate(ends))
