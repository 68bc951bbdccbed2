"""How a robot moves a part as far as a task asks for: where it stands, and whether it holds the handle or pushes the face."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from s2a.planner.gripper_shape import gripper_spheres
from s2a.planner.misses import Unreachable
from s2a.planner.obstacles import RoomHulls
from s2a.planner.part_base import with_base
from s2a.planner.part_reach import part_hulls
from s2a.planner.push import PRESS, pushes
from s2a.robot.collision import SLACK, robot_shape
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import ToolPath
from s2a.scene.articulation import transform
from s2a.sim.world import SimStage

TRIED = 24
"""Pushes with the gripper clear for which a base is searched."""


def ready_to_move(
    stage: SimStage,
    path_of: Callable[[SimStage], ToolPath],
    spec: RobotSpec,
    noise: float,
    seed: int = 0,
    *,
    may_push: bool = False,
) -> SimStage:
    """Return a stage with the robot where it can do a task with its part; see `part_base.with_base`.

    Args:
        stage: of the part.
        path_of: returns the tool path of the task in a stage.
        spec: the robot.
        noise: how far from home an episode may start [rad].
        seed: of the searches.
        may_push: the part may be pushed where its handle cannot be held on all of the path.

    Raises:
        Unreachable: no base does, with the segment that comes farthest.
    """
    try:
        return with_base(stage, path_of(stage), spec, noise, seed)
    except Unreachable as error:
        if not may_push:
            raise
        for pushed in itertools.islice(_clear(stage, path_of, spec), TRIED):
            try:
                return with_base(pushed, path_of(pushed), spec, noise, seed)
            except Unreachable:
                continue
        raise Unreachable(f"{error}; nor can it be pushed") from error


def _clear(stage: SimStage, path_of: Callable[[SimStage], ToolPath], spec: RobotSpec) -> Iterator[SimStage]:
    """Yield a stage with a push of its part on which gripper and wrist meet neither the room nor the part."""
    room, target, gripper = stage.room, stage.target, gripper_spheres(spec.gripper)
    riders = {i for i in room.articulations if target in room.carriers(i)}
    around, part = RoomHulls(room, {target, *riders}, stage.grasp[:3]), part_hulls(stage)
    shape = robot_shape(spec)
    radii = np.concatenate([gripper.radii, shape.wrist_radii])
    for pose in pushes(stage, spec.gripper):
        pushed = replace(stage, push=pose)
        path = path_of(pushed)
        turned = path.poses[:, :3, :3].transpose(0, 2, 1)
        wrist = shape.wrist @ turned + path.poses[:, None, :3, 3]
        centers = np.concatenate([gripper.placed(path.poses, np.zeros(len(path.poses))), wrist], axis=1)
        if around.depth(centers, radii).max() > SLACK:
            continue
        back = np.stack([np.linalg.inv(transform(stage.joint, q)) for q in path.q])
        on_part = centers @ np.swapaxes(back[:, :3, :3], 1, 2) + back[:, None, :3, 3]
        if part.depth(on_part, radii).max() <= PRESS + SLACK:
            yield pushed
