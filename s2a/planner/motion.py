"""Opening a part by plan: inverse kinematics along the way of the grasp, then the hand closes and pulls.

The grip is friction alone; nothing is attached.
"""

from __future__ import annotations

from dataclasses import dataclass

import newton
import newton.ik as ik
import numpy as np
import torch
import warp as wp
from scipy.spatial.transform import Rotation

from s2a.articulation import opening_sign, pose_at
from s2a.env.vec_env import VecEnv
from s2a.errors import InputError
from s2a.planner.collision import freest
from s2a.ranges import Count, CountFromZero, Positive
from s2a.robot.model import ARM_JOINTS, JOINTS, add_robot
from s2a.robot.spec import RobotSpec
from s2a.scene import Vec3
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

WORST_ERROR = 1e-6
"""Largest accepted cost of a path point: 1 mm and 1 mrad squared."""


@dataclass(frozen=True)
class PlannerConfig:
    """The motion in numbers.

    Attributes:
        restarts: random starts of the inverse kinematics; each is tracked along the whole way.
        approach: distance from which the hand moves straight to the grasp [m].
        depth: how far the pads reach past the grasp point, into the furniture [m].
        opening: way of the grasp point [m]; less where the joint ends earlier.
        reach_time: to the point of approach [s].
        approach_time: from there to the grasp [s].
        close_time: for the fingers to close [s].
        pull_time: to draw the part along its joint by `opening` [s].
        seed: of the random starts.
    """

    restarts: Count
    approach: Positive
    depth: float
    opening: Positive
    reach_time: Positive
    approach_time: Positive
    close_time: Positive
    pull_time: Positive
    seed: CountFromZero


class Planner:
    """A policy that follows a planned path; the same for all worlds once the arm is at the point of approach.

    Attributes:
        path: joint targets after the reach, shape [step 9].
        reach_steps: control steps from the start position to `path[0]`.
        grasp_steps: until the hand has closed.
    """

    def __init__(self, env: VecEnv, config: PlannerConfig) -> None:
        """Plan for an environment's stage; InputError if the arm cannot reach along the whole way."""
        sim = env.sim
        self._env = env
        rate = _rate(sim)
        self.path = torch.tensor(_path(sim, config), dtype=torch.float32, device=sim.device)
        self.reach_steps = round(config.reach_time * rate)
        self.grasp_steps = self.reach_steps + _closed(config, rate)

    def __call__(self, observation: torch.Tensor) -> torch.Tensor:
        """Return the action [world 9] that brings the joint targets onto the path; the observation is not needed."""
        step = self._env.episode_step.long()
        now = self._env.sim.joint_target_q[:, :JOINTS]
        left = (self.reach_steps - step).clamp(min=1)[:, None]
        reach = now + (self.path[0] - now) / left
        follow = self.path[(step - self.reach_steps + 1).clamp(0, len(self.path) - 1)]
        target = torch.where((step < self.reach_steps)[:, None], reach, follow)
        return (target - now) / self._env.action_step


def grasping_motion(sim: Simulation, config: PlannerConfig) -> np.ndarray:
    """Return joint targets [step 9] that bring the open hand straight to the grasp and close it.

    Raises:
        InputError: the arm cannot reach along the whole way.
    """
    return _path(sim, config)[: _closed(config, _rate(sim))]


def _rate(sim: Simulation) -> float:
    """Return the control steps a second."""
    return 1.0 / (sim.config.dt * sim.config.substeps)


def _closed(config: PlannerConfig, rate: float) -> int:
    """Return the control steps from the point of approach until the hand has closed, as `_hand_path` counts them."""
    return round(config.approach_time * rate) + round(config.close_time * rate)


def _path(sim: Simulation, config: PlannerConfig) -> np.ndarray:
    """Return joint targets [step 9] from the point of approach to the end of the pull; InputError: out of reach.

    Of the ways of the arm the best is taken on which it touches nothing but what it holds.
    """
    poses, fingers = _hand_path(sim.stage, config, _rate(sim))
    arms = _tracks(sim.stage, sim.robot, poses, config)
    both = np.broadcast_to(fingers[:, None], (*arms.shape[:2], 2))
    paths = np.concatenate([arms, both], axis=2)
    return paths[freest(sim, paths)]


