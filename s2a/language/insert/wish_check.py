"""Relations of a placement hint: checks on the triangles of the room, and their use by an insertion."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
from scipy.spatial import cKDTree

from s2a.core.config import nearest
from s2a.core.errors import InputError
from s2a.language.grammar import EDGES, Relation, Wish, is_kind_of, landmarks, parse_wish
from s2a.language.insert.plan import Plan
from s2a.language.insert.search import floor_height
from s2a.language.insert.serves import front, visible_from
from s2a.language.insert.supports import target_mesh
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_query import kept_ray_mesh, visible_distance
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd.descriptive import silhouette

BESIDE, FAR = 0.45, 0.8
"""Largest gap to what a thing is near, and least gap to what it is away from [m]."""
AREA = 1.2
"""Distance to an area's things [m], up to which an object is in it although those of another area are nearer."""
CONTACT = 0.03
"""Largest gap to what carries a thing [m]: the noise of a scan."""
OFF_HEIGHT = 0.1
"""Largest error of a height on a wall [m]."""
SEEN = 0.5
"""Least visible fraction of what is seen from somewhere."""
SEATS = ("sofa", "armchair", "chair", "bed", "bench", "toilet")
"""On which one sits, and looks ahead; before all else one sits or stands, and looks around."""
SITTING, STANDING, BEFORE = 1.15, 1.55, 0.4
"""Heights of the eyes of who sits and of who stands, and how far before a thing [m]."""
AROUND = np.array([(np.cos(a), np.sin(a), 0.0) for a in np.arange(8) * np.pi / 4])


def met(scene: Scene, object: Mesh, relation: Relation) -> bool:
    """Return True if an object in its place has a relation to one of the things that it may mean.

    `object`: in the scene [m].
    """
    if relation.kind == "height":
        middle = float(object.bounds[:, 2].mean()) - floor_height(scene)
        return abs(middle - float(relation.height or 0.0)) <= OFF_HEIGHT
    if relation.kind == "area":
        boxes = {i: target_mesh(scene, i) for i in {*relation.part_ids[0], *_landmarks(scene)}}
        return _in_area(object, relation.part_ids[0], boxes) != relation.negated
    holds = any(_holds(scene, object, relation.kind, list(ids)) for ids in product(*relation.part_ids))
    return holds != relation.negated


def _holds(scene: Scene, object: Mesh, kind: str, ids: list[str]) -> bool:
    meshes = [target_mesh(scene, part_id) for part_id in ids]
    if kind == "between":
        return len(meshes) == 2 and ids[0] != ids[1] and between(object, *meshes)
    if kind in ("near", "away"):
        gap = _gap(object, meshes[0])
        return gap <= BESIDE if kind == "near" else gap >= FAR
    if kind == "on":
        return _carried(object, meshes[0])
    if kind == "in":
        return _within(object, meshes[0])
    if kind == "wall":
        return _gap(object, meshes[0]) <= 2 * CONTACT and object.bounds[0, 2] > floor_height(scene) + 0.2
    if kind == "against":
        return _gap(object, meshes[0]) <= 2 * CONTACT
    if kind == "opposite":
        return _opposite(viewer(scene, ids[0]), object, meshes[0])
    if kind == "below" and not _covered(object, meshes[0]):
        return False
    if kind == "seen from":
        return _seen_from(scene, object, ids[0], meshes[0])
    if kind in ("top", "bottom"):
        return _carried(object, meshes[0]) and _extreme(object, meshes[0], kind == "top")
    return placed(viewer(scene, ids[0]), object, meshes[0], kind)


def viewer(scene: Scene, part_id: str) -> np.ndarray:
    """Return the horizontal direction from a thing to who stands before it, unit, shape [2]: the front of what carries it."""
    return front(scene, _carrier(scene, part_id))


