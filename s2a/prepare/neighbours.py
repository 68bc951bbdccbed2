"""Neighbours: hulls trimmed apart along their paths, so that no pair needs a filter, and the pairs that overlap all the same."""

import logging
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from s2a.prepare.room_hulls import RoomConfig, cut_all
from s2a.scene.articulation import carried
from s2a.scene.geometry.convex import (
    APART,
    clip,
    contains,
    deepest,
    grown,
    halfspaces,
    hull,
    overlap,
    sections,
    sweep,
    volume,
)
from s2a.scene.geometry.mesh_ops import sample_with_faces
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import Collider, SimBody

GAP = 0.002  # [m] Between trimmed neighbours: as between real fronts, and Bullet thickens each hull by 1 mm
TRIED = 8  # Planes between two hulls that are tried, those with the thinnest overlap first
# Fraction of the hulls of a part that may be cut off it, and of one hull: more is a real collision, such as of a door that
# opens into a neighbour's handle, and both stay whole. Chosen: hulls bulge over a scan by 1 to 2 cm on both sides, a fifth of
# a front 0.2 m high; a hull may be a strip of that, of which half still stands where it was scanned
MAX_LOSS, MAX_HULL_LOSS = 0.2, 0.5
MUCH = 0.5  # Loss of furniture that is logged, with how much of its surface, by SAMPLES points, is within ON_HULL of a hull
ON_HULL, SAMPLES = 0.01, 2000  # [m]
STEP = 0.1  # [rad] Section of a turn that neighbours are cut free of

_log = logging.getLogger(__name__)

# What is left of two hulls, each in pieces; None: it stays whole
Cut = tuple[list[Mesh] | None, list[Mesh] | None]


