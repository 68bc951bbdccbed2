"""Neighbours: hulls trimmed apart along their paths, so that no pair needs a filter, and the pairs that overlap all the same."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from s2a.prepare.room_hulls import RoomConfig, cut_all
from s2a.scene.geometry.convex import APART, clip, deepest, grown, halfspaces, hull, overlap, sections, sweep, volume
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import Collider, SimBody

GAP = 0.002  # [m] Between trimmed neighbours: as between real fronts, and Bullet thickens each hull by 1 mm
HANDLE_WEIGHT = 100.0  # of volume cut off a grasp region, against that of anything else
TRIED = 8  # Planes between two hulls that are tried, those with the thinnest overlap first
# Fraction of a hull that a path may cut off a part: more is a real collision, such as of a door that opens into a
# neighbour's handle, and both stay whole
MAX_LOSS = 0.2
STEP = 0.1  # [rad] Section of a turn that neighbours are cut free of

# What is left of two hulls, each in pieces; None: it stays whole
Cut = tuple[list[Mesh] | None, list[Mesh] | None]


class _Hulls:
    """The colliders of bodies, which cuts replace, and their paths."""

    def __init__(self, bodies: Mapping[str, SimBody], handles: Mapping[str, Sequence[str]], config: RoomConfig) -> None:
        self.bodies = {i: list(body.colliders) for i, body in bodies.items()}
        self._handles, self._config = handles, config
        # by piece: the piece, which keeps its id its own, and the volume of the hull that it is of, before and now [m^3]
        self._whole: dict[int, tuple[Collider, list[float]]] = {}
        # by hull and joint: the hull, which keeps its id its own, its sections, their bounds, and covers made so far
        self._sections: dict[tuple[int, Joint], tuple[Mesh, list[np.ndarray], np.ndarray, dict[int, Mesh | None]]] = {}

    def weight(self, body: str, collider: Collider) -> float:
        """Return what a cut volume of a collider counts."""
        return HANDLE_WEIGHT if collider.part in self._handles.get(body, ()) else 1.0

    def put(self, body: str, collider: Collider, pieces: Iterable[Mesh]) -> list[Collider]:
        """Put pieces in place of a collider, and return them."""
        at = next(k for k, other in enumerate(self.bodies[body]) if other is collider)
        fresh = [collider if piece is collider.mesh else replace(collider, mesh=piece) for piece in pieces]
        self.bodies[body][at : at + 1] = fresh
        _, volumes = self._volumes(collider)
        volumes[1] -= _loss(collider.mesh, [piece.mesh for piece in fresh])
        self._whole |= {id(piece): (piece, volumes) for piece in fresh}
        return fresh

    def _volumes(self, collider: Collider) -> tuple[Collider, list[float]]:
        whole = volume(collider.mesh)
        return self._whole.get(id(collider), (collider, [whole, whole]))

    def bearable(self, collider: Collider, loss: float) -> bool:
        """Return whether a cut [m^3], with all earlier ones, takes no more than MAX_LOSS of the hull that this is of."""
        _, (whole, left) = self._volumes(collider)
        return left - loss >= (1.0 - MAX_LOSS) * whole

    def boxes(self, body: str) -> np.ndarray:
        """Return the bounds of a body's colliders [m], shape [collider 2 3]."""
        return np.array([collider.mesh.bounds for collider in self.bodies[body]]).reshape(-1, 2, 3)

    def paths(self, mesh: Mesh, joint: Joint, boxes: np.ndarray) -> list[Mesh]:
        """Return convex hulls, GAP wider, that cover the sections of a hull's path that reach into boxes [box 2 3]."""
        if (key := (id(mesh), joint)) not in self._sections:
            points = sections(mesh, joint, STEP)
            bounds = np.array([[each.min(axis=0) - GAP, each.max(axis=0) + GAP] for each in points]).reshape(-1, 2, 3)
            self._sections[key] = (mesh, points, bounds, {})
        _, points, bounds, covers = self._sections[key]
        meet = np.all((bounds[:, None, 0] < boxes[:, 1]) & (boxes[:, 0] < bounds[:, None, 1]), axis=2)
        chosen = np.flatnonzero(np.any(meet, axis=1)).tolist()
        covers.update({k: hull(grown(points[k], GAP)) for k in chosen if k not in covers})
        return [cover for k in chosen if (cover := covers[k]) is not None]

    def cut(self, mesh: Mesh, paths: Sequence[Mesh]) -> list[Mesh]:
        """Return what paths leave of a hull."""
        config = self._config
        return cut_all(mesh, paths, config.cut_hulls, config.min_volume, config.min_cut_volume)


