"""One skill in one simulated episode, from a state of the room to the next; verified by the task's own metric."""

from __future__ import annotations

import time
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, make_dataclass, replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import torch
from PIL import Image
from scipy.spatial.transform import Rotation

from s2a import tasks
from s2a.core import config
from s2a.core.bounds import CountFromZero
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write, temporary_folder
from s2a.language.do.plan import Skill
from s2a.learn.perception.follow import DepthPolicy
from s2a.learn.rl.policy_file import PolicyFile
from s2a.motion.obstacles import Obstacles
from s2a.motion.open import plan_letting_go
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.motion.workcell import Workcell
from s2a.robot.collision import SLACK
from s2a.robot.spec import RobotSpec
from s2a.robot.tool_path import matrix
from s2a.scene.articulation import displace, lever_arm, open_limit, pose_at, transform
from s2a.scene.scene import Joint, Mesh, Vec3
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import Articulation, Collider, Quat, SimBody, SimRoom, in_scene
from s2a.sim.camera import Camera, CameraConfig
from s2a.sim.simulation import SimConfig, Simulation, device_of
from s2a.sim.world import SimStage
from s2a.tasks.base import MdpConfig, Task
from s2a.tasks.env import Policy, VecEnv


def _settings(kind: type[Task]) -> type:
    """Return the settings of a skill: `task` and the thresholds of its `metrics`, those of a kind of task."""
    return make_dataclass("SkillSettings", [("task", kind.Config), ("metrics", kind.Metrics)], frozen=True)


def _chosen(values: Mapping[str, Any]) -> type:
    """Return the dataclass of a command's key `skills`: the settings of each skill by its name."""
    fields = [(name, _settings(tasks.of(each))) for name, each in values["skills"].items()]
    return make_dataclass("Skills", fields, frozen=True)


# A command's key `skills`: `task` and `metrics` of each skill by its name
Skills = Annotated[Any, config.Chosen(_chosen)]


def tasks_of(skills: Any) -> dict[str, type[Task]]:
    """Return the task of each skill of a command's key `skills`."""
    return {name: tasks.task(each.task.name) for name, each in vars(skills).items()}


@dataclass(frozen=True)
class ExecutionConfig:
    """How skills are executed.

    Attributes:
        robot: name of the robot.
        device: of the simulation.
        seed: of the start noise.
        sim: how physics is stepped, the same for all skills.
        skills: their tasks, as the key `skills`.
        planner: the planner's motion.
        camera: of the images.
    """

    robot: str
    device: str
    seed: CountFromZero
    sim: SimConfig
    skills: Any
    planner: PlannerConfig
    camera: CameraConfig
    # that does the skills of its task in the planner's place; None: none does. See `world`
    policy: PolicyFile | DepthPolicy | None = None

    def policy_of(self, task: MdpConfig) -> PolicyFile | DepthPolicy | None:
        """Return the policy where it does a task; one that does not say of which it is does none."""
        world = self.policy.world if self.policy else None
        return self.policy if world and task.name == world[1].name else None

    def world(self, task: MdpConfig) -> tuple[SimConfig, MdpConfig]:
        """Return how physics is stepped in an episode of a task, and what the robot sees and does in it.

        With a policy they are those of its training: steps, solver, gains and limits of the arm, spring and damping of the joint,
        and the delays of actions and errors of the grasp that it sees, drawn for an episode. Only the episode's length is the
        skill's own, and nothing of the room or arm is drawn (`vary`): masses and friction are those that the planner meets.
        """
        policy = self.policy_of(task)
        if policy is None:
            return self.sim, task
        physics, mdp = policy.worlds(self.sim, task)
        return replace(physics, vary=None), replace(mdp, episode_steps=task.episode_steps)


@dataclass(frozen=True)
class RoomChange:
    """How a room differs from its file."""

    # coordinates of articulated parts [m or rad] by id; those left out are at zero
    joints: dict[str, float] = field(default_factory=dict)
    # poses of free objects (position, quaternion xyzw; shape [7]) by id; those left out stand as in the file
    objects: dict[str, tuple[float, ...]] = field(default_factory=dict)

    def with_(self, other: RoomChange) -> RoomChange:
        """Return this state where the other says nothing."""
        return RoomChange({**self.joints, **other.joints}, {**self.objects, **other.objects})

    def plain(self) -> dict[str, object]:
        """Return the state as values for JSON, to 0.1 mm."""
        objects = {i: [round(float(x), 4) for x in pose] for i, pose in self.objects.items()}
        return {"joints": {i: round(q, 4) for i, q in self.joints.items()}, "objects": objects}


