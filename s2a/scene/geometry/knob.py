"""Handles that are round: the profile that turns about their axis, and pieces along it.

Shadows hang skirts on one side of a knob; what most of its sides agree on is the knob.
"""

import numpy as np
from scipy.ndimage import median_filter
from scipy.optimize import least_squares

from s2a.scene.geometry.convex import hull
from s2a.scene.geometry.mesh_ops import normals, sample_with_faces
from s2a.scene.scene import Mesh

SAMPLES = 40000  # Points sampled on a knob
HEAD = 0.006  # [m] Depth from its face within which a scan shows a knob's side as it is
STEP = 0.0015  # [m] Depths at which the radius is taken
SECTORS = 16  # Around the axis; also the sides of the prisms that stand for a knob
ROUND = 0.15  # Largest deviation of a round handle from a circle, root mean square, as a fraction of its radius
TOLERANCE = 0.0005  # [m] How far a piece's side may be from the profile
MIN_POINTS = 20  # Smallest number of points of a usable sector
TRUER = 0.12  # Fraction of a knob's sides that flare out least; behind its head these show it, and the others skirts
UPRIGHT = 0.4  # Sides lean by less than this (sine) where they are no skirts, nor the corner to the face
FLAT = 0.95  # Cosine to its axis of what counts as a knob's face; noise makes the outermost of it stand out
CORNER = 0.0025  # [m] Depth within which a scan rounds the corner between face and side off
UNEVEN = 0.0008  # [m] How much more a side of a head may flare out than those that do least
DRAWN = 0.0011  # [m] A head has ended where it draws in by more than this
STALK = 0.75  # A stalk's radius is less than this fraction of its head's
THIN = 0.2  # Fraction of a stalk's length that is as thin as it is
# From a head's end on, a stalk's profile lies below a cone's by more than this fraction of what the cone narrows by
SAG = 0.03


def knob_hulls(region: Mesh, frame: np.ndarray, front: float) -> list[Mesh] | None:
    """Return a knob as frusta from its face to the front, or None if it is not round.

    `frame`: axes as columns [3 3]: z into the furniture; `front`: coordinate of the front along z [m].
    """
    points, faces = sample_with_faces(region, SAMPLES, seed=0)
    local, facing = points @ frame, (normals(region) @ frame)[faces]
    face = float(np.quantile(local[:, 2], 0.03)) if len(local) else 0.0
    steep, deep = np.abs(facing[:, 2]), local[:, 2] - face
    upright = (steep < UPRIGHT) & (deep > CORNER) & (deep < CORNER + HEAD)
    circle = _circle(local[upright, :2]) or _circle(local[(steep < 0.7) & (deep < HEAD), :2])
    if circle is None or front - face < 2 * STEP:
        return None
    flat = local[facing[:, 2] < -FLAT, 2]
    flat = flat[flat < face + CORNER]
    rings = knob_profile(
        local, circle, float(np.quantile(flat, 0.25)) if len(flat) else face, front, _sag(region, circle[2])
    )
    axis = [*circle[:2]]
    pieces = [hull(np.concatenate([_ring(axis, *a), _ring(axis, *b)])) for a, b in rings]
    return [Mesh(piece.vertices @ frame.T, piece.faces) for piece in pieces if piece is not None]


def sectors(points: np.ndarray, circle: tuple[float, float, float]) -> np.ndarray:
    """Return the sector around a circle's centre in which each point [point 3] lies, shape [point]."""
    turn = np.arctan2(points[:, 1] - circle[1], points[:, 0] - circle[0]) / (2 * np.pi)
    return np.floor((turn + 0.5) * SECTORS).astype(int) % SECTORS


def true_sides(points: np.ndarray, circle: tuple[float, float, float], face: float) -> np.ndarray:
    """Return the sectors in which a scan shows the side of a knob's head, shape [SECTORS], bool.

    A skirt begins at the edge of the face and flares out; of a round handle all sides flare out alike. So those count that
    flare out by less than UNEVEN more than the least quarter does.

    Args:
        points: of its surface [m], shape [point 3], z into the furniture.
        circle: centre and radius of its head [m].
        face: z of its outermost face [m].
    """
    radius, sector = np.linalg.norm(points[:, :2] - circle[:2], axis=1), sectors(points, circle)
    deep = points[:, 2] - face
    flares = np.full(SECTORS, np.inf)
    for k in range(SECTORS):
        upper, lower = ((sector == k) & (deep > a) & (deep < a + HEAD / 3) for a in (HEAD / 6, HEAD / 2))
        if min(upper.sum(), lower.sum()) >= MIN_POINTS:
            flares[k] = np.quantile(radius[lower], 0.5) - np.quantile(radius[upper], 0.9)
    measured = np.isfinite(flares)
    if measured.sum() < SECTORS / 2:
        return np.ones(SECTORS, bool)
    return flares < np.quantile(flares[measured], 0.25) + UNEVEN


