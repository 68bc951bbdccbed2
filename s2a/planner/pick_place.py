"""Picking a free object and placing it: base, grasp and joint path, or the segment that fails and by how much."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.planner.free_motion import free_motion
from s2a.planner.misses import Misses, Unreachable
from s2a.planner.object_grasps import ObjectGrasps, matrix, object_grasps
from s2a.planner.obstacles import HELD_RADIUS, RoomHulls, gripper_spheres, surface_points
from s2a.planner.pick_base import arm_depth, bases, chunks, reached
from s2a.planner.pick_plan import PickPlan
from s2a.robot.collision import SLACK, RobotShape, robot_shape
from s2a.robot.joint_path import follow
from s2a.robot.spec import RobotSpec
from s2a.usd.sim_scene import SimRoom

APPROACH, LIFT = 0.10, 0.08
"""[m] Straight paths before the grasp and after the release, and above start and place."""
STEP = 0.02
"""[m] Between poses of a straight path."""
DROP = 0.001
"""[m] Above the planned place the fingers open, so that the object is not pressed onto its support."""
GRASPS, BASES, PAIRS = 16, 24, 96
"""Grasps and bases that are tried, and pairs of both that are planned to the end."""
IK_SEEDS = 12
"""Starts of the inverse kinematics."""
Fits = Callable[[list[tuple[np.ndarray, float]]], list[tuple[np.ndarray, float]]]
"""Poses [4 4] and pedestals of bases [m] -> those of them that will do."""
SEARCH = 5.0
"""[s] For each collision-free motion."""


def plan_pick(
    room: SimRoom,
    target: str,
    start: np.ndarray,
    goal: np.ndarray,
    spec: RobotSpec,
    seed: int = 0,
    fits: Fits | None = None,
) -> PickPlan:
    """Return how a robot picks an object at a pose and places it at another; 7-vectors of its body frame, scene frame.

    `fits` says which bases will do, of those where the robot can stand.

    Raises:
        Unreachable: no grasp, base or path was found.
    """
    return _Search(room, target, start, goal, spec, seed).plan(fits)


class _Search:
    """The search for base, grasp and path, cheapest tests first."""

    def __init__(
        self, room: SimRoom, target: str, start: np.ndarray, goal: np.ndarray, spec: RobotSpec, seed: int
    ) -> None:
        self._spec, self._seed, self._target = spec, seed, target
        self._shape: RobotShape = robot_shape(spec)
        self._object = room.free[target]
        self._start, self._goal = matrix(start), matrix(goal)
        self._near = RoomHulls(room, {target}, (start[:3] + goal[:3]) / 2)
        hulls = [c.mesh for c in self._object.colliders]
        self._points = surface_points(hulls)
        self._misses = Misses()
        self._grasps = object_grasps(hulls, np.array(self._object.mass.center), spec.gripper, seed)

    def plan(self, fits: Fits | None) -> PickPlan:
        """Return the first plan found."""
        grasps, tried = self._clear_grasps(), 0
        for base, pedestal, k in self._pairs(grasps, fits):
            found = self._plan_from(base, pedestal, grasps[k])
            if found is not None:
                return found
            tried += 1
            if tried >= PAIRS:
                break
        raise self._failure()

    def _pairs(self, grasps: np.ndarray, fits: Fits | None) -> Iterator[tuple[np.ndarray, float, int]]:
        """Yield bases, pedestals and indices of grasps that reach, those where the arm was found to be clear first."""
        places = {"grasp": self._start, "place": self._goal}
        later: list[tuple[np.ndarray, float, int]] = []
        for some in chunks(bases(self._shape, self._near, self._start, self._goal), BASES):
            kept = some if fits is None else fits(some)
            found = reached(self._shape, self._near, places, kept, grasps, self._seed, self._misses)
            for base, pedestal, k, clear in found:
                if clear:
                    yield base, pedestal, k
                else:
                    later.append((base, pedestal, k))
        yield from later

    def _failure(self) -> Unreachable:
        return Unreachable(f"{self._target!r} cannot be picked and placed so: {self._misses.text}")

    def _clear_grasps(self) -> np.ndarray:
        """Return tool poses in the object's frame, shape [grasp 4 4], at which the gripper is free at start and goal."""
        found: ObjectGrasps = self._grasps
        widest = self._spec.gripper.max_opening
        if not len(found.tool):
            size = np.ptp(self._points, axis=0).min()
            raise Unreachable(
                f"{self._target!r}: grasp: no two opposite faces as wide as the pads fit between the fingers, which "
                f"open {1000 * widest:.0f} mm; the object's thinnest extent is {1000 * size:.0f} mm; choose a smaller "
                "object or another robot="
            )
        depth = np.zeros(len(found.tool))
        for at in (self._start, self._goal):
            depth = np.maximum(depth, self._gripper_depth(at @ found.tool))
        # Only those that keep clear; the arm comes from somewhere above or beside, never from below.
        free = depth <= 0.0
        if not free.any():
            raise Unreachable(
                f"{self._target!r}: grasp: the gripper reaches at least {1000 * depth.min():.0f} mm into what is around the "
                "object or its place; choose a place with more room around it"
            )
        return _diverse(found.tool[free])

    def _gripper_depth(self, tool: np.ndarray) -> np.ndarray:
        """Return how deep the open gripper reaches into the room on the straight path to tool poses [grasp 4 4]."""
        centers, radii = gripper_spheres(self._spec.gripper)
        depth = np.zeros(len(tool))
        for back in np.linspace(0.0, APPROACH, 4):
            offset = centers - [0.0, 0.0, back]
            places = offset @ tool[:, :3, :3].transpose(0, 2, 1) + tool[:, None, :3, 3]
            depth = np.maximum(depth, self._near.depth(places, radii + 0.002))
        return depth

    def _plan_from(self, base: np.ndarray, pedestal: float, grasp: np.ndarray) -> PickPlan | None:
        """Return the plan for a base and a grasp; None where a segment fails, which is noted."""
        kin = self._shape.kin
        home = np.array(kin.spec.home)
        tool = self._start @ grasp
        poses = np.concatenate(
            [_line(tool, -APPROACH * tool[:3, 2], 0.0)[::-1], _line(tool, np.array([0, 0, LIFT]), 0.0)[1:]]
        )
        at = round(APPROACH / STEP)
        for path in self._free_paths(poses, base, home, "approach and lift", 1)[:3]:
            held = np.linalg.inv(kin.tool(path[at : at + 1])[0]) @ np.linalg.inv(base) @ self._start
            tool = self._goal @ np.linalg.inv(held)
            tool[2, 3] += DROP
            down = np.concatenate(
                [_line(tool, np.array([0, 0, LIFT]), 0.0)[::-1], _line(tool, -APPROACH * tool[:3, 2], 0.0)[1:]]
            )
            lowers = self._free_paths(down, base, path[-1], "lowering and retreat", 2, flip=False)
            low = round(LIFT / STEP)
            for lower in lowers[:3]:
                reach = self._move(home, path[0], base, None, "reach", 3)
                carry = self._move(path[-1], lower[0], base, held, "carry", 4) if reach is not None else None
                if reach is None or carry is None:
                    continue
                x, y, z = base[:3, 3]
                quat = Rotation.from_matrix(base[:3, :3]).as_quat()
                return PickPlan(
                    np.array([x, y, z, *quat]), pedestal, reach, path[: at + 1], path[at:], carry,
                    lower[: low + 1], lower[low:], np.linalg.inv(held),
                )  # fmt: skip
        return None

    def _free_paths(
        self, poses: np.ndarray, base: np.ndarray, near: np.ndarray, name: str, stage: int, flip: bool = True
    ) -> list[np.ndarray]:
        """Return joint paths along tool poses [pose 4 4] on which the arm collides with nothing, nearest to joints first."""
        kin = self._shape.kin
        (paths,) = follow(kin, poses, base[None], IK_SEEDS, self._seed)
        if len(paths) and not flip:
            wanted = np.linalg.inv(base) @ poses[0]
            turn = np.einsum("pij,ij->p", kin.tool(paths[:, 0])[:, :3, :3], wanted[:3, :3])
            paths = paths[turn > 2.9]  # the trace of a rotation by 0: 3; by half a turn: -1
        if not len(paths):
            self._misses.note(
                stage, 1.0, f"{name}: the arm cannot follow the straight path; choose a place with more room"
            )
            return []
        found = []
        for path in paths[np.argsort(np.abs(paths[:, 0] - near).max(axis=1))]:
            depth = max(
                float(arm_depth(self._shape, self._near, path, base, fingers=False).max()),
                self._shape.self_penetration(path)[0],
            )
            if depth <= SLACK:
                found.append(path)
            else:
                self._misses.note(
                    stage, depth, f"{name}: the arm reaches {1000 * depth:.0f} mm into the room or itself"
                )
        return found

    def _move(
        self, start: np.ndarray, goal: np.ndarray, base: np.ndarray, held: np.ndarray | None, name: str, stage: int
    ) -> np.ndarray | None:
        """Return a collision-free motion [pose arm]; with an object of pose `held` [4 4] in the tool frame, or past it."""
        kin = self._shape.kin
        body = np.linalg.inv(base) @ self._start
        room_frame = self._points @ body[:3, :3].T + body[:3, 3]

        def depth(q: np.ndarray) -> np.ndarray:
            found = arm_depth(self._shape, self._near, q, base)
            if held is not None:
                carried = base @ kin.tool(q) @ held
                points = self._points @ carried[:, :3, :3].transpose(0, 2, 1) + carried[:, None, :3, 3]
                near = self._near.depth(points, np.full(len(self._points), HELD_RADIUS))
                return np.maximum(found, np.where(near > 0.0, near + SLACK, 0.0))
            chosen = self._shape.moving
            gaps = np.linalg.norm(self._shape.centers(q)[:, chosen][:, :, None] - room_frame, axis=3).min(axis=2)
            return np.maximum(found, (self._shape.radii[chosen] - gaps).max(axis=1))

        ends = np.stack([start, goal])
        worst = float(depth(ends).max())

        def free(q: np.ndarray) -> np.ndarray:
            ok = depth(q) <= SLACK
            return ok & np.array(
                [o and self._shape.self_penetration(each[None])[0] <= SLACK for o, each in zip(ok, q, strict=True)]
            )

        if worst > SLACK:
            self._misses.note(
                stage, worst, f"{name}: an end of the motion reaches {1000 * worst:.0f} mm into something"
            )
            return None
        path = free_motion(start, goal, kin.lower, kin.upper, free, SEARCH, self._seed)
        if path is None:
            self._misses.note(stage, 0.0, f"{name}: no collision-free motion was found in {SEARCH:.0f} s")
        return path


def _line(tool: np.ndarray, offset: np.ndarray, first: float) -> np.ndarray:
    """Return poses from a tool pose [4 4] to the same shifted by an offset [3], STEP apart, shape [pose 4 4]."""
    count = round(float(np.linalg.norm(offset)) / STEP) + 1
    poses = np.tile(tool, (count, 1, 1))
    poses[:, :3, 3] += np.linspace(first, 1.0, count)[:, None] * offset
    return poses


def _diverse(tool: np.ndarray) -> np.ndarray:
    """Return up to GRASPS of tool poses [grasp 4 4], in order, no two of nearly the same direction."""
    kept: list[np.ndarray] = []
    for pose in tool:
        if all(np.trace(pose[:3, :3].T @ other[:3, :3]) < 1 + 2 * math.cos(0.5) for other in kept):
            kept.append(pose)
        if len(kept) == GRASPS:
            break
    return np.stack(kept)
