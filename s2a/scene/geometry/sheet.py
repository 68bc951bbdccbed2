"""Handles that are bent sheets, open on one side (cups, edge pulls), as thin convex hulls."""

from collections.abc import Iterable

import numpy as np
from scipy.cluster.vq import kmeans2

from s2a.scene.geometry.convex import box, clip, hull
from s2a.scene.geometry.front_panel import SEARCH_RADIUS, STRAY, near_region
from s2a.scene.geometry.mesh_ops import keep, normals, sample, sample_with_faces
from s2a.scene.scene import Mesh

SAMPLES = 6000  # Points sampled on a sheet
SHEET = 0.002  # [m] Thickness of a sheet; a scan shows its outer face alone
BEND = 0.02  # [m] So far apart on a face, points belong together as little as at opposite normals
OPEN = 0.5  # Faces that look towards the open side by more than this (cosine) are skirts in its shadow
HEAD = 0.006  # [m] Depth from its outermost point within which a cup is narrow
SHORTEST, LONGEST = 1.4, 4.0  # Length of a cup by its width; bars are longer, knobs are shorter
WIDENING = 1.3  # Width of a cup by the width of its head
UPRIGHT = 0.7  # Height of a unit vector that counts as upwards
ONE_SIDED = 0.1  # An edge pull has less than this fraction of the panel on one of its sides
FRONT_SAMPLES = 40000  # Points sampled on a panel
TAIL = 0.05  # Fraction of a patch's points that may be outside of it on either side
STEP = 0.002  # [m] Depths at which a wall is searched
MIN_POINTS = 20  # A depth with fewer points shows no wall
SHOWN = 0.5  # Fraction of its depths at which a wall has been scanned, from which none is added
BORDER = 0.8  # Fraction of the points of a pull's head that lie within its wall; noise and skirts are outside


def sheet_opening(region: Mesh, frame: np.ndarray, plane: tuple[np.ndarray, float], front: Mesh) -> np.ndarray | None:
    """Return the direction [3] towards which a handle is open (zeros if it is unknown), or None if it is no bent sheet.

    A handle on the border of its front, beyond which there is no front, is an edge pull: open towards the front's middle.
    One that widens towards its front by far more than a bar's skirts do is a cup, which is open below if it is level.

    Args:
        region: the handle as scanned.
        frame: axes as columns [3 3]: x along it, y across it, z into the furniture.
        plane: of the front, as outward normal and offset [m].
        front: the part that carries it.
    """
    y = frame[:, 1]
    low, high = np.quantile(sample(region, SAMPLES, seed=0) @ y, [0.02, 0.98])
    beside = sample(front, FRONT_SAMPLES, seed=0)
    beside = (
        beside[(np.abs(beside @ plane[0] - plane[1]) < STRAY) & near_region(beside, region, frame, SEARCH_RADIUS)] @ y
    )
    below, above = (beside < low - STRAY).sum(), (beside > high + STRAY).sum()
    if min(below, above) < ONE_SIDED * max(below, above):
        return -y if below > above else y
    if not _is_cup(sample(region, SAMPLES, seed=0) @ frame):
        return None
    return -y if y[2] > UPRIGHT else np.zeros(3)


def _is_cup(points: np.ndarray) -> bool:
    """Return True if a handle [point 3], long along x, has the proportions of a cup, which widens towards the front."""
    length, width, _ = np.ptp(np.quantile(points, [0.02, 0.98], axis=0), axis=0)
    middle = points[np.abs(points[:, 0] - np.median(points[:, 0])) < length / 4]
    if not len(middle) or not SHORTEST * width < length < LONGEST * width:
        return False
    head = middle[middle[:, 2] < np.quantile(middle[:, 2], 0.02) + HEAD]
    return bool(
        np.ptp(np.quantile(middle[:, 1], [0.02, 0.98])) > WIDENING * np.ptp(np.quantile(head[:, 1], [0.02, 0.98]))
    )


def sheet_hulls(region: Mesh, frame: np.ndarray, opening: np.ndarray, count: int, max_vertices: int) -> list[Mesh]:
    """Return convex patches of a sheet behind its scanned face.

    Args:
        region: the handle as scanned; its faces look outwards.
        frame: axes as columns [3 3]: x along it.
        opening: direction towards which it is open [3]; its faces towards it are not there.
        count: largest number of patches.
        max_vertices: largest number of vertices of a patch.
    """
    region = keep(region, normals(region) @ opening < OPEN)
    points, faces = sample_with_faces(region, SAMPLES, seed=0)
    if len(points) < count:
        return []
    facing = normals(region)[faces]
    places = np.concatenate([(points @ frame - points.mean(axis=0) @ frame), BEND / 2 * facing], axis=1)
    length, width, depth = np.ptp(places[:, :3], axis=0)
    places[:, 0] *= min(1.0, LONGEST * max(width, depth) / length)
    _, patch = kmeans2(places, count, minit="++", rng=np.random.default_rng(0))
    pieces = [_patch(points[patch == k], facing[patch == k], max_vertices) for k in range(count)]
    return [piece for piece in pieces if piece is not None]


