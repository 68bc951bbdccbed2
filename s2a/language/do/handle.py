"""Opening and closing a part by its handle, and letting go of it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from s2a.core.errors import InputError
from s2a.planner.obstacles import RoomHulls
from s2a.planner.part_plan import PlannerConfig, planned_path
from s2a.planner.part_reach import detour
from s2a.planner.pick_base import arm_depth
from s2a.planner.segments import Segments
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import PathSettings, ToolPath, matrices
from s2a.scene.articulation import transform
from s2a.scene.scene import Mesh
from s2a.sim.world import SimStage
from s2a.tasks.env import VecEnv
from s2a.tasks.starts import Demonstration

TRIED = ((1.0, 1.0, 1.0), (1.0, 0.5, 1.0), (1.0, 0.5, 0.8), (0.5, 0.5, 1.0), (1.0, 0.0, 1.0), (0.5, 0.0, 1.0))
"""Fractions of `planner.approach` by which the gripper comes straight to the handle, and draws back from it, and of
`planner.opening`: bases are for opening what is shut, and an open part may be too near to the robot for all of it."""


@dataclass(frozen=True)
class HandleMotion:
    """The motion of a task that moves a part: grasp, move, let go, draw back.

    Attributes:
        demonstration: its targets, as the planner takes them.
        arm: its joint path, shape [pose arm].
        approach: straight path to the handle [m].
        retreat: that back from it [m].
    """

    demonstration: Demonstration
    arm: np.ndarray
    approach: float
    retreat: float


def motion(env: VecEnv, config: PlannerConfig) -> HandleMotion:
    """Return the motion that does a task, with the first of TRIED that the arm reaches.

    Raises:
        InputError: the arm cannot reach along the path.
    """
    first: InputError | None = None
    for ahead, back, opening in TRIED:
        tried = replace(config, approach=ahead * config.approach, opening=opening * config.opening)
        try:
            return _motion(env, tried, back)
        except InputError as error:
            first = first or error
    raise first or InputError("no straight path was tried")


def _motion(env: VecEnv, config: PlannerConfig, fraction: float) -> HandleMotion:
    """Return the motion that draws back by a fraction of the approach."""
    sim = env.sim
    path, arm = planned_path(sim, config, partial(_with_retreat, env=env, fraction=fraction))
    back = round(fraction * path.grasp)
    last = len(path.poses) - 1 - back
    rate = 1.0 / (sim.config.dt * sim.config.substeps)
    opened = 0.0 if sim.stage.internal else None
    around = detour(sim.stage, sim.robot, arm[0], float(path.q[0]), config.start_noise, config.seed, opened)
    reach = arm[:1] if around is None else around
    found = Segments(reach[0], sim.robot, sim.plan_limits, rate, config.close_time, closed=sim.stage.internal)
    if around is not None:
        found.between(around, config.reach_time)
    found.go(arm[: path.grasp + 1], config.approach_time)
    found.hold(sim.stage.internal)
    found.go(arm[path.grasp : last + 1], config.pull_time)
    found.release(sim.stage.internal)
    if back:
        found.go(arm[last:], config.approach_time)
    targets = found.trajectory(config.start_noise, config.reach_time).targets
    part = np.full((len(targets), 1), path.q[path.grasp])
    demonstration = Demonstration(targets, np.concatenate([targets, part], axis=1), found.closed)
    return HandleMotion(demonstration, arm, config.approach, config.approach * back / max(1, path.grasp))


def _with_retreat(stage: SimStage, settings: PathSettings, env: VecEnv, fraction: float) -> ToolPath:
    """Return the task's tool path, and after it a fraction of the approach backwards, from where the part was moved to."""
    path = env.task.tool_path(stage, settings, config=env.task.config)
    moved = transform(stage.joint, float(path.q[-1])) @ np.linalg.inv(transform(stage.joint, float(path.q[path.grasp])))
    back = moved @ path.poses[: path.grasp][::-1][: round(fraction * path.grasp)]
    poses, q = np.concatenate([path.poses, back]), np.append(path.q, np.full(len(back), path.q[-1]))
    return ToolPath(poses, q, path.grasp)


def refuse_collision(stage: SimStage, moved: Collection[str], spec: RobotSpec, arm: np.ndarray) -> None:
    """Raise InputError where the arm in joints [pose arm], or at home, meets what was moved; its base is for the room before.

    Args:
        stage: the room as it stands.
        moved: ids of parts that stand open and of objects that were moved.
        spec: the robot.
        arm: its joint path.
    """
    room, target = stage.room, stage.target
    bodies = {i: body for i, body in room.bodies.items() if i in moved and i != target}
    free = {i: body for i, body in room.free.items() if i in moved}
    if not bodies and not free:
        return
    near = RoomHulls(
        replace(room, bodies=bodies, free=free, static_colliders=()), {target}, stage.grasp[:3], _far_below(stage)
    )
    (base,) = matrices(stage.base[None])
    depth = arm_depth(robot_shape(spec), near, np.concatenate([arm, [spec.home]]), base, fingers=False).max()
    if depth > SLACK:
        raise InputError(
            f"from its base for {target!r} the arm reaches {1000 * depth:.0f} mm into what was moved before: "
            f"{', '.join([*bodies, *free])}"
        )


def _far_below(stage: SimStage) -> Mesh:
    """Return a triangle 1.5 m below the grasp, which no arm meets: a set of hulls cannot be empty."""
    corners = np.array([[0.0, 0.0, -1.5], [0.01, 0.0, -1.5], [0.0, 0.01, -1.5]])
    return Mesh(stage.grasp[:3] + corners, np.array([[0, 1, 2]]))