def opened_by(room: SimRoom, state: RoomChange) -> dict[str, float]:
    """Return the path by which each part's grasp point stands open [m], by id; negative where it is pushed past shut."""
    paths = {}
    for part, q in state.joints.items():
        joint, point = room.articulations[part].joint, np.array(room.articulations[part].grasp.point)
        paths[part] = float(q * np.copysign(1.0, open_limit(joint)) * lever_arm(joint, point))
    return paths


def at_state(room: SimRoom, state: RoomChange, without: Collection[str] = ()) -> SimRoom:
    """Return a room as a state leaves it: what the file calls zero is where each part stands now.

    Hulls, surfaces, grasps and joints of a part that stands open are moved with it, and what hangs on it; its joint's limits
    are shifted. Base poses stay: they are of the shut part.

    `without`: parts that are left as they are in the file, because an episode starts with them at their coordinate.
    """
    for part in room.articulations:  # parents come before children
        q = state.joints.get(part, 0.0)
        if q != 0.0 and part not in without:
            room = _displaced(room, part, q)
    free = dict(room.free)
    for i, pose in state.objects.items():
        free[i] = replace(free[i], position=_vector(pose[:3]), orientation=_quaternion(pose[3:]))
    return replace(room, free=free)


def write(room: SimRoom, state: RoomChange, without: Collection[str], path: Path) -> None:
    """Write a room as a state leaves it, to exactly this path, its visuals beside it; see `at_state`."""
    sim_stage.write(at_state(room, state, without), path)


def _displaced(room: SimRoom, part: str, q: float) -> SimRoom:
    """Return a room with a part, and what hangs on it, moved from zero to a coordinate, which is its new zero."""
    joint = room.articulations[part].joint
    moved = [part, *(i for i in room.articulations if part in room.carriers(i))]
    bodies = {i: _moved_body(body, joint, q) if i in moved else body for i, body in room.bodies.items()}
    joints = {i: _moved_part(each, joint, q) if i in moved else each for i, each in room.articulations.items()}
    low, high = joint.limits
    own = replace(joints[part], joint=replace(joint, limits=(low - q, high - q)))
    return replace(room, bodies=bodies, articulations={**joints, part: own})


def _moved_body(body: SimBody, joint: Joint, q: float) -> SimBody:
    turn = Rotation.from_matrix(transform(joint, q)[:3, :3])
    (center,) = displace(np.array([body.mass.center], float), joint, q)
    mass = replace(
        body.mass, center=_vector(center), axes=_quaternion((turn * Rotation.from_quat(body.mass.axes)).as_quat())
    )
    colliders = tuple(Collider(c.part, _moved_mesh(c.mesh, joint, q), c.structure) for c in body.colliders)
    return replace(body, visual=_moved_mesh(body.visual, joint, q), colliders=colliders, mass=mass)


def _moved_part(part: Articulation, joint: Joint, q: float) -> Articulation:
    """Return an articulation with its axis and grasp moved."""
    own, grasp = part.joint, part.grasp
    axis = transform(joint, q)[:3, :3] @ np.array(own.axis)
    (origin,) = displace(np.array([own.origin]), joint, q)
    pose = pose_at(joint, np.array([*grasp.point, *grasp.orientation]), q)
    moved = _moved_mesh(grasp.region, joint, q)
    held = replace(grasp, point=_vector(pose[:3]), orientation=_quaternion(pose[3:]), region=moved)
    return replace(
        part, joint=replace(own, axis=_vector(axis / np.linalg.norm(axis)), origin=_vector(origin)), grasp=held
    )


def _moved_mesh(mesh: Mesh, joint: Joint, q: float) -> Mesh:
    if not len(mesh.vertices):
        return mesh
    return replace(mesh, vertices=displace(np.asarray(mesh.vertices, float), joint, q).astype(np.float32))


def _vector(values: Iterable[float]) -> Vec3:
    x, y, z = map(float, values)
    return x, y, z


def _quaternion(values: Iterable[float]) -> Quat:
    x, y, z, w = map(float, values)
    return x, y, z, w


START_ERROR = 0.01  # [m] By which a part may stand elsewhere at the start of an episode than the one before left it
BESIDE = 0.02  # [m] Within which of a part's box a free object counts as in or on it, and moves with it