def knob_profile(
    points: np.ndarray, circle: tuple[float, float, float], face: float, front: float, sag: float = 0.0
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return pairs of rings (radius, z) [m] between which a knob's radius changes evenly.

    Args:
        points: of its surface [m], shape [point 3], z into the furniture.
        circle: centre and radius of its head [m].
        face: z of its outermost face [m].
        front: z of the front [m].
        sag: how far its sides lie inside of what was scanned, on average [m].
    """
    out = points[:, :2] - circle[:2]
    radius = np.linalg.norm(out, axis=1)
    sector, shown = sectors(points, circle), true_sides(points, circle, face)
    depths = np.append(np.arange(face + STEP / 2, front - STEP, STEP), front)
    rows = []
    for depth in depths:
        here = np.abs(points[:, 2] - depth) < STEP / 2
        inner = radius[here & (radius < 0.8 * circle[2])]
        share = 0.95 if depth == depths[0] and len(inner) else 0.5
        among = np.flatnonzero(shown) if depth < face + HEAD else range(SECTORS)
        sides = [np.quantile(radius[k], share) for s in among if (k := here & (sector == s)).sum() >= MIN_POINTS]
        rows.append(np.quantile(sides, [0.5, TRUER]) if len(sides) >= 3 else [np.nan] * 2)
    profiles = np.array(rows)
    measured = np.isfinite(profiles[:, 0])
    if not measured.any():
        return [(np.array([circle[2], face]), np.array([circle[2], front]))]
    radii, truer = (
        median_filter(np.interp(depths, depths[measured], values[measured]), size=3, mode="nearest")
        for values in profiles.T
    )
    depths[0] = face
    radii = _sharp(radii, depths - face)
    rings = np.stack([np.minimum(radii + sag, 1.1 * circle[2]), depths], axis=1)
    return [(part[a], part[b]) for part in _head_and_stalk(rings, truer, face + HEAD) for a, b in _breaks(part)]


def _head_and_stalk(rings: np.ndarray, truer: np.ndarray, least: float) -> list[np.ndarray]:
    """Return rings as those of a head and those of its stalk; all together where there is no stalk.

    Fusion rounds the corner behind a head off to a fillet of several millimetres, so a stalk begins where the head ends.

    Args:
        rings: radius and z [m], shape [ring 2].
        truer: radius at the sides that flare out least [m], shape [ring].
        least: z that a head reaches [m].
    """
    depths, edge = rings[:, 1], truer.max() - DRAWN
    ended = (depths > least) & (truer < edge)
    k = int(np.argmax(ended))
    if not ended.any() or not 2 <= k <= len(rings) - 2:
        return [rings]
    thin = float(np.quantile(truer[k:], THIN))
    cone = np.linspace(truer[k], truer[k:].min(), len(truer) - k)
    if thin > STALK * truer.max() or (cone - truer[k:]).mean() <= SAG * np.ptp(cone):
        return [rings]
    back = float(np.interp(edge, [truer[k], max(truer[k - 1], edge)], depths[[k, k - 1]]))
    return [np.vstack([rings[:k], [rings[k - 1, 0], back]]), np.array([[thin, back], [thin, depths[-1]]])]


def _sharp(radii: np.ndarray, deep: np.ndarray) -> np.ndarray:
    """Return a profile's radii [m] with its side drawn on straight to the face, as a scan rounds the corner off.

    `radii`: of the rings [m], shape [ring]; `deep`: how far they are behind the face [m], shape [ring].
    """
    side = (deep > CORNER) & (deep < CORNER + HEAD)
    if side.sum() < 3:
        return radii
    line = np.polyval(np.polyfit(deep[side], radii[side], 1), deep)
    return np.where(deep < CORNER, np.maximum(radii, line), radii)


def _sag(region: Mesh, radius: float) -> float:
    """Return how far a round side [m] lies inside of the circle through its vertices, on average: the mesh's edges are chords."""
    corners = region.vertices[region.faces].astype(np.float64)
    edge = float(np.median(np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)))
    return min(edge, radius) ** 2 / (12 * radius)


def _circle(points: np.ndarray) -> tuple[float, float, float] | None:
    """Return centre and radius [m] of the circle through most points [point 2]; None if they lie on none."""
    if len(points) < MIN_POINTS:
        return None
    middle = (points.min(axis=0) + points.max(axis=0)) / 2
    start = [*middle, np.median(np.linalg.norm(points - middle, axis=1))]

    def off(circle: np.ndarray) -> np.ndarray:
        return np.linalg.norm(points - circle[:2], axis=1) - circle[2]

    circle = least_squares(off, start, loss="soft_l1", f_scale=0.001).x
    x, y, radius = map(float, circle)
    around = np.unique(np.floor(np.arctan2(points[:, 1] - y, points[:, 0] - x) / (np.pi / 4)))
    is_round = np.sqrt(np.mean(off(circle) ** 2)) < ROUND * radius and len(around) >= 6
    return (x, y, radius) if is_round and radius < 2 * start[2] else None


def _breaks(rings: np.ndarray) -> list[tuple[int, int]]:
    """Return runs (first, last) of rings [ring 2] whose radii lie within TOLERANCE of a straight line between them."""
    runs, first = [], 0
    for last in range(2, len(rings) + 1):
        end = min(last, len(rings) - 1)
        between = rings[first : end + 1]
        line = np.interp(between[:, 1], between[[0, -1], 1], between[[0, -1], 0])
        if last == len(rings) or np.abs(line - between[:, 0]).max() > TOLERANCE:
            runs.append((first, last - 1))
            first = last - 1
    return runs


def _ring(axis: list[float], radius: float, z: float) -> np.ndarray:
    """Return a polygon with the area of a circle of this radius [m] around the axis (x, y), shape [SECTORS 3]."""
    turn = 2 * np.pi / SECTORS
    angles = turn * (np.arange(SECTORS) + 0.5)
    reach = radius * np.sqrt(turn / np.sin(turn))
    return np.stack([axis[0] + reach * np.cos(angles), axis[1] + reach * np.sin(angles), np.full(SECTORS, z)], axis=1)
