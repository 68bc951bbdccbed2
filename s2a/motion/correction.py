"""Corrections of a running trajectory: where it is anchored to something that is elsewhere, the gripper moves along."""

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np
import torch
from scipy.interpolate import CubicSpline

from s2a.motion.trajectory import Anchor, Trajectory, eased
from s2a.robot.kinematics import kinematics
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import matrices, matrix, turns
from s2a.scene.articulation import lever_arm, pose_at, transform
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage

STEPS = 8  # Control steps between poses for which inverse kinematics are solved
ITERATIONS, DAMPING = 12, 1e-3  # Of the inverse kinematics: starts are within the distances below of their targets
# Root of the squared errors [m and rad] up to which the arm reaches what corrects a slip or a moved part; else it
# goes as planned
REACHED = 5e-3
# [m, rad] By which an object may be off in the gripper: it may have swung about the pads.
# What is farther off has fallen
SLIPPED, SWUNG = 0.05, math.radians(60.0)
# [m, rad] From its start: an object that has rolled farther would be grasped where no collisions were looked for
ROLLED, TILTED = 0.1, math.radians(40.0)
PART_OFF = 0.15  # [m] By which a handle may be off. What is farther off would need another plan


class Worlds(Protocol):
    """The worlds of a simulation, rigid or soft: how many, where targets are computed, and the robot in each."""

    num_envs: int
    device: str
    robot: RobotSpec


