"""Picking up a soft body and placing it: the plan for the rigid body of its shape, executed on the soft one."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch

from s2a.motion.correction import Correction, lead_held
from s2a.motion.gripper import FIRM, HANGING, gripper_boxes
from s2a.motion.obstacles import Obstacles
from s2a.motion.pick import trajectory_of
from s2a.motion.pick_plan import PickPlan, PickTask, plan_pick
from s2a.motion.settings import PlannerConfig
from s2a.motion.trajectory import Trajectory, eased
from s2a.motion.workcell import Workcell
from s2a.robot.spec import GripperSpec, RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.usd.sim_scene import SimRoom
from s2a.sim.limit_use import Limits
from s2a.sim.soft import RATE, SoftSimulation
from s2a.sim.soft_body import SoftBody
from s2a.sim.soft_config import SoftConfig
from s2a.tasks.pick_place.soft_metrics import SoftEpisode, SoftMetrics, outcome
from s2a.tasks.pick_place.soft_stage import NAME, hulls_near, with_body

AFTER = 1.5
"""[s] That an episode goes on after the arm's motion: half a second to come to rest, and one at rest."""
Watch = Callable[[int, SoftSimulation], None]


@dataclass(frozen=True)
class SoftTrial:
    """A soft body to be picked and placed.

    Attributes:
        room: without it.
        body: at rest.
        config: how it is simulated.
        robot: what picks it.
        start: pose of its frame, 7-vector, scene frame.
        goal: likewise.
        plan: how.
    """

    room: SimRoom
    body: SoftBody
    config: SoftConfig
    robot: RobotSpec
    start: np.ndarray
    goal: np.ndarray
    plan: PickPlan


def plan_trial(
    room: SimRoom,
    body: SoftBody,
    config: SoftConfig,
    robot: RobotSpec,
    ends: tuple[np.ndarray, np.ndarray],
    approach: float,
    seed: int = 0,
) -> SoftTrial:
    """Plan as for a rigid body of the same shape, from start to goal (7-vectors); Unreachable where there is no plan.

    The gripper comes straight to it from a distance `approach` [m].
    """
    task = PickTask(with_body(room, body, config, ends[0]), NAME, *ends, approach)
    plan = plan_pick(task, robot, seed, contacts=(*HANGING, FIRM))
    return SoftTrial(room, body, config, robot, *ends, plan)


def trajectory(trial: SoftTrial, config: PlannerConfig) -> Trajectory:
    """Return the joint targets of a trial."""
    return trajectory_of(trial.plan, config, trial.robot, trial.robot.limits, RATE)


def run_trial(
    trial: SoftTrial,
    planner: PlannerConfig,
    metrics: SoftMetrics,
    seed: int | Sequence[int],
    device: str = "cpu",
    watch: Watch | None = None,
) -> dict[str, Any]:
    """Simulate a trial from a noisy start of the arm; return its outcome.

    That is the columns of `soft_metrics`, the seconds that it took, and as `limit_use` the largest fraction of each limit of the
    robot, as `s2a.sim.limit_use` has them.

    Args:
        trial: what is done.
        planner: times of the motion, and the noise.
        metrics: the thresholds.
        seed: of the noise.
        device: of Warp.
        watch: is called after every control step, with its number.
    """
    plan, robot = trial.plan, trial.robot
    first = np.array(robot.start)
    arm = len(robot.arm_joints)
    first[:arm] += np.random.default_rng(seed).uniform(-1.0, 1.0, arm) * planner.start_noise
    begun = time.perf_counter()
    hulls = hulls_near(trial.room, trial.body, [trial.start, trial.goal])
    sim = SoftSimulation(trial.body, trial.start, robot, plan.base, first, hulls, trial.config, device)
    built = time.perf_counter()
    planned = trajectory(trial, planner)
    targets, (held,) = _targets(first, planned), [each for each in planned.anchors if each.to == "held"]
    slip, world = Correction(sim, [planned], [held]), torch.tensor([True])
    center, forces, joints, gap, torques = [], [], [], [], []
    for step, target in enumerate(targets):
        index = torch.tensor([max(0, step - planned.reach_steps)])
        if int(index) == held.begin:
            lead_held(slip, world, (np.linalg.inv(_tool_frame(sim.tool, robot)) @ sim.pose)[None])
        target[:arm] += slip(index)[0].cpu().numpy()
        sim.step(target)
        q, particles = sim.joints, sim.particles
        center.append(sim.center)
        forces.append(sim.finger_forces)
        joints.append(q)
        torques.append(sim.torques)
        gap.append(gripper_gap(particles, _tool_frame(sim.tool, robot), q[arm:], robot.gripper))
        if watch is not None:
            watch(step, sim)
    ended = time.perf_counter()
    depth = _arm_depth(trial, np.array(joints))
    episode = SoftEpisode(np.array(center), np.array(forces), np.array(gap), depth, RATE)
    found = outcome(episode, trial.goal[:3], metrics)
    seconds = {"simulated": len(targets) / RATE, "built_in": built - begun, "stepped_in": ended - built}
    used = _limit_use(robot, first, targets, np.array(joints), np.array(torques))
    return found | {name: round(value, 3) for name, value in seconds.items()} | {"limit_use": used}


