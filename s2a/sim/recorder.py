"""Recordings of a robot's own sensors: joint positions and torques."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import csv
from pathlib import Path

import torch
import warp as wp

from s2a.sim.simulation import Simulation


class Recorder:
    """Positions of all joints and torques of the arm's, as means over every control step of each world's first episode.

    A single physics step would not do: while a target stands still between control steps, the controller's torque saws.
    A torque is that on the link's side, as sensors behind the gears measure it: the motor's less what turns its rotor. It lacks
    what carries the robot's weight, where that is carried.
    """

    def __init__(self, sim: Simulation) -> None:
        """Sum over the physics steps of a simulation; make it before the environment, whose steps may be captured as a graph."""
        self._sim, spec = sim, sim.robot
        self._joints, self._arm = len(spec.joints), len(spec.arm_joints)
        self._sums = wp.zeros((sim.num_envs, self._joints + self._arm), dtype=float, device=sim.device)
        self._samples: list[torch.Tensor] = []
        self._alive: list[torch.Tensor] = []
        model = sim.model
        # The solver's integrator is implicit in the controller's damping: the motor brakes by the speed after the step.
        brakes = model.joint_armature.numpy() / sim.config.dt + model.joint_target_kd.numpy()
        self._brakes = wp.array(brakes.reshape(sim.num_envs, -1), dtype=float, device=sim.device)
        sim.after_substep.append(self._add)

    def watch(self, done: torch.Tensor) -> None:
        """Take a sample after a control step; `done` [world] tells which worlds were reset in it."""
        self._samples.append(self.sample())
        before = self._alive[-1] if self._alive else torch.ones_like(done)
        self._alive.append(before & ~done)

    def sample(self) -> torch.Tensor:
        """Return the means over the control step that has ended, shape [world column], and begin the next."""
        sums = wp.to_torch(self._sums)
        found = sums / self._sim.config.substeps
        sums.zero_()
        return found

    def save(self, folder: Path) -> None:
        """Write a CSV file of `RobotSpec.recorded` for each world, pull_0.csv and so on."""
        step = self._sim.config.control_dt
        alive, rows = torch.stack(self._alive).cpu(), torch.stack(self._samples).cpu()
        for world in range(self._sim.num_envs):
            with (folder / f"pull_{world}.csv").open("w", newline="") as file:
                writer = csv.writer(file)
                writer.writerow(self._sim.robot.recorded)
                for i, row in enumerate(rows[alive[:, world], world].tolist()):
                    writer.writerow([f"{i * step:.6g}", *(f"{x:.7g}" for x in row)])

    def _add(self) -> None:
        sim, data = self._sim, self._sim.solver.mjw_data
        q = sim.before.joint_q.reshape((sim.num_envs, -1))
        qd = [each.joint_qd.reshape((sim.num_envs, -1)) for each in (sim.before, sim.state)]
        inputs = [q, data.qfrc_actuator, *qd, self._brakes, self._joints, self._sums]
        wp.launch(_add, dim=(sim.num_envs, self._joints + self._arm), inputs=inputs, device=sim.device)


@wp.kernel
def _add(
    q: wp.array2d(dtype=float),
    motor: wp.array2d(dtype=float),
    qd_before: wp.array2d(dtype=float),
    qd_after: wp.array2d(dtype=float),
    brake: wp.array2d(dtype=float),
    joints: int,
    sums: wp.array2d(dtype=float),
):
    # The force of a step turns the position before it: (q[k + 1] - 2 q[k] + q[k - 1]) / dt^2 is the acceleration by force k.
    world, column = wp.tid()
    if column < joints:
        sums[world, column] += q[world, column]
    else:
        i = column - joints
        sums[world, column] += motor[world, i] - brake[world, i] * (qd_after[world, i] - qd_before[world, i])
