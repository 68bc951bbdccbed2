"""A soft body to pick up and place: its trials, the plan for the rigid body of its shape, their simulation and metrics."""

from __future__ import annotations

import itertools
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from scipy.spatial.transform import Rotation

from s2a.core.bounds import Fraction, NotNegative, Positive
from s2a.core.errors import InputError
from s2a.motion.correction import Correction, lead_held
from s2a.motion.gripper import FIRM, HANGING, gripper_boxes
from s2a.motion.obstacles import Obstacles
from s2a.motion.pick import trajectory_of
from s2a.motion.pick_plan import PickPlan, PickTask, plan_pick
from s2a.motion.places import NEAR, first_planned, place_poses
from s2a.motion.trajectory import PlannerConfig, Trajectory, eased
from s2a.motion.workcell import Workcell
from s2a.robot.spec import GripperSpec, RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody, SimRoom, in_scene
from s2a.sim.recorder import Limits
from s2a.sim.soft import RATE, SoftSimulation
from s2a.sim.soft_body import SoftBody, SoftConfig
from s2a.tasks.mdp.grasp import OPPOSED
from s2a.tasks.pick_place import PickPlaceConfig

# Of an outcome, what holds or not; success: all of the others
COLUMNS = ("success", "placed", "at_rest", "gripper_gone", "carried", "released_at_rest", "arm_clear", "finite")
# The others: metres, a fraction, metres, metres, newtons
VALUES = ("position_error", "carried_fraction", "drift", "arm_depth", "grip_force")
# [s] The path is how far the body comes in each. In steps, its trembling where it stands made 46 mm of path before it
# was touched, and 60 mm after its release. No motion is too slow to count: what is pushed at 6 mm/s is not carried
INTERVAL = 0.5


@dataclass(frozen=True)
class SoftMetrics:
    """Thresholds.

    Attributes:
        position: tolerance of the centre of mass at its place [m]: a soft body sags and leans more than a rigid one, and has no
            single orientation.
        rest_time: at rest, at the end of the episode [s].
        rest_speed: speed of the centre of mass up to which it rests [m/s].
        clear_distance: distance of fingers and gripper body from the body's vertices beyond which the gripper has retreated [m].
        contact_force: force of each finger from which a pinch holds [N].
        carried_fraction: fraction of the body's path over which a pinch must have held.
        max_drift: maximum drift of the body after the last contact [m]: more is dropped or thrown.
        max_depth: maximum depth of the arm in the room's hulls, at any time [m], as in the planner.
    """

    position: Positive = 0.05
    rest_time: Positive = 1.0
    rest_speed: Positive = 0.01
    clear_distance: NotNegative = 0.02
    contact_force: Positive = 1.0
    carried_fraction: Fraction = 0.8
    max_drift: NotNegative = 0.02
    max_depth: NotNegative = 0.005


@dataclass(frozen=True)
class SoftEpisode:
    """What was recorded."""

    center: np.ndarray  # centre of mass [m], shape [step 3]
    forces: np.ndarray  # of the body on the left and the right finger [N], shape [step 2 3]
    gap: np.ndarray  # least distance of fingers and gripper body from the body's vertices [m], shape [step]
    depth: np.ndarray  # of the arm in the room's hulls [m], shape [step]
    rate: float  # steps a second


def outcome(episode: SoftEpisode, goal: np.ndarray, metrics: SoftMetrics) -> dict[str, float | bool]:
    """Return the results of an episode by name: those of `success`, and what they were decided by.

    `goal`: place of the centre of mass [m], shape [3].
    """
    last = round(metrics.rest_time * episode.rate)
    error = np.linalg.norm(episode.center - goal, axis=1)
    steps = np.linalg.norm(np.diff(episode.center, axis=0), axis=1)
    size = np.linalg.norm(episode.forces, axis=2)
    touched = np.flatnonzero((size > 0.0).any(axis=1))
    drift = np.linalg.norm(episode.center[-1] - episode.center[touched[-1] if len(touched) else 0])
    rates = {
        "placed": bool((error[-last:] <= metrics.position).all()),
        "at_rest": bool((steps[-last:] * episode.rate <= metrics.rest_speed).all()),
        "gripper_gone": bool((episode.gap[-last:] >= metrics.clear_distance).all() and not size[-last:].any()),
        "carried": (carried := _carried(episode, metrics.contact_force)) >= metrics.carried_fraction,
        "released_at_rest": bool(drift <= metrics.max_drift),
        "arm_clear": bool(episode.depth.max() <= metrics.max_depth),
        "finite": bool(np.isfinite(episode.center).all()),
    }
    values = {"position_error": float(error[-1]), "carried_fraction": carried, "drift": float(drift)}
    values |= {"arm_depth": float(episode.depth.max()), "grip_force": float(size.min(axis=1).max())}
    return {"success": all(rates.values()), **rates, **values}


