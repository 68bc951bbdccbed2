"""Relations of a placement hint: checks on the triangles of the room, and their use by an insertion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from s2a.core.errors import InputError
from s2a.language.grammar import BEDDING, EDGES, Relation, Wish, alike, is_kind_of, landmarks, parse_wish
from s2a.language.insert.plan import Plan
from s2a.language.insert.serves import SEATS, front, visible, visible_from
from s2a.language.insert.supports import floor_height, is_floor, nearby, target_mesh
from s2a.scene.geometry.mesh_query import kept_ray_mesh, visible_distance
from s2a.scene.scene import Mesh, Scene
from s2a.scene.upright_box import silhouette

BESIDE, FAR = 0.45, 0.8  # Largest gap to what a thing is near, and least gap to what it is away from [m]
AREA = 1.2  # Distance to an area's things [m], up to which an object is in it although those of another area are nearer
CONTACT = 0.03  # Largest gap to what carries a thing [m]: the noise of a scan
OFF_HEIGHT = 0.1  # Largest error of a height on a wall [m]
# Largest distance from the foot of what hangs on a wall, and least height of its underside above the floor [m]
FOOT, HUNG = 0.35, 0.4
SEEN = 0.5  # Least visible fraction of what is seen from somewhere
OPPOSITE = -0.5  # Largest cosine between the directions to two things that something is between
SPACING = 0.1  # Of the points that stand for a thing with large faces [m]
# Heights of the eyes of who sits and of who stands, and how far before a thing [m]
SITTING, STANDING, BEFORE = 1.15, 1.55, 0.4
AROUND = np.array([(np.cos(a), np.sin(a), 0.0) for a in np.arange(8) * np.pi / 4])
# Places in a rectangle, as fractions of its sides
THIRDS = np.array([(x, y) for x in (0.2, 0.5, 0.8) for y in (0.2, 0.5, 0.8)])
UP = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class PlacedBodies:
    """Boxes in the room that stand for places of one object, or the one object itself."""

    # low, high: lowest and highest corners [m], shape [body 3] each
    low: np.ndarray
    high: np.ndarray
    mesh: Mesh | None = None  # the object in its place; None where only boxes are known

    @staticmethod
    def of(object: Mesh) -> PlacedBodies:
        """Return an object in its place."""
        low, high = object.bounds[:, None].astype(float)
        return PlacedBodies(low, high, object)

    @staticmethod
    def at(places: np.ndarray, object: Mesh) -> PlacedBodies:
        """Return an upright object's boxes at places of its foot's middle [m], shape [place 3]."""
        sides = np.ptp(object.bounds, axis=0).astype(float)
        half = np.array([min(sides[:2]) / 2] * 2 + [0.0])
        return PlacedBodies(places - half, places + half + (0.0, 0.0, sides[2]))

    @property
    def middle(self) -> np.ndarray:
        """Middles [m], shape [body 3]."""
        return (self.low + self.high) / 2

    def along(self, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the least and largest coordinates on two level axes, the columns of [2 2]; shape [body 2] each."""
        if self.mesh is not None:
            own = self.mesh.vertices[:, :2] @ axes
            return own.min(axis=0)[None], own.max(axis=0)[None]
        middle, half = self.middle[:, :2] @ axes, (self.high - self.low)[:, :2] / 2
        return middle - half, middle + half

    def undersides(self) -> np.ndarray:
        """Return points of the undersides [m], shape [body point 3]."""
        if self.mesh is None:
            places = self.low[:, None, :2] + THIRDS * (self.high - self.low)[:, None, :2]
            return np.concatenate([places, np.broadcast_to(self.low[:, None, 2:], (len(self.low), 9, 1))], axis=2)
        height = self.mesh.vertices[:, 2] - self.low[0, 2]
        foot = self.mesh.vertices[height < 0.01 + 0.02 * height.max()].astype(float)
        foot = foot[:: max(1, len(foot) // 200)]
        middle = np.append(foot[:, :2].mean(axis=0), self.low[0, 2])
        return np.concatenate([foot, (foot + middle) / 2, middle[None]])[None]


class RoomRelations:
    """Relations of bodies to the things of a room; what is derived from a thing is kept for the next question."""

    def __init__(self, scene: Scene) -> None:
        """Begin; `scene` does not change."""
        self.scene, self.floor = scene, floor_height(scene)
        self._meshes: dict[str, Mesh] = {}
        self._trees: dict[tuple[str, int], cKDTree] = {}
        self._fine: dict[str, cKDTree] = {}
        self._viewers: dict[str, np.ndarray] = {}
        self._outlines: dict[str, np.ndarray] = {}

    def met(self, bodies: PlacedBodies, relation: Relation) -> np.ndarray:
        """Return which bodies have a relation to one of the things that it may mean, shape [body]."""
        if relation.kind == "height":
            middle = bodies.middle[:, 2] - self.floor
            return np.asarray(np.abs(middle - float(relation.height or 0.0)) <= OFF_HEIGHT)
        if relation.kind == "area":
            return np.asarray(self._in_area(bodies, relation.part_ids[0]) != relation.negated)
        holds = np.zeros(len(bodies.low), bool)
        for ids in product(*relation.part_ids):
            holds |= self._holds(bodies, relation.kind, ids)
        return np.asarray(holds != relation.negated)

    def mesh(self, part_id: str) -> Mesh:
        """Return the surface of a part and its descendants."""
        if part_id not in self._meshes:
            self._meshes[part_id] = target_mesh(self.scene, part_id)
        return self._meshes[part_id]

    def _holds(self, bodies: PlacedBodies, kind: str, ids: Sequence[str]) -> np.ndarray:
        mesh = self.mesh(ids[0])
        if kind == "between":
            return self._between(bodies, *ids)
        if kind in ("near", "away"):
            gap = self._gap(bodies, ids[0])
            return np.asarray(gap <= BESIDE if kind == "near" else gap >= FAR)
        if kind == "on":
            return self._carried(bodies, ids[0])
        if kind == "in":
            return _within(bodies, mesh)
        if kind in ("wall", "against"):
            touches = self._gap(bodies, ids[0]) <= (2 * CONTACT if bodies.mesh or kind == "wall" else 10 * CONTACT)
            return np.asarray(touches & ((kind == "against") | (bodies.low[:, 2] > self.floor + 0.2)))
        if kind == "below" and self._hung(ids[0]):
            aside = self._tree(ids[0], 2).query(bodies.middle[:, :2])[0]
            return np.asarray((bodies.high[:, 2] <= mesh.bounds[0, 2] + 0.02) & (aside <= FOOT))
        if kind == "seen from":
            return self._seen_from(bodies, ids[0])
        if kind in ("top", "bottom"):
            return self._carried(bodies, ids[0]) & _extreme(bodies, mesh, kind == "top")
        if kind == "opposite":
            return self._opposite(bodies, ids[0])
        holds = placed(self._viewer(ids[0]), bodies, self._outline(ids[0]), mesh.bounds[:, 2], kind)
        return holds & _covered(bodies, mesh) if kind == "below" else holds

    def _viewer(self, part_id: str) -> np.ndarray:
        if part_id not in self._viewers:
            self._viewers[part_id] = viewer(self.scene, part_id)
        return self._viewers[part_id]

    def _outline(self, part_id: str) -> np.ndarray:
        """Return the points of a thing that bound it from all sides [m], shape [point 3]; not all are gone through each time."""
        if part_id not in self._outlines:
            self._outlines[part_id] = silhouette(self.mesh(part_id).vertices)
        return self._outlines[part_id]

    def _tree(self, part_id: str, axes: int) -> cKDTree:
        """Return a tree of the corners and middles of a thing's triangles, in the plane or in space."""
        if (part_id, axes) not in self._trees:
            mesh = self.mesh(part_id)
            points = np.concatenate([mesh.vertices, mesh.vertices[mesh.faces].mean(axis=1)])
            self._trees[part_id, axes] = cKDTree(points[:, :axes])
        return self._trees[part_id, axes]

    def _gap(self, bodies: PlacedBodies, part_id: str) -> np.ndarray:
        """Return the distances to a thing's surface [m], up to the spacing of its points, shape [body]."""
        apart = _box_gap(bodies, self.mesh(part_id))
        tree = self._tree(part_id, 3)
        if bodies.mesh is not None:
            own = bodies.mesh
            points = np.concatenate([own.vertices, own.vertices[own.faces].mean(axis=1)])
            return np.maximum(apart, np.minimum(tree.query(points)[0].min(), apart + 0.02))
        nearest = tree.data[tree.query(bodies.middle)[1]]
        return np.maximum(
            apart, np.linalg.norm(np.maximum(bodies.low - nearest, 0) + np.maximum(nearest - bodies.high, 0), axis=1)
        )

    def _carried(self, bodies: PlacedBodies, part_id: str) -> np.ndarray:
        """Return which bodies a thing is right below, or what covers it: rays from their undersides meet it."""
        bedding = self._bedding(part_id) if is_kind_of(self.scene.parts[part_id].label, "bed") else []
        rests = np.logical_or.reduce([_rests(bodies, self.mesh(i)) for i in (part_id, *bedding)])
        # The faces of a floor under furniture are often labelled as that.
        on_floor = is_floor(self.scene, part_id) & (np.abs(bodies.low[:, 2] - self.floor) <= CONTACT)
        return np.asarray(rests | on_floor)

    def _bedding(self, part_id: str) -> list[str]:
        """Return what covers a bed: bedding that is above some of its plan."""
        low, high = self.mesh(part_id).bounds[:, :2]
        bedding = {
            i: part.mesh.bounds[:, :2]
            for i, part in self.scene.parts.items()
            if part.label.lower() in BEDDING and len(part.mesh.faces)
        }
        return [i for i, (first, last) in bedding.items() if (first < high).all() and (last > low).all()]

    def _hung(self, part_id: str) -> bool:
        """Return True for what hangs on a wall: it is thin, and its underside is high."""
        outline = self._outline(part_id)
        axes = np.array([(np.cos(a), np.sin(a)) for a in np.arange(18) * np.pi / 18]).T
        return bool(np.ptp(outline[:, :2] @ axes, axis=0).min() < HUNG and outline[:, 2].min() > self.floor + HUNG)

    def _opposite(self, bodies: PlacedBodies, part_id: str) -> np.ndarray:
        """Return which bodies are before a thing, at a distance, and within its width or near that."""
        axes = _axes(self._viewer(part_id))
        own, its = bodies.middle[:, :2] @ axes, self._outline(part_id)[:, :2] @ axes
        low, high = its.min(axis=0), its.max(axis=0)
        return np.asarray((own[:, 1] >= high[1] + FAR) & (low[0] - 0.3 <= own[:, 0]) & (own[:, 0] <= high[0] + 0.3))

    def _in_area(self, bodies: PlacedBodies, own: Sequence[str]) -> np.ndarray:
        """Return which bodies are near an area's own things, or have no thing of another area nearer."""
        marks = landmarks({i: part.label for i, part in self.scene.parts.items() if len(part.mesh.faces)})
        own_gap = np.min([_box_gap(bodies, self.mesh(i)) for i in own], axis=0)
        others = [_box_gap(bodies, self.mesh(i)) for i in marks if i not in own]
        return np.asarray((own_gap <= AREA) | (own_gap <= np.min(others, axis=0, initial=np.inf)))

    def _between(self, bodies: PlacedBodies, one: str, other: str) -> np.ndarray:
        """Return which bodies' middles are between two things: within the width of these, and the two to opposite sides."""
        if one == other:
            return np.zeros(len(bodies.low), bool)
        a, b = (self.mesh(i).bounds.mean(axis=0)[:2].astype(float) for i in (one, other))
        line, off = b - a, bodies.middle[:, :2] - a
        length = max(float(np.linalg.norm(line)), 1e-6)
        across = np.array([-line[1], line[0]]) / length
        along, aside = off @ line / length, np.abs(off @ across)
        half = max(float(np.ptp(self._outline(i)[:, :2] @ across)) / 2 for i in (one, other))
        first, second = (self._nearest(bodies, i) - bodies.middle[:, :2] for i in (one, other))
        apart = np.linalg.norm(first, axis=1) * np.linalg.norm(second, axis=1)
        opposite = (first * second).sum(axis=1) <= OPPOSITE * np.maximum(apart, 1e-9)
        return np.asarray((0.1 * length < along) & (along < 0.9 * length) & (aside <= max(half, 0.15)) & opposite)

    def _nearest(self, bodies: PlacedBodies, part_id: str) -> np.ndarray:
        """Return the points of a thing nearest to bodies' middles in the plan [m], shape [body 2]."""
        if part_id not in self._fine:
            mesh = self.mesh(part_id)
            corners = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, SPACING, max_iter=20)[0]
            self._fine[part_id] = cKDTree(corners[:, :2])
        tree = self._fine[part_id]
        return np.asarray(tree.data[tree.query(bodies.middle[:, :2])[1]])

    def _seen_from(self, bodies: PlacedBodies, part_id: str) -> np.ndarray:
        """Return which bodies who uses a thing sees: over a seat, and ahead of it; else before the thing; of a box its top."""
        toward, mesh = self._viewer(part_id), self.mesh(part_id)
        axes = np.array([toward, (-toward[1], toward[0])])
        seat = any(is_kind_of(self.scene.parts[part_id].label, one) for one in SEATS)
        low, high = (mesh.vertices[:, :2] @ axes.T).min(axis=0), (mesh.vertices[:, :2] @ axes.T).max(axis=0)
        along = (low[0] + high[0]) / 2 if seat else high[0] + BEFORE
        height = self.floor + (SITTING if mesh.bounds[1, 2] < self.floor + SITTING else STANDING)
        aside = low[1] + np.array([0.25, 0.5, 0.75]) * (high[1] - low[1])
        eyes = np.array([[*(axes.T @ (along, a)), height] for a in aside])
        ahead = (bodies.middle[:, :2] @ toward > along) | (not seat)
        if bodies.mesh is not None:
            return np.asarray(ahead & (visible_from(self.scene, bodies.mesh, eyes).max() >= SEEN))
        tops = np.column_stack([bodies.middle[:, :2], bodies.high[:, 2]])
        around = nearby(
            self.scene, np.minimum(tops.min(axis=0), eyes.min(axis=0)), np.maximum(tops.max(axis=0), eyes.max(axis=0))
        )
        return np.asarray(ahead & visible(around, tops, eyes).any(axis=0))


def met(scene: Scene, object: Mesh, relation: Relation) -> bool:
    """Return True if an object in its place [m] has a relation to one of the things that it may mean."""
    return bool(RoomRelations(scene).met(PlacedBodies.of(object), relation)[0])


def viewer(scene: Scene, part_id: str) -> np.ndarray:
    """Return the horizontal direction from a thing to who stands before it, unit, shape [2]: the front of what carries it."""
    return front(scene, _carrier(scene, part_id))


def _axes(toward: np.ndarray) -> np.ndarray:
    """Return the level axes of who stands in a direction [2] from a thing, as columns: to the right, and towards him."""
    return np.stack([(-toward[1], toward[0]), toward], axis=1)


def placed(toward: np.ndarray, bodies: PlacedBodies, outline: np.ndarray, heights: np.ndarray, kind: str) -> np.ndarray:
    """Return which bodies are left of, above ... a thing, as seen by somebody in a direction [2] from it, shape [body].

    The thing is given by its outline [point 3] and its least and largest height [m].
    """
    axes = _axes(toward)
    (first, last), its = bodies.along(axes), outline[:, :2] @ axes
    low, high = its.min(axis=0), its.max(axis=0)
    size = np.maximum(high - low, 1e-6)
    apart = np.maximum(np.maximum(first - high, low - last), 0.0)
    fraction = ((first + last) / 2 - low) / size
    if kind in ("left", "right", "front", "behind"):
        axis, reach = (0, (0.7, 0.3)) if kind in ("left", "right") else (1, (0.1, 0.7))
        beyond = (low - last if kind in ("left", "behind") else first - high)[:, axis]
        return np.asarray((beyond >= -0.25 * (last - first)[:, axis]) & (apart <= reach).all(axis=1))
    if kind == "above":
        return np.asarray((bodies.low[:, 2] >= heights[1] - 0.01) & (apart <= (0.0, 0.3)).all(axis=1))
    if kind == "below":
        return np.asarray(
            (bodies.high[:, 2] <= heights[1] + 0.01) & ((fraction >= 0.0) & (fraction <= 1.0)).all(axis=1)
        )
    within = ((fraction >= -0.05) & (fraction <= 1.05)).all(axis=1)
    if kind in EDGES:
        axis = 0 if kind in ("left edge", "right edge") else 1
        lower = kind in ("left edge", "back edge")
        in_third = fraction[:, axis] <= 0.35 if lower else fraction[:, axis] >= 0.65
        return np.asarray(within & (in_third | ((first - low if lower else high - last)[:, axis] <= 0.1)))
    if kind == "corner":
        return np.asarray(within & (np.minimum(first - low, high - last) <= np.maximum(0.15 * size, 0.1)).all(axis=1))
    return np.asarray(within & (np.abs(fraction - 0.5) <= np.maximum(0.17, 0.1 / size)).all(axis=1))


def _covered(bodies: PlacedBodies, mesh: Mesh) -> np.ndarray:
    """Return which bodies a thing is over, seen along rays upwards."""
    places = bodies.low[:, None, :2] + THIRDS * (bodies.high - bodies.low)[:, None, :2]
    start = np.concatenate([places, np.broadcast_to(bodies.high[:, None, 2:], (len(places), 9, 1))], axis=2)
    return (
        _meets(mesh, start, UP, max(float(mesh.bounds[1, 2] - bodies.high[:, 2].min()), 0.0) + 0.01).mean(axis=1) > 0.6
    )


def _meets(mesh: Mesh, start: np.ndarray, direction: np.ndarray, reach: float) -> np.ndarray:
    """Return which rays meet a thing within some metres; starts [body ray 3], shape [body ray]."""
    seen, _ = visible_distance(kept_ray_mesh(mesh), start.reshape(-1, 3), direction, reach)
    return np.asarray(seen.reshape(start.shape[:2]) < 0.999 * reach)


def _carrier(scene: Scene, part_id: str) -> str:
    """Return the id of what a small thing stands on, for that has a front; else its own."""
    mesh = target_mesh(scene, part_id)
    if np.ptp(mesh.bounds, axis=0)[:2].max() > 0.7:
        return part_id
    bodies = PlacedBodies.of(mesh)
    for other, part in scene.parts.items():
        big = len(part.mesh.vertices) and part.parent is None and "floor" not in part.label.lower()
        if not big or other == part_id or np.ptp(part.mesh.bounds, axis=0)[:2].max() < 0.5:
            continue
        if _rests(bodies, part.mesh)[0]:
            return other
    return part_id


def _rests(bodies: PlacedBodies, mesh: Mesh) -> np.ndarray:
    """Return which bodies have a surface right below them: a fifth of the rays from their undersides meet it."""
    start = bodies.undersides() + 0.02 * UP
    reach = 0.02 + CONTACT + 0.01
    below, above = start.reshape(-1, 3).min(axis=0) - reach * UP, start.reshape(-1, 3).max(axis=0)
    if (below > mesh.bounds[1]).any() or (above < mesh.bounds[0]).any():
        return np.zeros(len(start), bool)  # no ray comes near it, and to ask them takes milliseconds
    return np.asarray(_meets(mesh, start, -UP, reach).mean(axis=1) > 0.2)


def _within(bodies: PlacedBodies, mesh: Mesh) -> np.ndarray:
    """Return which bodies a thing rises around, and which begin below its top."""
    low, high = mesh.bounds.astype(float)
    level = bodies.middle[:, :2]
    inside = ((level >= low[:2]) & (level <= high[:2])).all(axis=1)
    inside &= (bodies.low[:, 2] > low[2] - CONTACT) & (bodies.low[:, 2] < high[2] - 0.01)
    if not inside.any():
        return np.asarray(inside)
    # At a third of what is below the rim: shallow trays hold tall things.
    height = bodies.low[:, 2] + 0.5 * np.minimum((bodies.high - bodies.low)[:, 2], high[2] - bodies.low[:, 2])
    start = np.repeat(np.column_stack([level, height])[:, None], 8, axis=1)
    reach = float(np.linalg.norm(high - low))
    around = np.tile(AROUND, (len(level), 1))
    return np.asarray(inside & (_meets(mesh, start, around, reach).sum(axis=1) >= 5))


def _extreme(bodies: PlacedBodies, mesh: Mesh, top: bool) -> np.ndarray:
    """Return which bodies have no board of a shelf above them, other than its lid; or none below what carries them."""
    up, reach = (1.0 if top else -1.0), 3.0
    start = bodies.middle
    start[:, 2] = bodies.high[:, 2] if top else bodies.low[:, 2] - 2 * CONTACT
    boards = np.zeros(len(start), int)
    for _ in range(12):
        seen, _ = visible_distance(kept_ray_mesh(mesh), start, up * UP, reach)
        boards += seen < reach
        start[:, 2] += up * (np.where(seen < reach, seen, 2 * reach) + 0.05)  # over the board, or away
        if (seen >= reach).all():
            break
    # The lid of a shelf may be above its uppermost board, and its base below the lowest.
    return np.asarray(boards <= 1)


# Relations to what stands or hangs at about the same height, and the lowest underside that is out of reach [m]
LEVEL, REACH = ("near", "left", "right", "front", "behind", "between"), 1.9
NAMED = 12  # Kinds of things that are named where one is missing


def read_wish(text: str, scene: Scene) -> Wish:
    """Return the parsed wish for a room.

    Nothing stands beside what hangs from the ceiling: without another one, that lamp counts as missing.
    """
    wish = parse_wish(text, {i: part.label for i, part in scene.parts.items() if len(part.mesh.faces)})
    if not wish.relations:
        return wish
    high = floor_height(scene) + REACH
    low = {i for i, part in scene.parts.items() if len(part.mesh.faces) and part.mesh.bounds[0, 2] < high}
    relations, missing = [], list(wish.missing)
    for one in wish.relations:
        ids = tuple(tuple(i for i in some if i in low) for some in one.part_ids)
        if one.kind not in LEVEL or all(ids):
            relations.append(replace(one, part_ids=ids) if one.kind in LEVEL else one)
        elif not one.negated:
            missing.append(scene.parts[next(some for some in one.part_ids if some)[0]].label)
    return Wish(tuple(relations), tuple(dict.fromkeys(missing)), wish.unread)


def planned_place(plan: Plan) -> Wish:
    """Return where a plan wants an object on its support, as relations that are searched for and checked as a wish's are."""
    relations = [Relation(one.relation, tuple((part_id,) for part_id in one.of), one.relation) for one in plan.place]
    height = plan.choices[0].height if plan.hangs else None
    if height is not None:
        relations.append(Relation("height", (), f"at {height:g} m", height))
    return Wish(tuple(relations))


def decline(wish: Wish, text: str, scene: Scene, understood: bool) -> None:
    """Raise an InputError if a wish names a thing that is not there, or if nothing of it is known to mean anything.

    `understood`: true if a model reads the wish, too.
    """
    remedy = "ask a model (llm=chat), or give wish=prefer to ignore it"
    if wish.unread and wish.relations and not (wish.missing or understood):
        raise InputError(
            f"prompt {text[:80]!r}: the rules do not read {wish.unread[0]!r} there; say it as 'at the left end of the couch', "
            + remedy
        )
    if text and not (wish.relations or wish.missing or understood):
        raise InputError(
            f"prompt {text[:80]!r}: the rules know relations to things of the room, such as 'on the desk', 'left of the bed', "
            f"'between the cup and the lamp'; say it so, {remedy}"
        )
    if not wish.missing:
        return
    kinds = list(dict.fromkeys(part.label for part in scene.parts.values() if part.parent is None))
    meant = alike(wish.missing[0], kinds)
    hint = f"; most alike: {', '.join(meant[:3])}" if meant else ""
    kinds = [*meant, *(kind for kind in kinds if kind not in meant)]
    listed = ", ".join(kinds[:NAMED]) + (", ..." if len(kinds) > NAMED else "")
    raise InputError(
        f"prompt {text[:80]!r}: there is no {wish.missing[0]!r} in this room{hint}; "
        f"there are: {listed}; name one of these, or give wish=prefer to put it elsewhere"
    )


def objection(related: RoomRelations, wish: Wish, object: Mesh) -> str:
    """Return the first relation that an object in its place [m] does not have, as a clause; empty if it has all."""
    bodies = PlacedBodies.of(object)
    unmet = next((one for one in wish.relations if not related.met(bodies, one)[0]), None)
    return "" if unmet is None else f"it would not be {'so: not ' if unmet.negated else ''}{unmet.words!r} there"


def verdict(wish: Wish, text: str, scene: Scene, object: Mesh) -> dict[str, Any]:
    """Return for the record which relations of a wish hold.

    `heeded` is None where nothing of it was understood, and where what was understood holds and the rest was not.
    """
    relations = [{"relation": one.kind, "words": one.words, "met": met(scene, object, one)} for one in wish.relations]
    heeded = all(one["met"] for one in relations) and not wish.missing if relations or wish.missing else None
    record = {"wish": text, "relations": relations, "missing": list(wish.missing), "unread": list(wish.unread)}
    return {**record, "heeded": None if heeded and wish.unread else heeded}


BLOCK = 500
"""Places that are looked at first."""


def allowed(wish: Wish, related: RoomRelations, object: Mesh) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return a filter of places [m] for the search, by an object's box where the check of the result has its surface; None: all.

    `object`: upright, standing on z = 0 above the origin, in metres.
    """
    if not wish.relations:
        return None

    def keep(places: np.ndarray) -> np.ndarray:
        stays = np.ones(len(places), bool)
        for one in wish.relations:
            if stays.any():
                stays[stays] = related.met(PlacedBodies.at(places[stays], object), one)
        return stays

    return keep


def any_allowed(keep: Callable[[np.ndarray], np.ndarray], places: np.ndarray) -> bool:
    """Return True if a filter of places [m], shape [place 3], keeps one: ever more are looked at up to the first."""
    order = np.random.default_rng(0).permutation(len(places))
    begin, count = 0, BLOCK
    while begin < len(order):
        if keep(places[order[begin : begin + count]]).any():
            return True
        begin, count = begin + count, 4 * count
    return False


def _box_gap(bodies: PlacedBodies, mesh: Mesh) -> np.ndarray:
    """Return the distances of boxes to the box of a thing [m], shape [body]."""
    apart = np.maximum(bodies.low - mesh.bounds[1], mesh.bounds[0] - bodies.high)
    return np.linalg.norm(np.maximum(apart, 0.0), axis=1)
