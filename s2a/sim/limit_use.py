"""How much of a robot's limits a policy uses: of what it commands, and of what then moves."""

from __future__ import annotations

import torch
import warp as wp

from s2a.robot.urdf import position_limits
from s2a.sim.simulation import Simulation

COMMANDED = ("commanded_velocity", "commanded_acceleration", "commanded_finger_speed")
MEASURED = ("position", "velocity", "acceleration", "torque", "finger_speed")


class LimitUse:
    """Largest fraction of every limit over all worlds and control steps.

    Velocities and accelerations are differences over control steps; torque is the motors'.

    Attributes:
        peaks: fraction of each limit by joint, of every arm joint or finger, by name of COMMANDED and MEASURED.
    """

    def __init__(self, sim: Simulation) -> None:
        """Begin with what the worlds are doing; they count as freshly reset."""
        self._sim, spec = sim, sim.robot
        self._arm, self._joints = len(spec.arm_joints), len(spec.joints)
        self._rate = 1.0 / (sim.config.dt * sim.config.substeps)
        lower, upper = torch.tensor(position_limits(spec), dtype=torch.float32, device=sim.device)
        self._middle, self._range = (lower + upper) / 2, (upper - lower) / 2
        limits = (spec.limits.velocity, spec.limits.acceleration, spec.limits.torque)
        self._velocity, self._acceleration, self._torque = (torch.tensor(x, device=sim.device) for x in limits)
        sizes = {name: 2 if "finger" in name else self._arm for name in (*COMMANDED, *MEASURED)}
        self.peaks = {name: torch.zeros(size, device=sim.device) for name, size in sizes.items()}
        self._remember()
        self._last_command = torch.zeros_like(self._last_target)

    def watch(self, reset: torch.Tensor) -> None:
        """Look at the worlds after a control step; those that were reset in it ([world], bool) only begin again."""
        arm, finger = self._arm, self._sim.robot.gripper.finger_speed
        target, speed = self._sim.joint_target_q[:, : self._joints], self._sim.joint_qd[:, : self._joints]
        command = torch.where(reset[:, None], 0.0, (target - self._last_target) * self._rate)
        change, gained = (command - self._last_command) * self._rate, (speed - self._last_speed) * self._rate
        position = (self._sim.joint_q[:, : self._joints] - self._middle) / self._range
        used = {
            "commanded_velocity": command[:, :arm] / self._velocity,
            "commanded_acceleration": change[:, :arm] / self._acceleration,
            "commanded_finger_speed": command[:, arm:] / finger,
            "position": position[:, :arm],
            "velocity": speed[:, :arm] / self._velocity,
            "acceleration": gained[:, :arm] / self._acceleration,
            "torque": self._motors()[:, :arm] / self._torque,
            "finger_speed": speed[:, arm:] / finger,
        }
        for name, fraction in used.items():
            seen = torch.where(reset[:, None], 0.0, fraction.abs()).amax(dim=0)
            self.peaks[name] = torch.maximum(self.peaks[name], seen)
        self._remember()
        self._last_command = command

    def fractions(self) -> dict[str, float]:
        """Return the largest fraction of each limit, of the worst joint."""
        return {name: float(peak.max()) for name, peak in self.peaks.items()}

    def _remember(self) -> None:
        self._last_target = self._sim.joint_target_q[:, : self._joints].clone()
        self._last_speed = self._sim.joint_qd[:, : self._joints].clone()

    def _motors(self) -> torch.Tensor:
        """Return the motors' torques [N m] in the last physics step, shape [world dof]."""
        return wp.to_torch(self._sim.solver.mjw_data.qfrc_actuator)