def trim_apart(
    bodies: Mapping[str, SimBody],
    joints: Mapping[str, Joint],
    parents: Mapping[str, str],
    handles: Mapping[str, Sequence[str]],
    config: RoomConfig,
) -> dict[str, SimBody]:
    """Return bodies whose colliders stay GAP apart, at rest and while one part moves.

    Furniture gives way to its parts: a frame gets a rebate. Of two parts that overlap at rest the plane between them takes the
    least volume; of a part and another one in its path, the one gives way that loses less. Where that would be more than
    MAX_LOSS, both stay as they are.

    Args:
        bodies: articulated parts and furniture by id.
        joints: of the articulated parts.
        parents: body that each of these moves against.
        handles: ids of the parts of each body that are grasped, which are cut last of all.
        config: how finely what is cut comes apart.
    """
    carried = {part: _carried(part, parents) for part in joints}
    hulls, ids = _Hulls(bodies, handles, config), list(joints)
    for k, one in enumerate(ids):
        for other in ids[k + 1 :]:
            if other not in carried[one] and one not in carried[other]:
                _trim(hulls, one, other, partial(_cut_at_rest, hulls, one, other))
    for part in ids:
        group = carried[part]
        for other in [i for i in ids if i not in group and i != parents[part]]:
            for body in group:
                _trim(hulls, body, other, partial(_cut_on_path, hulls, body, other, joints[part]))
    for part in ids:
        group = carried[part]
        for other in [i for i in bodies if i not in group and (i not in joints or i == parents[part])]:
            boxes = hulls.boxes(other)
            moving = [collider.mesh for body in group for collider in hulls.bodies[body]]
            paths = [path for mesh in moving for path in hulls.paths(mesh, joints[part], boxes)]
            for collider in tuple(hulls.bodies[other]) if paths else ():
                hulls.put(other, collider, hulls.cut(collider.mesh, paths))
    return {i: replace(body, colliders=tuple(hulls.bodies[i])) for i, body in bodies.items()}


def _carried(part: str, parents: Mapping[str, str]) -> list[str]:
    """Return a part and those that move with it."""
    group = [part]
    for body in group:
        group += [child for child, parent in parents.items() if parent == body]
    return group


def _trim(hulls: _Hulls, one: str, other: str, cut: Callable[[Collider, Collider], Cut | None]) -> None:
    """Cut each pair of colliders of two bodies, and what is left of them where an earlier cut took them apart.

    Where a cut is None, a real collision, both bodies stay as they were.
    """
    before = {body: list(hulls.bodies[body]) for body in (one, other)}
    todo = [(a, b) for a in hulls.bodies[one] for b in hulls.bodies[other]]
    while todo:
        pair = todo.pop()
        if (cuts := cut(*pair)) is None:
            hulls.bodies |= before
            return
        for body, collider, left in zip((one, other), pair, cuts, strict=True):
            if left is not None:
                fresh = hulls.put(body, collider, left)
                todo = [
                    (x, y)
                    for a, b in todo
                    for x in (fresh if a is collider else [a])
                    for y in (fresh if b is collider else [b])
                ]


def _cut_at_rest(hulls: _Hulls, one: str, other: str, a: Collider, b: Collider) -> Cut:
    """Return what is left of colliders of two parts that are nearer than GAP."""
    if (a.mesh.bounds[0] >= b.mesh.bounds[1] + GAP).any() or (b.mesh.bounds[0] >= a.mesh.bounds[1] + GAP).any():
        return None, None
    wide = hull(grown(a.mesh.vertices, GAP / 2))
    if wide is None or overlap(wide, b.mesh) <= APART:
        return None, None
    left = split(a.mesh, b.mesh, hulls.weight(one, a), hulls.weight(other, b))
    return tuple([] if mesh is None else [mesh] for mesh in left)  # type: ignore[return-value]


