"""Skills of a robot that drives, one after the other in one world that goes on: doors stay open, objects where they fell."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import newton
import numpy as np
import torch
from scipy.spatial.transform import Rotation

from s2a import robot as robots
from s2a import tasks
from s2a.core.errors import InputError
from s2a.language.do.episode import (
    ExecutionConfig,
    Outcome,
    RoomChange,
    at_state,
    missed,
    opened_by,
    read_state,
)
from s2a.language.do.plan import Skill
from s2a.motion.floor import FreeFloor
from s2a.motion.obstacles import Obstacles
from s2a.motion.open import CLEARANCES, plan_letting_go
from s2a.motion.part_base import ready_to_move
from s2a.motion.policy import Planner, from_home
from s2a.motion.search import Follow, Search, Stand
from s2a.motion.segments import Drive, Reach, Release, Segment, Straight, Timeline
from s2a.motion.trajectory import Trajectory, preceded
from s2a.motion.workcell import Workcell
from s2a.robot.kinematics import arm_pose
from s2a.robot.spec import DriveSpec
from s2a.robot.tool_path import matrix
from s2a.scene.scene import Joint
from s2a.scene.usd.sim_scene import ALL, SimRoom
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.recorder import RobotContacts
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.env import VecEnv
from s2a.view.states import States

ATTEMPTS = 2  # Of a skill that fails
BACK, BACK_POSES = 0.1, 6  # [m] By which the gripper draws back where the arm finds no path home, in so many poses
SETTLE, STILL = 3.0, 0.02  # [s] and [m/s, rad/s] In which, and below which, a room comes to rest after a skill
FINGERS = 0.8  # [s] In which the fingers open as a skill begins


# [m/s, rad/s] and [m, rad] by which something may move farther in a control step than the faster of its velocities before
# and after it: a physics step's acceleration in contact. And [rad/s] by which what lies free may turn farther
SPARE, TREMBLE, SPIN = 0.3, 1e-3, 10.0
CREEP = 1, 30  # Control steps in which it may go so far beyond its velocities once, or as it starts and as it stops
BETWEEN = 0.05  # Of a way by which it may be longer: velocities are read once in a control step, and targets step there


@dataclass
class LiveFrames:
    """What was where after every control step, from the first skill to the last; the coordinates of a base come first."""

    dt: float  # control step [s]
    q: list[np.ndarray] = field(default_factory=list)  # all coordinates [m, rad], shape [coord]
    qd: list[np.ndarray] = field(default_factory=list)  # all velocities [m/s, rad/s], shape [dof]

    def jumps(
        self, single: dict[str, tuple[int, int, float]], free: dict[str, tuple[int, int, float]]
    ) -> dict[str, float]:
        """Return by how much something moved or turned beyond what its velocities allow, by its name: a teleport.

        Args:
            single: column of coordinate and velocity of what has one, and the limit of the velocity [m/s, rad/s].
            free: first columns of objects that lie free, and distance of the centre of mass from the origin [m].
        """
        q, qd = np.array(self.q, float), np.abs(np.array(self.qd, float))
        excess: dict[str, float] = {}
        for steps in [each for each in CREEP if len(q) > each]:
            for name, (i, j, limit) in single.items():
                most = np.minimum(qd[:, j], limit)
                self._beyond(excess, name, np.abs(q[steps:, i] - q[:-steps, i]), most, steps, SPARE)
            for name, (i, j, lever) in free.items():
                speed, spin = (np.linalg.norm(qd[:, k : k + 3], axis=1) for k in (j, j + 3))
                far = np.linalg.norm(q[steps:, i : i + 3] - q[:-steps, i : i + 3], axis=1)
                self._beyond(excess, name, far, speed + lever * spin, steps, SPARE)
                turned = Rotation.from_quat(q[:, i + 3 : i + 7])
                self._beyond(excess, name, (turned[steps:] * turned[:-steps].inv()).magnitude(), spin, steps, SPIN)
        return excess

    def _beyond(
        self, excess: dict[str, float], name: str, moved: np.ndarray, speed: np.ndarray, steps: int, spare: float
    ) -> None:
        """Note how much farther something moved in so many steps than its speed [frame] and what it may beside allow."""
        way = np.concatenate([[0.0], np.cumsum((1.0 + BETWEEN) * self.dt * np.maximum(speed[1:], speed[:-1]))])
        beyond = float((moved - (way[steps:] - way[:-steps])).max())
        if not beyond <= min(steps, 2) * (spare * self.dt + TREMBLE):  # or no number
            excess[name] = max(beyond, excess.get(name, beyond))


class LiveRoom:
    """A room in which everything moves, and a robot that drives in it.

    Attributes:
        frames: of all skills so far.
        contacts: peaks of the contact forces.
    """

    def __init__(self, file: Path, room: SimRoom, config: ExecutionConfig, start: RoomChange | None = None) -> None:
        """Put the robot on the widest free floor of the room as it starts; None: as in its file.

        Raises:
            InputError: nothing moves in the room, or no floor is free for the base.
        """
        self._file, self._room, self._config, self._spec = file, room, config, robots.load(config.robot)
        start = start or RoomChange()
        floor = FreeFloor(at_state(room, start), self._spec)
        if not room.movable:
            raise InputError(f"room {room.name!r} has no part that moves; prepare it with targets=all")
        first = room.movable[0]
        joint, grasp = _handle(room, first)
        stage = SimStage(
            file, first, joint, _vector(floor.height, self._drive, floor.now), grasp, np.zeros(3), room.static_visual,
            (float(self._drive.mount[2]), self._spec.base.radius), config.robot, (ALL,), room=room,
        )  # fmt: skip
        self._sim = Simulation(stage, config.sim, 1, config.device)
        self._floor_height, self.frames = floor.height, LiveFrames(config.sim.control_dt)
        self.contacts = RobotContacts(self._sim)
        count = self._spec.base_joints
        places = {i: self._sim.axis_of(i) for i in room.movable}
        self._columns = {i: (count + coord, count + dof) for i, (coord, dof) in places.items()}
        self._dofs = np.array(
            [count + dof + k for i, (_, dof) in places.items() for k in range(6 if i in room.free else 1)], int
        )
        for i, values in {**{i: (q,) for i, q in start.joints.items()}, **start.objects}.items():
            coord = places[i][0]
            self._sim.joint_q[0, coord : coord + len(values)] = torch.tensor(values)
        sim = self._sim
        newton.eval_fk(sim.model, sim.state.joint_q, sim.state.joint_qd, sim.state)

    @property
    def _drive(self) -> DriveSpec:
        assert self._spec.drive is not None
        return self._spec.drive

    @property
    def state(self) -> RoomChange:
        """Where everything is now."""
        return read_state(self._sim, self._room.movable, {})

    def states(self, success: bool) -> States:
        """Return where everything was after every control step; `success`: the sentence was done."""
        q, sim, columns = np.array(self.frames.q), self._sim, self._columns
        start = _vector(self._floor_height, self._drive, np.array([*q[0, :3], 0.0]))
        return States(
            sim.config.control_frequency, self._spec.name, start, layer_hash(self._file), ["world 0"],
            [q[:, : self._spec.base_joints + sim.layout.robot_joints]],
            {i: [q[:, columns[i][0]]] for i in self._room.articulations},
            {i: [q[:, columns[i][0] : columns[i][0] + 7]] for i in self._room.free}, [success],
        )  # fmt: skip

    def about(self) -> dict[str, Any]:
        """Return what the record says of the whole simulation."""
        frames, names = self.frames, ("x", "y", "yaw", "lift")
        # no frame: nothing was simulated
        moved = np.abs([each[: len(names)] for each in frames.qd]).reshape(-1, len(names))
        peaks = moved.max(axis=0, initial=0.0)
        limits = (*self._drive.velocity, *self._spec.limits.velocity)
        fastest = dict(zip((*names, *self._spec.arm_joints), limits, strict=True))
        robot = {name: (k, k, fastest.get(name, math.inf)) for k, name in enumerate((*names, *self._spec.joints))}
        single = robot | {i: (*self._columns[i], math.inf) for i in self._room.articulations}
        levers = {i: float(np.linalg.norm(body.mass.center)) for i, body in self._room.free.items()}
        return {
            "between_skills": "the robot drives; it is one simulation, in which nothing is set back",
            "robot_seconds": self._seconds(0),
            "base_peaks": dict(zip(names, map(float, peaks.round(3)), strict=False)),
            "base_limits": dict(zip(names, self._drive.velocity, strict=True)),
            "jumps": frames.jumps(single, {i: (*self._columns[i], lever) for i, lever in levers.items()}),
        }

    @torch.inference_mode()
    def settle(self) -> RoomChange:
        """Let time pass, the robot where it is, until nothing else moves, 3 s at most; return where everything is then."""
        for _ in range(math.ceil(SETTLE * self._sim.config.control_frequency)):
            self._sim.step()
            self._keep()
            if np.abs(self.frames.qd[-1][self._dofs]).max(initial=0.0) < STILL:
                break
        return self.state

    def execute(self, skill: Skill, *_unused: object) -> Outcome:
        """Drive to where a skill can be done, and do it; where that fails, once more from how the room is then."""
        start = time.perf_counter()
        record: dict[str, Any] = {**vars(skill), "began": {"step": len(self.frames.q)}, "tries": []}
        for _ in range(ATTEMPTS):
            attempt: dict[str, Any] = {"step": len(self.frames.q)}
            try:
                outcome = self._try(skill, attempt)
            except InputError as error:
                outcome = Outcome(False, f"{skill.words}: {error}.", self.state)
            if len(self.frames.q) > attempt["step"]:
                outcome = replace(outcome, state=self.settle())
            record["tries"].append(attempt | {"success": outcome.success, "reason": outcome.reason})
            if outcome.success or len(self.frames.q) == attempt["step"]:  # nothing moved: it would be planned alike
                break
        record |= {"success": outcome.success, "reason": outcome.reason, "ended": outcome.state.plain()}
        record |= {
            "robot_seconds": self._seconds(record["began"]["step"]),
            "seconds": round(time.perf_counter() - start, 1),
        }
        return replace(outcome, record=record)

    def _seconds(self, step: int) -> float:
        return round((len(self.frames.q) - step) * self._sim.config.control_dt, 1)

    def _try(self, skill: Skill, attempt: dict[str, Any]) -> Outcome:
        """Plan and simulate; fills the attempt."""
        config, state = self._config, self.state
        settings = getattr(config.skills, skill.skill)
        task = tasks.task(settings.task.name)
        mdp = task.requested(
            settings.task, (skill.support or skill.part) if skill.object else None,
            opened_by(self._room, state).get(skill.part or "", 0.0),
        )  # fmt: skip
        now = at_state(self._room, state, (skill.part,) if skill.part else ())
        floor = FreeFloor(at_state(self._room, state), self._spec, self._base)
        planner = replace(config.planner, start_noise=0.0)
        home = self._to_home(now, state, floor)
        stage = task.read_stage(
            self._sim.stage.path, skill.object or skill.part, config.robot, (ALL,), mdp, planner, now, floor
        )
        path_of = partial(task.tool_path, motion=planner, config=mdp)
        if not skill.object:
            stage = ready_to_move(stage, path_of, self._spec, 0.0, config.seed, may_push=task.PUSHES, floor=floor)
        route = floor.path(floor.stands(matrix(stage.base), stage.pedestal[0]), config.seed)
        if route is None:
            raise InputError(f"the base has no free path to ({stage.base[0]:.2f}, {stage.base[1]:.2f})")
        self._sim.aim(stage)
        self.contacts.aim()
        env = tasks.make_env(self._sim, mdp, settings.metrics, {}, config.seed, continues=True)
        before = self._timeline([*home, Drive(route)])
        own = self._own(skill, env, planner)
        assert before.base is not None
        whole = preceded(own, before.targets, before.base)
        fingers = math.ceil(FINGERS * self._sim.config.control_frequency)
        actor = Planner(env, planner, trajectory=replace(whole, reach_steps=fingers))
        env.lengthen(actor.episode_steps)
        attempt |= {"base": _rounded(floor.stands(matrix(stage.base), stage.pedestal[0])), "drive": len(route)}
        metrics = self._simulate(env, actor)
        metric = task.RESULTS.success
        success = metrics[metric] == 1.0
        attempt |= {"metric": metric, "metrics": metrics, "contacts": self.contacts.peaks()}
        return Outcome(success, "" if success else missed(skill, task, metrics), self.state)

    def _own(self, skill: Skill, env: VecEnv, planner: Any) -> Trajectory:
        """Return the trajectory of a skill, from home on."""
        if skill.object:
            own = env.task.trajectory(planner)
            assert own is not None, "a task that carries an object plans its own trajectory"
            return own
        moved = plan_letting_go(self._sim, planner, partial(env.task.tool_path, config=env.task.config))
        return from_home(self._sim, moved.demonstration, planner)

    @property
    def _base(self) -> np.ndarray:
        return self._sim.base_q[0].cpu().numpy().astype(float)

    @property
    def _arm(self) -> np.ndarray:
        return self._sim.joint_target_q[0, : len(self._spec.arm_joints)].cpu().numpy().astype(float)

    def _to_home(self, room: SimRoom, state: RoomChange, floor: FreeFloor) -> list[Segment]:
        """Return the segments that bring the arm from where it is to home, around all that stands there now."""
        arm, home = self._arm, np.array(self._spec.home)
        if np.allclose(arm, home, atol=1e-3):
            return [Release()]
        base = arm_pose(self._drive, self._base, floor.height)
        cell = Workcell(self._spec, Obstacles.of_room(at_state(self._room, state), (), base[:3, 3]), floor)
        search = Search(self._spec, cell.kin, self._config.seed)
        depth = cell.empty(base)
        for back in ([arm[None]], search.paths([Stand(base)], _backwards(cell, base, arm))[0]):
            for first in back:
                motions = (
                    search.moved(cell, first[-1], home, depth, more, again) for again, more in enumerate(CLEARANCES)
                )
                path = next((each for each in motions if each is not None), None)
                if path is not None:
                    slow = [Straight(first, self._config.planner.approach_time)] if len(first) > 1 else []
                    return [Release(), *slow, Reach(path, self._config.planner.reach_time)]
        deep = float(depth(np.stack([arm, home]), 0.0).max())
        raise InputError(f"the arm has no free path to its home pose; it penetrates the room by {1000 * deep:.0f} mm")

    def _timeline(self, segments: list[Segment]) -> Timeline:
        sim = self._sim
        line = Timeline(
            self._arm, self._spec, sim.plan_limits, sim.config.control_frequency, self._config.planner.close_time,
            base=sim.base_target_q[0].cpu().numpy().astype(float),
        )  # fmt: skip
        return line.add(segments)

    @torch.inference_mode()
    def _simulate(self, env: VecEnv, actor: Planner) -> dict[str, float]:
        """Step until the episode ends; return the task's metrics."""
        env.reset_all()
        for _ in range(env.max_episode_length):
            env.step(actor(env.observation.clone()))
            self._keep()
            if env.done[0]:
                break
        values = env.result[0].cpu().tolist()
        return {name: round(value, 5) for name, value in zip(env.columns, values, strict=True)}

    def _keep(self) -> None:
        """Add a frame."""
        sim, frames = self._sim, self.frames
        frames.q.append(np.concatenate([each[0].cpu().numpy() for each in (sim.base_q, sim.joint_q)]))
        frames.qd.append(np.concatenate([each[0].cpu().numpy() for each in (sim.base_qd, sim.joint_qd)]))


def _backwards(cell: Workcell, base: np.ndarray, arm: np.ndarray) -> Follow:
    """Return the segment on which the gripper draws straight back from where it is, with the arm in joints [arm]."""
    tool = base @ cell.kin.tool(arm[None])[0]
    poses = np.tile(tool, (BACK_POSES, 1, 1))
    poses[:, :3, 3] -= np.linspace(0.0, BACK, BACK_POSES)[:, None] * tool[:3, 2]
    return Follow("back", 0, poses, lambda _, path: cell.met(path, base), 1, near=arm[None])


def _handle(room: SimRoom, i: str) -> tuple[Any, np.ndarray]:
    """Return the joint and grasp of a part; of a free object what stands for them."""
    if i in room.articulations:
        grasp = room.articulations[i].grasp
        return room.articulations[i].joint, np.array([*grasp.point, *grasp.orientation])
    body = room.free[i]
    return Joint("prismatic", (1.0, 0.0, 0.0), body.position, (0.0, 1.0)), np.array([*body.position, *body.orientation])


def _vector(floor: float, drive: DriveSpec, q: np.ndarray) -> np.ndarray:
    return Stand(arm_pose(drive, q, floor)).vector


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), 3) for value in values]
