"""Convex hulls: construction, cuts, containment, decomposition of solids, and swept volumes."""

import itertools
from collections.abc import Sequence
from itertools import pairwise

import coacd
import numpy as np
import vhacdx
from scipy.optimize import linprog
from scipy.spatial import ConvexHull, QhullError

from s2a.scene.articulation import displace
from s2a.scene.geometry.mesh_ops import components, keep, weld
from s2a.scene.scene import Joint, Mesh

FLAT = 1e-3  # [m] Pieces thinner than this are thickened to it: Qhull and MuJoCo refuse flat ones
# [m] Pieces whose intersection holds no larger ball are apart: the limit of float32. A sharp edge whose ball has a
# tenth of a millimetre reaches in by several
APART = 1e-6
MARGIN = 1e-4  # [m] Distance of what is cut from what it is cut free of
CLEARLY = 1e-6  # [m] Gap at a face between pieces that are apart beyond the tolerance of the linear program
# Points inside of a piece by which the planes that it can be cut at are compared, and how many of these are tried
INSIDE, TRIED = 256, 8


def hull(points: np.ndarray, max_vertices: int | None = None, thickness: float = FLAT) -> Mesh | None:
    """Return the convex hull of points [point 3] as a piece, at least `thickness` [m] thick in every direction.

    None if fewer than three points differ. With `max_vertices`, extreme points along evenly spread directions stand
    for the hull's vertices where it has more.
    """
    points = np.unique(np.asarray(points, np.float64).round(6), axis=0)
    if len(points) < 3:
        return None
    points = _thicken(points, thickness)
    try:
        corners = points[ConvexHull(points).vertices]
        if max_vertices is not None and len(corners) > max_vertices:
            corners = _extremes(corners, max_vertices)
        return _closed(corners)
    except QhullError:
        return None


def halfspaces(piece: Mesh) -> np.ndarray:
    """Return a piece's planes as rows (nx, ny, nz, d), inside where n.x + d <= 0 [m], shape [plane 4]."""
    return _solid(piece)[0]


def volume(piece: Mesh) -> float:
    """Return the volume of a piece [m^3]."""
    return _solid(piece)[1]


def _solid(piece: Mesh) -> tuple[np.ndarray, float]:
    """Return the planes [plane 4] and volume [m^3] of a piece."""
    solid: tuple[np.ndarray, float] | None = vars(piece).get("solid")
    if solid is None:  # kept with the piece, as its bounds are: obstacles meet thousands of others
        convex_hull = ConvexHull(piece.vertices.astype(np.float64))
        solid = vars(piece)["solid"] = (convex_hull.equations, float(convex_hull.volume))
    return solid


def contains(piece: Mesh, points: np.ndarray, margin: float = 0.0) -> np.ndarray:
    """Return which points [point 3] lie in a piece, or within about `margin` [m] outside of it; shape [point], bool."""
    planes = halfspaces(piece)
    low, high = piece.bounds + [[-margin] * 3, [margin] * 3]
    inside = ((points >= low) & (points <= high)).all(axis=1)
    inside[inside] = (points[inside] @ planes[:, :3].T + planes[:, 3] <= margin).all(axis=1)
    return inside


def clip(piece: Mesh, normal: np.ndarray, offset: float) -> Mesh | None:
    """Return the part of a piece where normal.x <= offset [m]; None if nothing (or a mere sliver) is left."""
    heights = piece.vertices @ np.asarray(normal, np.float64) - offset
    if (heights <= 0).all():
        return piece
    if (heights >= -FLAT).all():
        return None
    edges = np.concatenate([piece.faces[:, [0, 1]], piece.faces[:, [1, 2]], piece.faces[:, [2, 0]]])
    crossing = edges[(heights[edges[:, 0]] < 0) & (heights[edges[:, 1]] > 0)]
    a, b = piece.vertices[crossing[:, 0]].astype(np.float64), piece.vertices[crossing[:, 1]].astype(np.float64)
    fraction = heights[crossing[:, 0]] / (heights[crossing[:, 0]] - heights[crossing[:, 1]])
    return hull(np.concatenate([piece.vertices[heights <= 0], a + fraction[:, None] * (b - a)]))