def _carried(episode: SoftEpisode, least: float) -> float:
    """Return the fraction of the path on which both fingers pressed from opposite sides."""
    size, forces = np.linalg.norm(episode.forces, axis=2), episode.forces
    cosine = (forces[:, 0] * forces[:, 1]).sum(axis=1) / np.maximum(size.prod(axis=1), 1e-12)
    pinched = (size >= least).all(axis=1) & (cosine < OPPOSED)  # as `is_grasped` of the other tasks
    ends = np.arange(0, len(pinched), max(1, round(INTERVAL * episode.rate)))
    path = np.linalg.norm(np.diff(episode.center[ends], axis=0), axis=1)
    held = np.array([pinched[a : b + 1].mean() for a, b in itertools.pairwise(ends)])
    return float((path * held).sum() / path.sum()) if path.any() else 0.0


SoftTask, SOFT_TASK = PickPlaceConfig, "pick_place"  # Settings and name of the task that is done with a soft body
NAME = "teddy_bear"
GAP = 0.003  # [m] Between the body and its support where it is put down: a millimetre more than its vertices' radius
EVEN = 0.02  # [m] Up to which a support's height may differ below a soft body
NEAR_BODY = 0.10  # [m] From what the body passes, up to which hulls of the room are simulated


def with_body(room: SimRoom, body: SoftBody, config: SoftConfig, pose: np.ndarray) -> SimRoom:
    """Return a room with a soft body as a rigid free object at a pose, 7-vector."""
    colliders = tuple(Collider(NAME, box) for box in body.boxes)
    mass = Mass(config.density * body.volume, (0.0, 0.0, 0.0), body.inertia(config.density), source="density")
    position, orientation = tuple(map(float, pose[:3])), tuple(map(float, pose[3:]))
    free = SimBody(NAME, body.surface, colliders, mass, position=position, orientation=orientation)  # type: ignore[arg-type]
    return replace(room, free={**room.free, NAME: free})


def standing(near: Obstacles, support: str, body: SoftBody, at: np.ndarray, yaw: float) -> np.ndarray:
    """Return the pose, 7-vector, of a body that stands on a support at x, y [2], turned by `yaw` about z [rad].

    Raises:
        InputError: there is no support below all of it, or its height differs by more than EVEN.
    """
    turn = Rotation.from_euler("z", yaw)
    low = body.vertices[:, 2].min()
    feet = turn.apply(body.vertices[body.vertices[:, 2] < low + 1e-6])[:, :2] + at
    bounds = np.concatenate([h.vertices for h in near.hulls_of(support)] or [np.zeros((0, 3))])
    if not len(bounds):
        supports = ", ".join(dict.fromkeys(near.names))
        raise InputError(f"{support!r} supports nothing near ({at[0]:.2f}, {at[1]:.2f}); near are: {supports}")
    height, names = near.below(np.c_[feet, np.full(len(feet), bounds[:, 2].max() + 0.2)])
    if set(names) != {support} or np.ptp(height) > EVEN:
        below = ", ".join(sorted(set(names)))
        raise InputError(
            f"at ({at[0]:.2f}, {at[1]:.2f}) a body of {1000 * np.ptp(body.vertices[:, 0]):.0f} mm stands on {below}, "
            f"{1000 * np.ptp(height):.0f} mm uneven; choose a place in the middle of {support!r}"
        )
    return np.array([*at, height.max() + GAP - low, *turn.as_quat()])


def hulls_near(room: SimRoom, body: SoftBody, ends: list[np.ndarray]) -> list[Mesh]:
    """Return the hulls of a room within NEAR_BODY of a body that stands at poses, 7-vectors; of free objects too."""
    every = [c.mesh for c in room.static_colliders]
    for each in (*room.bodies.values(), *(b for i, b in room.free.items() if i != NAME)):
        every += [Mesh(in_scene(each, c.mesh), c.mesh.faces) for c in each.colliders]
    points = [body.vertices @ m[:3, :3].T + m[:3, 3] for m in map(matrix, ends)]
    boxes = [(p.min(axis=0) - NEAR_BODY, p.max(axis=0) + NEAR_BODY) for p in points]
    bounds = [(np.min(hull.vertices, axis=0), np.max(hull.vertices, axis=0)) for hull in every]
    return [
        hull
        for hull, (least, most) in zip(every, bounds, strict=True)
        if any((least <= high).all() and (most >= low).all() for low, high in boxes)
    ]


