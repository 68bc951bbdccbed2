"""Which body, coordinate and velocity of a world is what: looked up by name, the same in all worlds."""

from __future__ import annotations

from dataclasses import dataclass

import newton

from s2a.robot.spec import RobotSpec
from s2a.sim.world import SimStage, axis_of, body_index


@dataclass(frozen=True)
class Layout:
    """Indices within a world.

    Attributes:
        robot_joints: number of the robot's driven joints; they are coordinates 0 to robot_joints - 1, the arm's first.
        arm_joints: number of the arm's.
        home: coordinates of the robot at the start of an episode [rad, m], shape [robot_joints].
        robot_bodies: all its links.
        finger_bodies: left, right.
        tool_body: the link that carries the tool frame.
        part_body: the part that is to be moved.
        part_coord: its coordinate.
        part_dof: its velocity.
    """

    robot_joints: int
    arm_joints: int
    home: tuple[float, ...]
    robot_bodies: tuple[int, ...]
    finger_bodies: tuple[int, int]
    tool_body: int
    part_body: int
    part_coord: int
    part_dof: int


def layout(world: newton.ModelBuilder, robot: RobotSpec, stage: SimStage) -> Layout:
    """Return the indices of a world with a robot, built of a stage."""
    coord, dof = axis_of(world, stage.target, stage.joint.kind)
    left, right = (body_index(world, name) for name in robot.gripper.links)
    root = body_index(world, robot.root_link)
    return Layout(
        robot_joints=len(robot.joints),
        arm_joints=len(robot.arm_joints),
        home=robot.start,
        robot_bodies=tuple(_below(world, root)),
        finger_bodies=(left, right),
        tool_body=body_index(world, robot.tool_link),
        part_body=body_index(world, stage.target),
        part_coord=coord,
        part_dof=dof,
    )


def _below(world: newton.ModelBuilder, root: int) -> list[int]:
    """Return a body and all that hang on it."""
    found = [root]
    for parent, child in sorted(zip(world.joint_parent, world.joint_child, strict=True)):
        if parent in found and child not in found:
            found.append(child)
    return found