def _targets(first: np.ndarray, planned: Trajectory) -> np.ndarray:
    """Return joint targets [step joint]: from where the robot begins to the trajectory, along it, and AFTER it."""
    ahead = eased(np.arange(1, planned.reach_steps + 1) / planned.reach_steps)[:, None]
    reach = first + ahead * (planned.targets[0] - first)
    still = np.repeat(planned.targets[-1:], math.ceil(AFTER * RATE), axis=0)
    return np.concatenate([reach, planned.targets, still])


def _limit_use(
    robot: RobotSpec, first: np.ndarray, targets: np.ndarray, joints: np.ndarray, torques: np.ndarray
) -> dict[str, float]:
    """Return the largest fraction of each limit, of targets and joints [step joint] and torques [step arm].

    Before the first step the robot stands at `first`, shape [joint].
    """

    def change(values: np.ndarray, before: np.ndarray) -> np.ndarray:
        return np.diff(values, axis=0, prepend=before[None]) * RATE

    command, speed, rest = change(targets, first), change(joints, first), np.zeros_like(first)
    rows = (command, change(command, rest), joints, speed, change(speed, rest), torques)
    used = Limits(robot, "cpu").fractions(*(torch.tensor(each, dtype=torch.float32) for each in rows))
    return {name: float(fraction.abs().max()) for name, fraction in used.items()}


def _tool_frame(body: np.ndarray, robot: RobotSpec) -> np.ndarray:
    """Return the pose of the tool frame [4 4], given that of the gripper body, 7-vector."""
    pose = matrix(body)
    pose[:3, 3] += pose[:3, :3] @ np.array(robot.tool_offset)
    return pose


def gripper_gap(points: np.ndarray, tool: np.ndarray, fingers: np.ndarray, gripper: GripperSpec) -> float:
    """Return the least distance of points [point 3] from the boxes of fingers and gripper body [m], 0 within.

    Args:
        points: scene frame.
        tool: pose of the tool frame [4 4].
        fingers: joints of the left and the right finger [m], shape [2].
        gripper: which.
    """
    local = (points - tool[:3, 3]) @ tool[:3, :3]
    shifts = [fingers[0] - gripper.finger_joint_open, gripper.finger_joint_open - fingers[1], 0.0]
    least = np.inf
    for (low, high), shift in zip(gripper_boxes(gripper), shifts, strict=True):
        moved = local - [0.0, shift, 0.0]
        least = min(least, float(np.linalg.norm(moved - np.clip(moved, low, high), axis=1).min()))
    return least


def _arm_depth(trial: SoftTrial, joints: np.ndarray) -> np.ndarray:
    """Return how deep the arm reached into the room's hulls at joints [step joint] that it moved through [m], shape [step]."""
    near = Obstacles.of_room(trial.room, set(), (trial.start[:3] + trial.goal[:3]) / 2)
    cell, arm = Workcell(trial.robot, near), len(trial.robot.arm_joints)
    base, pads = matrix(trial.plan.base), joints[:, arm:].sum(axis=1)
    each = [cell.arm_depth(q[None], base, opened=float(wide)) for q, wide in zip(joints[:, :arm], pads, strict=True)]
    return np.concatenate(each)
