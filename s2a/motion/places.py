"""Placements of an object: as scanned, on a support, at a pose, or where an insertion put it."""

import itertools
import json
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TypeVar

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.motion.grasps import refuse_ungraspable
from s2a.motion.gripper import FIRM, Contact
from s2a.motion.obstacles import FOOT, RADIUS, Obstacles, moved_room, surface_points, uneven_rests
from s2a.motion.search import Unreachable
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.articulation import displace, opening_direction, pose_at, transform
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import first_hits, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom, in_scene

Ends = TypeVar("Ends")
Plan = TypeVar("Plan")
GRID = 0.04  # [m] Between the spots that are tried on a support
# [m] Up to which a support's height may differ below an object that stands level; half over an edge of 4 mm, a wine
# glass falls over
LEVEL = 0.0015
# [m] By which what is beside an object that stands on a support that is not level may be higher than its lowest point
ROUGH = 0.01
APART = 0.15  # [m] Least distance of a free spot from where the object stands
# [m] Between an object on a free spot and everything beside it: room for the gripper from all sides; else half of its
# width; else an open finger with its clearance, and the arm's error; else what keeps it from touching,
# for a grasp from above
MARGINS = 0.16, 0.08, 0.04, 0.015
NEARBY = 0.7  # [m] From the other end of the motion, up to which spots come first, however little room is around them
# [m] Between the heights of both ends, up to which spots come first: a part may have several tops, and a floor
AS_HIGH = 0.1
# [m] Between both ends, seen from above, at most: a robot between them is 0.63 m from each, three quarters of an arm's
# 0.855 m
FAR = 1.25
HIGH = 1.2  # [m] Between the heights of both ends, at most, likewise
# Free places that a task plans for, one after the other, until there is a plan; and of them on one of several supports
CANDIDATES, OF_ONE = 6, 3
INNER = 0.25  # [m] From the border of a support that is far away, where its spots are looked for
NEAR = "nearby"  # Stands for free places of what carries the object at the other end, and of what is near that
GAP = 0.001  # [m] Between an object and its support where it is put down
MOVED = "as task.start_shift and task.start_turn need it"  # Why a spot has to be level


def free_object(room: SimRoom, name: str | None) -> str:
    """Return the id of a free object; None stands for the only one. InputError: there is none such; it lists them."""
    possible = ", ".join(room.free) or "none; give s2a prepare free=[...]"
    if name is None and len(room.free) == 1:
        return next(iter(room.free))
    if name not in room.free:
        raise InputError(f"part={name} is no free object of room {room.name!r}; possible: {possible}")
    return name


def scanned(room: SimRoom, name: str) -> np.ndarray:
    """Return where an object stands in the room's file, 7-vector."""
    body = room.free[name]
    return np.array([*body.position, *body.orientation], float)


def place_poses(
    room: SimRoom, name: str, request: str | None, other: np.ndarray, level: float = LEVEL, leaning: bool = True
) -> Iterator[np.ndarray]:
    """Yield the poses of an object's body frame of a request, 7-vectors, scene frame: one, or several of a support.

    Args:
        room: the room.
        name: id of the object.
        request: None: as it stands; "x y z [yaw in degrees]"; an insert.json; the id of a support: free spots near `other`; NEAR:
            those of what is near.
        other: the other end of the motion, 7-vector.
        level: up to which a support's height may differ below the object [m].
        leaning: it may lean on a support that is not level; not so where it is shifted or turned on that.

    Raises:
        InputError: none of these; no free spot; an insertion of another object.
    """
    if request is None:
        yield scanned(room, name)
        return
    if request.endswith(".json"):
        yield _inserted(room, name, Path(request))
        return
    if request == NEAR:
        yield from itertools.islice(nearby_placements(room, name, other, level, leaning), CANDIDATES)
        return
    try:
        numbers = [float(x) for x in request.replace(",", " ").split()]
    except ValueError:
        yield from itertools.islice(free_placements(room, name, request, other, level, leaning), CANDIDATES)
        return
    if len(numbers) not in (3, 4):
        raise InputError(f"{request!r} is no pose; expected 'x y z' or 'x y z yaw', metres and degrees")
    yaw = Rotation.from_euler("z", numbers[3] if len(numbers) == 4 else 0.0, degrees=True)
    turned = yaw * Rotation.from_quat(room.free[name].orientation)
    yield np.array([*numbers[:3], *turned.as_quat()])