class _Hulls:
    """The colliders of bodies, which cuts replace, and their paths."""

    def __init__(
        self, bodies: Mapping[str, SimBody], handles: Mapping[str, Collection[Collider]], config: RoomConfig
    ) -> None:
        self.bodies = {i: list(body.colliders) for i, body in bodies.items()}
        self._handles, self._config = handles, config
        # by collider: itself, which keeps its id its own, and the hull that it is a piece of
        self._origin = {id(c): (c, c) for colliders in self.bodies.values() for c in colliders}
        self._whole = {i: self._volumes(i) for i in bodies}  # before any cut
        # by hull and joint: the hull, which keeps its id its own, its sections, their bounds, and covers made so far
        self._sections: dict[tuple[int, Joint], tuple[Mesh, list[np.ndarray], np.ndarray, dict[int, Mesh | None]]] = {}

    def grasped(self, body: str, collider: Collider) -> bool:
        """Return whether a collider is one of a grasp region, which nothing cuts."""
        return any(collider is each for each in self._handles.get(body, ()))

    def put(self, body: str, collider: Collider, pieces: Iterable[Mesh]) -> list[Collider]:
        """Put pieces in place of a collider, and return them."""
        at = next(k for k, other in enumerate(self.bodies[body]) if other is collider)
        fresh = [collider if piece is collider.mesh else replace(collider, mesh=piece) for piece in pieces]
        self._origin |= {id(each): (each, self._origin[id(collider)][1]) for each in fresh}
        self.bodies[body][at : at + 1] = fresh
        return fresh

    def _volumes(self, body: str) -> dict[tuple[str, int | None], float]:
        """Return the volume of the hulls of each part of a body (part and None), and of each hull before any cut [m^3]."""
        volumes: dict[tuple[str, int | None], float] = {}
        for collider in self.bodies[body]:
            for key in (None, id(self._origin[id(collider)][1])):
                volumes[collider.part, key] = volumes.get((collider.part, key), 0.0) + volume(collider.mesh)
        return volumes

    def lost(self, body: str) -> set[str]:
        """Return the parts of a body that lost more than MAX_LOSS by cuts, or one hull of which more than MAX_HULL_LOSS."""
        left = self._volumes(body)
        return {
            part
            for (part, one), whole in self._whole[body].items()
            if left.get((part, one), 0.0) < (1.0 - (MAX_LOSS if one is None else MAX_HULL_LOSS)) * whole
        }

    def warn(self, name: str, body: SimBody) -> None:
        """Log of which furniture much was cut, and how much of its surface the rest still covers."""
        whole, left = ([c.mesh for c in each] for each in (body.colliders, self.bodies[name]))
        lost = 1.0 - sum(map(volume, left)) / max(sum(map(volume, whole)), 1e-12)
        if whole and lost > MUCH and len(body.visual.faces):
            points, _ = sample_with_faces(body.visual, SAMPLES, 0)
            was, now = (
                100 * np.any([contains(each, points, ON_HULL) for each in meshes], axis=0).mean()
                for meshes in (whole, left)
            )
            words = "%.0f %% of the hulls of %s cut where parts move; they cover %.0f %% of its surface, %.0f %% before"
            _log.warning(words, 100 * lost, name, now, was)

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
        chosen = np.flatnonzero(_meet(bounds, boxes).any(axis=1)).tolist()
        covers.update({k: hull(grown(points[k], GAP)) for k in chosen if k not in covers})
        return [cover for k in chosen if (cover := covers[k]) is not None]

    def cut(self, mesh: Mesh, paths: Sequence[Mesh], count: int = 1) -> list[Mesh]:
        """Return what paths leave of a hull, in so many pieces at most."""
        least = min(self._config.min_volume, (1.0 - MAX_HULL_LOSS) * volume(mesh))  # a small hull does not vanish
        return cut_all(mesh, paths, count, least, self._config.min_cut_volume)

    def recess(self, body: str, paths: Sequence[Mesh], firm: Collection[str]) -> None:
        """Cut paths out of a body that parts move against; of `firm` parts and those fixed to it only what they can bear."""
        firm = {*firm, *(collider.part for collider in self.bodies[body] if collider.part != body)}
        before, config = list(self.bodies[body]), self._config
        for collider in before:
            if not self.grasped(body, collider):
                self.put(
                    body, collider, self.cut(collider.mesh, paths, 1 if collider.part in firm else config.cut_hulls)
                )
        if lost := self.lost(body) & firm:
            left = [collider for collider in self.bodies[body] if collider.part not in lost]
            self.bodies[body] = [*left, *(collider for collider in before if collider.part in lost)]
        if not self.bodies[body]:  # a real collision, too
            self.bodies[body] = before


def trim_apart(
    bodies: Mapping[str, SimBody],
    joints: Mapping[str, Joint],
    parents: Mapping[str, str],
    handles: Mapping[str, Collection[Collider]],
    frozen: Collection[str],
    config: RoomConfig,
) -> dict[str, SimBody]:
    """Return bodies whose colliders stay apart: by GAP while one part moves, by GAP / 2 at rest.

    Furniture gives way to its parts: a frame gets a rebate; what is fixed to it, such as a pane, bears MAX_LOSS. Of a part and
    another one in its path, which begins at rest, the one gives way that loses less, by planes beyond which it stays whole.
    Where that would be more than MAX_LOSS of a part, MAX_HULL_LOSS of one hull, or a piece of what is grasped, both stay as
    they are on the path; at rest, the plane between them that takes the least volume parts them, under the same conditions.

    Args:
        bodies: articulated parts and furniture by id.
        joints: of the articulated parts.
        parents: body that each of these moves against.
        handles: colliders of each body at which it is grasped.
        frozen: ids of parts that could move, and are one with the furniture here.
        config: how finely what is cut comes apart.
    """
    groups = {part: carried(part, parents) for part in joints}
    hulls, ids, firm = _Hulls(bodies, handles, config), list(joints), {*frozen, *joints}
    for part in ids:
        for other in [i for i in ids if i not in groups[part] and i != parents[part]]:
            for body in groups[part]:
                boxes = hulls.boxes(other)
                if any(hulls.paths(collider.mesh, joints[part], boxes) for collider in hulls.bodies[body]):
                    _trim(hulls, body, other, partial(_cut_on_path, hulls, body, other, joints[part]))
    for k, one in enumerate(ids):
        for other in ids[k + 1 :]:
            near = _meet(hulls.boxes(one) + GAP * np.array([[-1.0], [1.0]]), hulls.boxes(other)).any()
            if near and other not in groups[one] and one not in groups[other]:
                _trim(hulls, one, other, partial(_cut_at_rest, hulls, one, other))
    for part in ids:
        group = groups[part]
        for other in [i for i in bodies if i not in group and (i not in joints or i == parents[part])]:
            boxes = hulls.boxes(other)
            moving = [collider.mesh for body in group for collider in hulls.bodies[body]]
            if paths := [path for mesh in moving for path in hulls.paths(mesh, joints[part], boxes)]:
                hulls.recess(other, paths, firm)
    for i, whole in bodies.items():
        hulls.warn(i, whole)
    return {i: replace(body, colliders=tuple(hulls.bodies[i])) for i, body in bodies.items()}


