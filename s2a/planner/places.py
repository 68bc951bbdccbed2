"""Where an object is to stand: as it was found, on a support, at a pose, or where an insertion put it."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.errors import InputError
from s2a.planner.misses import Unreachable
from s2a.planner.object_grasps import matrix
from s2a.planner.obstacles import RoomHulls, surface_points
from s2a.usd.sim_scene import SimRoom

Ends = TypeVar("Ends")
Plan = TypeVar("Plan")
GRID = 0.04
"""[m] Between the spots that are tried on a support."""
LEVEL = 0.0015
"""[m] Up to which a support's height may differ below an object; half over an edge of 4 mm, a wine glass falls over."""
FOOT = 0.01
"""[m] Above an object's lowest point, up to which it stands on its support."""
APART = 0.15
"""[m] Least distance of a free spot from where the object stands."""
MARGINS = 0.16, 0.08, 0.04
"""[m] Between an object on a free spot and everything beside it: room for the gripper from all sides; else half of its width;
else an open finger with its clearance, and the arm's error."""
NEARBY = 0.7
"""[m] From the other end of the motion, up to which spots come first, however little room is around them."""
CANDIDATES = 4
"""Free places of a support that a task plans for, one after the other, until there is a plan."""
GAP = 0.001
"""[m] Between an object and its support where it is put down."""


def free_object(room: SimRoom, name: str | None) -> str:
    """Return the id of a free object; None stands for the only one. InputError: there is none such; it lists them."""
    known = ", ".join(room.free) or "none; give s2a prepare free=[...]"
    if name is None and len(room.free) == 1:
        return next(iter(room.free))
    if name not in room.free:
        raise InputError(f"part={name} is no free object of room {room.name!r}; possible: {known}")
    return name


def scanned(room: SimRoom, name: str) -> np.ndarray:
    """Return where an object stands in the room's file, 7-vector."""
    body = room.free[name]
    return np.array([*body.position, *body.orientation], float)


def place_poses(room: SimRoom, name: str, said: str | None, other: np.ndarray) -> Iterator[np.ndarray]:
    """Yield the poses of an object's body frame that a key says, 7-vectors, scene frame: one, or several of a support.

    Args:
        room: the room.
        name: id of the object.
        said: None: as it stands; "x y z [yaw in degrees]"; an insert.json; the id of a support: free spots near `other`.
        other: the other end of the motion, 7-vector.

    Raises:
        InputError: none of these; no free spot; an insertion of another object.
    """
    if said is None:
        yield scanned(room, name)
        return
    if said.endswith(".json"):
        yield _inserted(room, name, Path(said))
        return
    try:
        numbers = [float(x) for x in said.replace(",", " ").split()]
    except ValueError:
        yield from itertools.islice(free_placements(room, name, said, other), CANDIDATES)
        return
    if len(numbers) not in (3, 4):
        raise InputError(f"{said!r} is no pose; expected 'x y z' or 'x y z yaw', metres and degrees")
    yaw = Rotation.from_euler("z", numbers[3] if len(numbers) == 4 else 0.0, degrees=True)
    turned = yaw * Rotation.from_quat(room.free[name].orientation)
    yield np.array([*numbers[:3], *turned.as_quat()])