def hidden_wall(region: Mesh, frame: np.ndarray, opening: np.ndarray, front: float) -> Mesh | None:
    """Return the wall that fixes a sheet to its front, on the side away from its opening, or None where a scan shows it.

    Between two doors no scanner sees it, yet no handle floats: it runs from the sheet's head straight to the front.

    Args:
        region: the handle as scanned; its faces look outwards.
        frame: axes as columns [3 3]: x along it, z into the furniture.
        opening: direction across it towards which it is open [3]; zeros if that is unknown.
        front: coordinate of the front along z [m].
    """
    points, faces = sample_with_faces(region, SAMPLES, seed=0)
    if not len(points) or not opening.any():
        return None
    axes = np.stack([frame[:, 0], opening, frame[:, 2]], axis=1)
    along, inner, deep = (points @ axes).T
    face = float(np.quantile(deep, 0.02))
    beside = deep[(normals(region) @ opening)[faces] < -OPEN]
    depths = np.arange(face + HEAD, front, STEP)
    if (
        not len(depths)
        or np.mean([(np.abs(beside - depth) < STEP / 2).sum() >= MIN_POINTS for depth in depths]) > SHOWN
    ):
        return None
    low, high = np.quantile(along, [0.01, 0.99])
    border = float(np.quantile(inner[deep < face + HEAD], 1 - BORDER))
    center = axes @ np.array([(low + high) / 2, border + SHEET / 2, (face + front) / 2])
    return box(center, axes, np.array([high - low, SHEET, front - face]))


def before_wall(patches: Iterable[Mesh], wall: Mesh, opening: np.ndarray) -> list[Mesh]:
    """Return patches of a sheet without what fusion drew on beyond its hidden wall, on the side where it is not open."""
    outer = float((wall.vertices @ -opening).max())
    return [piece for patch in patches if (piece := clip(patch, -opening, outer)) is not None]


def _patch(points: np.ndarray, facing: np.ndarray, max_vertices: int) -> Mesh | None:
    """Return the hull of points on a sheet and of those behind it, without those that noise lifts out."""
    normal = facing.mean(axis=0) if len(facing) else np.zeros(3)
    length = np.linalg.norm(normal)
    if len(points) < 10 or length < 0.3:
        return None
    normal /= length
    low, high = np.quantile(points @ normal, [TAIL, 1 - TAIL])
    points = points[(points @ normal >= low) & (points @ normal <= high)]
    return hull(np.concatenate([points, points - SHEET * normal]), max_vertices)


STRAIGHT_SAMPLES = 20000  # Points sampled on a sheet
FLAT = 0.8  # Cosine of the largest angle between a face of the lip or of the wall and the direction in which it looks
CORNER = 0.003  # [m] So near to an edge a scan rounds it off
BINS = 12  # Pieces along a sheet whose medians are compared
KNOWN = 0.7  # Fraction of the pieces that show a straight lip or wall at least
LIKE = 0.002  # [m] How far a straight sheet may seem to swell: noise is shared by neighbouring points
ALONG = 0.9  # Fraction of a sheet's length along which its lip is straight; of a cup's, which is a bowl, a part
STRAIGHT_STEP = 0.001  # [m] Places across a lip at which its depth is asked
DRAWN = 0.0015  # [m] Where a lip lies so much deeper than its plane it has ended, and a skirt goes on into its shadow
LEAN = 0.35  # Largest slope of a wall against the front's normal; a steeper one is none


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
    points, faces = sample_with_faces(region, STRAIGHT_SAMPLES, seed=0)
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
    places = np.arange(begin, last, STRAIGHT_STEP)
    shown = [np.abs(across - place) < STRAIGHT_STEP for place in places]
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
    bins = np.array([k for k in range(BINS) if (piece == k).sum() >= MIN_POINTS])
    if len(bins) < KNOWN * BINS:
        return None
    places, medians = np.array([(np.median(along[piece == k]), np.median(values[piece == k])) for k in bins]).T
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
