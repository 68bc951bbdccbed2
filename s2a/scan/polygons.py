"""Polygons -> triangles: a fan where a polygon is convex, ears where it is not, so that no notch is covered."""

import numpy as np

_FLAT = 1e-9  # fraction of a polygon's own size squared below which a triangle has no area


def triangulate(points: np.ndarray, counts: np.ndarray, indices: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Cut polygons into triangles, `count - 2` each, in the order of the polygons.

    Args:
        points: shape [vertex 3].
        counts: corners of each polygon, shape [polygon]; those with fewer than 3 give nothing.
        indices: vertices of the corners of all polygons, one after the other; those out of range make their polygon a fan.

    Returns:
        Positions in `indices` of the triangles' corners, shape [triangle 3], and the polygon of each triangle, shape [triangle].
    """
    counts = np.asarray(counts, dtype=np.int64)
    corners, polygon = _fans(counts)
    first = np.cumsum(counts) - counts
    start = np.concatenate([[0], np.cumsum(np.maximum(counts - 2, 0))])
    valid = np.append((indices >= 0) & (indices < len(points)), True)
    for count in np.unique(counts[counts > 3]):
        mine = np.flatnonzero(counts == count)
        places = first[mine][:, None] + np.arange(count)
        inside = valid[places].all(axis=1)
        mine, places = mine[inside], places[inside]
        outlines = points[indices[places]].astype(np.float64)
        fan = _smallest(outlines)
        if count == 4:  # there is one other way to cut
            turned = mine[_smallest(np.roll(outlines, -1, axis=1)) > np.maximum(fan, _FLAT)]
            turned = turned[fan[np.searchsorted(mine, turned)] <= _FLAT]
            for k, corner in enumerate([(1, 2, 3), (1, 3, 0)]):
                corners[start[turned] + k] = first[turned][:, None] + corner
            continue
        for each in np.flatnonzero(fan <= _FLAT):
            corners[start[mine[each]] : start[mine[each] + 1]] = places[each][ears(outlines[each])]
    return corners, polygon


def ears(outline: np.ndarray) -> np.ndarray:
    """Return the triangles of a polygon [corner 3] that need not be convex nor quite flat, as corners, shape [corner - 2, 3].

    Ear clipping (Meisters 1975), the best-shaped ear first. A polygon that crosses itself gets the triangles that are left over.
    """
    flat = _projected(outline)
    size = float(np.ptp(flat, axis=0).max()) ** 2
    left = list(range(len(flat)))
    triangles: list[tuple[int, ...]] = []
    while len(left) > 3:
        ring = flat[left]
        before, after = np.roll(ring, 1, axis=0), np.roll(ring, -1, axis=0)
        area = _cross(ring - before, after - ring)
        longest = np.maximum(np.sum((after - before) ** 2, axis=1), np.finfo(float).tiny)
        order = np.argsort(-area / longest)
        convex = next((i for i in order if area[i] > _FLAT * size and _is_ear(ring, i)), None)
        # Without an ear a corner on a straight line, or a spike, goes; a polygon that crosses itself loses any corner.
        level = [i for i in order if abs(area[i]) <= _FLAT * size]
        chosen = int((level or list(order))[0] if convex is None else convex)
        triangles.append((left[chosen - 1], left[chosen], left[(chosen + 1) % len(left)]))
        del left[chosen]
    triangles.append(tuple(left))
    return np.array(triangles)


def _fans(counts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the corners [triangle 3] of polygons with so many corners, and each triangle's polygon."""
    first = np.cumsum(counts) - counts
    many = np.maximum(counts - 2, 0)
    polygon = np.repeat(np.arange(len(counts)), many)
    step = np.arange(len(polygon)) - np.repeat(np.cumsum(many) - many, many)
    start = first[polygon]
    return np.stack([start, start + step + 1, start + step + 2], axis=1), polygon


def _smallest(outlines: np.ndarray) -> np.ndarray:
    """Return the smallest triangle of each fan, as a fraction of its polygon's area, shape [polygon].

    It is below 0 where the triangle looks the other way, and infinite for polygons without area, whose cut does not matter.
    """
    spokes = outlines[:, 1:] - outlines[:, :1]
    triangles = np.cross(spokes[:, :-1], spokes[:, 1:])
    normal = triangles.sum(axis=1)
    square = np.sum(normal**2, axis=1)
    facing = np.sum(triangles * normal[:, None], axis=2).min(axis=1)
    return np.where(square > 0, facing / np.where(square > 0, square, 1.0), np.inf)


def _projected(outline: np.ndarray) -> np.ndarray:
    """Return an outline in its own plane, counterclockwise, shape [corner 2]."""
    following = np.roll(outline - outline[0], -1, axis=0)
    normal = np.cross(outline - outline[0], following).sum(axis=0)  # Newell
    length = np.linalg.norm(normal)
    if not length > 0:
        return np.asarray(outline[:, :2] - outline[0, :2])
    normal /= length
    aside = np.eye(3)[np.abs(normal).argmin()]
    u = np.cross(aside, normal)
    u /= np.linalg.norm(u)
    return np.asarray((outline - outline[0]) @ np.stack([u, np.cross(normal, u)], axis=1))


def _is_ear(ring: np.ndarray, corner: int) -> bool:
    """Return whether no other corner of a ring [corner 2] lies in the triangle at a corner, or on its sides."""
    a, b, c = ring[corner - 1], ring[corner], ring[(corner + 1) % len(ring)]
    others = ring[~((ring == a).all(axis=1) | (ring == b).all(axis=1) | (ring == c).all(axis=1))]
    sides = [_cross(q - p, others - p) >= 0 for p, q in ((a, b), (b, c), (c, a))]
    return not np.logical_and.reduce(sides).any()


def _cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0])