@dataclass(frozen=True)
class Outcome:
    """How a skill went."""

    success: bool  # by the task's own metric
    reason: str  # why not; empty after a success
    state: RoomChange  # the room afterwards; as before where nothing was simulated
    record: dict[str, Any] = field(default_factory=dict)  # plain values for JSON


def execute(
    skill: Skill, file: Path, room: SimRoom, state: RoomChange, config: ExecutionConfig, image: Path | None = None
) -> Outcome:
    """Execute a skill in an episode that begins in a state of the room.

    Args:
        skill: a checked one.
        file: the room's file.
        room: what is in it, with visuals where an image is asked for.
        state: what the skills before left.
        config: robot, physics, tasks, planner.
        image: PNG file for the room at the end of the episode, or None.
    """
    start = time.perf_counter()
    record: dict[str, Any] = {**vars(skill), "began": {"from": "the state that the skill before left"}}
    changed = bool(state.joints or state.objects)
    if not changed:
        record["began"]["from"] = "the room's file"
    with temporary_folder() as folder:
        # A part that a task begins with open starts at its coordinate; all others are where they stand.
        begins = tasks.task(getattr(config.skills, skill.skill).task.name).INSTRUCTION.begins
        own = (skill.part,) if skill.part and begins == "open" else ()
        path = folder / "room.usd" if changed else file
        if changed:
            write(room, state, own, path)
        try:
            outcome = _episode(skill, path, room, state, own, config, record, image)
        except InputError as error:
            reason = f"{skill.words}: {str(error).replace(str(path), 'the room as it stands')}."
            outcome = Outcome(False, reason, state)
    record |= {"success": outcome.success, "reason": outcome.reason, "seconds": round(time.perf_counter() - start, 1)}
    return replace(outcome, record=record)


def _episode(
    skill: Skill,
    path: Path,
    room: SimRoom,
    state: RoomChange,
    own: tuple[str, ...],
    config: ExecutionConfig,
    record: dict[str, Any],
    image: Path | None,
) -> Outcome:
    """Plan and simulate the episode; fills the record."""
    settings = getattr(config.skills, skill.skill)
    task = tasks.task(settings.task.name)
    opened = opened_by(room, state).get(skill.part or "", 0.0)
    policy, (physics, mdp) = config.policy_of(settings.task), config.world(settings.task)
    mdp = task.requested(mdp, (skill.support or skill.part) if skill.object else None, opened)
    now = at_state(room, state)
    also = riders(now, skill.part) if skill.part and not skill.object else []
    unchanged = None if state.joints or state.objects else room
    stage = task.read_stage(path, skill.object or skill.part, config.robot, also, mdp, config.planner, unchanged)
    sim = Simulation(stage, physics, 1, device_of(config.device))
    env = tasks.make_env(sim, mdp, settings.metrics, {}, config.seed)
    record["policy"] = policy.name if policy else "planner"
    actor: Policy = policy.bound(env) if policy else _planner(skill, env, config, room, state, record)
    if isinstance(actor, Planner):
        env.lengthen(actor.episode_steps)
    env.reset_all()
    offsets = {i: 0.0 if i in own else q for i, q in state.joints.items()}
    began = read_state(sim, stage.active, offsets)
    _refuse_jump(skill, room, state, began)
    record["began"] |= {**began.plain(), "arm": "at home, with start noise", "base": _rounded(stage.base)}
    metrics, ended = _simulate(env, actor, sim, stage, offsets, image, config)
    after = state.with_(ended)
    metric = task.RESULTS.success
    success = metrics[metric] == 1.0
    record |= {"ended": ended.plain(), "metric": metric, "metrics": metrics}
    return Outcome(success, "" if success else missed(skill, task, metrics), after)


def _planner(
    skill: Skill, env: VecEnv, config: ExecutionConfig, room: SimRoom, state: RoomChange, record: dict[str, Any]
) -> Planner:
    """Return the planner; after opening and closing it lets go of the handle and draws back, which goes into the record."""
    if skill.object:
        return Planner(env, config.planner)
    moved = plan_letting_go(env.sim, config.planner, partial(env.task.tool_path, config=env.task.config))
    ajar = [i for i, path in opened_by(room, state).items() if abs(path) > START_ERROR]
    hanging = [i for i in room.articulations if set(room.carriers(i)) & set(ajar)]
    refuse_collision(env.sim.stage, [*ajar, *hanging, *state.objects], env.sim.robot, moved.arm)
    record |= {"approach": round(moved.approach, 3), "retreat": round(moved.retreat, 3)}
    return Planner(env, config.planner, [moved.demonstration])