def overlap(a: Mesh, b: Mesh) -> float:
    """Return the radius of the largest ball that fits into both pieces [m]; 0 if they are apart."""
    if (a.bounds[0] >= b.bounds[1]).any() or (b.bounds[0] >= a.bounds[1]).any():
        return 0.0
    if _beyond_a_face(a, b) or _beyond_a_face(b, a):
        return 0.0
    planes = np.concatenate([halfspaces(a), halfspaces(b)])
    room = np.concatenate([planes[:, :3], np.ones((len(planes), 1))], axis=1)
    bounds = [(None, None)] * 3 + [(0.0, None)]
    solution = linprog([0, 0, 0, -1.0], A_ub=room, b_ub=-planes[:, 3], bounds=bounds, method="highs")
    return float(solution.x[3]) if solution.status == 0 else 0.0


def _beyond_a_face(a: Mesh, b: Mesh) -> bool:
    """Return True if a piece lies wholly beyond one of another's planes."""
    planes = halfspaces(a)
    return bool((b.vertices @ planes[:, :3].T + planes[:, 3] > CLEARLY).all(axis=0).any())


def cut_free(piece: Mesh, obstacle: Mesh, count: int = 1, min_volume: float = 0.0, margin: float = 1e-4) -> list[Mesh]:
    """Return the parts of a piece that are free of an obstacle, each beyond a single plane of it; none if nothing is left.

    A piece that does not overlap the obstacle comes back as it is. What is cut stays convex, at the price of losing more than
    the overlap itself: the less, the more parts are allowed. Each time the largest part of the rest is cut off.

    `min_volume`: parts but the first have this volume or more [m^3].
    """
    if overlap(piece, obstacle) <= APART:
        return [piece]
    planes = np.unique(halfspaces(obstacle).round(6), axis=0)
    parts: list[Mesh] = []
    rest: Mesh | None = piece
    while rest is not None and len(parts) < count:
        part, plane = _largest_part(rest, planes, margin)
        if part is None or (parts and volume(part) < min_volume):
            break
        parts.append(part)
        rest = clip(rest, plane[:3], margin - plane[3])
    return parts


def _largest_part(piece: Mesh, planes: np.ndarray, margin: float) -> tuple[Mesh | None, np.ndarray]:
    """Return the largest part of a piece beyond one of the planes [plane 4], and that plane.

    Of the planes, those are tried beyond which most of some points inside of the piece lie.
    """
    corners = piece.vertices.astype(np.float64)
    weights = np.random.default_rng(0).dirichlet(np.full(len(corners), 0.5), INSIDE)
    beyond = (np.concatenate([corners, weights @ corners]) @ planes[:, :3].T + planes[:, 3] > margin).sum(axis=0)
    best = planes[np.argsort(-beyond, kind="stable")[:TRIED]]
    parts = [(clip(piece, -plane[:3], plane[3] - margin), plane) for plane in best]
    return max(parts, key=lambda pair: 0.0 if pair[0] is None else volume(pair[0]))


def subtract(piece: Mesh, obstacle: Mesh, thinnest: float = 2 * FLAT) -> list[Mesh]:
    """Return the part of a piece outside of an obstacle as convex hulls, none thinner than `thinnest` [m]."""
    outside, rest = [], piece
    for plane in np.unique(halfspaces(obstacle).round(6), axis=0):
        part = clip(rest, -plane[:3], plane[3])
        if part is not None and _thickness(part) > thinnest:
            outside.append(part)
        inside = clip(rest, plane[:3], -plane[3])
        if inside is None:
            break
        rest = inside
    return outside


def box(center: np.ndarray, axes: np.ndarray, size: np.ndarray) -> Mesh:
    """Return an oriented box: centre [m], axes as columns of a rotation [3 3], full extents along them [m]."""
    signs = np.array([[i, j, k] for i in (-0.5, 0.5) for j in (-0.5, 0.5) for k in (-0.5, 0.5)])
    return _closed(np.asarray(center) + (signs * np.asarray(size)) @ np.asarray(axes).T)


def column(base: np.ndarray, radius: float, height: float, sides: int = 16) -> Mesh:
    """Return a vertical prism around a circle of this radius [m] that stands on `base`."""
    angles = 2 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=1) * radius / np.cos(np.pi / sides)
    return _closed(np.concatenate([base + ring, base + ring + [0, 0, height]]))


def _thickness(piece: Mesh) -> float:
    """Return the extent of a piece along its thinnest principal direction [m]."""
    _, _, axes = np.linalg.svd(piece.vertices - piece.vertices.mean(axis=0), full_matrices=False)
    return float(np.ptp(piece.vertices @ axes[-1]))


