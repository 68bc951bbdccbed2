"""A sim.usd under physics: one Newton model with a gripper parked out of reach, and the checks of the part that moves."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import mujoco
import newton
import numpy as np
import warp as wp

from s2a import robot as robots
from s2a.core.bounds import Count, NotNegative, Positive
from s2a.core.check import Check, Suite, at_most
from s2a.core.outputs import temporary_folder
from s2a.robot.model import add_gripper
from s2a.scene.articulation import opening_sign, pose_at
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import PREPARE_AGAIN, rotate
from s2a.sim.contacts import RestingRoom, mujoco_depths, newton_depths
from s2a.sim.world import JointConfig, build_world, read_stage

PARKED = 50.0  # [m] Height at which the gripper waits


@dataclass(frozen=True)
class PhysicsConfig:
    """How physics is stepped.

    Attributes:
        dt: time step [s].
    """

    dt: Positive
    iterations: Count = 50  # of the constraint solver
    impratio: Positive = 10.0  # ratio of friction to normal impedance


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
        free_objects = sim_stage.read(path, visuals=False).free if free else ()
        self.stage, self.dt = read_stage(path, part, robot=robot, also=tuple(free_objects)), config.dt
        self.robot = robots.load(self.stage.robot)
        gripper = self.robot.gripper
        with temporary_folder() as folder, wp.ScopedDevice("cpu"):
            # Neither a spring nor damping: what stays, stays by the dry friction that the stage itself has.
            builder = build_world(self.stage, JointConfig(0.0, 0.0, "grasp"), config.dt)
            add_gripper(builder, self.robot, wp.transform(wp.vec3(0.0, 0.0, PARKED), wp.quat_identity()))
            for i, label in enumerate(builder.joint_label):
                if label.split("/")[-1] in gripper.joints:
                    builder.joint_armature[builder.joint_qd_start[i]] = 0.1 * gripper.ratio**2
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
        index = ends.index(self.stage.target)
        self.joint, self.dof = int(coordinates[index]), int(dofs[index])
        # MuJoCo orders the joints of a linkage in its own way.
        names = [str(label).replace("/", "_") for label in self.model.joint_label]
        fingers = [self.mj.joint(names[ends.index(joint)]) for joint in gripper.joints]
        self.fingers = np.array([finger.qposadr[0] for finger in fingers])
        self.finger_dofs = np.array([finger.dofadr[0] for finger in fingers])
        ratios = self.model.joint_mimic_coeffs.numpy()[:, 1]
        self._followers = [
            (int(self.mj.joint(names[i]).qposadr[0]), int(self.mj.joint(names[leader]).qposadr[0]), float(ratios[i]))
            for i, leader in enumerate(self.model.joint_mimic_joint.numpy())
            if leader >= 0
        ]
        self.carrier = str(self.model.body_label[int(self.model.joint_parent.numpy()[index])]).split("/")[-1]
        label = str(self.model.body_label[bodies.index(gripper.body)])
        self._gripper = int(self.mj.body_mocapid[self.mj.body(label.replace("/", "_")).id])

    def data(self, q: float = 0.0, finger: float = 0.0) -> mujoco.MjData:
        """Return a state at rest: the target's coordinate [m or rad], both fingers' [m or rad]."""
        data = mujoco.MjData(self.mj)
        data.qpos[self.joint] = q
        data.qpos[self.fingers] = finger
        for follower, leader, ratio in self._followers:
            data.qpos[follower] = ratio * data.qpos[leader]
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

    def place_gripper(self, data: mujoco.MjData, pose: np.ndarray) -> None:
        """Hold the gripper at a pose, 7-vector in the scene."""
        data.mocap_pos[self._gripper] = pose[:3]
        data.mocap_quat[self._gripper] = np.roll(pose[3:], 1)
        mujoco.mj_kinematics(self.mj, data)

    def deepest(
        self, data: mujoco.MjData, one: Iterable[int], other: Iterable[int], within: float = 0.0
    ) -> tuple[float, int, int]:
        """Return the largest penetration of two groups of geoms [m], and the two; negative where there is a gap.

        `within`: gaps wider than this [m] are all reported as this.
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


FIX = "correct the colliders or the annotated axis and range, then " + PREPARE_AGAIN
GAIN = 200.0  # [N s/m] How hard the sweep corrects its speed; its force is bounded, so that this is of no consequence
# [N/m] How fast the sweep's force grows while it is too slow: by 20 N/s at the 1 cm/s with which it ends. Without
# this, dry friction stops it where GAIN times the speed that is left no longer overcomes it: 6 N,
# 10 mm before the limit
INTEGRAL = 2000.0
SLACK = 0.002  # [m] How near to a limit the sweep has to come: limits are soft


