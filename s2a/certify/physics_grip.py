"""Whether the gripper finds room at the grasp, closes on it, and holds it against a pull."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.physics import World
from s2a.ranges import NotNegative, Numbers, Positive

TOUCH = 1.0
"""[N] Force with which a finger counts as pressing."""


@dataclass(frozen=True)
class GripConfig:
    """How the hand takes hold.

    Attributes:
        approach: distance from which it comes straight to the grasp [m].
        depths: how far the point between the pads goes past the grasp point [m]; the first that holds counts.
        margins: room on either side of the region's thin section to which the fingers open before the approach [m],
            besides all the way.
        touch: how deep a finger may be in anything on its way [m].
        opened: how far the part is open meanwhile, as a way of the grasp point [m]; at most half of its range.
        force: of each finger [N].
        damping: of each finger [N s/m].
        gear: how stiffly the closed fingers resist moving to one side together [N/m].
        close_time: to close [s].
        pull: along the joint, towards its closed end, while the hand stands still [N].
        pull_time: how long [s].
        slip: how far the part may move meanwhile [m].
        dt: time step [s]; short, because at the steps of training MuJoCo's soft friction creeps by millimetres.
    """

    approach: Positive
    depths: Numbers
    margins: tuple[float, ...]
    touch: NotNegative
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
class Grip:
    """What became of one attempt.

    Attributes:
        holds: whether the hand got there, both fingers press, and the pull did not slip.
        way: what the hand did, in words.
        slip: how far the part moved under the pull [m]; None if it did not come to that.
        prim: what was in the way, or the region.
    """

    holds: bool
    way: str
    slip: float | None
    prim: str


def grip(world: World, config: GripConfig) -> Grip:
    """Try the depths and openings one after the other; return the first attempt that holds, else the one that came farthest."""
    # What turns about the grasp point itself opens without a way: there half of the range counts alone.
    way = config.opened / world.lever if world.lever > 0.0 else math.inf
    q = world.sign * min(way, 0.5 * max(map(abs, world.stage.joint.limits)))
    thin = 0.5 * float(world.stage.grasp_size[1])
    widest = world.robot.gripper.finger_joint_open
    openings = [widest, *(min(widest, thin + margin) for margin in config.margins)]
    tries = []
    for depth in config.depths:
        attempt = _first_way(world, q, depth, openings, config)
        tries.append(attempt)
        if attempt.holds:
            return attempt
    return max(tries, key=lambda attempt: attempt.slip is not None)


def _first_way(world: World, q: float, depth: float, openings: list[float], config: GripConfig) -> Grip:
    """Return the attempt with the widest opening with which the hand reaches a depth."""
    blocked = []
    for opening in openings:
        # In the closed pose, where the furniture is nearest, and where the part stands open for the pull.
        ways = [_obstacle(world, at, depth, opening, config) for at in (0.0, q)]
        if not any(ways):
            return _hold(world, q, depth, opening, config)
        blocked.append(next(way for way in ways if way))
    prim, into = min(blocked, key=lambda found: found[1])
    return Grip(False, f"the open hand is {1000 * into:.1f} mm in {prim} on its way to the grasp", None, prim)


def _obstacle(world: World, q: float, depth: float, opening: float, config: GripConfig) -> tuple[str, float] | None:
    """Return what the open hand meets on its straight way to the grasp, and how deep [m]; None if nothing."""
    hand = world.geoms(world.robot.gripper.body, *world.robot.gripper.links)
    around = world.geoms(world.stage.target, world.carrier, "static")
    data = world.data(q, opening)
    worst, prim = config.touch, ""
    for short in np.linspace(config.approach, 0.0, 11):
        world.place_hand(data, _hand_pose(world, q, depth - short))
        into, _, other = world.deepest(data, hand, around)
        if into > worst:
            worst, prim = into, world.labels[other]
    return (prim, worst) if prim else None


def _hold(world: World, q: float, depth: float, opening: float, config: GripConfig) -> Grip:
    """Close the fingers on the part, pull it, and tell how far it slips.

    Its weight is carried until the hand has closed, since a lid would fall shut before; then the hand has it, and the pull.
    Each finger closes by itself, as an arm that yields lets them; then they are geared to each other, as the hand's are, and
    it stands still: equal forces alone would follow a load from one finger to the other.
    """
    stage, joint, fingers, dofs = world.stage, world.joint, world.fingers, world.finger_dofs
    data = world.data(q, opening)
    world.mj.opt.timestep, world.mj.dof_damping[dofs] = config.dt, config.damping
    world.place_hand(data, _hand_pose(world, q, depth))
    pull = -world.sign * config.pull * world.lever

    mujoco.mj_forward(world.mj, data)

    def run(seconds: float, torque: float, gear: float = 0.0, carried: bool = False) -> None:
        closed = data.qpos[fingers].copy()
        for _ in range(round(seconds / config.dt)):
            moved = data.qpos[fingers] - closed
            data.qfrc_applied[dofs] = -config.force - gear * (moved - moved.mean())
            data.qfrc_applied[world.dof] = torque + carried * data.qfrc_bias[world.dof]
            mujoco.mj_step(world.mj, data)

    region = f"/scene/{stage.target}/region"
    run(config.close_time, 0.0, carried=True)
    pressing = [_presses(world, data, finger) for finger in world.robot.gripper.links]
    if not all(pressing):
        missing = "neither finger presses" if not any(pressing) else "only one finger presses"
        return Grip(False, f"the hand closes to {1000 * data.qpos[fingers].sum():.0f} mm, but {missing}", None, region)
    before, width = float(data.qpos[joint]), float(data.qpos[fingers].sum())
    run(config.pull_time, pull, config.gear)
    slip = abs(float(data.qpos[joint]) - before) * world.lever
    word = f"{1000 * width:.0f} mm between the fingers; {config.pull:g} N for {config.pull_time:g} s move it {1000 * slip:.1f} mm"
    return Grip(bool(slip <= config.slip), word, slip, region)


def _presses(world: World, data: mujoco.MjData, finger: str) -> bool:
    """Return whether a finger presses on the target."""
    one, other = set(world.geoms(finger)), set(world.geoms(world.stage.target))
    total, force = 0.0, np.zeros(6)
    for i, contact in enumerate(data.contact):
        if (contact.geom1 in one and contact.geom2 in other) or (contact.geom2 in one and contact.geom1 in other):
            mujoco.mj_contactForce(world.mj, data, i, force)
            total += force[0]
    return total > TOUCH


def _hand_pose(world: World, q: float, inwards: float) -> np.ndarray:
    """Return the gripper body's pose, 7-vector, with the tool frame's origin `inwards` [m] past the grasp point."""
    grasp = world.grasp_pose(q)
    offset = np.array([0.0, 0.0, inwards]) - world.robot.tool_offset
    return np.concatenate([grasp[:3] + Rotation.from_quat(grasp[3:]).apply(offset), grasp[3:]])
