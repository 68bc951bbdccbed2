"""One skill in one simulated episode, from a state of the room to the next; verified by the task's own metric."""

from __future__ import annotations

import time
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import torch
from PIL import Image

from s2a import tasks
from s2a.core.errors import InputError
from s2a.core.outputs import temporary_folder
from s2a.env.vec_env import VecEnv
from s2a.language.do import state as states
from s2a.language.do.handle import motion, refuse_collision
from s2a.language.do.plan import Skill
from s2a.language.do.settings import ExecutionConfig
from s2a.language.do.state import RoomChange
from s2a.planner.motion import Planner
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.sim.camera import Camera
from s2a.sim.simulation import Simulation, device_of
from s2a.sim.world import SimStage, axis_of

TASKS = {"open": "open_part", "close": "close_part", "pick_place": "pick_place", "put_in": "put_in"}
SUCCESS = {"open": "final_success", "close": "final_success", "pick_place": "success", "put_in": "success"}
"""The metric of the task by which a skill counts as done: what was opened or closed is so at the end."""
START_ERROR = 0.01
"""[m] By which a part may stand elsewhere at the start of an episode than the one before left it."""
BESIDE = 0.02
"""[m] Within which of a part's box a free object counts as in or on it, and moves with it."""


@dataclass(frozen=True)
class Outcome:
    """How a skill went.

    Attributes:
        success: by the task's own metric.
        reason: why not; empty after a success.
        state: the room afterwards; as before where nothing was simulated.
        record: plain values for JSON.
    """

    success: bool
    reason: str
    state: RoomChange
    record: dict[str, Any] = field(default_factory=dict)


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
        # A part that is closed starts at its coordinate; all others are where they stand.
        own = (skill.part,) if skill.part and skill.skill == "close" else ()
        path = folder / "room.usd" if changed else file
        if changed:
            states.write(room, state, own, path)
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
    mdp = _mdp(skill, settings.task, room, state)
    now = states.at_state(room, state)
    also = riders(now, skill.part) if skill.skill in ("open", "close") and skill.part else []
    task = tasks.task(TASKS[skill.skill])
    stage = task.read_stage(path, skill.object or skill.part, config.robot, also, mdp)
    sim = Simulation(stage, config.sim, 1, device_of(config.device))
    env = tasks.make_env(sim, mdp, settings.metrics, {}, config.seed)
    planner = _planner(skill, env, config, room, state, record)
    env.reset_all()
    offsets = {i: 0.0 if i in own else q for i, q in state.joints.items()}
    began = _read(sim, stage, offsets)
    _refuse_jump(skill, room, state, began)
    record["began"] |= {**began.plain(), "arm": "at home, with start noise", "base": _rounded(stage.base)}
    metrics, ended = _simulate(env, planner, sim, stage, offsets, image, config)
    after = state.with_(ended)
    success = metrics[SUCCESS[skill.skill]] == 1.0
    record |= {"ended": ended.plain(), "metric": SUCCESS[skill.skill], "metrics": metrics}
    return Outcome(success, "" if success else _missed(skill, metrics), after)


def _mdp(skill: Skill, mdp: Any, room: SimRoom, state: RoomChange) -> Any:
    """Return the task's settings with what the skill says."""
    if skill.skill == "close":
        return replace(mdp, start_opening=max(states.opened_by(room, state).get(skill.part or "", 0.0), 1e-3))
    if skill.skill in ("pick_place", "put_in"):
        return replace(mdp, start=None, place=skill.support or skill.part)
    return mdp


def _planner(
    skill: Skill, env: VecEnv, config: ExecutionConfig, room: SimRoom, state: RoomChange, record: dict[str, Any]
) -> Planner:
    """Return the planner; after opening and closing it lets go of the handle and draws back, which goes into the record."""
    if skill.object:
        return Planner(env, config.planner)
    found = motion(env, config.planner)
    ajar = [i for i, path in states.opened_by(room, state).items() if abs(path) > START_ERROR]
    hanging = [i for i in room.articulations if set(room.carriers(i)) & set(ajar)]
    refuse_collision(env.sim.stage, [*ajar, *hanging, *state.objects], env.sim.robot, found.arm)
    record |= {"approach": round(found.approach, 3), "retreat": round(found.retreat, 3)}
    return Planner(env, config.planner, [found.demonstration])


@torch.inference_mode()
def _simulate(
    env: VecEnv,
    planner: Planner,
    sim: Simulation,
    stage: SimStage,
    offsets: dict[str, float],
    image: Path | None,
    config: ExecutionConfig,
) -> tuple[dict[str, float], RoomChange]:
    """Step until the episode ends; return the task's metrics, and the state one control step before the end."""
    ended, pose = _read(sim, stage, offsets), sim.joint_q[0].clone()
    for _ in range(env.max_episode_length):
        env.step(planner(env.observation.clone()))
        if env.done[0]:  # the world has been reset
            break
        ended, pose = _read(sim, stage, offsets), sim.joint_q[0].clone()
    if image:
        Image.fromarray(Camera(stage, config.camera).image(pose)).save(image)
    values = env.result[0].cpu().tolist()
    return {name: round(value, 5) for name, value in zip(env.columns, values, strict=True)}, ended


def _read(sim: Simulation, stage: SimStage, offsets: dict[str, float]) -> RoomChange:
    """Return coordinates and poses of what moves in world 0; `offsets`: coordinates that the file calls zero."""
    joints, objects = {}, {}
    coords, bodies = sim.joint_q[0].cpu().numpy(), sim.body_q[0].cpu().numpy()
    for i in stage.active:
        if i in stage.room.articulations:
            at = axis_of(sim.world, i, stage.room.articulations[i].joint.kind)[0]
            joints[i] = float(coords[at]) + offsets.get(i, 0.0)
        else:
            objects[i] = tuple(map(float, bodies[sim.body(i)]))
    return RoomChange(joints, objects)


def _refuse_jump(skill: Skill, room: SimRoom, state: RoomChange, began: RoomChange) -> None:
    """Raise where an episode cannot begin as the one before left the part that it moves."""
    if skill.part and skill.part in state.joints:
        was, now = (states.opened_by(room, each)[skill.part] for each in (state, began))
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


def _missed(skill: Skill, metrics: dict[str, float]) -> str:
    """Return why a skill does not count as done."""
    values = ", ".join(f"{name} {value:g}" for name, value in metrics.items())
    return f"{skill.words} was simulated, and {SUCCESS[skill.skill]} does not hold ({values})."


def _rounded(values: np.ndarray) -> list[float]:
    return [round(float(value), 3) for value in values]