class Correction:
    """What is added to the arm's targets in every world on an anchored stretch of its trajectory.

    It is a smooth curve through what inverse kinematics found at some steps, and does not change at the first and the last of
    these, where the arm stands: corners would cost accelerations far beyond the robot's limits.

    Attributes:
        anchors: one a trajectory.
        at: steps of each trajectory at which it is found, shape [knot] each.
        tool: planned poses of the tool there, in the base frame, shape [trajectory knot 4 4].
    """

    def __init__(
        self,
        sim: Worlds,
        trajectories: Sequence[Trajectory],
        anchors: Sequence[Anchor],
        stage: np.ndarray | None = None,
    ) -> None:
        """Begin with nothing to be added.

        `stage`: index of the trajectory of each world, shape [world]; None: the first one.
        """
        arm = len(sim.robot.arm_joints)
        self.anchors, self._kin = anchors, kinematics(sim.robot)
        self.at = [np.append(np.arange(each.first, each.last, STEPS), each.last) for each in anchors]
        most, steps = max(map(len, self.at)), max(len(each.targets) for each in trajectories)
        knots = [np.pad(at, (0, most - len(at)), "edge") for at in self.at]
        self._arm = np.stack([each.targets[at, :arm] for each, at in zip(trajectories, knots, strict=True)])
        self.tool = self._kin.tool(self._arm.reshape(-1, arm)).reshape(len(knots), most, 4, 4)
        shares = np.zeros((len(knots), steps, most))
        for k, (anchor, at) in enumerate(zip(anchors, self.at, strict=True)):
            curve = CubicSpline(at, np.eye(len(at)), bc_type="clamped")
            on_curve = curve(np.clip(np.arange(steps), anchor.first, anchor.last))
            shares[k, :, : len(at)] = anchor.weights(steps)[:, None] * on_curve
        self._stage = np.zeros(sim.num_envs, int) if stage is None else stage
        self._stage_of = torch.tensor(self._stage, device=sim.device)
        self._shares = torch.tensor(shares, dtype=torch.float32, device=sim.device)
        self._moved = torch.zeros((sim.num_envs, most, arm), dtype=torch.float32, device=sim.device)

    def stage_of(self, worlds: torch.Tensor) -> np.ndarray:
        """Return the indices of the trajectories of some worlds [world], bool; shape [some]."""
        return self._stage[worlds.cpu().numpy()]

    def lead(
        self, worlds: torch.Tensor, tool: np.ndarray, ok: np.ndarray | None = None, *, whole: bool = False
    ) -> None:
        """Lead the tool through other poses in some worlds.

        Args:
            worlds: which, shape [world], bool.
            tool: poses of the tool in the base frame, shape [some knot 4 4].
            ok: in which of them; nothing is added in the others; shape [some]; None: in all.
            whole: Add nothing where the arm does not reach all of the poses; else it goes as near as inverse kinematics finds.
        """
        start = self._arm[self.stage_of(worlds)]
        moved, ok = np.zeros_like(start), np.ones(len(start), bool) if ok is None else ok
        if ok.any():
            begin = start[ok].reshape(-1, start.shape[-1])
            arm, left = self._kin.solve(tool[ok].reshape(-1, 4, 4), begin, ITERATIONS, DAMPING)
            reached = (left.reshape(int(ok.sum()), -1) <= REACHED).all(axis=1) | (not whole)
            moved[np.flatnonzero(ok)[reached]] = (arm - begin).reshape(-1, *start.shape[1:])[reached]
        if self.anchors[0].to == "handle":
            moved[:, -1] = 0.0  # shut, the part is where it was planned to be
        self._moved[worlds] = torch.tensor(moved, dtype=torch.float32, device=self._moved.device)

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets, shape [world arm], at these steps of the trajectories, shape [world]."""
        shares = self._shares[self._stage_of, step.clamp(0, self._shares.shape[1] - 1)]
        return torch.einsum("wp,wpa->wa", shares, self._moved)


def lead_object(correction: Correction, sim: Simulation, worlds: torch.Tensor) -> None:
    """Pick the object where it stands in some worlds [world], bool.

    With P the planned pose of the object and S the true one, the tool's pose T becomes S P^-1 T.
    """
    first, index = sim.layout.part_coord, worlds.cpu().numpy()
    pose = matrices(sim.joint_q[:, first : first + 7].cpu().numpy()[index].astype(float))
    base = matrix(sim.stage.base)
    change = np.linalg.inv(base) @ pose @ np.linalg.inv(matrix(sim.stage.grasp)) @ base
    correction.lead(worlds, change[:, None] @ correction.tool)


def lead_held(
    correction: Correction, worlds: torch.Tensor, seen: np.ndarray, place_off: np.ndarray | None = None
) -> None:
    """Let the object in the gripper pass where it was planned to in some worlds [world], bool, unless it has fallen.

    With H its planned pose in the tool frame and S that seen, the tool's pose T becomes M T H S^-1, M being the motion by which
    its place is off.

    Args:
        correction: of the anchor "held".
        worlds: which.
        seen: poses of the objects in the tool frame, shape [some 4 4].
        place_off: motions in the base frame, shape [some 4 4]; None: the place stays.
    """
    held = correction.anchors[0].held
    assert held is not None
    change = held @ np.linalg.inv(seen)
    off = np.linalg.norm(seen[:, :3, 3] - held[:3, 3], axis=1)
    tool = correction.tool if place_off is None else place_off[:, None] @ correction.tool
    ok = (off <= SLIPPED) & (turns(change) <= SWUNG)
    correction.lead(worlds, tool @ change[:, None], ok, whole=True)


def lead_grasp(
    correction: Correction,
    stages: Sequence[SimStage],
    part: Sequence[np.ndarray],
    worlds: torch.Tensor,
    seen: np.ndarray,
) -> None:
    """Grasp the handle where it is observed in some worlds [world], bool.

    With G the true grasp when the part is at the pose's coordinate, and S the observed grasp in it, T becomes G S G^-1 T. The
    joint stays as it is known.

    Args:
        correction: of the anchor "grasp".
        stages: one a trajectory.
        part: coordinates of the part on each trajectory, shape [step] each.
        worlds: which.
        seen: pose of the observed grasp in the true grasp frame of each of all worlds, shape [world 7].
    """
    most = correction.tool.shape[1]
    grasp = [
        np.linalg.inv(matrix(stage.base))
        @ matrices(
            np.array(
                [pose_at(stage.joint, stage.grasp, q) for q in coordinates[np.pad(at, (0, most - len(at)), "edge")]]
            )
        )
        for stage, coordinates, at in zip(stages, part, correction.at, strict=True)
    ]
    chosen = correction.stage_of(worlds)
    own, offset = np.stack(grasp)[chosen], matrices(seen[worlds.cpu().numpy()])[:, None]
    correction.lead(worlds, own @ offset @ np.linalg.inv(own) @ correction.tool[chosen])


class TrackedPart:
    """Where a part that the trajectory moves is in each world.

    Attributes:
        joint: of the part.
        base: pose of the robot's base [4 4].
    """

    def __init__(self, sim: Simulation, part: str) -> None:
        """Find a part of the simulation's room by its id."""
        articulation = sim.stage.room.articulations[part]
        self._sim, self.joint, self.base = sim, articulation.joint, matrix(sim.stage.base)
        self._lever = lever_arm(self.joint, np.array(articulation.grasp.point))
        self._coord, _ = sim.axis_of(part)

    def coordinates(self, worlds: torch.Tensor) -> np.ndarray:
        """Return its coordinates in some worlds [world], bool; shape [some]."""
        return self._sim.joint_q[:, self._coord].cpu().numpy()[worlds.cpu().numpy()].astype(float)

    def is_near(self, coordinates: np.ndarray, planned: float) -> np.ndarray:
        """Return where its handle is near enough to that at a planned coordinate for the same plan to do, shape [some]."""
        return np.abs(coordinates - planned) * self._lever <= PART_OFF

    def off(self, planned: float, worlds: torch.Tensor) -> np.ndarray:
        """Return by what motions in the base frame it is off a planned coordinate in some worlds, shape [some 4 4]."""
        back = np.linalg.inv(transform(self.joint, planned)) @ self.base
        now = self.coordinates(worlds)
        now = np.where(self.is_near(now, planned), now, planned)
        return np.array([np.linalg.inv(self.base) @ transform(self.joint, q) @ back for q in now]).reshape(-1, 4, 4)