def split(a: Mesh, b: Mesh, weight_a: float = 1.0, weight_b: float = 1.0) -> tuple[Mesh | None, Mesh | None]:
    """Return two hulls cut apart by the plane that takes the least weighted volume, GAP between them; None for what is gone."""
    normals = np.unique(np.concatenate([halfspaces(a)[:, :3], -halfspaces(b)[:, :3]]).round(4), axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    top, bottom = (a.vertices @ normals.T).max(axis=0), (b.vertices @ normals.T).min(axis=0)
    best: tuple[float, Mesh | None, Mesh | None] = (np.inf, a, b)
    for k in np.argsort(top - bottom, kind="stable")[:TRIED]:
        middle = (top[k] + bottom[k]) / 2
        for below, above in (
            (middle - GAP / 2, middle + GAP / 2), (bottom[k] - GAP, bottom[k]), (top[k], top[k] + GAP),
        ):  # fmt: skip
            parts = clip(a, normals[k], below), clip(b, -normals[k], -above)
            loss = weight_a * _loss(a, parts[:1]) + weight_b * _loss(b, parts[1:])
            if loss < best[0]:
                best = (loss, *parts)
    return best[1:]


def _loss(whole: Mesh, parts: Sequence[Mesh | None]) -> float:
    """Return the volume that a hull loses by a cut [m^3]."""
    if any(part is whole for part in parts):
        return 0.0
    return volume(whole) - sum(volume(part) for part in parts if part is not None)


def _cut_on_path(hulls: _Hulls, one: str, other: str, joint: Joint, a: Collider, b: Collider) -> Cut | None:
    """Return what is left of a collider that a joint moves, or of another in its path, whichever loses less; None: too little."""
    paths = hulls.paths(a.mesh, joint, b.mesh.bounds[None])
    if not any(overlap(path, b.mesh) > APART for path in paths):
        return None, None
    back = replace(joint, limits=(-joint.limits[1], -joint.limits[0]))
    cuts: list[tuple[float, Cut]] = []
    left = hulls.cut(b.mesh, paths)
    if hulls.bearable(b, loss := _loss(b.mesh, left)):
        cuts.append((loss * hulls.weight(other, b), (None, left)))
    left = hulls.cut(a.mesh, hulls.paths(b.mesh, back, a.mesh.bounds[None]))
    if hulls.bearable(a, loss := _loss(a.mesh, left)):
        cuts.append((loss * hulls.weight(one, a), (left, None)))
    return min(cuts, key=lambda cut: cut[0])[1] if cuts else None


# [m] Hulls that overlap by less touch at most; float32 points of a room are exact to 1e-6. A door whose edge lies 0.1
# mm in a neighbour does not open
MAX_CONTACT_DEPTH = 1e-5
# [m] Gap below which neighbours count as overlapping: no scan resolves it. Fronts that were cut along one border
# touch all over, and twelve contacts without depth hold a drawer against a pull of 15 N
TOUCHING = 2e-4


def filtered_pairs(
    moving: Mapping[str, SimBody], fixed: Mapping[str, SimBody], joints: Mapping[str, Joint]
) -> dict[str, dict[str, float]]:
    """Return, for each articulated part, the bodies that it overlaps on its path, and how deep [m].

    Hulls bulge over what was scanned: of two neighbouring doors one can hit the other's handle, which must not be cut off for
    that. The other body stands at its scanned pose. Of bodies that only touch the depth is 0.
    """
    depths: dict[str, dict[str, float]] = {part: {} for part in moving}
    bounds = {i: _bounds([c.mesh for c in body.colliders]) for i, body in {**fixed, **moving}.items()}
    for part, body in moving.items():
        meshes = [hull(grown(collider.mesh.vertices, TOUCHING)) for collider in body.colliders]
        hulls = [mesh for mesh in meshes if mesh is not None]
        reach = _bounds([cover for piece in hulls for cover in sweep(piece, joints[part])])
        for other, still in {**fixed, **moving}.items():
            low, high = bounds[other]
            if other == part or (low > reach[1]).any() or (high < reach[0]).any():
                continue
            depth = deepest(hulls, [collider.mesh for collider in still.colliders], joints[part])
            if depth > MAX_CONTACT_DEPTH:
                depths[part][other] = max(0.0, depth - TOUCHING / 2)
    return depths


def _bounds(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return the lowest and highest corner of meshes [m], shape [2 3]; an empty box where there is none."""
    if not meshes:
        return np.array([[np.inf] * 3, [-np.inf] * 3])
    corners = np.array([mesh.bounds for mesh in meshes])
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