def _meet(some: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Return which bounds [some 2 3] overlap which others [other 2 3], shape [some other]."""
    return np.all((some[:, None, 0] < others[:, 1]) & (others[:, 0] < some[:, None, 1]), axis=2)


def _trim(hulls: _Hulls, one: str, other: str, cut: Callable[[Collider, Collider], Cut]) -> None:
    """Cut each pair of colliders of two bodies, and what is left of them where an earlier cut took them apart.

    Where a part loses more than it can bear, a real collision, both bodies stay as they were.
    """
    before = {body: list(hulls.bodies[body]) for body in (one, other)}
    todo = [(a, b) for a in hulls.bodies[one] for b in hulls.bodies[other]]
    while todo:
        pair = todo.pop()
        for body, collider, left in zip((one, other), pair, cut(*pair), strict=True):
            if left is not None:
                fresh = hulls.put(body, collider, left)
                todo = [
                    (x, y)
                    for a, b in todo
                    for x in (fresh if a is collider else [a])
                    for y in (fresh if b is collider else [b])
                ]
    if any(hulls.bodies[body] != colliders and hulls.lost(body) for body, colliders in before.items()):
        hulls.bodies |= before


def _cut_at_rest(hulls: _Hulls, one: str, other: str, a: Collider, b: Collider) -> Cut:
    """Return what is left of colliders of two parts that are nearer than GAP."""
    if (a.mesh.bounds[0] >= b.mesh.bounds[1] + GAP).any() or (b.mesh.bounds[0] >= a.mesh.bounds[1] + GAP).any():
        return None, None
    wide = hull(grown(a.mesh.vertices, GAP / 2))
    firm = hulls.grasped(one, a), hulls.grasped(other, b)
    if wide is None or all(firm) or overlap(wide, b.mesh) <= APART:
        return None, None
    left = split(a.mesh, b.mesh, *firm)
    return tuple([] if mesh is None else [mesh] for mesh in left)  # type: ignore[return-value]


def split(a: Mesh, b: Mesh, firm_a: bool = False, firm_b: bool = False) -> tuple[Mesh | None, Mesh | None]:
    """Return two hulls cut apart by the plane that takes the least volume, GAP between them; None for what is gone.

    Nothing is taken from a firm one; of the other nothing may be left then.
    """
    normals = np.unique(np.concatenate([halfspaces(a)[:, :3], -halfspaces(b)[:, :3]]).round(4), axis=0)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    top, bottom = (a.vertices @ normals.T).max(axis=0), (b.vertices @ normals.T).min(axis=0)
    best: tuple[float, Mesh | None, Mesh | None] = (np.inf, a if firm_a else None, b if firm_b else None)
    for k in np.argsort(top - bottom, kind="stable")[:TRIED]:
        middle = (top[k] + bottom[k]) / 2
        places = [(top[k], top[k] + GAP)] if firm_a else [(bottom[k] - GAP, bottom[k])] if firm_b else [
            (middle - GAP / 2, middle + GAP / 2), (bottom[k] - GAP, bottom[k]), (top[k], top[k] + GAP),
        ]  # fmt: skip
        for below, above in places:
            parts = a if firm_a else clip(a, normals[k], below), b if firm_b else clip(b, -normals[k], -above)
            loss = sum(_loss(whole, [] if part is None else [part]) for whole, part in zip((a, b), parts, strict=True))
            if loss < best[0]:
                best = (loss, *parts)
    return best[1:]


def _loss(whole: Mesh, parts: Sequence[Mesh]) -> float:
    """Return the volume that a hull loses by a cut [m^3]."""
    return 0.0 if any(part is whole for part in parts) else volume(whole) - sum(map(volume, parts))


def _cut_on_path(hulls: _Hulls, one: str, other: str, joint: Joint, a: Collider, b: Collider) -> Cut:
    """Return what is left of a collider that a joint moves, or of another in its path, whichever loses less."""
    paths = hulls.paths(a.mesh, joint, b.mesh.bounds[None])
    if not any(overlap(path, b.mesh) > APART for path in paths):
        return None, None
    back = replace(joint, limits=(-joint.limits[1], -joint.limits[0]))
    cuts: list[tuple[float, Cut]] = []
    if not hulls.grasped(other, b):
        left = hulls.cut(b.mesh, paths)
        cuts.append((_loss(b.mesh, left), (None, left)))
    if not hulls.grasped(one, a):
        left = hulls.cut(a.mesh, hulls.paths(b.mesh, back, a.mesh.bounds[None]))
        cuts.append((_loss(a.mesh, left), (left, None)))
    # what leaves nothing only where all else does, too
    return min(cuts, key=lambda cut: ([] in cut[1], cut[0]), default=(0.0, (None, None)))[1]


# [m] Hulls that overlap by less touch at most; float32 points of a room are exact to 1e-6. A door whose edge lies 0.1
# mm in a neighbour does not open
MAX_CONTACT_DEPTH = 1e-5
# [m] Gap below which neighbours count as overlapping: no scan resolves it. Fronts that were cut along one border
# touch all over, and twelve contacts without depth hold a drawer against a pull of 15 N
TOUCHING = 2e-4
STOPS = 24  # Coordinates between the limits at which the depth of an overlap is measured


def filtered_pairs(
    moving: Mapping[str, SimBody], fixed: Mapping[str, SimBody], joints: Mapping[str, Joint]
) -> dict[str, dict[str, float]]:
    """Return, for each articulated part, the bodies that it overlaps on its path, and how deep [m].

    Hulls bulge over what was scanned: of two neighbouring doors one can hit the other's handle, which must not be cut off for
    that. The other body stands at its scanned pose. Of bodies that only touch the depth is 0.
    """
    depths: dict[str, dict[str, float]] = {part: {} for part in moving}
    bodies = {**fixed, **moving}
    bounds = {i: _bounds([c.mesh for c in body.colliders]) for i, body in bodies.items()}
    for part, body in moving.items():
        paths = [path for c in body.colliders for path in sweep(c.mesh, joints[part], TOUCHING, STEP)]
        reach = _bounds(paths)
        for other, still in bodies.items():
            low, high = bounds[other]
            if other == part or (low > reach[1]).any() or (high < reach[0]).any():
                continue
            if any(overlap(path, c.mesh) > MAX_CONTACT_DEPTH for c in still.colliders for path in paths):
                own, others = ([c.mesh for c in each.colliders] for each in (body, still))
                depths[part][other] = deepest(own, others, joints[part], STOPS)
    return depths


def _bounds(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return the lowest and highest corner of meshes [m], shape [2 3]; an empty box where there is none."""
    if not meshes:
        return np.array([[np.inf] * 3, [-np.inf] * 3])
    corners = np.array([mesh.bounds for mesh in meshes])
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
