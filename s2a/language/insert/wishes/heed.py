"""Use of a placement hint by an insertion: impossible hints declined, the search narrowed, results refused."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from s2a.core.config import nearest
from s2a.core.errors import InputError
from s2a.language.insert.place.preferences import floor_height
from s2a.language.insert.place.supports import target_mesh
from s2a.language.insert.plan import Plan
from s2a.language.insert.wishes.check import BESIDE, FAR, OFF_HEIGHT, between, met, placed, viewer
from s2a.language.insert.wishes.parse import Relation, Wish, parse_wish
from s2a.scene.geometry.convex import box
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd.descriptive import silhouette

SIDED = ("left", "right", "front", "behind", "above", "back edge", "front edge", "corner", "middle")
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
    return Wish(tuple(relations), tuple(dict.fromkeys(missing)))


def planned_place(plan: Plan) -> Wish:
    """Return where a plan wants an object on its support, as relations that are searched for and checked as a wish's are."""
    found = [Relation(one.relation, tuple((part_id,) for part_id in one.of), one.relation) for one in plan.place]
    height = plan.choices[0].height if plan.hangs else None
    if height is not None:
        found.append(Relation("height", (), f"at {height:g} m", height))
    return Wish(tuple(found))


def decline(wish: Wish, text: str, scene: Scene, understood: bool) -> None:
    """Raise an InputError if a wish names a thing that is not there, or if nothing of it is known to mean anything.

    Args:
        wish: the parsed wish.
        text: what was said.
        scene: the room.
        understood: True if a model reads the wish, too.
    """
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
    """Return for the record which relations of a wish hold; `heeded` is None where nothing of it was understood."""
    relations = [{"relation": one.kind, "words": one.words, "met": met(scene, object, one)} for one in wish.relations]
    heeded = all(one["met"] for one in relations) and not wish.missing if relations or wish.missing else None
    return {"wish": text, "heeded": heeded, "relations": relations, "missing": list(wish.missing)}


def allowed(wish: Wish, scene: Scene, object: Mesh) -> Callable[[np.ndarray], np.ndarray] | None:
    """Return a filter of places [m] for the search, rough where the check of the result is exact; None for no filter.

    Args:
        wish: the wish.
        scene: the room.
        object: upright, standing on z = 0 above the origin, in metres.
    """
    sided = [
        one
        for one in wish.relations
        if one.kind in (("near",) if one.negated else (*SIDED, "between", "near", "height", "away"))
    ]
    if not sided:
        return None
    sides = np.ptp(object.bounds, axis=0)
    # Sides are told from outlines: the points of a scan would be gone through for every place.
    floor = floor_height(scene)
    known = {i: _outline(target_mesh(scene, i)) for one in sided for ids in one.part_ids for i in ids}
    seen = {i: viewer(scene, i) for i in known}

    standing = box(np.array([0.0, 0.0, sides[2] / 2]), np.eye(3), np.array([min(sides[:2])] * 2 + [sides[2]]))

    def one_place(place: np.ndarray) -> bool:
        brick = Mesh(standing.vertices + place, standing.faces)
        for one in sided:
            if one.kind == "between":
                holds = any(
                    a != b and between(brick, known[a], known[b]) for a in one.part_ids[0] for b in one.part_ids[1]
                )
            elif one.kind == "height":
                holds = abs(brick.bounds[:, 2].mean() - floor - float(one.height or 0.0)) < OFF_HEIGHT
            elif one.negated or one.kind == "away":
                holds = all(_gap(brick, known[i]) > (BESIDE if one.negated else FAR) for i in one.part_ids[0])
            elif one.kind == "near":
                holds = any(_gap(brick, known[i]) < 0.4 for i in one.part_ids[0])
            else:
                holds = any(placed(brick.bounds, seen[i], brick, known[i], one.kind) for i in one.part_ids[0])
            if not holds:
                return False
        return True

    known_places: dict[tuple[float, ...], bool] = {}  # the same ones come for every turn of the object

    def keep(places: np.ndarray) -> np.ndarray:
        for place in places:
            asked = tuple(place.round(4).tolist())
            if asked not in known_places:
                known_places[asked] = one_place(place)
        return np.array([known_places[tuple(place.round(4).tolist())] for place in places], bool)

    return keep


def _outline(mesh: Mesh) -> Mesh:
    """Return the points of a mesh that bound it from all sides."""
    return Mesh(silhouette(mesh.vertices), np.empty((0, 3), int))


def _gap(brick: Mesh, mesh: Mesh) -> float:
    """Return the distance between two boxes [m]."""
    apart = np.maximum(brick.bounds[0] - mesh.bounds[1], mesh.bounds[0] - brick.bounds[1])
    return float(np.linalg.norm(np.maximum(apart, 0.0)))