def _inserted(room: SimRoom, name: str, record: Path) -> np.ndarray:
    """Return where an insertion put an object: where it stands in a room that was prepared with it."""
    try:
        ids = [each.get("id") for each in json.loads(record.read_text())["objects"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{record}: no insertion record ({error}); give the insert.json of s2a insert") from error
    if name not in ids:
        raise InputError(f"{record} did not insert {name!r}; it inserted: {', '.join(filter(None, ids)) or 'nothing'}")
    return scanned(room, name)


def free_placements(room: SimRoom, name: str, support: str, other: np.ndarray) -> Iterator[np.ndarray]:
    """Yield poses at which an object stands on a support, level and clear of all else, turned as it is in the file.

    They are APART from each other and from `other` (7-vector). First come those NEARBY with the largest of MARGINS, and of those
    the nearest ones.

    Raises:
        InputError: no such support near the object, or no free spot on it.
    """
    near = RoomHulls(room, {name}, other[:3])
    hulls = near.hulls_of(support)
    if not hulls:
        known = ", ".join(dict.fromkeys(near.names))
        raise InputError(f"{support!r} supports nothing within 2 m of {name!r}; near are: {known}")
    bounds = np.concatenate([h.vertices for h in hulls])
    body = room.free[name]
    turn = matrix(scanned(room, name))[:3, :3]
    points = surface_points([c.mesh for c in body.colliders], 200) @ turn.T
    corners = np.concatenate([c.mesh.vertices for c in body.colliders]) @ turn.T
    feet = corners[corners[:, 2] < corners[:, 2].min() + FOOT]
    taken = [np.array(other[:2])]
    for margin, spot in _spots(bounds.min(axis=0), bounds.max(axis=0), other):
        if min(np.linalg.norm(spot - each) for each in taken) < APART:
            continue
        z = _standing(near, support, points, feet, spot, float(bounds[:, 2].max()), margin)
        if z is not None:
            taken.append(spot)
            yield np.array([*spot, z, *body.orientation])
    if len(taken) == 1:
        raise InputError(
            f"{support!r} has no level spot that is free for {name!r} and {100 * APART:.0f} cm from where it stands"
        )


def _spots(low: np.ndarray, high: np.ndarray, other: np.ndarray) -> Iterator[tuple[float, np.ndarray]]:
    """Yield margins [m] and places [2] between two corners, in the order of `free_placements`."""
    grid = [np.arange(low[k], high[k], GRID) for k in range(2)]
    spots = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)
    away = np.linalg.norm(spots - other[:2], axis=1)
    spots = spots[np.argsort(away, kind="stable")]
    split = int((away <= NEARBY).sum())
    for some in (spots[:split], spots[split:]):
        yield from itertools.product(MARGINS, some)


def _standing(
    near: RoomHulls,
    support: str,
    points: np.ndarray,
    feet: np.ndarray,
    spot: np.ndarray,
    top: float,
    margin: float,
) -> float | None:
    """Return the height [m] of an object's origin that stands on a support at a place [2]; None: it does not, or not clear.

    Args:
        near: the room around the object.
        support: id of the part.
        points: of the object's surface, turned, about its origin [point 3].
        feet: those on which it stands [corner 3].
        spot: x and y.
        top: of the support [m].
        margin: to everything beside it [m].
    """
    foot = footprint(feet)
    height, names = near.below(np.c_[foot + spot, np.full(len(foot), top + 0.3)])
    if np.ptp(height) > LEVEL or set(names) != {support} or not math.isfinite(height[0]):
        return None
    z = float(height.max()) + GAP - float(feet[:, 2].min())
    beside = points + [*spot, z]
    # Spheres about what is low would reach into the support.
    beside[:, 2] = np.maximum(beside[:, 2], float(height.max()) + margin + LEVEL)
    return None if near.depth(beside, np.full(len(beside), margin)) > 0.0 else z


def footprint(points: np.ndarray) -> np.ndarray:
    """Return points on the ground below what an object stands on [point 3] and around it with some margin, shape [point 2]."""
    low, high = points[:, :2].min(axis=0) - 0.01, points[:, :2].max(axis=0) + 0.01
    sides = [np.linspace(a, b, 3) for a, b in zip(low, high, strict=True)]
    return np.array(list(itertools.product(*sides)))


def first_planned(ends: Iterable[Ends], plan: Callable[[Ends], Plan]) -> tuple[Ends, Plan]:
    """Return the first of some starts and places for which there is a plan, and that plan.

    Raises:
        Unreachable: of the first ones, where there is none for any.
    """
    first: Unreachable | None = None
    for each in ends:
        try:
            return each, plan(each)
        except Unreachable as error:
            first = first or error
    assert first is not None, "`place_poses` yields a pose, or raises"
    raise first
