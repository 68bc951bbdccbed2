"""A soft body in a room and the arm that grips it: the body by VBD, the arm by MuJoCo, coupled by proxies of the gripper."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import newton
import numpy as np
import warp as wp
from newton.solvers import SolverMuJoCo, SolverVBD
from newton.solvers.experimental.coupled import SolverCoupledProxy
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.robot.model import add_robot
from s2a.robot.spec import RobotSpec
from s2a.scene.scene import Mesh
from s2a.sim.soft_body import SoftBody, SoftConfig

RATE = 60  # [1/s] Control steps


class SoftSimulation:
    """One world with an arm, a soft body and convex hulls that do not move.

    The hulls touch the body, not the arm: whether that keeps clear of them is checked on the joints that it moved through.
    Nothing fixes the body to the gripper: what holds it are contacts of its vertices with the fingers' hulls.

    Attributes:
        body: what is soft.
        robot: the arm.
        device: of Warp.
        num_envs: 1.
        model: the Newton model.
        state: before and after every step (always this same buffer).
    """

    def __init__(
        self,
        body: SoftBody,
        pose: np.ndarray,
        robot: RobotSpec,
        base: np.ndarray,
        joints: np.ndarray,
        hulls: Sequence[Mesh],
        config: SoftConfig,
        device: str = "cpu",
    ) -> None:
        """Build the world; the first call on a machine compiles kernels for minutes.

        Args:
            body: at rest.
            pose: of its frame, 7-vector.
            robot: the arm.
            base: pose of its base, 7-vector.
            joints: where it begins, arm and fingers [robot joint].
            hulls: convex, scene frame.
            config: the settings.
            device: of Warp.

        Raises:
            InputError: an odd number of substeps.
        """
        if config.substeps % 2:
            raise InputError(f"key 'soft.substeps' is {config.substeps}; a captured step needs an even number")
        self.body, self.robot, self._config, self.device, self.num_envs = body, robot, config, device, 1
        with wp.ScopedDevice(device):
            builder = _world(body, pose, robot, base, joints, hulls, config)
            names = [label.split("/")[-1] for label in builder.body_label]
            self._tool = names.index(robot.tool_link)
            self._fingers = [names.index(link) for link in robot.gripper.links]
            self.model = builder.finalize()
            self._contact_material()
            self.state, self._other = self.model.state(), self.model.state()
            for each in (self.state, self._other):
                newton.eval_fk(self.model, self.model.joint_q, self.model.joint_qd, each)
            self._control = self.model.control()
            self._solver, self._arm = _solver(self.model, [self._tool, *self._fingers], config)
            self._pressed = wp.zeros(len(self._fingers), dtype=wp.vec3)
            self._finger_bodies = wp.array(self._fingers, dtype=int)
            self._substeps()  # compiles and loads every kernel, which capture forbids; the arm stands meanwhile
            with wp.ScopedCapture() as capture:
                self._substeps()
            self._graph = capture.graph
        self._targets = self._control.joint_target_q.numpy()
        self._masses = self.model.particle_mass.numpy()

    def _contact_material(self) -> None:
        """Give both sides of every contact the same material: Newton takes their means."""
        model, config = self.model, self._config
        model.soft_contact_ke, model.soft_contact_kd = config.contact_stiffness, config.contact_damping
        model.soft_contact_mu = config.friction
        model.shape_material_ke.fill_(config.contact_stiffness)
        model.shape_material_kd.fill_(config.contact_damping)
        model.shape_material_mu.fill_(config.friction)

    def _substeps(self) -> None:
        # What the coupling hands on to MuJoCo; the solver has no public name for it.
        (mapping,) = self._solver._proxy_mappings
        self._pressed.zero_()
        for _ in range(self._config.substeps):
            self.state.clear_forces()
            self._solver.step(self.state, self._other, self._control, None, 1.0 / (RATE * self._config.substeps))
            # Contacts chatter: a single substep may be one without force.
            wp.launch(_add_forces, dim=2, inputs=[mapping.coupling_forces, self._finger_bodies, self._pressed])
            self.state, self._other = self._other, self.state

    def step(self, targets: np.ndarray) -> None:
        """Advance by a control step towards joint targets [robot joint]."""
        self._targets[: len(targets)] = targets
        self._control.joint_target_q.assign(self._targets)
        wp.capture_launch(self._graph)

    @property
    def joints(self) -> np.ndarray:
        """Joints of the robot [rad, m], shape [robot joint]."""
        return self.state.joint_q.numpy()[: len(self.robot.joints)].copy()  # on a CPU it is the buffer itself

    @property
    def torques(self) -> np.ndarray:
        """Torques of the arm's motors in the last substep [N m], shape [arm]."""
        return self._arm.mjw_data.qfrc_actuator.numpy()[0, : len(self.robot.arm_joints)].copy()

    @property
    def particles(self) -> np.ndarray:
        """Positions of the body's vertices [m], shape [vertex 3]."""
        return self.state.particle_q.numpy().copy()

    @property
    def center(self) -> np.ndarray:
        """Centre of mass of the body [m], shape [3]."""
        return self._masses @ self.particles / self._masses.sum()

    @property
    def pose(self) -> np.ndarray:
        """Pose of the body's frame that fits its vertices best, by their masses, shape [4 4]."""
        rest, now, pose = self.body.vertices, self.particles, np.eye(4)
        middle, center = self._masses @ rest / self._masses.sum(), self.center
        turn, _ = Rotation.align_vectors(now - center, rest - middle, self._masses)
        pose[:3, :3] = turn.as_matrix()
        pose[:3, 3] = center - pose[:3, :3] @ middle
        return pose

    @property
    def mass(self) -> float:
        """Of the body [kg]."""
        return float(self._masses.sum())

    @property
    def tool(self) -> np.ndarray:
        """Pose of the gripper body, 7-vector."""
        return self.state.body_q.numpy()[self._tool]

    @property
    def finger_forces(self) -> np.ndarray:
        """Mean forces that the body exerts on the left and the right finger in the last control step [N], shape [2 3]."""
        return self._pressed.numpy() / self._config.substeps