def near_support(room: SimRoom, support: str | None, start: np.ndarray) -> np.ndarray:
    """Return about where a robot that drives looks for spots on a support: the start (7-vector), or what is nearest to that."""
    hulls = [c.mesh.vertices for c in room.static_colliders if c.part == support]
    hulls += [in_scene(body, c.mesh) for body in room.bodies.values() for c in body.colliders if c.part == support]
    if not hulls:
        return start
    low, high = np.concatenate(hulls).min(axis=0), np.concatenate(hulls).max(axis=0)
    inner = np.minimum((high - low)[:2] / 2, INNER)
    near = np.clip(start[:2], low[:2] + inner, high[:2] - inner)
    if np.linalg.norm(near - start[:2]) <= FAR:
        return start
    return np.array([*near, high[2], *start[3:]])


def _inserted(room: SimRoom, name: str, record: Path) -> np.ndarray:
    """Return where an insertion put an object: where it stands in a room that was prepared with it."""
    try:
        ids = [each.get("id") for each in json.loads(record.read_text())["objects"]]
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{record}: no insertion record ({error}); give the insert.json of s2a insert") from error
    if name not in ids:
        raise InputError(f"{record} did not insert {name!r}; it inserted: {', '.join(filter(None, ids)) or 'nothing'}")
    return scanned(room, name)


def nearby_placements(
    room: SimRoom, name: str, other: np.ndarray, level: float = LEVEL, leaning: bool = True
) -> Iterator[np.ndarray]:
    """Yield free placements near a place (7-vector): on what carries the object there, then on what is near, the floor too.

    Raises:
        InputError: there is none.
    """
    near = Obstacles.of_room(room, {name}, other[:3])
    own = near.below(other[None, :3])[1][0]
    away = {i: _distance(near, i, other) for i in dict.fromkeys(near.names) if i != own and i not in room.free}
    count = 0
    for support in [own, *sorted(away, key=lambda i: away[i])]:
        spots = _placements(room, name, support, other, near, level, leaning)
        for pose in itertools.islice((each for each in spots if abs(each[2] - other[2]) <= HIGH), OF_ONE):
            count += 1
            yield pose
    if not count:
        needed = "level or steady" if leaning else f"level, {MOVED}"
        raise InputError(
            f"nothing within {FAR:.2f} m of {name!r} has a spot that is free for it, {needed}; give a pose"
        )


def _distance(near: Obstacles, support: str, other: np.ndarray) -> float:
    """Return how far the box about a part is from a place [m]."""
    points = np.concatenate([h.vertices for h in near.hulls_of(support)])
    return float(np.linalg.norm(np.clip(other[:3], points.min(axis=0), points.max(axis=0)) - other[:3]))


def free_placements(
    room: SimRoom, name: str, support: str, other: np.ndarray, level: float = LEVEL, leaning: bool = True
) -> Iterator[np.ndarray]:
    """Yield poses at which an object stands on a support, clear of all else, turned as it is in the file.

    They are APART from each other and from `other` (7-vector), and up to FAR from that. Those about as high come first: of a bare
    room, a table and the floor are one support. Of these the level ones, then those at which the object leans a little on a
    support that is not level; of each those NEARBY with the largest of MARGINS, and of those the nearest ones.

    Raises:
        InputError: no such support near the object, or no free spot on it.
    """
    near = Obstacles.of_room(room, {name}, other[:3])
    if support not in near.names:
        supports = ", ".join(dict.fromkeys(near.names))
        raise InputError(f"{support!r} supports nothing within 2 m of {name!r}; near are: {supports}")
    poses = _placements(room, name, support, other, near, level, leaning)
    first = next(poses, None)
    if first is None:
        farther = _placements(room, name, support, other, near, level, leaning, RADIUS)
        if next(farther, None) is not None:
            raise InputError(
                f"{support!r} has spots that are free for {name!r}, but none within {FAR:.2f} m of where it stands, as far as "
                "one base reaches; give another support or a pose, or a robot that drives"
            )
        uneven = "nor an uneven one where it rests steadily" if leaning else MOVED
        raise InputError(
            f"{support!r} has no level spot that is free for {name!r} and {100 * APART:.0f} cm from where it stands, {uneven}; "
            "give another support or a pose"
        )
    yield first
    yield from poses


