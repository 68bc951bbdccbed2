"""The inside of a part such as a drawer, and the places in it at which an object can stand while the part is open."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from s2a.core.errors import InputError
from s2a.motion.obstacles import Obstacles, moved_room, surface_points
from s2a.motion.places import GAP, GRID, LEVEL, footprint
from s2a.robot.tool_path import matrix
from s2a.scene.articulation import displace, opening_direction, pose_at, transform
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import first_hits, ray_mesh
from s2a.scene.usd.sim_scene import SimRoom

BESIDE = 0.03
"""[m] Between an object in a part and the part's walls: an open finger with its clearance, and the arm's error."""
ABOVE = 0.002
"""[m] Between an object in a part, its corners too, and what the part passes as it is shut."""
NEAR_FLOOR = 0.01
"""[m] Above an object's lowest point: so far down, what is below the part's floor is near."""
LOW = 0.01
"""[m] Above the floor, at which the walls are looked for."""
STOPS = 15
"""Coordinates of the joint at which an object in the part is looked at as the part is shut."""


@dataclass(frozen=True)
class Inside:
    """The box within a part's walls.

    Attributes:
        frame: its middle and axes: opening direction, sideways, up; the part at zero; scene frame, shape [4 4].
        half: half its extents along these axes [m], shape [3].
    """

    frame: np.ndarray
    half: np.ndarray


def inside_placements(room: SimRoom, name: str, part: str, q: float) -> list[tuple[np.ndarray, Inside]]:
    """Return poses (7-vectors, scene frame) at which an object stands in an open part, and the inside, the best first.

    The part's floor is level below it, walls surround it, and it passes below all else as the part is shut.

    Raises:
        InputError: there is none.
    """
    joint, body = room.articulations[part].joint, room.free[name]
    opened = moved_room(room, part, q, {})
    near = Obstacles.of_room(opened, {name}, displace(np.array([room.articulations[part].grasp.point]), joint, q)[0])
    others = Obstacles.of_room(room, {name, part}, np.array(room.articulations[part].grasp.point))
    own = displace(merge([c.mesh for c in room.bodies[part].colliders]).vertices, joint, q)
    points = surface_points([c.mesh for c in body.colliders]) @ matrix(np.array([0, 0, 0, *body.orientation]))[:3, :3].T
    low, high, foot = own.min(axis=0), own.max(axis=0), footprint(points)
    upper = points[points[:, 2] > points[:, 2].min() + NEAR_FLOOR]
    found, low_by = [], math.inf
    for x, y in itertools.product(np.arange(low[0], high[0], GRID / 2), np.arange(low[1], high[1], GRID / 2)):
        height, names = near.below(np.c_[foot + [x, y], np.full(len(foot), high[2] + 0.3)])
        if set(names) != {part} or not math.isfinite(height.min()) or np.ptp(height) > LEVEL:
            continue
        floor = np.array([x, y, float(height.max())])
        at = np.array([x, y, floor[2] + GAP - float(points[:, 2].min()), *body.orientation])
        inside = inside_of(room, part, q, floor)
        if inside is None or _beside(inside, joint_local(joint, points + at[:3], q)) < BESIDE:
            continue
        low_by = min(low_by, depth := _shut_depth(others, room, part, upper + at[:3], q))
        if depth <= 0.0:
            found.append((at, inside))
    if not found and math.isfinite(low_by):
        text = f"of {np.ptp(points[:, 2]):.3f} m height fits into {part!r}, but meets what is above as that is shut"
        raise InputError(f"{name!r} {text}, by {1000 * low_by:.0f} mm or more; choose a lower object or a higher part")
    if not found:
        raise InputError(
            f"{part!r} has no level floor between walls on which {name!r} can stand, {100 * BESIDE:.0f} cm from them and below "
            "what is above it; drawers have a floor where the room was prepared with prepare.interior=true"
        )
    middle = np.mean([at[:2] for at, _ in found], axis=0)
    return sorted(found, key=lambda each: float(np.linalg.norm(each[0][:2] - middle)))


def at_zero(room: SimRoom, part: str, pose: np.ndarray, q: float) -> np.ndarray:
    """Return the pose (7-vector) that a body in a part at coordinate q has with the part at zero."""
    return pose_at(room.articulations[part].joint, pose, -q)


def joint_local(joint: object, points: np.ndarray, q: float) -> np.ndarray:
    """Return points [point 3] of a part at coordinate q as they are with the part at zero."""
    back = np.linalg.inv(transform(joint, q))  # type: ignore[arg-type]
    return points @ back[:3, :3].T + back[:3, 3]


def inside_of(room: SimRoom, part: str, q: float, floor: np.ndarray) -> Inside | None:
    """Return the inside of a part around a point [3] of its floor, the part at coordinate q; None where a wall is missing.

    It ends at the walls that level lines from just above the floor meet, and at the top of the lowest of them.
    """
    joint = room.articulations[part].joint
    whole = merge([c.mesh for c in room.bodies[part].colliders])
    tree = ray_mesh(whole.vertices, whole.faces)
    (at,) = joint_local(joint, floor[None], q) + [0.0, 0.0, LOW]
    ahead = opening_direction(joint, np.array(room.articulations[part].grasp.point)) * [1.0, 1.0, 0.0]
    if np.linalg.norm(ahead) < 0.5:
        return None
    ahead /= np.linalg.norm(ahead)
    aside = np.cross([0.0, 0.0, 1.0], ahead)
    directions = np.array([ahead, -ahead, aside, -aside])
    gaps = first_hits(tree, np.tile(at, (4, 1)), directions)
    if not np.isfinite(gaps).all():
        return None
    over = at + (gaps[:, None] + 0.003) * directions
    over[:, 2] = whole.vertices[:, 2].max() + 0.1
    tops = over[:, 2] - first_hits(tree, over, np.tile([0.0, 0.0, -1.0], (4, 1)))
    bottom, top = at[2] - LOW, float(tops.min())
    frame = np.eye(4)
    frame[:3, :3] = np.stack([ahead, aside, [0.0, 0.0, 1.0]], axis=1)
    frame[:3, 3] = at + 0.5 * ((gaps[0] - gaps[1]) * ahead + (gaps[2] - gaps[3]) * aside)
    frame[2, 3] = 0.5 * (bottom + top)
    return Inside(frame, np.array([gaps[0] + gaps[1], gaps[2] + gaps[3], top - bottom]) / 2)


def _beside(inside: Inside, points: np.ndarray) -> float:
    """Return how far the nearest of points [point 3] is from the walls [m]."""
    local = (points - inside.frame[:3, 3]) @ inside.frame[:3, :3]
    return float((inside.half[:2] - np.abs(local[:, :2])).min())


def _shut_depth(others: Obstacles, room: SimRoom, part: str, points: np.ndarray, q: float) -> float:
    """Return how deep an object of points [point 3] reaches into what the part passes as it is shut [m]."""
    joint = room.articulations[part].joint
    zero = joint_local(joint, points, q)
    passed = np.stack([displace(zero, joint, at) for at in np.linspace(q, 0.0, STOPS)])
    return float(others.depth(passed, np.full(len(points), ABOVE)).max())