def placed(toward: np.ndarray, object: Mesh, mesh: Mesh, kind: str) -> bool:
    """Return True if an object is left of, above ... a thing, as seen by somebody in a direction [2] from it."""
    axes = np.stack([(-toward[1], toward[0]), toward], axis=1)  # to the right, and towards the viewer
    own, its = object.vertices[:, :2] @ axes, mesh.vertices[:, :2] @ axes
    first, last, low, high = own.min(axis=0), own.max(axis=0), its.min(axis=0), its.max(axis=0)
    size = np.maximum(high - low, 1e-6)
    apart = np.maximum(np.maximum(first - high, low - last), 0.0)
    fraction = ((first + last) / 2 - low) / size
    if kind in ("left", "right", "front", "behind"):
        axis, reach = (0, (0.7, 0.3)) if kind in ("left", "right") else (1, (0.1, 0.7))
        beyond = (low - last if kind in ("left", "behind") else first - high)[axis]
        return bool(beyond >= -0.25 * (last - first)[axis] and (apart <= reach).all())
    (bottom, upper), top = object.bounds[:, 2], float(mesh.bounds[1, 2])
    if kind == "above":
        return bool(bottom >= top - 0.01 and (apart <= (0.0, 0.3)).all())
    if kind == "below":
        return bool(upper <= top + 0.01 and (0.0 <= fraction).all() and (fraction <= 1.0).all())
    if not ((fraction >= -0.05).all() and (fraction <= 1.05).all()):
        return False
    if kind in EDGES:
        axis = 0 if kind in ("left edge", "right edge") else 1
        from_low, from_high = (first - low)[axis], (high - last)[axis]
        lower = kind in ("left edge", "back edge")
        in_third = fraction[axis] <= 0.35 if lower else fraction[axis] >= 0.65
        return bool(in_third or (from_low if lower else from_high) <= 0.1)
    if kind == "corner":
        return bool((np.minimum(first - low, high - last) <= np.maximum(0.15 * size, 0.1)).all())
    return bool((np.abs(fraction - 0.5) <= np.maximum(0.17, 0.1 / size)).all())


def _opposite(toward: np.ndarray, object: Mesh, mesh: Mesh) -> bool:
    """Return True if an object is before a thing that faces a direction [2], at a distance, and within its width or near that."""
    axes = np.stack([(-toward[1], toward[0]), toward], axis=1)
    own, its = object.bounds.mean(axis=0)[:2] @ axes, mesh.vertices[:, :2] @ axes
    low, high = its.min(axis=0), its.max(axis=0)
    return bool(own[1] >= high[1] + FAR and low[0] - 0.3 <= own[0] <= high[0] + 0.3)


def _landmarks(scene: Scene) -> tuple[str, ...]:
    return landmarks({i: part.label for i, part in scene.parts.items() if len(part.mesh.faces)})


def _in_area(object: Mesh, own: Sequence[str], meshes: Mapping[str, Mesh]) -> bool:
    """Return True if an object is near an area's own things, or no thing of another area is nearer."""
    nearest_own = min(_box_gap(object, meshes[i]) for i in own)
    return nearest_own <= AREA or all(
        _box_gap(object, mesh) >= nearest_own for i, mesh in meshes.items() if i not in own
    )


def _covered(object: Mesh, mesh: Mesh) -> bool:
    """Return True if a thing is over most of an object, seen along rays upwards."""
    low, high = object.bounds.astype(float)
    grid = np.array([(x, y) for x in (0.2, 0.5, 0.8) for y in (0.2, 0.5, 0.8)])
    start = np.column_stack([low[:2] + grid * (high - low)[:2], np.full(9, high[2])])
    reach = float(mesh.bounds[1, 2]) - high[2] + 0.01
    if reach <= 0.01:
        return False
    seen, _ = visible_distance(kept_ray_mesh(mesh), start, np.array([0.0, 0.0, 1.0]), reach)
    return bool((seen < 0.999 * reach).mean() > 0.5)


def between(object: Mesh, one: Mesh, other: Mesh) -> bool:
    """Return True if an object's middle is between two things and not beside the line from one to the other."""
    a, b, c = (mesh.bounds.mean(axis=0)[:2].astype(float) for mesh in (one, other, object))
    line = b - a
    length = float(np.linalg.norm(line))
    if length < 1e-6:
        return False
    along = float((c - a) @ line) / length
    aside = abs(float(np.cross(np.append(line, 0.0), np.append(c - a, 0.0))[2])) / length
    across = np.array([-line[1], line[0]]) / length
    half = max(float(np.ptp(mesh.vertices[:, :2] @ across)) / 2 for mesh in (one, other))
    return bool(0.1 * length < along < 0.9 * length and aside <= max(half, 0.15))


def _seen_from(scene: Scene, object: Mesh, part_id: str, mesh: Mesh) -> bool:
    """Return True if who uses a thing sees most of an object: over a seat, and ahead of it; else before the thing."""
    toward, floor = viewer(scene, part_id), floor_height(scene)
    axes = np.array([toward, (-toward[1], toward[0])])
    seat = any(is_kind_of(scene.parts[part_id].label, one) for one in SEATS)
    low, high = (mesh.vertices[:, :2] @ axes.T).min(axis=0), (mesh.vertices[:, :2] @ axes.T).max(axis=0)
    along = (low[0] + high[0]) / 2 if seat else high[0] + BEFORE
    height = floor + (SITTING if mesh.bounds[1, 2] < floor + SITTING else STANDING)
    aside = low[1] + np.array([0.25, 0.5, 0.75]) * (high[1] - low[1])
    eyes = np.array([[*(axes.T @ (along, a)), height] for a in aside])
    ahead = float(object.bounds.mean(axis=0)[:2] @ toward) > along
    return bool((ahead or not seat) and visible_from(scene, object, eyes).max() >= SEEN)