def _hand_path(stage: SimStage, config: PlannerConfig, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return poses of the tool, 7-vectors [step 7], and finger positions [step], at `rate` steps a second."""
    way = min(config.opening, 0.95 * stage.travel)
    counts = [round(t * rate) for t in (config.approach_time, config.close_time, config.pull_time)]
    approach, close, pull = (np.arange(1, n + 1) / n for n in counts)
    inwards = np.concatenate([config.approach * (approach - 1.0), 0.0 * close, 0.0 * pull]) + config.depth
    opened = np.concatenate([0.0 * approach, 0.0 * close, way * pull])
    # Targets of zero press the pads on the handle; where they stop is the handle's thickness.
    fingers = np.concatenate([0.04 + 0.0 * approach, 0.04 * (1.0 - close), 0.0 * pull])
    return np.stack([_tool_pose(stage, o, i) for o, i in zip(opened, inwards, strict=True)]), fingers


def _tool_pose(stage: SimStage, opened: float, inwards: float) -> np.ndarray:
    """Return the tool's pose [7] when the grasp point moved by `opened` [m], `inwards` [m] past it."""
    pose = stage.grasp.copy()
    pose[:3] += inwards * Rotation.from_quat(stage.grasp[3:]).as_matrix()[:, 2]
    return pose_at(stage.joint, pose, opening_sign(stage.joint) * opened / stage.lever)


def _tracks(stage: SimStage, robot: RobotSpec, poses: np.ndarray, config: PlannerConfig) -> np.ndarray:
    """Return the arm's joint positions along the poses, shape [track step 7], the best track first.

    A single start gets stuck; so many random ones (the hand both ways round) are tracked along the whole way. Those that
    stay exact and smooth are ordered by how far they keep from the joint limits and how near the start position they begin.
    """
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    add_robot(builder, robot, wp.transform(*stage.base[:3], *stage.base[3:]))
    model = builder.finalize(device="cpu")
    tool = next(i for i, label in enumerate(builder.body_label) if label.split("/")[-1] == robot.tool_link)
    lower, upper = (a.numpy() for a in (model.joint_limit_lower, model.joint_limit_upper))
    start = np.tile(np.asarray(robot.start, dtype=np.float32), (config.restarts, 1))
    rng = np.random.default_rng(config.seed)
    start[1:, :ARM_JOINTS] = rng.uniform(lower, upper, (config.restarts - 1, JOINTS))[:, :ARM_JOINTS]
    half_turn = Rotation.from_rotvec([0.0, 0.0, np.pi])
    flipped = [np.concatenate([p[:3], (Rotation.from_quat(p[3:]) * half_turn).as_quat()]) for p in poses]
    both = [_solve(model, tool, robot.tool_offset, np.array(p), start) for p in (poses, flipped)]
    q, cost = (np.concatenate(x, axis=1) for x in zip(*both, strict=True))
    arm = q[:, :, :ARM_JOINTS]
    jump = np.abs(np.diff(arm, axis=0)).max(axis=(0, 2))
    margin = np.minimum(arm - lower[:ARM_JOINTS], upper[:ARM_JOINTS] - arm).min(axis=(0, 2))
    distance = np.abs(arm[0] - np.asarray(robot.home)).max(axis=1)
    worst = cost.max(axis=0)
    feasible = (worst < WORST_ERROR) & (jump < 0.1) & (margin > 0.0)
    if not feasible.any():
        raise InputError(
            f"{stage.path}: the arm cannot follow part {stage.target!r} from its base at {np.round(stage.base[:3], 2)} m "
            f"(best error {1e3 * np.sqrt(worst.min()):.1f} mm); prepare the stage with another base pose"
        )
    score = 0.3 * distance + 10.0 * jump - 2.0 * np.clip(margin, 0.0, 0.2)
    order = np.argsort(score, kind="stable")
    return arm[:, order[feasible[order]]].swapaxes(0, 1)


def _solve(
    model: newton.Model, tool: int, offset: Vec3, poses: np.ndarray, start: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Track the poses from every start position.

    Returns:
        Joint positions [step start coord] and the sums of squared errors [step start] (m^2 and rad^2).
    """
    count = len(start)
    with wp.ScopedDevice("cpu"):
        position = ik.IKObjectivePosition(tool, wp.vec3(*offset), wp.zeros(count, dtype=wp.vec3))
        rotation = ik.IKObjectiveRotation(tool, wp.quat_identity(), wp.zeros(count, dtype=wp.vec4))
        limits = ik.IKObjectiveJointLimit(model.joint_limit_lower, model.joint_limit_upper, weight=10.0)
        solver = ik.IKSolver(model, count, [position, rotation, limits], jacobian_mode=ik.IKJacobianType.ANALYTIC)
        q = wp.array(start, dtype=wp.float32)
        found, costs = [], []
        for i, pose in enumerate(poses.astype(np.float32)):
            position.set_target_positions(wp.array(np.tile(pose[:3], (count, 1)), dtype=wp.vec3))
            rotation.set_target_rotations(wp.array(np.tile(pose[3:], (count, 1)), dtype=wp.vec4))
            # Fewer lag behind by millimetres where the arm is stretched.
            solver.step(q, q, iterations=80 if i == 0 else 12)
            found.append(q.numpy().copy())
            costs.append(solver.costs.numpy()[:count].copy())
    return np.stack(found), np.stack(costs)
