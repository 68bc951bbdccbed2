"""Relations of a wish -> places that honour it, without a model."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from s2a.language.grammar import EDGES, Relation, is_kind_of, parse_wish

BEDDING = ("blanket", "duvet", "mattress", "bedspread", "quilt")
"""What covers a bed."""
Line = dict[str, Any]
DIRECT = ("on", "in", "against", "top", "bottom", *EDGES, "corner", "middle")
"""Relations to what carries the object."""
BESIDE = ("near", "left", "right", "front", "behind", "between")
"""Relations to what stands on the same support."""


@dataclass(frozen=True)
class PlacementHint:
    """What a wish says about the place.

    Attributes:
        near: id of the requested neighbour, or None.
        choices: places that honour the wish, in the form of a plan; empty if it names no place in the room.
    """

    near: str | None
    choices: list[dict[str, Any]]


def parse_hint(hint: str, room: list[Line], hangs: bool = False) -> PlacementHint:
    """Parse a wish for a room, given by the lines of `s2a.language.insert.describe`; `hangs` is set for what usually hangs."""
    relations = [
        one for one in parse_wish(hint, {line["id"]: line["label"] for line in room}).relations if not one.negated
    ]
    lines = {line["id"]: line for line in room}
    beside = [one for one in relations if one.kind in (*BESIDE, "above", "below")]
    near = beside[0].part_ids[0][0] if beside else None
    choices: list[dict[str, Any]] = []
    for relation in sorted(relations, key=lambda one: (one.kind != "wall", one.kind not in DIRECT)):
        choices = choices or _choices(relation, lines, hangs)
    return PlacementHint(near, choices[:3])


def _choices(relation: Relation, lines: dict[str, Line], hangs: bool) -> list[dict[str, Any]]:
    """Return the choices for one relation, one part that it may mean after the other."""
    if relation.kind == "wall" or (relation.kind in ("above", "near", "left", "right", "height") and hangs):
        walls = [line for line in lines.values() if line["label"].lower().endswith("wall")]
        named = {part_id for ids in relation.part_ids for part_id in ids}
        if relation.kind != "wall" and named:
            walls.sort(key=lambda wall: min(_apart(wall, lines[part_id]) for part_id in named))
        elif named:
            walls = [wall for wall in walls if wall["id"] in named]
        hanging = {"surface": "vertical", "relation": "hanging", "height": None, "reason": "as wished"}
        return [{"target": wall["id"], **hanging} for wall in walls]
    choices: list[dict[str, Any]] = []
    for part_id in relation.part_ids[0] if relation.part_ids else ():
        line = lines.get(part_id)
        if line is None:
            continue
        if relation.kind in DIRECT:
            choices += [one for part in (line, *_covers(line, lines)) for one in _places(part, relation.kind)]
        elif relation.kind in BESIDE:
            choices += _places(_below(line, lines), "on")
        elif relation.kind == "seen from":
            choices += [one for other in _around(line, lines) for one in _places(other, "on")[:1]]
        elif relation.kind == "above":
            choices += [one for other in lines.values() if _over(other, line) for one in _places(other, "on")]
        elif relation.kind in ("below", "opposite", "area"):
            stands = [_below(line, lines)] if relation.kind == "below" else _around(line, lines)[:2]
            choices += [one for other in stands for one in _places(other, "on")]
    return choices


def _around(line: Line, lines: dict[str, Line]) -> list[Line]:
    """Return what carries things near a thing, the nearest first; not the floor."""
    others = [o for o in lines.values() if "supports" in o and o["id"] != line["id"] and o["label"] != "floor"]
    return sorted(others, key=lambda other: _apart(other, line))


def _below(line: Line, lines: dict[str, Line]) -> Line:
    """Return the line of what a thing stands on: the floor, if that is not known, or what it is a part of."""
    if line.get("on") in lines:
        return lines[line["on"]]
    if line.get("part_of") in lines and "supports" in lines[line["part_of"]]:
        return lines[line["part_of"]]
    around = [other for other in lines.values() if _holds(other, line)]
    if around:
        return min(around, key=lambda other: (_apart(other, line), other["size"][0] * other["size"][1]))
    return next((other for other in lines.values() if other["label"] == "floor"), line)


def _covers(line: Line, lines: dict[str, Line]) -> list[Line]:
    """Return what covers a part and carries things in its stead: the blanket of a bed."""
    if not is_kind_of(line["label"], "bed"):
        return []
    bedding = [other for other in lines.values() if other["label"].lower() in BEDDING and "supports" in other]
    return [other for other in bedding if other.get("on") == line["id"] or _apart(other, line) == 0.0]


def _holds(line: Line, thing: Line) -> bool:
    """Return True if a thing is let into a part or in a row with it: a sink and its counter. Boxes may be turned."""
    if (
        line["id"] == thing["id"]
        or line["label"] == "floor"
        or not ("supports" in line and "size" in line and "size" in thing)
    ):
        return False
    top = thing["center"][2] + thing["size"][2] / 2
    near = min(abs(s["height"] - top) for s in line["supports"])
    return bool(_apart(line, thing) < 0.05 and near < 0.3 and top > 0.3)


def _places(line: Line, kind: str) -> list[dict[str, Any]]:
    """Return the choices that a part offers, those of the wished kind alone, the most free area first."""
    supports = list(line.get("supports", []))
    if kind == "in":
        supports = [s for s in supports if s["kind"] != "horizontal"] or supports
    elif kind in ("top", "bottom"):
        supports.sort(key=lambda s: s["height"], reverse=kind == "top")
    else:
        supports = [s for s in supports if s["kind"] == "horizontal"] or supports
    how = kind if kind in ("in", "against") else "on"
    return [
        {
            "target": line["id"],
            "surface": "inside" if s["kind"] == "inside" else "horizontal",
            "relation": "in" if s["kind"] == "inside" and how == "on" else how,
            "height": s["height"],
            "reason": "as wished",
        }
        for s in supports[:3]
    ]


def _over(line: Line, thing: Line) -> bool:
    """Return True if a part carries things over another one."""
    if "supports" not in line or "size" not in thing or "size" not in line:
        return False
    off = np.abs(np.array(line["center"]) - thing["center"])[:2]
    reach = (np.array(line["size"]) + thing["size"])[:2] / 2
    top = thing["center"][2] + thing["size"][2] / 2
    return bool((off < reach).all() and max(s["height"] for s in line["supports"]) >= top - 0.01)


def _apart(line: Line, thing: Line) -> float:
    """Return the horizontal distance of the boxes of two parts [m]; 0 where it is not known."""
    if "size" not in line or "size" not in thing:
        return 0.0
    off = np.abs(np.array(line["center"]) - thing["center"])[:2]
    return float(np.linalg.norm(np.maximum(off - (np.array(line["size"]) + thing["size"])[:2] / 2, 0.0)))
