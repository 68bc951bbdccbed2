"""Facts of a room for a planner of skills: parts with labels, boxes and joints, open parts, free objects."""

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from s2a import robot as robots
from s2a.core.errors import InputError, printable
from s2a.motion.obstacles import Obstacles
from s2a.scene.articulation import opening_direction
from s2a.scene.scene import Mesh, Vec3
from s2a.scene.upright_box import upright_box
from s2a.scene.usd.descriptive import DescribedPart
from s2a.scene.usd.sim_scene import SimBody, SimRoom, in_scene

LABEL = 60  # Characters of a label that are shown: it is a name, not a text
ABOVE_SUPPORT = 0.02  # [m] Above an object's lowest point, from where its support is looked for
KNOWN_FRACTION = 0.5  # Of a room's articulated parts, that a description of this room has

# sRGB of the colours that sentences name
COLORS = {
    "red": (190, 40, 40), "orange": (235, 130, 40), "yellow": (235, 210, 60), "green": (60, 150, 70), "blue": (50, 90, 180),
    "purple": (120, 60, 150), "pink": (240, 150, 180), "brown": (115, 75, 45), "beige": (215, 195, 160),
    "black": (25, 25, 25), "grey": (128, 128, 128), "white": (240, 240, 240),
}  # fmt: skip
# Saturation below which a colour is grey, and share of a surface from which its colour counts
PALE, MUCH = 0.2, 0.25

Kind = Literal["slides", "turns", "free", "fixed"]


@dataclass(frozen=True)
class RoomPart:
    """A part of the room."""

    id: str  # its id
    label: str  # its name
    parent: str | None = None  # id of the part that it belongs to, or None
    kind: Kind = "fixed"  # "slides" or "turns" on a joint; "free": it can be picked up; "fixed"
    center: Vec3 | None = None  # of its upright box [m], scene coordinates; None where it has no surface
    size: Vec3 | None = None  # of that box [m]
    # horizontal direction that its front faces, of what moves on a joint; else None
    facing: tuple[float, float] | None = None
    on: str | None = None  # id of the part that an object stands on or in; else None
    touches: tuple[str, ...] = ()  # ids of the furniture at its sides, of a front that is drawn without any
    open: float = 0.0  # path by which its grasp point stands open [m]; 0 where it is shut or does not move
    colors: tuple[str, ...] = ()  # names of COLORS of much of its surface; empty where they are not known
    # The robot has a collision-free base pose for it, of what moves on a joint, or drives and looks for one
    base: bool = False

    @property
    def moves(self) -> bool:
        """True for what moves on a joint."""
        return self.kind in ("slides", "turns")


Facts = Mapping[str, RoomPart]  # The parts of a room by id, parents before children


def gather(
    room: SimRoom, described: Mapping[str, DescribedPart] | None, opened: Mapping[str, float], robot: str
) -> dict[str, RoomPart]:
    """Return the facts of a room.

    Args:
        room: the simulation-ready room as it stands now.
        described: the descriptive flavour; None: labels are what ids say. What only the room has, such as what was inserted
            after the export, is added.
        opened: by how much parts stand open [m], by id; a part that is left out is shut.
        robot: name of the robot.

    Raises:
        InputError: the description is one of another room.
    """
    described = described or {}
    missing = [part for part in room.articulations if part not in described]
    if described and len(missing) > KNOWN_FRACTION * len(room.articulations):
        raise InputError(
            f"the description has no part {missing[0]!r} of room {room.name!r}: it is one of another room; "
            "give scene= the descriptive.usda of the same export, or leave it out"
        )
    points = _points(room)
    hidden = _hidden(described)
    ids = [*(i for i in described if i not in hidden), *(i for i in points if i not in described)]
    parts = {i: _thing(i, room, described.get(i), points.get(i), opened, robot) for i in ids}
    parents = {i: thing.parent if thing.parent in parts else None for i, thing in parts.items()}
    # Fronts of different furniture share a wall: it tells nothing of what they belong to.
    sides = {i: tuple(o for o in thing.touches if not _is_wall(o, described)) for i, thing in parts.items()}
    return {i: replace(thing, parent=parents[i], touches=sides[i]) for i, thing in parts.items()}


def _is_wall(i: str, described: Mapping[str, DescribedPart]) -> bool:
    return i in described and described[i].label.lower().endswith("wall")


def text(facts: Facts) -> str:
    """Return the facts as text for a model: a line of JSON a part."""
    return "\n".join(json.dumps(line, separators=(",", ":"), ensure_ascii=False) for line in lines(facts))


def lines(facts: Facts) -> list[dict[str, Any]]:
    """Return a dictionary per part, without what its id implies."""
    return [_line(thing) for thing in facts.values()]


def possible(facts: Facts) -> str:
    """Return what the robot can do in a room, in words."""
    opens = [i for i, thing in facts.items() if thing.moves and thing.base]
    free = [i for i, thing in facts.items() if thing.kind == "free"]
    return f"open or close: {', '.join(opens) or 'none'}; pick up: {', '.join(free) or 'none'}"