@dataclass(frozen=True, kw_only=True)
class MotionConfig:
    """Bounds of the checks without a gripper.

    Attributes:
        rest_time: time for which nothing may move [s].
        open_time: time for which the part may not open by itself [s].
    """

    rest_time: Positive
    rest_displacement: NotNegative = 0.001  # max displacement of any body then [m]
    open_time: Positive
    open: NotNegative = 0.001  # how far its grasp point may have moved then [m]
    # at the grasp point, with which the joint is swept, besides what carries its weight [N]. What a finger pulls
    # a kitchen drawer with
    force: Positive = 10.0
    # the same as a fraction of the weight of what moves, where that is more. Rollers resist with 2 to 3 % of the
    # weight they carry: 60 kg take a hand, not a finger
    weight_fraction: NotNegative = 0.05
    speed: Positive = 0.25  # of the grasp point during the sweep [m/s]
    # of the part's colliders in those of any other body or the room, as scanned [m]; MuJoCo's and Newton's contacts
    # give way by that
    penetration: NotNegative = 0.001
    sweep_penetration: NotNegative = 0.002  # the same anywhere along the travel [m]


MOTION: Suite[MujocoWorld, MotionConfig] = Suite()  # Checks of the moving part without a gripper


@MOTION.check()
def rest(world: MujocoWorld, config: MotionConfig) -> list[Check]:
    """Watch the stage under gravity, stepped by Newton: does it stay at rest, and does it open by itself?"""
    model, solver = world.model, world.solver
    state, other, control = model.state(), model.state(), model.control()
    newton.eval_fk(model, model.joint_q, model.joint_qd, state)
    names = [label.split("/")[-1] for label in model.body_label]
    own = [i for i, label in enumerate(model.body_label) if label.startswith("/scene/")]  # all but the gripper
    start, moved = state.body_q.numpy()[own], np.zeros(len(own))
    # Of each body its centre, and of the target (its frame is the scene's) also where it is held.
    centers = model.body_com.numpy()[own]
    held = [world.stage.grasp[:3] if names[i] == world.stage.target else c for i, c in zip(own, centers, strict=True)]
    points = np.stack([centers, np.array(held)], axis=1)
    for step in range(round(config.open_time / world.dt)):
        solver.step(state, other, control, None, world.dt)
        state, other = other, state
        if (step + 1) % 12 == 0 and (step + 1) * world.dt <= config.rest_time + 1e-9:
            moved = np.fmax(moved, displacements(start, state.body_q.numpy()[own], points))
    coordinate = float(state.joint_q.numpy()[world.joint]) * world.lever_arm
    moved = np.where(np.isfinite(state.body_q.numpy()[own]).all(axis=1), moved, np.nan)
    worst = int(np.argmax(np.where(np.isnan(moved), np.inf, moved)))
    joint = f"/scene/joints/{world.stage.target}"
    return [
        at_most(
            "rest_displacement", float(moved[worst]), config.rest_displacement, "m", prim=f"/scene/{names[own[worst]]}",
            message=f"max displacement of a body within {config.rest_time:g} s, no robot", remedy=FIX,
        ),
        at_most(
            "self_opening", abs(coordinate), config.open, "m", prim=joint,
            message=f"displacement of the grasp point after {config.open_time:g} s under gravity alone",
            remedy="level the annotated axis, or give the joint dry friction (prepare.friction)",
        ),
    ]  # fmt: skip


@MOTION.check()
def joint_sweep(world: MujocoWorld, config: MotionConfig) -> Check:
    """Push the part to its far limit and back to the near one, with a small force besides what carries its weight.

    What a lid weighs is no jam; the force at the grasp point that carries it is part of the message.
    """
    data, lever_arm, limits = world.data(), world.lever_arm, world.stage.joint.limits
    world.mj.opt.timestep, joint = world.dt, f"/scene/joints/{world.stage.target}"
    far, near = (limits[1], limits[0]) if world.sign > 0 else limits
    reached, blocks, weights = [], [], []
    for goal in (far, near):
        end, weight = _push(world, data, goal, config)
        reached.append(abs(goal - end) * lever_arm)
        blocks.append(_touched(world, data))
        weights.append(weight)
    worst = int(np.argmax(reached))
    message = (
        f"short of its {('open', 'closed')[worst]} limit when pushed with {_force(world, config):.3g} N at the grasp"
    )
    message += f" besides the {max(weights):.1f} N or less that carry its weight" if max(weights) > 0.1 else ""
    stopped = reached[worst] > SLACK and blocks[worst]
    return at_most(
        "joint_sweep", float(reached[worst]), SLACK, "m", prim=blocks[worst] if stopped else joint,
        message=f"{message}: blocked by {blocks[worst]}" if stopped else message,
        remedy="correct the colliders that block it, or lower the joint's dry friction",
    )  # fmt: skip


@MOTION.check()
def penetration(world: MujocoWorld, config: MotionConfig) -> list[Check]:
    """Measure how deep the part reaches into other bodies and the room, at rest and along its travel, no pair filtered."""
    room, part = world.stage.room, world.stage.target
    joints = {i: each.joint for i, each in room.articulations.items()}
    parents = {i: each.parent for i, each in room.articulations.items()}
    around = RestingRoom(room.bodies, joints, parents, room.static_colliders)
    clear = (0.0, "no collision in MuJoCo and Newton, no pair filtered")
    rest, travel = [clear], [clear]
    for name, engine in (("MuJoCo", mujoco_depths), ("Newton", newton_depths)):
        for other, each in around.overlaps(part, engine).items():
            rest.append((each.rest, f"in {other}, by {name} without filters"))
            travel.append((each.travel, f"in {other} at {each.q:.3f}, by {name} without filters"))
    return [
        at_most(name, depth, bound, "m", prim=f"/scene/{part}", message=message, remedy=FIX)
        for name, (depth, message), bound in (
            ("rest_penetration", max(rest), config.penetration),
            ("sweep_penetration", max(travel), config.sweep_penetration),
        )
    ]


