"""Recordings of a robot's own sensors, and the utilisation of its limits."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
import csv
from pathlib import Path

import mujoco_warp
import numpy as np
import torch
import warp as wp

from s2a.core.outputs import atomic_write
from s2a.robot.spec import RobotSpec
from s2a.robot.urdf import position_limits
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
        means = sums / self._sim.config.substeps
        sums.zero_()
        return means

    def save(self, folder: Path) -> None:
        """Write a CSV file of `RobotSpec.recorded` for each world, pull_0.csv and so on."""
        step = self._sim.config.control_dt
        alive, rows = torch.stack(self._alive).cpu(), torch.stack(self._samples).cpu()
        for world in range(self._sim.num_envs):
            with atomic_write(folder / f"pull_{world}.csv") as out, out.open("w", newline="") as file:
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


COMMANDED = ("commanded_velocity", "commanded_acceleration", "commanded_finger_speed")
MEASURED = ("position", "velocity", "acceleration", "torque", "finger_speed")


class Limits:
    """A robot's limits as tensors."""

    def __init__(self, spec: RobotSpec, device: str) -> None:
        self._arm, self._finger = len(spec.arm_joints), spec.gripper.finger_speed
        lower, upper = torch.tensor(position_limits(spec), dtype=torch.float32, device=device)
        self._middle, self._range = (lower + upper) / 2, (upper - lower) / 2
        limits = (spec.limits.velocity, spec.limits.acceleration, spec.limits.torque)
        self._velocity, self._acceleration, self._torque = (
            torch.tensor(x, dtype=torch.float32, device=device) for x in limits
        )

    def fractions(
        self,
        command: torch.Tensor,
        command_change: torch.Tensor,
        joints: torch.Tensor,
        speed: torch.Tensor,
        speed_change: torch.Tensor,
        torque: torch.Tensor,
    ) -> dict[str, torch.Tensor]:
        """Return the fraction of each limit that is used, with its sign, by name of COMMANDED and MEASURED; shape [row joint].

        Args:
            command: speed of the targets of all joints, shape [row joint].
            command_change: its change a second.
            joints: positions.
            speed: of the joints.
            speed_change: its change a second.
            torque: of the arm's motors first, shape [row motor].
        """
        arm = self._arm
        return {
            "commanded_velocity": command[:, :arm] / self._velocity,
            "commanded_acceleration": command_change[:, :arm] / self._acceleration,
            "commanded_finger_speed": command[:, arm:] / self._finger,
            "position": ((joints - self._middle) / self._range)[:, :arm],
            "velocity": speed[:, :arm] / self._velocity,
            "acceleration": speed_change[:, :arm] / self._acceleration,
            "torque": torque[:, :arm] / self._torque,
            "finger_speed": speed[:, arm:] / self._finger,
        }


class LimitUse:
    """Largest fraction of every limit over all worlds and control steps.

    Velocities and accelerations are differences over control steps; torque is the motors'.

    Attributes:
        peaks: fraction of each limit by joint, of every arm joint or finger, by name of COMMANDED and MEASURED.
    """

    def __init__(self, sim: Simulation) -> None:
        """Begin with what the worlds are doing; they count as freshly reset."""
        self._sim, spec = sim, sim.robot
        self._limits, self._joints = Limits(spec, sim.device), len(spec.joints)
        self._rate = sim.config.control_frequency
        sizes = {name: 2 if "finger" in name else len(spec.arm_joints) for name in (*COMMANDED, *MEASURED)}
        self.peaks = {name: torch.zeros(size, device=sim.device) for name, size in sizes.items()}
        self._remember()
        self._last_command = torch.zeros_like(self._last_target)

    def watch(self, reset: torch.Tensor) -> None:
        """Look at the worlds after a control step; those that were reset in it ([world], bool) only begin again."""
        target, speed = self._sim.joint_target_q[:, : self._joints], self._sim.joint_qd[:, : self._joints]
        command = torch.where(reset[:, None], 0.0, (target - self._last_target) * self._rate)
        change, gained = (command - self._last_command) * self._rate, (speed - self._last_speed) * self._rate
        joints = self._sim.joint_q[:, : self._joints]
        motors = wp.to_torch(self._sim.solver.mjw_data.qfrc_actuator)  # torques [N m] in the last physics step
        used = self._limits.fractions(command, change, joints, speed, gained, motors)
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