def refuse_collision(stage: SimStage, moved: Collection[str], spec: RobotSpec, arm: np.ndarray) -> None:
    """Raise InputError where the arm in joints [pose arm], or at home, meets what was moved; its base is for the room before.

    `moved`: ids of parts that stand open and of objects that were moved.
    """
    room, target = stage.room, stage.target
    bodies = {i: body for i, body in room.bodies.items() if i in moved and i != target}
    free = {i: body for i, body in room.free.items() if i in moved}
    obstacles = Obstacles.of_room(replace(room, bodies=bodies, free=free, static_colliders=()), (), stage.grasp[:3])
    path = np.concatenate([arm, [spec.home]])
    depth = Workcell(spec, obstacles).arm_depth(path, matrix(stage.base), fingers=False).max()
    if depth > SLACK:
        raise InputError(
            f"from its base for {target!r} the arm penetrates what earlier skills moved by {1000 * depth:.0f} mm: "
            f"{', '.join([*bodies, *free])}"
        )


@torch.inference_mode()
def _simulate(
    env: VecEnv,
    actor: Policy,
    sim: Simulation,
    stage: SimStage,
    offsets: dict[str, float],
    image: Path | None,
    config: ExecutionConfig,
) -> tuple[dict[str, float], RoomChange]:
    """Step until the episode ends; return the task's metrics, and the state one control step before the end."""
    ended, pose = read_state(sim, stage.active, offsets), sim.joint_q[0].clone()
    for _ in range(env.max_episode_length):
        env.step(actor(env.observation.clone()))
        if env.done[0]:  # the world has been reset
            break
        ended, pose = read_state(sim, stage.active, offsets), sim.joint_q[0].clone()
    if image:
        with atomic_write(image) as file:
            Image.fromarray(Camera(stage, config.camera).image(pose)).save(file)
    values = env.result[0].cpu().tolist()
    return {name: round(value, 5) for name, value in zip(env.columns, values, strict=True)}, ended


def read_state(sim: Simulation, active: Iterable[str], offsets: Mapping[str, float]) -> RoomChange:
    """Return coordinates and poses of what moves in world 0; `offsets`: coordinates that the file calls zero."""
    joints, objects = {}, {}
    coords, bodies = sim.joint_q[0].cpu().numpy(), sim.body_q[0].cpu().numpy()
    for i in active:
        if i in sim.stage.room.articulations:
            at = sim.axis_of(i)[0]
            joints[i] = float(coords[at]) + offsets.get(i, 0.0)
        else:
            objects[i] = tuple(map(float, bodies[sim.body(i)]))
    return RoomChange(joints, objects)


def _refuse_jump(skill: Skill, room: SimRoom, state: RoomChange, began: RoomChange) -> None:
    """Raise where an episode cannot begin as the one before left the part that it moves."""
    if skill.part and skill.part in state.joints:
        was, now = (opened_by(room, each)[skill.part] for each in (state, began))
        if abs(was - now) > START_ERROR:
            raise InputError(
                f"{skill.part} was left open by {was:.3f} m, and its task can begin at {now:.3f} m at most; "
                "nothing was simulated"
            )


def riders(room: SimRoom, part: str) -> list[str]:
    """Return the free objects in or on a part, which move with it: their origin is in the box around the part's hulls."""
    points = np.concatenate([in_scene(room.bodies[part], c.mesh) for c in room.bodies[part].colliders])
    low, high = points.min(axis=0) - BESIDE, points.max(axis=0) + BESIDE
    return [i for i, body in room.free.items() if np.all((low <= body.position) & (np.array(body.position) <= high))]


def missed(skill: Skill, task: type[Task], metrics: dict[str, float]) -> str:
    """Return why a skill does not count as done: the metric, and the values; the record has all metrics."""
    values = ", ".join(f"{name.replace('_', ' ')} {metrics[name]:g}" for name in task.RESULTS.values)
    failed = [name for name in task.RESULTS.rates if name in task.RESULTS.logged and not metrics[name]]
    return (
        f"{skill.words} was simulated, and {task.RESULTS.success} does not hold ({values}; not: {', '.join(failed)})."
    )


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), 3) for value in values]