@wp.kernel
def _add_forces(forces: wp.array[wp.spatial_vector], bodies: wp.array[int], total: wp.array[wp.vec3]):  # noqa: ANN202
    i = wp.tid()
    total[i] = total[i] + wp.spatial_top(forces[bodies[i]])


def _world(
    body: SoftBody,
    pose: np.ndarray,
    robot: RobotSpec,
    base: np.ndarray,
    joints: np.ndarray,
    hulls: Sequence[Mesh],
    config: SoftConfig,
) -> newton.ModelBuilder:
    """Return a builder with the robot first, then the hulls and the body."""
    builder = newton.ModelBuilder()
    SolverMuJoCo.register_custom_attributes(builder)
    SolverVBD.register_custom_attributes(builder)
    builder.rigid_gap = 0.01
    gains = replace(robot.gains, finger_stiffness=config.grip_stiffness, finger_effort=config.grip_force)
    # Two drives that press with all their force yield to any push from one side, and shift sideways together.
    add_robot(builder, robot, wp.transform(*base), gains=gains, coupled_fingers=True)
    moving = [i for i in range(builder.joint_count) if builder.joint_type[i] != newton.JointType.FIXED]
    for i, value in zip(moving, joints, strict=True):
        at = builder.joint_q_start[i]
        builder.joint_q[at] = builder.joint_target_q[at] = float(value)
    for hull in hulls:
        mesh = newton.Mesh(hull.vertices, hull.faces.ravel(), compute_inertia=False)
        builder.add_shape_convex_hull(-1, mesh=mesh)
    builder.add_soft_mesh(
        pos=wp.vec3(*pose[:3]), rot=wp.quat(*pose[3:]), scale=1.0, vel=wp.vec3(),
        vertices=[wp.vec3(*each) for each in body.vertices], indices=body.tets.ravel().tolist(), density=config.density,
        k_mu=config.shear, k_lambda=config.bulk, k_damp=config.damping, particle_radius=config.particle_radius,
    )  # fmt: skip
    builder.color()
    return builder


def _solver(model: newton.Model, proxies: Sequence[int], config: SoftConfig) -> tuple[Any, SolverMuJoCo]:
    """Return the coupled solver and that of the arm in it; bodies of which VBD has a proxy are touched by the soft one."""
    arms: list[SolverMuJoCo] = []

    def arm(view: Any) -> SolverMuJoCo:
        solver = SolverMuJoCo(
            view, solver="newton", integrator="implicitfast", iterations=config.arm_iterations,
            ls_iterations=config.arm_iterations, njmax=40, nconmax=10, disable_contacts=True,
        )  # fmt: skip
        arms.append(solver)
        return solver

    def soft(view: Any) -> SolverVBD:
        return SolverVBD(
            view, iterations=config.iterations, friction_epsilon=config.friction_speed,
            rigid_body_particle_contact_buffer_size=1024, particle_enable_tile_solve=False,
        )  # fmt: skip

    def contacts(view: Any) -> newton.CollisionPipeline:
        return newton.CollisionPipeline(view, soft_contact_gap=config.contact_gap, broad_phase="explicit")

    entry, proxy = SolverCoupledProxy.Entry, SolverCoupledProxy.Proxy
    bodies, joints, particles = (range(n) for n in (model.body_count, model.joint_count, model.particle_count))
    coupled = proxy(
        source="arm", destination="soft", bodies=proxies, mode="lagged", collision_pipeline=contacts, collide_interval=1
    )
    whole = SolverCoupledProxy(
        model=model,
        entries=[
            entry(name="arm", solver=arm, bodies=list(bodies), joints=list(joints)),
            entry(name="soft", solver=soft, particles=list(particles)),
        ],
        coupling=SolverCoupledProxy.Config(proxies=[coupled]),
    )
    return whole, arms[0]