DRAWS = 20  # Of a pose, until the body stands at it
Ends = tuple[np.ndarray, np.ndarray]


def trials(
    room: SimRoom,
    body: SoftBody,
    config: SoftConfig,
    task: PickPlaceConfig,
    robot: RobotSpec,
    approach: float,
    count: int,
    seed: int,
) -> Iterator[SoftTrial | str]:
    """Yield trials, each planned for itself, or why there is no plan for one.

    In each, start and place are shifted by up to `task.start_shift` along x and y and turned by up to `task.start_turn`.

    Raises:
        InputError: a start or a place that is missing or where the body does not stand.
    """
    candidates = _candidates(room, body, config, task)
    for number in range(count):
        rng = np.random.default_rng([seed, number])
        try:
            drawn = ((_drawn(room, body, a, task, rng), _drawn(room, body, b, task, rng)) for a, b in candidates)
            _, trial = first_planned(
                with_body(room, body, config, candidates[0][0]),
                NAME,
                robot,
                drawn,
                lambda ends: plan_trial(room, body, config, robot, ends, approach, number),  # noqa: B023 - it is called at once
            )
            yield trial
        except InputError as error:
            yield str(error)


def _candidates(room: SimRoom, body: SoftBody, config: SoftConfig, task: PickPlaceConfig) -> list[Ends]:
    """Return starts and places of the body's frame, 7-vectors, those to be tried first first."""
    start, place = task.start, task.place
    if start is None or place is None or start == place or any(each.endswith(".json") for each in (start, place)):
        raise InputError(
            f"task.start={start} and task.place={place}: with physics=soft the body is not part of the room; give the id "
            "of a support or a pose for each, two different ones"
        )
    ends = [each for each in (start, place) if each != NEAR]
    about = {each: _about(room, each) for each in ends}
    with_it = with_body(room, body, config, about[ends[0]])
    goal = next(place_poses(with_it, NAME, place, about[ends[0]], EVEN))
    return [(each, goal) for each in place_poses(with_it, NAME, start, goal, EVEN)]


def _about(room: SimRoom, request: str) -> np.ndarray:
    """Return a pose, 7-vector, on the middle of a support, or the one that is said."""
    try:
        return np.array([*(float(x) for x in request.replace(",", " ").split()[:3]), 0.0, 0.0, 0.0, 1.0])
    except ValueError:
        pass
    points = [np.asarray(c.mesh.vertices) for c in room.static_colliders if c.part == request]
    for each in (*room.bodies.values(), *room.free.values()):
        points += [in_scene(each, c.mesh) for c in each.colliders if c.part == request]
    if not points:
        raise InputError(f"{request!r} is neither a pose nor a part of room {room.name!r} that supports anything")
    low, high = np.concatenate(points).min(axis=0), np.concatenate(points).max(axis=0)
    return np.array([*(low + high)[:2] / 2, high[2], 0.0, 0.0, 0.0, 1.0])


def _drawn(
    room: SimRoom, body: SoftBody, pose: np.ndarray, task: PickPlaceConfig, rng: np.random.Generator
) -> np.ndarray:
    """Return the first pose that is drawn about one, 7-vectors, at which all of the body is on the same support."""
    near = Obstacles.of_room(room, set(), pose[:3])
    support, yaw = near.below(pose[None, :3])[1][0], Rotation.from_quat(pose[3:]).as_euler("zyx")[0]
    for left in reversed(range(DRAWS)):
        at = pose[:2] + rng.uniform(-1.0, 1.0, 2) * task.start_shift
        try:
            return standing(near, support, body, at, yaw + rng.uniform(-1.0, 1.0) * task.start_turn)
        except InputError:
            if not left:
                raise
    raise AssertionError("the last draw returns or raises")


AFTER = 1.5  # [s] That an episode goes on after the arm's motion: half a second to come to rest, and one at rest
Watch = Callable[[int, SoftSimulation], None]


@dataclass(frozen=True)
class SoftTrial:
    """A soft body to be picked and placed."""

    room: SimRoom  # without it
    body: SoftBody  # at rest
    config: SoftConfig  # how it is simulated
    robot: RobotSpec  # what picks it
    start: np.ndarray  # pose of its frame, 7-vector, scene frame
    goal: np.ndarray  # likewise
    plan: PickPlan  # how


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
    robot, as `s2a.sim.recorder` has them.

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
    results = outcome(episode, trial.goal[:3], metrics)
    seconds = {"simulated": len(targets) / RATE, "built_in": built - begun, "stepped_in": ended - built}
    used = _limit_use(robot, first, targets, np.array(joints), np.array(torques))
    return results | {name: round(value, 3) for name, value in seconds.items()} | {"limit_use": used}


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
