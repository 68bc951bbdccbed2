"""One Newton model of a sim.usd with a gripper parked out of reach, and MuJoCo's own view of it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import newton
import numpy as np
import warp as wp

from s2a import robot as robots
from s2a.core.bounds import Count, Positive
from s2a.core.outputs import temporary_folder
from s2a.robot.model import add_gripper
from s2a.scene.articulation import opening_sign, pose_at
from s2a.scene.usd import sim_stage
from s2a.sim.room import owner
from s2a.sim.world import JointConfig, build_world, read_stage

PARKED = 50.0
"""[m] Height at which the gripper waits."""


@dataclass(frozen=True)
class PhysicsConfig:
    """How physics is stepped.

    Attributes:
        dt: time step [s].
        iterations: of the constraint solver.
        impratio: ratio of friction to normal impedance.
    """

    dt: Positive
    iterations: Count
    impratio: Positive


class MujocoWorld:
    """A stage under physics on the CPU.

    Attributes:
        stage: contents of sim.usd beside the physics.
        robot: whose gripper it is.
        model: the Newton model, built once for all checks.
        solver: Newton's MuJoCo solver, on MuJoCo's C library.
        mj: the solver's MjModel.
        xml: the same model as MuJoCo's own text.
        labels: path of each geom's prim, or the name of the gripper's link.
        dt: time step [s].
        joint: index of the target's joint coordinate, the same in Newton and in MuJoCo.
        dof: index of its velocity and force.
        fingers: indices of the two fingers' coordinates, shape [2].
        finger_dofs: indices of their velocities and forces, shape [2].
        carrier: name of the body that the target moves against.
    """

    def __init__(
        self, path: Path, config: PhysicsConfig, part: str | None = None, *, free: bool = True, robot: str | None = None
    ) -> None:
        """Build the model; the first one on a machine compiles kernels for a minute.

        Args:
            path: a simulation-ready room.
            config: how physics is stepped.
            part: the articulated part that moves; None: the only one.
            free: The room's free objects move too.
            robot: name of the robot whose gripper it is; None: one that the part was prepared for.
        """
        known = sim_stage.read(path, visuals=False).free if free else ()
        self.stage, self.dt = read_stage(path, part, robot=robot, also=tuple(known)), config.dt
        self.robot = robots.load(self.stage.robot)
        gripper = self.robot.gripper
        with temporary_folder() as folder, wp.ScopedDevice("cpu"):
            # Neither a spring nor damping: what stays, stays by the dry friction that the stage itself has.
            builder = build_world(self.stage, JointConfig(0.0, 0.0, "grasp"), config.dt)
            add_gripper(builder, self.robot, wp.transform(wp.vec3(0.0, 0.0, PARKED), wp.quat_identity()))
            for i, label in enumerate(builder.joint_label):
                if label.split("/")[-1] in gripper.joints:
                    builder.joint_armature[builder.joint_qd_start[i]] = 0.1
            self.model = builder.finalize()
            self.solver = newton.solvers.SolverMuJoCo(
                self.model,
                use_mujoco_cpu=True,
                cone="elliptic",
                impratio=config.impratio,
                iterations=config.iterations,
                ls_iterations=config.iterations,
                enable_multiccd=True,
                save_to_mjcf=str(folder / "scene.xml"),
            )
            self.xml = (folder / "scene.xml").read_text()
        self.mj: mujoco.MjModel = self.solver.mj_model
        self.mj.opt.timestep = config.dt
        shapes = self.solver.mjc_geom_to_newton_shape.numpy()[0]
        bodies = [label.split("/")[-1] for label in self.model.body_label]
        paths = [str(self.model.shape_label[shape]) for shape in shapes]
        owners = [bodies[self.model.shape_body.numpy()[shape]] for shape in shapes]
        self.labels = [path if path.startswith("/scene/") else owner for path, owner in zip(paths, owners, strict=True)]
        ends = [label.split("/")[-1] for label in self.model.joint_label]
        coordinates, dofs = self.model.joint_q_start.numpy(), self.model.joint_qd_start.numpy()
        index, fingers = ends.index(self.stage.target), [ends.index(joint) for joint in gripper.joints]
        self.joint, self.dof = int(coordinates[index]), int(dofs[index])
        self.fingers, self.finger_dofs = coordinates[fingers], dofs[fingers]
        self.carrier = str(self.model.body_label[int(self.model.joint_parent.numpy()[index])]).split("/")[-1]
        label = str(self.model.body_label[bodies.index(gripper.body)])
        self._gripper = int(self.mj.body_mocapid[self.mj.body(label.replace("/", "_")).id])

    def data(self, q: float = 0.0, finger: float = 0.0) -> mujoco.MjData:
        """Return a state at rest: the target's coordinate [m or rad], both fingers' [m]."""
        data = mujoco.MjData(self.mj)
        data.qpos[self.joint] = q
        data.qpos[self.fingers] = finger
        mujoco.mj_kinematics(self.mj, data)
        return data

    def geoms(self, *parts: str) -> list[int]:
        """Return the colliders of a body /scene/<part>, of a link of the gripper, or, as "static", of all that is fixed."""
        owners = [label.split("/")[2] if label.startswith("/scene/") else label for label in self.labels]
        still = [
            label.startswith("/scene/") and body == 0
            for label, body in zip(self.labels, self.mj.geom_bodyid, strict=True)
        ]
        owners = ["static" if fixed else name for fixed, name in zip(still, owners, strict=True)]
        return [i for i, name in enumerate(owners) if name in parts]

    def obstacles(self) -> list[int]:
        """Return the static colliders, but those that the target does not collide with."""
        filtered = self.stage.room.articulations[self.stage.target].filtered
        return [i for i in self.geoms("static") if owner(self.labels[i]) not in filtered]

    def place_gripper(self, data: mujoco.MjData, pose: np.ndarray) -> None:
        """Hold the gripper at a pose, 7-vector in the scene."""
        data.mocap_pos[self._gripper] = pose[:3]
        data.mocap_quat[self._gripper] = np.roll(pose[3:], 1)
        mujoco.mj_kinematics(self.mj, data)

    def deepest(
        self, data: mujoco.MjData, one: Iterable[int], other: Iterable[int], within: float = 0.0
    ) -> tuple[float, int, int]:
        """Return the largest penetration of two groups of geoms [m], and the two; negative where there is a gap.

        Args:
            data: a state with up-to-date kinematics.
            one: geoms.
            other: geoms.
            within: gaps wider than this [m] are all reported as this.
        """
        worst, pair = -within, (-1, -1)
        radius, center = self.mj.geom_rbound, data.geom_xpos
        others = np.array(list(other), int)
        for a in one:
            if not len(others):
                break
            gaps = np.linalg.norm(center[others] - center[a], axis=1) - radius[others] - radius[a]
            for b in others[gaps < within]:
                depth = -mujoco.mj_geomDistance(self.mj, data, a, int(b), max(within, 1e-6), None)
                if depth > worst:
                    worst, pair = depth, (a, int(b))
        return worst, *pair

    def grasp_pose(self, q: float) -> np.ndarray:
        """Return the grasp frame's pose, 7-vector, when the joint's coordinate is q [m or rad]."""
        return pose_at(self.stage.joint, self.stage.grasp, q)

    @property
    def lever_arm(self) -> float:
        """Grasp-point displacement per unit of joint coordinate [1 or m]."""
        return self.stage.lever_arm

    @property
    def sign(self) -> float:
        """1 if the joint opens towards its upper limit, else -1."""
        return opening_sign(self.stage.joint)