def lead_handle(correction: Correction, tracked: TrackedPart, part: np.ndarray, worlds: torch.Tensor) -> None:
    """Take the handle where the part stands in some worlds [world], bool, and move with it until the part is shut.

    With q the planned coordinate of the part, M(q) its motion, and s the fraction of the planned opening that it is open, the
    tool's pose T becomes M(s q) M(q)^-1 T.

    `part`: planned coordinates, shape [step].
    """
    planned, joint, base = part[correction.at[0]], tracked.joint, tracked.base
    now = tracked.coordinates(worlds)
    change = np.array(
        [[transform(joint, q / planned[0] * p) @ np.linalg.inv(transform(joint, p)) for p in planned] for q in now]
    )
    tool = np.linalg.inv(base) @ change @ base @ correction.tool
    correction.lead(worlds, tool, tracked.is_near(now, planned[0]), whole=True)


def target_in_tool(sim: Simulation, worlds: torch.Tensor) -> np.ndarray:
    """Return the poses of the target in the tool frame in some worlds [world], bool; shape [some 4 4]."""
    poses = sim.state.body_q.numpy().reshape(sim.num_envs, -1, 7)[worlds.cpu().numpy()]
    tool = matrices(poses[:, sim.layout.tool_body])
    tool[:, :3, 3] += tool[:, :3, :3] @ np.array(sim.robot.tool_offset)
    return np.linalg.inv(tool) @ matrices(poses[:, sim.layout.part_body])


class Retries:
    """Where a world goes on that has not lifted its object, and what is added to the arm's targets on its way back.

    The targets of the way back follow those of the trajectory. It begins where the object should be lifted, opens the fingers,
    sees where the object stands now, and ends at the point of approach to that.
    """

    def __init__(self, sim: Simulation, trajectory: Trajectory, shifted: Correction) -> None:
        """Take a trajectory that picks, and knows a way back."""
        object_, held, retry = trajectory.anchor("object"), trajectory.anchor("held"), trajectory.retry
        assert object_ and held and held.held is not None and retry
        self._sim, self._shifted, self._held = sim, shifted, held.held
        self._near, self._lifted = object_.first, object_.last
        self._end, back = len(trajectory.targets), len(retry.targets)
        self._seen, self._last = self._end + retry.seen, self._end + back - 1
        gone = eased((np.arange(back) - retry.seen) / max(back - 1 - retry.seen, 1))
        self._gone = torch.tensor(gone, dtype=torch.float32, device=sim.device)
        shape = (sim.num_envs, len(sim.robot.arm_joints))
        self._before = torch.zeros(shape, dtype=torch.float32, device=sim.device)
        self._lost = torch.zeros(sim.num_envs, dtype=torch.bool, device=sim.device)

    def see(self, step: torch.Tensor) -> torch.Tensor | None:
        """Find which worlds have not lifted their object, by where they are on the trajectory, shape [world].

        Returns:
            The worlds in which it is to be seen now where the object stands, shape [world], bool; None: in none.
        """
        lifted = step == self._lifted
        self._lost &= ~lifted
        if bool(lifted.any()):
            index = torch.nonzero(lifted)[:, 0]
            self._lost[index] = torch.tensor(self._slipped(lifted), device=step.device)
            self._before[index] = self._shifted(step)[index]
        seen = (step == self._seen) & self._lost
        if not bool(seen.any()):
            return None
        self._lost &= ~seen
        return seen

    def _slipped(self, worlds: torch.Tensor) -> np.ndarray:
        """Return in which of some worlds [world], bool, the object is not in the gripper, but near its start; shape [some]."""
        inside = target_in_tool(self._sim, worlds)
        fell = np.linalg.norm(inside[:, :3, 3] - self._held[:3, 3], axis=1) > SLIPPED
        every = self._sim.state.body_q.numpy().reshape(self._sim.num_envs, -1, 7)
        poses = every[worlds.cpu().numpy(), self._sim.layout.part_body]
        moved = matrices(poses) @ np.linalg.inv(matrix(self._sim.stage.grasp))
        away = np.linalg.norm(poses[:, :3] - self._sim.stage.grasp[:3], axis=1)
        return fell & (away <= ROLLED) & (turns(moved) <= TILTED)

    def after(self, place: torch.Tensor, following: torch.Tensor) -> torch.Tensor:
        """Return where each world goes on that would be at `following` after `place`, shape [world]."""
        own = torch.where(place < self._end, following.clamp(max=self._end - 1.0), following)
        leaves = self._lost & (place >= self._lifted) & (place < self._end)
        own = torch.where(leaves, float(self._end), own)
        return torch.where(own > self._last, float(self._near), own)

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        """Return what to add to the arm's targets on the way back, shape [world arm], at these steps [world]; else 0."""
        gone = self._gone[(step - self._end).clamp(0, len(self._gone) - 1)][:, None]
        now = self._shifted(torch.full_like(step, self._near))
        return (step >= self._end)[:, None] * torch.lerp(self._before, now, gone)
