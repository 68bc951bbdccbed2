"""Where an object is to stand: as it was found, on a support, at a pose, or where an insertion put it."""

from __future__ import annotations

import itertools
import json
import math
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.errors import InputError
from s2a.planner.object_grasps import matrix
from s2a.planner.obstacles import RoomHulls, surface_points
from s2a.usd.sim_scene import SimRoom

GRID = 0.04
"""[m] Between the spots that are tried on a support."""
LEVEL = 0.004
"""[m] Up to which a support's height may differ below an object."""
APART = 0.15
"""[m] Least distance of a free spot from where the object stands."""
MARGINS = 0.08, 0.04
"""[m] Between an object on a free spot and everything beside it: half of the gripper's body; else an open finger with its
clearance, and the arm's error."""
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


def place_pose(room: SimRoom, name: str, said: str | None, other: np.ndarray) -> np.ndarray:
    """Return the pose of an object's body frame that a key says, 7-vector, scene frame.

    Args:
        room: the room.
        name: id of the object.
        said: None: as it stands; "x y z [yaw in degrees]"; an insert.json; the id of a support: its free spot nearest to `other`.
        other: the other end of the motion, 7-vector.

    Raises:
        InputError: none of these; no free spot; an insertion of another object.
    """
    if said is None:
        return scanned(room, name)
    if said.endswith(".json"):
        return _inserted(room, name, Path(said))
    try:
        numbers = [float(x) for x in said.replace(",", " ").split()]
    except ValueError:
        return free_placement(room, name, said, other)
    if len(numbers) not in (3, 4):
        raise InputError(f"{said!r} is no pose; expected 'x y z' or 'x y z yaw', metres and degrees")
    yaw = Rotation.from_euler("z", numbers[3] if len(numbers) == 4 else 0.0, degrees=True)
    turned = yaw * Rotation.from_quat(room.free[name].orientation)
    return np.array([*numbers[:3], *turned.as_quat()])


def _inserted(room: SimRoom, name: str, record: Path) -> np.ndarray:
    """Return where an insertion put an object: where it stands in a room that was prepared with it."""
    try:
        ids = [each.get("id") for each in json.loads(record.read_text())["objects"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{record}: no insertion record ({error}); give the insert.json of s2a insert") from error
    if name not in ids:
        raise InputError(f"{record} did not insert {name!r}; it inserted: {', '.join(filter(None, ids)) or 'nothing'}")
    return scanned(room, name)


def free_placement(room: SimRoom, name: str, support: str, other: np.ndarray) -> np.ndarray:
    """Return a pose at which an object stands on a support, level and clear of all else, turned as it is in the file.

    The nearest one to `other` (7-vector) that is APART from it, of those with the larger of MARGINS if there are any.

    Raises:
        InputError: no such support near the object, or no free spot on it.
    """
    near = RoomHulls(room, {name}, other[:3])
    hulls = near.hulls_of(support)
    if not hulls:
        known = ", ".join(dict.fromkeys(near.names))
        raise InputError(f"{support!r} supports nothing within 2 m of {name!r}; near are: {known}")
    bounds = np.concatenate([h.vertices for h in hulls])
    low, high = bounds.min(axis=0), bounds.max(axis=0)
    body = room.free[name]
    turn = matrix(scanned(room, name))[:3, :3]
    points = surface_points([c.mesh for c in body.colliders], 200) @ turn.T
    foot = footprint(points)
    spots = [
        np.array([x, y])
        for x, y in itertools.product(np.arange(low[0], high[0], GRID), np.arange(low[1], high[1], GRID))
    ]
    spots = [s for s in spots if np.linalg.norm(s - other[:2]) >= APART]
    spots.sort(key=lambda s: float(np.linalg.norm(s - other[:2])))
    for margin, spot in itertools.product(MARGINS, spots):
        asked = np.c_[foot + spot, np.full(len(foot), high[2] + 0.3)]
        height, names = near.below(asked)
        if np.ptp(height) > LEVEL or set(names) != {support} or not math.isfinite(height[0]):
            continue
        z = float(height.max()) + GAP - float(points[:, 2].min())
        beside = points + [*spot, z]
        # Spheres about what is low would reach into the support.
        beside[:, 2] = np.maximum(beside[:, 2], float(height.max()) + margin + LEVEL)
        if near.depth(beside, np.full(len(beside), margin)) > 0.0:
            continue
        return np.array([*spot, z, *body.orientation])
    raise InputError(
        f"{support!r} has no level spot that is free for {name!r} and {100 * APART:.0f} cm from where it stands"
    )


def footprint(points: np.ndarray) -> np.ndarray:
    """Return points on the ground below an object [point 3] and on its bounds with some margin, shape [point 2]."""
    low, high = points[:, :2].min(axis=0) - 0.01, points[:, :2].max(axis=0) + 0.01
    sides = [np.linspace(a, b, 3) for a, b in zip(low, high, strict=True)]
    return np.array(list(itertools.product(*sides)))