def _points(room: SimRoom) -> dict[str, np.ndarray]:
    """Return the corners of the hulls that stand for each part or body [point 3], scene coordinates."""
    corners: dict[str, list[np.ndarray]] = {}
    for collider in room.static_colliders:
        corners.setdefault(collider.part, []).append(np.asarray(collider.mesh.vertices, float))
    for body in (*room.bodies.values(), *room.free.values()):
        for collider in body.colliders:
            corners.setdefault(body.id, []).append(in_scene(body, collider.mesh))
    return {part: np.concatenate(points) for part, points in corners.items()}


def _hidden(described: Mapping[str, DescribedPart]) -> set[str]:
    """Return the ids of handles and of what else belongs to a moving part, unless it moves itself."""
    hidden: set[str] = set()
    for i, part in described.items():
        below = part.parent is not None and (
            part.parent in hidden or described[part.parent].motion in ("prismatic", "revolute")
        )
        if part.motion == "fixed" and (below or part.graspable):
            hidden.add(i)
    return hidden


def _thing(
    i: str,
    room: SimRoom,
    described: DescribedPart | None,
    points: np.ndarray | None,
    opened: Mapping[str, float],
    robot: str,
) -> RoomPart:
    """Return one part; its box is the described one unless it can move."""
    joint = room.articulations.get(i)
    kind: Kind = "free" if i in room.free else "fixed"
    facing, base = None, False
    if joint is not None:
        kind = "slides" if joint.joint.kind == "prismatic" else "turns"
        ahead = opening_direction(joint.joint, np.array(joint.grasp.point))
        facing = (round(float(ahead[0]), 2) + 0.0, round(float(ahead[1]), 2) + 0.0)
        base = robots.load(robot).drive is not None or (robot in joint.bases and joint.bases[robot].free)
    center, size = (described.center, described.size) if described and kind == "fixed" else (None, None)
    if center is None and points is not None:
        box = upright_box(points)
        center, size = box.center, box.size
    parent = described.parent if described else joint.parent if joint else None
    on = _support(room, room.free[i]) if kind == "free" else described.on if described else None
    label = described.label if described else i.rpartition("_")[0].replace("_", " ") or i
    name = " ".join(printable(label).split())[:LABEL]
    touches = described.touches if described and joint is not None and parent is None else ()
    body = room.free.get(i) or room.bodies.get(i)
    colors = () if body is None else color_names(body.visual)
    return RoomPart(i, name, parent, kind, center, size, facing, on, touches, opened.get(i, 0.0), colors, base)


def color_names(mesh: Mesh) -> tuple[str, ...]:
    """Return the names of the colours of much of a surface, the most frequent first; none where it has no colours."""
    if mesh.colors is None or not mesh.face_areas.any():
        return ()
    rgb = mesh.colors[mesh.faces].astype(float).mean(axis=1)
    bright, dark = rgb.max(axis=1), rgb.min(axis=1)
    names = np.array([*COLORS])
    # By hue where there is one, whatever the light: relative to the brightest channel, with brightness counting less.
    table = np.array([*COLORS.values()], float)
    pale = (bright - dark) < PALE * np.maximum(bright, 60.0)
    looks = [
        np.c_[each / np.maximum(each.max(axis=1, keepdims=True), 1.0), each.max(axis=1) / 255.0]
        for each in (rgb, table)
    ]
    off = np.linalg.norm((looks[0][:, None] - looks[1][None]) * [1.0, 1.0, 1.0, 0.6], axis=2)
    is_grey = np.isin(names, ["black", "grey", "white"])
    off[pale[:, None] & ~is_grey] += 0.3
    off[~pale[:, None] & is_grey] += 0.3
    share = np.bincount(off.argmin(axis=1), mesh.face_areas, len(names)) / mesh.face_areas.sum()
    return tuple(str(names[k]) for k in np.argsort(-share) if share[k] >= MUCH)


def _support(room: SimRoom, body: SimBody) -> str | None:
    """Return the part whose surface is below an object's middle."""
    own = np.concatenate([in_scene(body, collider.mesh) for collider in body.colliders])
    at = np.array([[*body.position[:2], own[:, 2].min() + ABOVE_SUPPORT]])
    height, names = Obstacles.of_room(room, {body.id}, at[0]).below(at)
    return names[0] if np.isfinite(height[0]) else None


def _line(thing: RoomPart) -> dict[str, Any]:
    """Return the description of one part."""
    line: dict[str, Any] = {"id": thing.id}
    if thing.label != thing.id.rpartition("_")[0].replace("_", " "):
        line["label"] = thing.label
    if thing.parent:
        line["part_of"] = thing.parent
    if thing.touches:
        line["touches"] = list(thing.touches)
    if thing.kind != "fixed":
        line["kind"] = thing.kind
    if thing.moves:
        line |= {"open": round(thing.open, 2), "faces": list(thing.facing or ()), "reachable": thing.base}
    if thing.on:
        line["on_or_in"] = thing.on
    if thing.center and thing.size:
        line |= {name: [round(v, 2) + 0.0 for v in getattr(thing, name)] for name in ("center", "size")}
    return line
