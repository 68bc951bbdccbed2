"""Is an object in its place as a person would have put it? Judged from triangles, apart from the code that places.

Nothing of `s2a.language.insert` is imported here: what carries an object is found by rays cast down from it, collisions by
winding numbers of the closed object and by its edges, openings by moving the triangles of every drawer and door through 25
positions. Which supports suit which object is written in suits.yaml, by hand, from labels alone. It rates by formulas; it is no
person.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import yaml
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation
from triangle_queries import Obstacles, cast, dense, depths, spread

from s2a.scene.articulation import displace
from s2a.scene.scene import Joint, Mesh, Scene

SIZE = 0.25
"""Largest error of the longest side, as a fraction of the true one."""
TILT, LEAN = np.radians(12.0), np.radians(35.0)
"""Largest tilt of what stands or hangs, and of what leans against something [rad]."""
GAP, BACK_GAP, LEAN_GAP = 0.012, 0.04, 0.15
"""Largest gap below what stands, behind what hangs, and behind what leans [m]."""
DEEP = 0.004
"""Depth from which an overlap counts, the noise of a scan left out [m]."""
OPENING_DEEP = 0.01
"""Depth from which a moving drawer or door is blocked [m]."""
OVERHANG = 0.2
"""Largest fraction of the outline, seen from above, with nothing of the support below it."""
POSITIONS = 25
CHECKS = ("size", "upright", "carried", "inside_support", "free", "openings", "suits")


@dataclass(frozen=True)
class Truth:
    """What is known of an object, but not told to the code that places it.

    Attributes:
        label: its name.
        length: its longest side [m]; None if unknown.
        height: in its usual pose [m]; None if unknown.
        placement: "on", "inside", "hanging" or "against wall".
    """

    label: str
    length: float | None
    height: float | None
    placement: str


@dataclass(frozen=True)
class Placed:
    """An object in its place.

    Attributes:
        mesh: in the scene [m].
        up: direction of its true up axis in the scene, shape [3]; None if every direction up is right.
        front: direction of its true front in the scene, shape [3]; None if it has none.
        length: its longest side along its own axes [m].
    """

    mesh: Mesh
    up: np.ndarray | None
    front: np.ndarray | None
    length: float


def check(scene: Scene, placed: Placed, truth: Truth, leave_out: str | None = None) -> dict:
    """Return the checks of CHECKS, the id and label of what carries the object, and the figures behind them.

    Args:
        scene: the room; it may hold the object itself as part `leave_out`, and other inserted ones.
        placed: the object in its place.
        truth: what is known of it.
        leave_out: id of the object in the scene.
    """
    room, points = Obstacles(scene, leave_out), spread(placed.mesh)
    found: dict = {"size": True, "upright": True}
    if truth.length:
        found["ratio"] = round(placed.length / truth.length, 4)
        found["size"] = abs(found["ratio"] - 1.0) <= SIZE
    if placed.up is not None:
        tilt = float(np.arccos(np.clip(placed.up[2], -1.0, 1.0)))
        found |= {"tilt": round(float(np.degrees(tilt)), 1)}
        found["upright"] = tilt <= (LEAN if truth.placement == "against wall" else TILT) or _lies(truth, placed.mesh)
    if truth.placement == "hanging":
        found |= _hung(room, placed, points, _named(truth.label.lower(), _table()["no_front"]))
    else:
        found |= _carried(room, points, truth.placement == "against wall")
    found |= _free(room, placed.mesh, points)
    blocked = _blocked(scene, placed.mesh, leave_out)
    found |= {"openings": not blocked, "blocks": blocked}
    label = scene.parts[found["support"]].label if found["support"] else ""
    found |= {"support_label": label, "suits": suits(truth, label)}
    if truth.placement == "against wall" and found["suits"] and label == "floor":
        found["back_gap"] = round(_behind(room, points), 3)
        found["suits"] = found["back_gap"] <= LEAN_GAP
    found |= {check: bool(found[check]) for check in CHECKS}
    return found | {"right": all(found[check] for check in CHECKS)}


def _lies(truth: Truth, mesh: Mesh) -> bool:
    """Return True for what may lie on any side, and lies about as low as it usually does."""
    low = truth.height is not None and float(np.ptp(mesh.vertices[:, 2])) <= 1.3 * truth.height + 0.005
    return low and _named(truth.label.lower(), _table()["any_side"])


def _named(label: str, words: list[str]) -> bool:
    """Return True if one of some words is in a label, as a word or its plural."""
    ends = {word: r"$" if word.endswith("$") else r"\b" for word in words}
    return any(re.search(rf"\b{re.escape(word.rstrip('$'))}(e?s)?{end}", label) for word, end in ends.items())


def suits(truth: Truth, support: str) -> bool:
    """Return True if an object of this name may be on a support of that name, by suits.yaml."""
    table, label, below = _table(), truth.label.lower(), support.lower()
    if truth.placement == "hanging":
        return _named(below, table["hangs_on"])
    if _named(below, table["hot"]):
        return _named(label, table["cookware"])
    # By the head noun: a tv stand is no tv, a chest of drawers is no drawer.
    if _named(below.split(" of ")[0], [f"{word}$" for word in table["never"]]) or not below:
        return False
    for kind in ("floor", "soft"):
        if _named(below, table[f"{kind}_supports"]):
            return _named(label, table[f"{kind}_objects"])
    return not _named(label, table["only_floor_objects"])


@cache
def _table() -> dict[str, list[str]]:
    return yaml.safe_load((Path(__file__).parent / "suits.yaml").read_text())


def up_and_front(
    plan: dict, true_up: str, true_front: str, quaternion: tuple[float, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """Return the true up and front of an object in the scene.

    Args:
        plan: the axes of the file that the plan turned up and to the front.
        true_up: the file's axis that is up in truth.
        true_front: the file's axis that is the front in truth.
        quaternion: of the pose, xyzw: the object's own frame has the plan's up along z and its front along x.
    """
    up, front = _axis(plan["up"]), _axis(plan["front"])
    to_own = np.stack([front, np.cross(up, front), up])
    turn = Rotation.from_quat(quaternion)
    return turn.apply(to_own @ _axis(true_up)), turn.apply(to_own @ _axis(true_front))


def _axis(name: str) -> np.ndarray:
    return (1.0 if name[0] == "+" else -1.0) * np.eye(3)["xyz".index(name[1])]


def _carried(room: Obstacles, points: np.ndarray, leans: bool) -> dict:
    """Return what is below an object, by rays down from its underside; what leans need not stand by itself."""
    cell = max(0.004, float(np.ptp(points[:, :2], axis=0).max()) / 40)
    cells, where = np.unique(np.floor(points[:, :2] / cell).astype(int), axis=0, return_inverse=True)
    lowest = np.full(len(cells), np.inf)
    np.minimum.at(lowest, where.ravel(), points[:, 2])
    column = np.column_stack([(cells + 0.5) * cell, lowest])
    lift = 0.02
    distance, face = room.cast(column + [0, 0, lift], np.tile([0.0, 0.0, -1.0], (len(column), 1)), 3.0)
    gap = distance - lift
    foot = lowest < lowest.min() + 0.012
    on = foot & (face >= 0) & (np.abs(gap) < GAP)
    support = room.part_of(face[on])
    middle = points[:, :2].mean(axis=0)
    # What bulges out over a smaller foot does not overhang: only what is as far below as the foot counts.
    level = float(np.median(column[on, 2] - gap[on])) if on.any() else np.inf
    below = (face >= 0) & (np.abs(column[:, 2] - gap - level) < 0.05)
    if not below.all():
        below |= room.outlined(support, level, column[:, :2])
    held = on.any() and (leans or _holds(column[on, :2], middle, cell))
    over = float(1.0 - below.mean())
    return {"carried": bool(held), "support": support, "overhang": round(over, 3), "inside_support": over <= OVERHANG}


def _holds(contacts: np.ndarray, middle: np.ndarray, cell: float) -> bool:
    """Return True if a point [2] is over the hull of contacts [point 2], to a cell."""
    grown = np.concatenate(
        [contacts + cell * np.array(direction) for direction in ((1, 1), (1, -1), (-1, 1), (-1, -1))]
    )
    planes = ConvexHull(grown).equations
    return bool((planes[:, :2] @ middle + planes[:, 2] <= 0).all())


def _hung(room: Obstacles, placed: Placed, points: np.ndarray, either: bool) -> dict:
    """Return what is behind a hanging object: a wall within a few centimetres; its front, or either side, is towards the room."""
    front = placed.front
    assert front is not None
    if either:
        back = _hung(room, replace(placed, front=-front), points, False)
        if back["carried"]:
            return back
    front = front / np.linalg.norm(front)
    ahead = points @ front
    back = points[ahead < ahead.min() + 0.3 * np.ptp(ahead) + 1e-6]
    distance, face = room.cast(back + 0.02 * front, np.tile(-front, (len(back), 1)), 1.0)
    near = distance < BACK_GAP + 0.02 + 0.3 * float(np.ptp(ahead))
    away, _ = room.cast(points.mean(axis=0)[None] + (np.ptp(ahead) / 2 + 0.01) * front, front[None], 0.35)
    return {
        "carried": bool(near.mean() > 0.3 and away[0] > 0.3),
        "support": room.part_of(face[near]),
        "overhang": round(float(1 - near.mean()), 3),
        "inside_support": bool(near.mean() > 0.5),
    }


def _behind(room: Obstacles, points: np.ndarray) -> float:
    """Return the smallest distance from the upper half of an object sideways to something [m]."""
    upper = points[points[:, 2] > np.median(points[:, 2])]
    found = []
    for angle in np.arange(16) * np.pi / 8:
        direction = np.array([np.cos(angle), np.sin(angle), 0.0])
        found.append(float(room.cast(upper, np.tile(direction, (len(upper), 1)), 2.0)[0].min()))
    return min(found)


def _free(room: Obstacles, mesh: Mesh, points: np.ndarray) -> dict:
    """Return how deep the room reaches into a closed object, and edges of it that pass through a surface of the room."""
    near = room.points_near(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0))
    deepest = float(depths(mesh, near).max(initial=0.0))
    edges = np.unique(np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1), axis=0)
    a, b = (mesh.vertices[edges[:, i]].astype(np.float64) for i in (0, 1))
    length = np.linalg.norm(b - a, axis=1)
    a, b, length = a[length > 1e-6], b[length > 1e-6], length[length > 1e-6]
    direction = (b - a) / length[:, None]
    distance, face = cast(room.tree, a, direction, length)
    through = np.where(face >= 0, np.minimum(distance, length - distance), 0.0)
    pierced = float(through.max(initial=0.0))
    return {"free": max(deepest, pierced) <= DEEP, "depth": round(deepest, 4), "pierced": round(pierced, 4)}


def _blocked(scene: Scene, mesh: Mesh, leave_out: str | None) -> list[str]:
    """Return the drawers and doors that reach deep into an object on their path from closed to open."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return [i for i in scene.movable if i != leave_out and _reaches(scene, i, mesh, low, high)]


def _reaches(scene: Scene, part_id: str, mesh: Mesh, low: np.ndarray, high: np.ndarray) -> bool:
    joint = scene.parts[part_id].motion
    assert isinstance(joint, Joint)
    parts = [scene.parts[i].mesh for i in (part_id, *scene.descendants(part_id)) if len(scene.parts[i].mesh.faces)]
    if not parts:
        return False
    points = np.concatenate([dense(part.vertices[part.faces]) for part in parts])
    for q in np.linspace(joint.limits[0], joint.limits[1], POSITIONS):
        moved = displace(points, joint, float(q))
        moved = moved[((moved > low) & (moved < high)).all(axis=1)]
        if len(moved) and depths(mesh, moved).max(initial=0.0) > OPENING_DEEP:
            return True
    return False
