"""One Newton model of a sim.usd with a gripper parked out of reach, and MuJoCo's own view of it."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import newton
import numpy as np
import warp as wp
from scipy.spatial.transform import Rotation

from s2a import robot as robots
from s2a.core.bounds import Count, NotNegative, Numbers, Positive
from s2a.core.outputs import temporary_folder
from s2a.motion.trajectory import STRAIGHT_APPROACH
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
    iterations: Count = 50
    impratio: Positive = 10.0


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
        force: of each finger [N]. The Franka Hand holds with up to 70 N.
        damping: of each finger [N s/m].
        gear: how stiffly the closed fingers resist moving to one side together [N/m].
        close_time: to close [s].
        pull: along the joint, towards its closed end, while the gripper stands still [N].
        pull_time: how long [s].
        slip: how far the part may move meanwhile [m].
        dt: time step [s]; short, because at the steps of training MuJoCo's soft friction creeps by millimetres.
    """

    approach: Positive = STRAIGHT_APPROACH
    depths: Numbers = (0.0, 0.005, -0.005)
    margins: tuple[float, ...] = (0.012,)
    max_penetration: NotNegative = 0.001
    opened: NotNegative = 0.05
    force: Positive = 30.0
    damping: NotNegative = 100.0
    gear: NotNegative = 20000.0
    close_time: Positive = 0.6
    pull: NotNegative = 20.0
    pull_time: Positive = 1.0
    slip: NotNegative = 0.002
    dt: Positive = 0.001


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