def _closed(corners: np.ndarray) -> Mesh:
    """Triangulate the hull of corners, faces outwards, in an order that depends on the corners alone."""
    corners = np.unique(corners.astype(np.float32), axis=0)
    convex_hull = ConvexHull(corners.astype(np.float64))
    faces = convex_hull.simplices.copy()
    a, b, c = np.moveaxis(corners[faces].astype(np.float64), 1, 0)
    inwards = np.einsum("ij,ij->i", np.cross(b - a, c - a), convex_hull.equations[:, :3]) < 0
    faces[inwards] = faces[inwards][:, ::-1]
    used, flat = np.unique(faces, return_inverse=True)
    return Mesh(corners[used], flat.reshape(faces.shape))


def _thicken(points: np.ndarray, thickness: float) -> np.ndarray:
    """Add points along the principal directions in which a set is thinner than `thickness`."""
    center = points.mean(axis=0)
    _, _, axes = np.linalg.svd(points - center, full_matrices=False)
    for axis in axes[::-1]:
        along = (points - center) @ axis
        missing = thickness - np.ptp(along)
        if missing > 0:
            points = np.concatenate([points - 0.5 * missing * axis, points + 0.5 * missing * axis])
    return points


def _extremes(corners: np.ndarray, count: int) -> np.ndarray:
    """Pick `count` corners, each the one that stands out most from the hull of those before."""
    chosen = list(dict.fromkeys(int(np.argmin(corners @ axis * sign)) for axis in np.eye(3) for sign in (1, -1)))
    distance = np.min([np.linalg.norm(corners - corners[i], axis=1) for i in chosen], axis=0)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        try:
            planes = ConvexHull(corners[chosen]).equations
            distance = (corners @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        except QhullError:  # so far the chosen corners lie in one plane
            distance = np.minimum(distance, np.linalg.norm(corners - corners[chosen[-1]], axis=1))
    return corners[chosen]


def one_hull(mesh: Mesh, max_vertices: int) -> list[Mesh]:
    """Return the convex hull of a mesh as the only piece; no piece for a mesh without extent."""
    piece = hull(mesh.vertices, max_vertices)
    return [] if piece is None else [piece]


def vhacd(mesh: Mesh, hulls: int, resolution: int, max_vertices: int) -> list[Mesh]:
    """Decompose by V-HACD.

    Args:
        mesh: a surface, which may be open.
        hulls: largest number of pieces.
        resolution: number of voxels.
        max_vertices: largest number of vertices a piece.
    """
    if len(mesh.faces) < 4:
        return one_hull(mesh, max_vertices)
    parts = vhacdx.compute_vhacd(
        mesh.vertices.astype(np.float64),
        np.concatenate([np.full((len(mesh.faces), 1), 3), mesh.faces], axis=1).astype(np.uint32).ravel(),
        maxConvexHulls=hulls,
        resolution=resolution,
        maxNumVerticesPerCH=64,
        asyncACD=False,
    )
    return _pieces([points for points, _ in parts], max_vertices)


def coacd_default(mesh: Mesh, max_vertices: int, seed: int) -> list[Mesh]:
    """Decompose by CoACD with the library's own settings (threshold 0.05)."""
    coacd.set_log_level("error")
    parts = coacd.run_coacd(coacd.Mesh(mesh.vertices.astype(np.float64), mesh.faces), seed=seed)
    return _pieces([points for points, _ in parts], max_vertices)


def _pieces(clouds: list[np.ndarray], max_vertices: int) -> list[Mesh]:
    pieces = [hull(points, max_vertices) for points in clouds]
    return [piece for piece in pieces if piece is not None]


def deepest(hulls: Sequence[Mesh], others: Sequence[Mesh], joint: Joint, steps: int = 8) -> float:
    """Return the radius of the largest ball [m] that fits into both a moving piece and another, anywhere along a joint."""
    worst = 0.0
    for q in np.linspace(*joint.limits, steps):
        moved = [Mesh(displace(piece.vertices, joint, q), piece.faces) for piece in hulls]
        worst = max([worst, *(overlap(piece, other) for piece in moved for other in others)])
    return worst


def sweep(mesh: Mesh, joint: Joint, clearance: float = 0.0, step: float = 0.2) -> list[Mesh]:
    """Return convex hulls that cover the swept volume of a mesh between the limits of its joint.

    Args:
        mesh: the moving mesh.
        joint: its joint.
        clearance: margin around the swept volume [m].
        step: angle of one section [rad].
    """
    covers = [hull(grown(points, clearance)) for points in sections(mesh, joint, step)]
    return [cover for cover in covers if cover is not None]


def sections(mesh: Mesh, joint: Joint, step: float) -> list[np.ndarray]:
    """Return points [point 3] whose hulls cover the swept volume of a mesh between the limits of its joint, in turn.

    A turn is covered in steps of at most `step` [rad], each by the hull of its two ends and of where their tangents meet:
    the arc between lies inside.
    """
    lower, upper = joint.limits
    count = 1 if joint.kind == "prismatic" else max(1, int(np.ceil((upper - lower) / step)))
    whole = hull(mesh.vertices)
    if whole is None:
        return []
    return [_cover(whole.vertices, joint, a, b) for a, b in pairwise(np.linspace(lower, upper, count + 1))]


def _cover(points: np.ndarray, joint: Joint, start: float, end: float) -> np.ndarray:
    """Return points whose hull holds the paths of points [point 3] between two joint coordinates [m] or [rad]."""
    ends = [displace(points, joint, start), displace(points, joint, end)]
    if joint.kind == "prismatic":
        return np.concatenate(ends)
    middle, axis, origin = displace(points, joint, (start + end) / 2), np.array(joint.axis), np.array(joint.origin)
    arms = middle - origin - ((middle - origin) @ axis)[:, None] * axis
    return np.concatenate([*ends, middle + (1.0 / np.cos((end - start) / 2) - 1.0) * arms])


def grown(points: np.ndarray, by: float) -> np.ndarray:
    """Return the corners of cubes around points [point 3] that reach `by` [m] to each side; the points where it is 0."""
    if by <= 0.0:
        return points
    corners = by * np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
    return (points[:, None] + corners).reshape(-1, 3)


def border(faces: np.ndarray) -> np.ndarray:
    """Return the directed edges [edge 2] that no face traverses in the opposite direction, as often as they are missing.

    They form closed loops, whatever the surface: the border of a border is nothing.
    """
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]).astype(np.int64)
    forward = edges[:, 0] < edges[:, 1]
    pairs, which = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    net = np.bincount(which.reshape(-1), weights=np.where(forward, 1.0, -1.0), minlength=len(pairs)).astype(int)
    turned = np.where(net[:, None] > 0, pairs, pairs[:, ::-1])
    return np.repeat(turned, np.abs(net), axis=0)