def _carrier(scene: Scene, part_id: str) -> str:
    """Return the id of what a small thing stands on, for that has a front; else its own."""
    mesh = target_mesh(scene, part_id)
    if np.ptp(mesh.bounds, axis=0)[:2].max() > 0.7:
        return part_id
    for other, part in scene.parts.items():
        big = len(part.mesh.vertices) and part.parent is None and "floor" not in part.label.lower()
        if not big or other == part_id or np.ptp(part.mesh.bounds, axis=0)[:2].max() < 0.5:
            continue
        if _carried(mesh, part.mesh):
            return other
    return part_id


def _gap(object: Mesh, mesh: Mesh) -> float:
    """Return the distance between two surfaces [m], up to the spacing of their vertices and middles of faces."""
    points = [np.concatenate([one.vertices, one.vertices[one.faces].mean(axis=1)]) for one in (object, mesh)]
    box = _box_gap(object, mesh)
    return max(box, min(float(cKDTree(points[1]).query(points[0])[0].min()), box + 0.02))


def _carried(object: Mesh, mesh: Mesh) -> bool:
    """Return True if rays from an object's underside meet a surface right below it."""
    low = float(object.bounds[0, 2])
    foot = object.vertices[object.vertices[:, 2] < low + 0.01 + 0.02 * float(np.ptp(object.bounds[:, 2]))]
    foot = foot[:: max(1, len(foot) // 200)].astype(float)
    middle = np.append(foot[:, :2].mean(axis=0), low)
    points = np.concatenate([foot, (foot + middle) / 2, middle[None]]) + (0.0, 0.0, 0.02)
    reach = 0.02 + CONTACT + 0.01
    below = points - (0.0, 0.0, reach)
    if (below.min(axis=0) > mesh.bounds[1]).any() or (points.max(axis=0) < mesh.bounds[0]).any():
        return False  # no ray comes near it, and to ask them takes milliseconds
    seen, _ = visible_distance(kept_ray_mesh(mesh), points, np.array([0.0, 0.0, -1.0]), reach)
    return bool((seen < 0.02 + CONTACT + 0.009).mean() > 0.2)


def _within(object: Mesh, mesh: Mesh) -> bool:
    """Return True if a thing rises around an object's middle, and the object begins below its top."""
    middle = object.bounds.mean(axis=0).astype(float)
    low, high = mesh.bounds
    if (
        (middle[:2] < low[:2]).any()
        or (middle[:2] > high[:2]).any()
        or not low[2] - CONTACT < object.bounds[0, 2] < high[2] - 0.01
    ):
        return False
    # At a third of what is below the rim: shallow trays hold tall things.
    height = object.bounds[0, 2] + min(0.5 * np.ptp(object.bounds[:, 2]), 0.5 * (high[2] - object.bounds[0, 2]))
    start = np.tile((middle[0], middle[1], height), (8, 1))
    reach = float(np.linalg.norm(high - low))
    seen, _ = visible_distance(kept_ray_mesh(mesh), start, AROUND, reach)
    return bool((seen < 0.999 * reach).sum() >= 5)


def _extreme(object: Mesh, mesh: Mesh, top: bool) -> bool:
    """Return True if no board of a shelf lies above an object, other than its lid; or none below what carries it."""
    middle = object.bounds.mean(axis=0).astype(float)
    tree, reach = kept_ray_mesh(mesh), 3.0
    up = 1.0 if top else -1.0
    start, levels = middle.copy(), []
    start[2] = object.bounds[1, 2] if top else object.bounds[0, 2] - 2 * CONTACT
    for _ in range(12):
        seen, _ = visible_distance(tree, start[None], np.array([0.0, 0.0, up]), reach)
        if seen[0] >= reach:
            break
        start[2] += up * (float(seen[0]) + 0.05)  # over the board
        levels.append(start[2])
    # The lid of a shelf may be above its uppermost board, and its base below the lowest.
    return len(levels) <= 1


SIDED = ("left", "right", "front", "behind", "above", "below", "opposite", *EDGES, "corner", "middle")
LEVEL, REACH = ("near", "left", "right", "front", "behind", "between"), 1.9
"""Relations to what stands or hangs at about the same height, and the lowest underside that is out of reach [m]."""
NAMED = 12
"""Kinds of things that are named where one is missing."""


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
    if wish.unread and wish.relations and not (wish.missing or understood):
        raise InputError(
            f"prompt {text[:80]!r}: the rules do not read {wish.unread[0]!r} there; say it as 'at the left end of the couch', "
            "ask a model (llm=chat), or give wish=prefer to have it passed over"
        )
    if text and not (wish.relations or wish.missing or understood):
        raise InputError(
            f"prompt {text[:80]!r}: the rules know relations to things of the room, such as 'on the desk', 'left of the bed', "
            "'between the cup and the lamp'; say it so, ask a model (llm=chat), or give wish=prefer to have it passed over"
        )
    if not wish.missing:
        return
    kinds = list(dict.fromkeys(part.label for part in scene.parts.values() if part.parent is None))
    listed = ", ".join(kinds[:NAMED]) + (", ..." if len(kinds) > NAMED else "")
    raise InputError(
        f"prompt {text[:80]!r}: there is no {wish.missing[0]!r} in this room{nearest(wish.missing[0], kinds)}; "
        f"there are: {listed}; name one of these, or give wish=prefer to put it elsewhere"
    )


def objection(wish: Wish, scene: Scene, object: Mesh) -> str:
    """Return the first relation that an object in its place [m] does not have, as a clause; empty if it has all."""
    unmet = next((one for one in wish.relations if not met(scene, object, one)), None)
    return "" if unmet is None else f"it would not be {'so: not ' if unmet.negated else ''}{unmet.words!r} there"


def verdict(wish: Wish, text: str, scene: Scene, object: Mesh) -> dict[str, Any]:
    """Return for the record which relations of a wish hold.

    `heeded` is None where nothing of it was understood, and where what was understood holds and the rest was not.
    """
    relations = [{"relation": one.kind, "words": one.words, "met": met(scene, object, one)} for one in wish.relations]
    heeded = all(one["met"] for one in relations) and not wish.missing if relations or wish.missing else None
    record = {"wish": text, "relations": relations, "missing": list(wish.missing), "unread": list(wish.unread)}
    return {**record, "heeded": None if heeded and wish.unread else heeded}


def allowed(wish: Wish, scene: Scene, object: Mesh) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return a filter of places [m] for the search, rough where the check of the result is exact; None for no filter.

    `object`: upright, standing on z = 0 above the origin, in metres.
    """
    sided = [
        one
        for one in wish.relations
        if one.kind in (("near",) if one.negated else (*SIDED, "between", "near", "height", "away", "area"))
    ]
    if not sided:
        return None
    sides = np.ptp(object.bounds, axis=0)
    # Sides are told from outlines: the points of a scan would be gone through for every place.
    floor = floor_height(scene)
    outlines = {i: _outline(target_mesh(scene, i)) for one in sided for ids in one.part_ids for i in ids}
    seen = {i: viewer(scene, i) for i in outlines}
    areas = any(one.kind == "area" for one in sided)
    marks = {i: outlines[i] if i in outlines else _outline(target_mesh(scene, i)) for i in _landmarks(scene) if areas}

    standing = box(np.array([0.0, 0.0, sides[2] / 2]), np.eye(3), np.array([min(sides[:2])] * 2 + [sides[2]]))

    def one_place(place: np.ndarray) -> bool:
        brick = Mesh(standing.vertices + place, standing.faces)
        for one in sided:
            if one.kind == "between":
                holds = any(
                    a != b and between(brick, outlines[a], outlines[b])
                    for a in one.part_ids[0]
                    for b in one.part_ids[1]
                )
            elif one.kind == "height":
                holds = abs(brick.bounds[:, 2].mean() - floor - float(one.height or 0.0)) < OFF_HEIGHT
            elif one.negated or one.kind == "away":
                holds = all(_box_gap(brick, outlines[i]) > (BESIDE if one.negated else FAR) for i in one.part_ids[0])
            elif one.kind == "near":
                holds = any(_box_gap(brick, outlines[i]) < 0.4 for i in one.part_ids[0])
            elif one.kind == "area":
                holds = _in_area(brick, one.part_ids[0], marks)
            elif one.kind == "opposite":
                holds = any(_opposite(seen[i], brick, outlines[i]) for i in one.part_ids[0])
            else:
                holds = any(placed(seen[i], brick, outlines[i], one.kind) for i in one.part_ids[0])
            if not holds:
                return False
        return True

    known_places: dict[tuple[float, ...], bool] = {}  # the same ones come for every turn of the object

    def keep(places: np.ndarray) -> np.ndarray:
        for place in places:
            key = tuple(place.round(4).tolist())
            if key not in known_places:
                known_places[key] = one_place(place)
        return np.array([known_places[tuple(place.round(4).tolist())] for place in places], bool)

    return keep


def _outline(mesh: Mesh) -> Mesh:
    """Return the points of a mesh that bound it from all sides."""
    return Mesh(silhouette(mesh.vertices), np.empty((0, 3), int))


def _box_gap(brick: Mesh, mesh: Mesh) -> float:
    """Return the distance between two boxes [m]."""
    apart = np.maximum(brick.bounds[0] - mesh.bounds[1], mesh.bounds[0] - brick.bounds[1])
    return float(np.linalg.norm(np.maximum(apart, 0.0)))
