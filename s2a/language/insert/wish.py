"""Places where a wish holds: every support of the room is looked at, whatever a model or the rules think of."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from s2a.language.grammar import BESIDE, DIRECT, Relation, Wish
from s2a.language.insert.describe import FOOT, WORTH, RoomState, circle, is_wall
from s2a.language.insert.supports import is_basin
from s2a.language.insert.wish_check import RoomRelations, allowed, any_allowed
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.regions import Region

SMALL = box(np.array([0.0, 0.0, 0.05]), np.eye(3), np.array([0.04, 0.04, 0.05]))
"""An object as small as any: where it does not go, nothing does."""
SAMPLES = 300
"""Places of a support that are looked at; all where none of these is as wished."""
EYES = (1.1, 1.9)
"""Heights above the floor at which things hang [m]."""
SAME = 0.1
"""What is on the same support stands on it up to this error [m]."""


def wished(room: RoomState, wish: Wish, hangs: bool) -> dict[str, Any]:
    """Return where a wish holds: choices in the form of a plan's, the supports that it names first, then by area; and near.

    `hangs`: True for what hangs on walls where nothing else is said.
    """
    kinds = {one.kind for one in wish.relations if not one.negated}
    hung = "wall" in kinds or ((hangs or "height" in kinds) and not kinds & {*DIRECT})
    related = RoomRelations(room.named)
    keep = allowed(wish, related, SMALL)
    supports = list(_walls(room, related) if hung else _levels(room)) if keep else []
    shares = [float(keep(_some(points)).mean()) for _, points, _ in supports] if keep else []
    if keep and not any(shares):  # before it is refused: all places
        shares = [any_allowed(keep, points) / len(points) for _, points, _ in supports]
    options: list[tuple[tuple[float, ...], dict[str, Any]]] = []
    for (target, points, region), share in zip(supports, shares, strict=True):
        if share > 0.0:
            area = share * (region.free_area if region else len(points))
            options.append((_rank(wish, related, target, region, area), _choice(wish, target, region)))
    choices = [choice for _, choice in sorted(options, key=lambda one: one[0])]
    return {"choices": choices, "near": _neighbour(room, wish, choices[0]["target"]) if choices else None}


def nowhere(room: RoomState, wish: Wish) -> str:
    """Return why a wish holds nowhere, as a clause: by the relations that no support has, else by all together."""
    alone: list[Relation] = [one for one in wish.relations if not wished(room, Wish((one,)), hangs=False)["choices"]]
    words = " and ".join(repr(one.words) for one in (alone or wish.relations))
    return f"nothing in this room that carries things is {words}"


def _neighbour(room: RoomState, wish: Wish, target: str) -> str | None:
    """Return what an object is to be beside: of the things that the wish may mean the one nearest to the support."""
    beside = [one for one in wish.relations if one.kind in (*BESIDE, "above", "below") and not one.negated]
    parts = room.named.parts
    middle = parts[target].mesh.bounds.mean(axis=0)
    ids = beside[0].part_ids[0] if beside else ()
    nearest = min(ids, key=lambda i: float(np.linalg.norm(parts[i].mesh.bounds.mean(axis=0) - middle)), default="")
    return nearest.partition(".")[0] or None


def _levels(room: RoomState) -> Iterator[tuple[str, np.ndarray, Region | None]]:
    """Yield the level supports that carry something, with their free places [m], [place 3]."""
    for target, regions in room.supports.items():
        for region in regions:
            if region.free_area >= WORTH and circle(region) >= FOOT:
                yield target, region.points(np.argwhere(region.free) + 0.5).astype(float), region


def _walls(room: RoomState, related: RoomRelations) -> Iterator[tuple[str, np.ndarray, Region | None]]:
    """Yield the walls, with places on them."""
    for target, part in room.scene.parts.items():
        height = part.mesh.vertices[:, 2] - related.floor
        points = part.mesh.vertices[(height > EYES[0]) & (height < EYES[1])]
        if is_wall(part.label) and len(points):
            yield target, points.astype(float), None


def _some(points: np.ndarray) -> np.ndarray:
    """Return some places from all over; at equal steps they may all lie in one line."""
    return points[np.random.default_rng(0).permutation(len(points))[:SAMPLES]]


def _rank(wish: Wish, related: RoomRelations, target: str, region: Region | None, area: float) -> tuple[float, ...]:
    """Return what a support is sorted by, the best first."""
    kinds = {one.kind for one in wish.relations if not one.negated}
    named = any(_is_of(target, ids) for one in wish.relations if one.kind in DIRECT for ids in one.part_ids)
    if region is None:
        return (not named, -area)
    carries = "in" in kinds and not (region.kind == "inside" or is_basin(region))
    level = next((region.height * sign for kind, sign in (("top", -1), ("bottom", 1)) if kind in kinds), 0.0)
    beside = [one for one in wish.relations if one.kind in BESIDE and not one.negated]
    apart = sum(not any(_level_with(related, i, region) for i in one.part_ids[0]) for one in beside)
    label = related.scene.parts[target].label
    rest = label == "unannotated" or (label == "floor" and not kinds & {*BESIDE, "below"})
    return (not named, carries, level, apart, rest, -area)


def _is_of(target: str, ids: tuple[str, ...]) -> bool:
    """Return True if a part, or an unlabelled support of it, is one of some things."""
    return any(target == i or i.startswith(f"{target}.") for i in ids)


def _level_with(related: RoomRelations, part_id: str, region: Region) -> bool:
    """Return True if a thing may stand on a support, or be let into it."""
    low, high = related.mesh(part_id).bounds[:, 2]
    return bool(low - SAME <= region.height <= high + SAME)


def _choice(wish: Wish, target: str, region: Region | None) -> dict[str, Any]:
    """Return a support as a choice of a plan."""
    choice = {"target": target, "reason": "as wished"}
    if region is None:
        return choice | {"surface": "vertical", "relation": "hanging", "height": None}
    own = [one.kind for one in wish.relations if any(_is_of(target, ids) for ids in one.part_ids)]
    relation = "against" if "against" in own else "in" if "in" in own or region.kind == "inside" else "on"
    surface = "inside" if region.kind == "inside" else "horizontal"
    return choice | {"surface": surface, "relation": relation, "height": round(region.height, 2) + 0.0}