def loops(edges: np.ndarray) -> list[np.ndarray]:
    """Return directed edges [edge 2] as closed loops of vertices; each edge is walked once."""
    onwards: dict[int, list[int]] = {}
    for start, end in edges.tolist():
        onwards.setdefault(start, []).append(end)
    walks = []
    while onwards:
        first = here = next(iter(onwards))
        walk: list[int] = []
        while here != first or not walk:
            walk.append(here)
            ends = onwards[here]
            after = ends.pop()
            if not ends:
                del onwards[here]
            here = after
        walks.append(np.array(walk))
    return walks


def drop_small_components(mesh: Mesh, min_area_fraction: float) -> Mesh:
    """Return a surface without the connected components below a fraction of its area."""
    piece = components(mesh)
    area = np.bincount(piece, weights=mesh.face_areas)
    return keep(mesh, area[piece] >= min_area_fraction * area.sum())


def close(mesh: Mesh, ground: float, near: float) -> Mesh:
    """Return a closed solid that stands flat on horizontal ground.

    A border that comes near the ground is extruded straight down to it: it runs around the underside and the sides that were
    not seen. Every other hole is closed by a fan around its middle.

    Args:
        mesh: a surface, faces outwards; vertices below the ground are extracted to it.
        ground: height of the ground [m].
        near: borders this close to the ground are closed along it [m].
    """
    mesh = weld(mesh)
    points = np.array(mesh.vertices, np.float64)
    points[:, 2] = np.maximum(points[:, 2], ground)
    colors = np.full(points.shape, 180, np.uint8) if mesh.colors is None else mesh.colors
    faces, added, tints, count = [mesh.faces], [points], [colors], len(points)
    for loop in loops(border(mesh.faces)):
        middle, tint = points[loop].mean(axis=0), colors[loop].mean(axis=0, keepdims=True).astype(np.uint8)
        after = np.roll(loop, -1)
        if points[loop, 2].min() < ground + near:
            middle[2], foot = ground, np.arange(count, count + len(loop))
            added, tints = [*added, points[loop] * [1, 1, 0] + [0, 0, ground]], [*tints, colors[loop]]
            beyond = np.roll(foot, -1)
            faces += [np.stack([after, loop, foot], axis=1), np.stack([after, foot, beyond], axis=1)]
            count, loop, after = count + len(loop), foot, beyond
        faces.append(np.stack([after, loop, np.full(len(loop), count)], axis=1))
        added, tints = [*added, middle[None]], [*tints, tint]
        count += 1
    return Mesh(np.concatenate(added), np.concatenate(faces), np.concatenate(tints))