def _placements(
    room: SimRoom,
    name: str,
    support: str,
    other: np.ndarray,
    near: Obstacles,
    level: float,
    leaning: bool,
    far: float = FAR,
) -> Iterator[np.ndarray]:
    """Yield the poses of `free_placements`, if there are any, in a room without the object, up to `far` [m] away."""
    body = room.free[name]
    turn = matrix(scanned(room, name))[:3, :3]
    points = surface_points([c.mesh for c in body.colliders]) @ turn.T
    whole = merge([c.mesh for c in body.colliders])
    bottom = Mesh(whole.vertices @ turn.T, whole.faces)
    lowest = float(bottom.vertices[:, 2].min())
    carrying = np.concatenate([h.vertices for h in near.hulls_of(support)])
    spots, top = _spots(carrying, other, far), float(carrying[:, 2].max()) + 0.3
    foot = footprint(bottom.vertices[bottom.vertices[:, 2] < lowest + FOOT])

    def level_poses() -> np.ndarray:
        flat = _level_spots(near, support, foot, spots, top, level)
        return np.c_[flat + [0.0, 0.0, GAP - lowest], np.tile(body.orientation, (len(flat), 1))]

    def leaning_poses() -> np.ndarray:
        rests = uneven_rests(near, support, bottom, turn @ np.array(body.mass.center), spots, top)
        upright = Rotation.from_quat(body.orientation)
        return np.array([[*spots[k], z + GAP, *(lean * upright).as_quat()] for k, lean, z in rests]).reshape(-1, 7)

    kinds = ((cache(level_poses), level), (cache(leaning_poses), ROUGH))[: 1 + leaning]
    heights = carrying[:, 2] - lowest - other[2]
    same_height = bool(heights.min() <= AS_HIGH and heights.max() >= -AS_HIGH)

    def in_order() -> Iterator[tuple[float, float, np.ndarray]]:
        # The leaning poses take long: they are computed where the level ones do not serve.
        for as_high, (poses, rough) in itertools.product((True, False)[not same_height :], kinds):
            every = poses()
            some = every[(np.abs(every[:, 2] - other[2]) <= AS_HIGH) == as_high]
            for margins in (MARGINS[:-1], MARGINS[-1:]):
                yield from ((rough, *each) for each in _in_order(some, other, margins, far))

    taken = [np.array(other[:2])]
    for rough, margin, pose in in_order():
        if min(np.linalg.norm(pose[:2] - each) for each in taken) < APART:
            continue
        lean = matrix(pose)[:3, :3] @ turn.T
        beside = points @ lean.T + pose[:3]
        # Spheres about what is low would reach into the support.
        beside[:, 2] = np.maximum(beside[:, 2], beside[:, 2].min() - GAP + margin + rough)
        if near.depth(beside, np.full(len(beside), margin)) <= 0.0:
            taken.append(pose[:2])
            yield pose


def _spots(bounds: np.ndarray, other: np.ndarray, far: float) -> np.ndarray:
    """Return places of a grid [spot 2] on a support of these points [point 3] that are up to `far` [m] from another place."""
    low, high = np.maximum(bounds.min(axis=0)[:2], other[:2] - far), np.minimum(bounds.max(axis=0)[:2], other[:2] + far)
    grid = [np.arange(low[k], high[k], GRID) for k in range(2)]
    return np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1).reshape(-1, 2)