# Who presses on whom, of `RobotContacts`: base, lift or arm on anything; the gripper on anything but the target; on that;
# the target on anything else, while the gripper touches it
PRESSING = ("body", "gripper", "target", "held")
ELSE, BODY, GRIPPER, TARGET = (wp.constant(i) for i in range(4))


class RobotContacts:
    """Contact forces of the robot of world 0: the largest sum of normal forces in a physics step, by who presses on whom.

    The sum over all contacts of `PRESSING`'s kind, so that a force that many points share counts whole.
    """

    def __init__(self, sim: Simulation) -> None:
        """Begin with none; `aim` makes it count."""
        self._sim, data = sim, sim.solver.mjw_data
        self._ids = wp.array(np.arange(data.naconmax), dtype=int, device=sim.device)
        self._force = wp.zeros(data.naconmax, dtype=wp.spatial_vector, device=sim.device)
        self._sums = wp.zeros(len(PRESSING), dtype=float, device=sim.device)
        self._peaks = wp.zeros(len(PRESSING), dtype=float, device=sim.device)

    def aim(self) -> None:
        """Count from now on, with the simulation's target of now; call it before an environment captures its step."""
        sim = self._sim
        bodies = sim.model.body_count // sim.num_envs
        of_body = np.full(bodies + 1, int(ELSE))  # the last entry stands for the immovable room
        of_body[list(sim.layout.robot_bodies)], of_body[sim.layout.part_body] = int(BODY), int(TARGET)
        of_body[[sim.layout.tool_body, *sim.layout.finger_bodies]] = int(GRIPPER)
        shapes = sim.solver.mjc_geom_to_newton_shape.numpy()
        body = sim.model.shape_body.numpy()[shapes]
        owner = np.where((shapes >= 0) & (body >= 0), of_body[np.where(body >= 0, body % bodies, bodies)], int(ELSE))
        self._owner = wp.array(owner, dtype=int, device=sim.device)
        self._peaks.zero_()
        sim.after_substep.append(self._add)

    def peaks(self) -> dict[str, float]:
        """Return the largest force since `aim` [N], by PRESSING."""
        return {name: round(float(each), 1) for name, each in zip(PRESSING, self._peaks.numpy(), strict=True)}

    def _add(self) -> None:
        data, device = self._sim.solver.mjw_data, self._sim.model.device
        mujoco_warp.contact_force(self._sim.solver.mjw_model, data, self._ids, False, self._force)
        self._sums.zero_()
        contact = data.contact
        inputs = [data.nacon, contact.geom, contact.worldid, contact.efc_address, self._force, self._owner, self._sums]
        wp.launch(_press, dim=data.naconmax, inputs=inputs, device=device)
        wp.launch(_raise, dim=len(PRESSING), inputs=[self._sums, self._peaks], device=device)


@wp.kernel
def _press(
    count: wp.array(dtype=int),
    geom: wp.array(dtype=wp.vec2i),
    world: wp.array(dtype=int),
    row: wp.array2d(dtype=int),
    force: wp.array(dtype=wp.spatial_vector),
    owner: wp.array2d(dtype=int),
    sums: wp.array(dtype=float),
):
    contact = wp.tid()
    if contact >= count[0] or row[contact, 0] < 0 or world[contact] != 0:
        return
    a, b = owner[0, geom[contact][0]], owner[0, geom[contact][1]]
    low, high = wp.min(a, b), wp.max(a, b)
    kind = int(-1)
    if a == BODY or b == BODY:
        if low == ELSE or high == TARGET:
            kind = 0
    elif low == ELSE and high == GRIPPER:
        kind = 1
    elif low == GRIPPER and high == TARGET:
        kind = 2
    elif low == ELSE and high == TARGET:
        kind = 3
    if kind >= 0:
        wp.atomic_add(sums, kind, wp.spatial_top(force[contact])[0])


@wp.kernel
def _raise(sums: wp.array(dtype=float), peaks: wp.array(dtype=float)):
    i = wp.tid()
    if i < 3 or sums[2] > 0.0:  # the target on all else counts while the gripper touches it
        peaks[i] = wp.max(peaks[i], sums[i])
