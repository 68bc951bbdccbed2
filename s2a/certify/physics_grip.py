"""Grasp-hold test: the gripper approaches the grasp, closes, and holds the part against a pull."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.physics import MujocoWorld
from s2a.core.bounds import NotNegative, Numbers, Positive

PRESS_FORCE = 1.0
"""[N] Force with which a finger counts as pressing."""


@dataclass(frozen=True)
class GripConfig:
    """Settings of the grasp-hold test.

    Attributes:
        approach: length of the straight approach [m].
        depths: how far the point between the pads goes past the grasp point [m]; the first that holds counts.
        margins: clearance on either side of the region's thin section to which the fingers open before the approach [m],
            besides fully open.
        max_penetration: of the open gripper on its approach [m].
        opened: how far the part is open meanwhile, as displacement of the grasp point [m]; at most half of its range.
        force: of each finger [N].
        damping: of each finger [N s/m].
        gear: how stiffly the closed fingers resist moving to one side together [N/m].
        close_time: to close [s].
        pull: along the joint, towards its closed end, while the gripper stands still [N].
        pull_time: how long [s].
        slip: how far the part may move meanwhile [m].
        dt: time step [s]; short, because at the steps of training MuJoCo's soft friction creeps by millimetres.
    """

    approach: Positive
    depths: Numbers
    margins: tuple[float, ...]
    max_penetration: NotNegative
    opened: NotNegative
    force: Positive
    damping: NotNegative
    gear: NotNegative
    close_time: Positive
    pull: NotNegative
    pull_time: Positive
    slip: NotNegative
    dt: Positive


@dataclass(frozen=True)
class GripTest:
    """Result of one attempt.

    Attributes:
        holds: The gripper reached the grasp, both fingers press, and the part did not slip.
        message: description of the attempt.
        slip: how far the part moved under the pull [m]; None without a pull.
        prim: path of the collider in collision, or of the region.
    """

    holds: bool
    message: str
    slip: float | None
    prim: str


def grip(world: MujocoWorld, config: GripConfig) -> GripTest:
    """Try the depths and finger openings in turn; return the first attempt that holds, else the one that came farthest."""
    # What turns about the grasp point itself opens without displacement: there half of the range counts alone.
    travel = config.opened / world.lever_arm if world.lever_arm > 0.0 else math.inf
    q = world.sign * min(travel, 0.5 * max(map(abs, world.stage.joint.limits)))
    thin = 0.5 * float(world.stage.grasp_size[1])
    widest = world.robot.gripper.finger_joint_open
    finger_openings = [widest, *(min(widest, thin + margin) for margin in config.margins)]
    if world.stage.internal:  # the fingers go into the pocket closed
        finger_openings = [0.0]
    attempts = []
    for depth in config.depths:
        attempt = _first_approach(world, q, depth, finger_openings, config)
        attempts.append(attempt)
        if attempt.holds:
            return attempt
    return max(attempts, key=lambda attempt: attempt.slip is not None)


def _first_approach(
    world: MujocoWorld, q: float, depth: float, finger_openings: list[float], config: GripConfig
) -> GripTest:
    """Return the attempt with the widest opening with which the gripper reaches a depth."""
    blocked = []
    for opening in finger_openings:
        # In the closed pose, where the furniture is nearest, and where the part stands open for the pull.
        collisions = [_obstacle(world, at, depth, opening, config) for at in (0.0, q)]
        if not any(collisions):
            return _hold(world, q, depth, opening, config)
        blocked.append(next(found for found in collisions if found))
    prim, into = min(blocked, key=lambda found: found[1])
    return GripTest(False, f"the open gripper penetrates {prim} by {1000 * into:.1f} mm on its approach", None, prim)


def _obstacle(
    world: MujocoWorld, q: float, depth: float, opening: float, config: GripConfig
) -> tuple[str, float] | None:
    """Return the deepest collision of the open gripper on its straight approach, path and depth [m]; None without."""
    gripper = world.geoms(world.robot.gripper.body, *world.robot.gripper.links)
    obstacles = world.geoms(world.stage.target, world.carrier, "static")
    data = world.data(q, opening)
    worst, prim = config.max_penetration, ""
    for short in np.linspace(config.approach, 0.0, 11):
        world.place_gripper(data, _gripper_pose(world, q, depth - short))
        into, _, other = world.deepest(data, gripper, obstacles)
        if into > worst:
            worst, prim = into, world.labels[other]
    return (prim, worst) if prim else None


def _hold(world: MujocoWorld, q: float, depth: float, opening: float, config: GripConfig) -> GripTest:
    """Close the fingers on the part, or spread them within it, pull it, and measure its slip.

    Its weight is carried until the gripper has closed, since a lid would fall shut before; then the gripper carries it, and
    the pull. Each finger closes by itself, as a compliant arm lets them; then they are geared to each other, as the gripper's
    are, and it stands still: equal forces alone would follow a load from one finger to the other.
    """
    stage, joint, fingers, dofs = world.stage, world.joint, world.fingers, world.finger_dofs
    data = world.data(q, opening)
    world.mj.opt.timestep, world.mj.dof_damping[dofs] = config.dt, config.damping
    world.place_gripper(data, _gripper_pose(world, q, depth))
    pull, towards = -world.sign * config.pull * world.lever_arm, 1.0 if stage.internal else -1.0

    mujoco.mj_forward(world.mj, data)

    def run(seconds: float, torque: float, gear: float = 0.0, carried: bool = False) -> None:
        closed = data.qpos[fingers].copy()
        for _ in range(round(seconds / config.dt)):
            moved = data.qpos[fingers] - closed
            data.qfrc_applied[dofs] = towards * config.force - gear * (moved - moved.mean())
            data.qfrc_applied[world.dof] = torque + carried * data.qfrc_bias[world.dof]
            mujoco.mj_step(world.mj, data)

    region = f"/scene/{stage.target}/region"
    grips = "opens" if stage.internal else "closes"
    run(config.close_time, 0.0, carried=True)
    pressing = [_presses(world, data, finger) for finger in world.robot.gripper.links]
    if not all(pressing):
        missing = "neither finger presses" if not any(pressing) else "only one finger presses"
        return GripTest(
            False, f"the gripper {grips} to {1000 * data.qpos[fingers].sum():.0f} mm, but {missing}", None, region
        )
    before, width = float(data.qpos[joint]), float(data.qpos[fingers].sum())
    run(config.pull_time, pull, config.gear)
    slip = abs(float(data.qpos[joint]) - before) * world.lever_arm
    word = f"{1000 * width:.0f} mm between the fingers; {config.pull:g} N for {config.pull_time:g} s move it {1000 * slip:.1f} mm"
    return GripTest(bool(slip <= config.slip), word, slip, region)


def _presses(world: MujocoWorld, data: mujoco.MjData, finger: str) -> bool:
    """Return whether a finger presses on the target."""
    one, other = set(world.geoms(finger)), set(world.geoms(world.stage.target))
    total, force = 0.0, np.zeros(6)
    for i, contact in enumerate(data.contact):
        if (contact.geom1 in one and contact.geom2 in other) or (contact.geom2 in one and contact.geom1 in other):
            mujoco.mj_contactForce(world.mj, data, i, force)
            total += force[0]
    return total > PRESS_FORCE


def _gripper_pose(world: MujocoWorld, q: float, inwards: float) -> np.ndarray:
    """Return the gripper body's pose, 7-vector, with the tool frame's origin `inwards` [m] past the grasp point."""
    grasp = world.grasp_pose(q)
    offset = np.array([0.0, 0.0, inwards]) - world.robot.tool_offset
    return np.concatenate([grasp[:3] + Rotation.from_quat(grasp[3:]).apply(offset), grasp[3:]])