def _level_spots(
    near: Obstacles, support: str, foot: np.ndarray, spots: np.ndarray, top: float, level: float
) -> np.ndarray:
    """Return those of places [spot 2] at which a foot [point 2] stands on a support level, and its height, shape [spot 3]."""
    if not len(spots):
        return np.zeros((0, 3))
    above = np.concatenate([spots[:, None] + foot, np.full((len(spots), len(foot), 1), top)], axis=2)
    height, names = near.below(above.reshape(-1, 3))
    height, own = height.reshape(len(spots), -1), np.array([n == support for n in names]).reshape(len(spots), -1)
    with np.errstate(invalid="ignore"):  # what is above nothing is at -inf
        good = own.all(axis=1) & np.isfinite(height).all(axis=1) & (np.ptp(height, axis=1) <= level)
    return np.c_[spots, height.max(axis=1)][good]


def _in_order(
    poses: np.ndarray, other: np.ndarray, margins: Sequence[float], far: float
) -> Iterator[tuple[float, np.ndarray]]:
    """Yield margins [m] and poses [7] in the order of `free_placements`."""
    away = np.linalg.norm(poses[:, :2] - other[:2], axis=1)
    poses, away = poses[np.argsort(away, kind="stable")], np.sort(away, kind="stable")
    split = int((away <= NEARBY).sum())
    for some in (poses[:split], poses[split : int((away <= far).sum())]):
        yield from itertools.product(margins, some)


def footprint(points: np.ndarray) -> np.ndarray:
    """Return points on the ground below what an object stands on [point 3] and around it with some margin, shape [point 2]."""
    low, high = points[:, :2].min(axis=0) - 0.01, points[:, :2].max(axis=0) + 0.01
    sides = [np.linspace(a, b, 3) for a, b in zip(low, high, strict=True)]
    return np.array(list(itertools.product(*sides)))


def first_planned(
    room: SimRoom,
    name: str,
    spec: RobotSpec,
    ends: Iterable[Ends],
    plan: Callable[[Ends], Plan],
    contact: Contact = FIRM,
) -> tuple[Ends, Plan]:
    """Return the first of some starts and places of an object for which there is a plan, and that plan.

    Where there is none for any, it is asked whether the gripper finds a contact on the object at all.

    Raises:
        Unreachable: of the first ones, where there is none for any; Ungraspable where the object is why.
        InputError: there are no starts or places.
    """
    first: Unreachable | None = None
    try:
        for each in ends:
            try:
                return each, plan(each)
            except Unreachable as error:
                first = first or error
    except InputError:  # no spot is free; the object may be too large for the gripper as well
        if first is None or not first.graspable:
            refuse_ungraspable(room, name, spec, contact)
        raise
    assert first is not None, "`place_poses` yields a pose, or raises"
    if not first.graspable:  # where it is, it took twice as long as the plans
        refuse_ungraspable(room, name, spec, contact)
    raise first


# [m] Between an object in a part and the part's walls: an open finger with its clearance, and the arm's error
BESIDE = 0.03
ABOVE = 0.002  # [m] Between an object in a part, its corners too, and what the part passes as it is shut
NEAR_FLOOR = 0.01  # [m] Above an object's lowest point: so far down, what is below the part's floor is near
LOW = 0.01  # [m] Above the floor, at which the walls are looked for
STOPS = 15  # Coordinates of the joint at which an object in the part is looked at as the part is shut


@dataclass(frozen=True)
class Inside:
    """The box within a part's walls."""

    # its middle and axes: opening direction, sideways, up; the part at zero; scene frame, shape [4 4]
    frame: np.ndarray
    half: np.ndarray  # half its extents along these axes [m], shape [3]


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
    places, low_by = [], math.inf
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
            places.append((at, inside))
    if not places and math.isfinite(low_by):
        text = f"of {np.ptp(points[:, 2]):.3f} m height fits into {part!r}, but meets what is above as that is shut"
        raise InputError(f"{name!r} {text}, by {1000 * low_by:.0f} mm or more; choose a lower object or a higher part")
    if not places:
        raise InputError(
            f"{part!r} has no level floor between walls on which {name!r} can stand, {100 * BESIDE:.0f} cm from them and below "
            "what is above it; drawers have a floor where the room was prepared with prepare.interior=true"
        )
    middle = np.mean([at[:2] for at, _ in places], axis=0)
    return sorted(places, key=lambda each: float(np.linalg.norm(each[0][:2] - middle)))


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