@MOTION.check()
def mujoco_reload(world: MujocoWorld, config: MotionConfig) -> Check:
    """Compile the model again from its own XML with MuJoCo alone, and compare what moves, its limits and its mass."""
    problems = []
    again = mujoco.MjModel.from_xml_string(world.xml)
    joint = int(world.mj.dof_jntid[world.dof])
    if again.nv != world.model.joint_dof_count:
        problems.append(f"{again.nv} degrees of freedom, not {world.model.joint_dof_count}")
    elif np.abs(again.jnt_range[joint] - world.stage.joint.limits).max() > 1e-5:
        problems.append(f"limits {again.jnt_range[joint].tolist()}, not {list(world.stage.joint.limits)}")
    mass = world.model.body_mass.numpy().sum()
    if abs(again.body_mass.sum() - mass) > 1e-3 * mass:
        problems.append(f"{again.body_mass.sum():.3f} kg in all, not {mass:.3f}")
    data = mujoco.MjData(again)
    for _ in range(100):
        mujoco.mj_step(again, data)
    if not np.isfinite(data.qpos).all():
        problems.append("coordinates that are not finite after 100 steps")
    path, count = f"/scene/joints/{world.stage.target}", float(len(problems))
    message = "; ".join(problems) or f"MuJoCo {mujoco.__version__} alone has the same joint, limits and mass"
    return at_most("mujoco_reload", count, 0.0, "problems", prim=path, message=message, remedy=FIX)


def _push(world: MujocoWorld, data: mujoco.MjData, goal: float, config: MotionConfig) -> tuple[float, float]:
    """Drive the joint towards a coordinate at an even speed with a bounded force besides the one that carries its weight.

    Returns:
        Where it ends [m] or [rad], and the largest force at the grasp point [N] that carries its weight.
    """
    lever_arm, model, heaviest = world.lever_arm, world.mj, 0.0
    mujoco.mj_forward(model, data)
    travel = abs(goal - data.qpos[world.joint]) * lever_arm
    direction, bound, held = np.sign(goal - data.qpos[world.joint]), _force(world, config), 0.0
    for _ in range(round((2.0 * travel / config.speed + 2.0) / world.dt)):
        speed = data.qvel[world.dof] * lever_arm * direction
        left = abs(goal - data.qpos[world.joint]) * lever_arm
        # Slower towards the end: the check is whether the limit is reached, not how hard it is hit.
        error = min(config.speed, 2.0 * left + 0.01) - speed
        if abs(GAIN * error + held) < bound:  # else it would grow beyond what is applied, and overshoot
            held = float(np.clip(held + INTEGRAL * error * world.dt, -bound, bound))
        force = np.clip(GAIN * error + held, -bound, bound)
        weight = float(data.qfrc_bias[world.dof])
        data.qfrc_applied[world.dof] = direction * force * lever_arm + weight
        heaviest = max(heaviest, abs(weight) / lever_arm if lever_arm > 0.0 else 0.0)
        mujoco.mj_step(model, data)
        if left < 0.2 * SLACK:
            break
    return float(data.qpos[world.joint]), heaviest


def _force(world: MujocoWorld, config: MotionConfig) -> float:
    """Return the force of the sweep at the grasp point [N]: more than a finger's for what is heavy, as it is in use."""
    body = int(world.mj.dof_bodyid[world.dof])
    weight = float(world.mj.body_subtreemass[body] * np.linalg.norm(world.mj.opt.gravity))
    return max(config.force, config.weight_fraction * weight)


def _touched(world: MujocoWorld, data: mujoco.MjData) -> str:
    """Return the path of the collider that presses hardest on the target; empty if none does."""
    own, force, contacts = set(world.geoms(world.stage.target)), np.zeros(6), [(0.0, "")]
    for i, contact in enumerate(data.contact):
        pair = (int(contact.geom1), int(contact.geom2))
        if len(own & set(pair)) == 1:
            mujoco.mj_contactForce(world.mj, data, i, force)
            contacts.append((float(force[0]), world.labels[next(geom for geom in pair if geom not in own)]))
    return max(contacts)[1]


def displacements(start: np.ndarray, now: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Return how far bodies moved [m], shape [body].

    Args:
        start: their poses, shape [body 7].
        now: the same, later.
        points: of each, in its own frame [m], shape [body point 3].
    """
    before, after = (rotate(poses[:, None, 3:], points) + poses[:, None, :3] for poses in (start, now))
    return np.linalg.norm(after - before, axis=2).max(axis=1)
