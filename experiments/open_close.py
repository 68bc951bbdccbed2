"""Does the planner open every part of five rooms, and shut it again?

    python experiments/skill_rooms.py     # once, on any machine
    python experiments/open_close.py [--num-envs 64] [--device cpu] [--jobs 1] [--rooms office_0 ...] [--seeds 0 1 2]

Every part is opened from a noisy start to 75 % of its range, or by 0.2 m or 60 degrees where that is less, and in episodes of
their own it is shut from there, until 1 cm is left; without the spring that would shut it. For each of both the robot stands
at the prepared base, else at one that is searched for. What counts is how the part stands at the end. Parts that have a row are
not done again. Writes experiments/results/open_close.json after each: a row a part, with a count a seed of what was opened and
shut, the worst opening at the end [m], the seconds (by the clock, of the processor) that planning for all worlds took and those
of the base's search, and the largest use of the robot's limits.
"""

from __future__ import annotations

import argparse
import math
import time
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from skill_jobs import Row, arguments, cause_of, one, results, run

RESULTS = Path(__file__).parent / "results/open_close.json"
FRACTION, SLIDE, TURN = 0.75, 0.2, math.radians(60.0)
"""Of the range, [m] and [rad]: how far a part is opened at most."""
BEYOND = 0.02
"""[m] By which the planner's target passes the opening that counts: the arm lags, and a grip creeps."""
LAG = 30
"""Control steps for which the arm comes after the end of its plan."""


def main() -> None:
    """Do what has no row, and write the results."""
    args = arguments(__doc__, RESULTS).parse_args()
    if args.one:
        room, part = args.one
        one(args.rows / f"{room}_{part}.json", lambda: _row(args, room, part))
        return
    jobs = {args.rows / f"{room}_{part}.json": (room, part) for room in args.rooms for part in _parts(args, room)}
    run(jobs, args, lambda: results(list(jobs), len(jobs), args))


def _parts(args: argparse.Namespace, room: str) -> list[str]:
    """Return the parts of a room, those with hinges first: they take longest."""
    from s2a.scene.usd import sim_stage

    parts = sim_stage.read(args.inputs / room / "room.usd", visuals=False).articulations
    return sorted(parts, key=lambda part: parts[part].joint.kind == "prismatic")


def _row(args: argparse.Namespace, room: str, part: str) -> Row:
    """Open a part and shut it; return how it went."""
    from s2a.sim.world import read_stage

    begun, stage = time.perf_counter(), read_stage(args.inputs / room / "room.usd", part)
    row: Row = {"room": room, "part": part, "kind": stage.joint.kind, "travel": round(stage.travel, 3)}
    row["episodes"] = 2 * args.num_envs * len(args.seeds)
    goal = goal_of(stage)
    row["goal"] = round(goal, 4)
    failed = _both(stage, goal, args, row)
    counts = [count for name in ("opened", "shut") for count in row.get(name, [])]
    row["planned"], hits = args.num_envs * len(counts), sum(counts)
    row |= {"success": hits / row["episodes"], "seconds": round(time.perf_counter() - begun, 1)}
    return row | {"cause": " and ".join(failed)}


def goal_of(stage: Any) -> float:
    """Return how far a part is to be opened [m], along the handle's path."""
    most = SLIDE if stage.joint.kind == "prismatic" else TURN * stage.lever_arm
    return min(FRACTION * stage.travel, most)


def both_tasks(goal: float) -> list[tuple[str, str, dict[str, float]]]:
    """Return what is done with a part: name, task, and its keys of s2a evaluate."""
    ahead = {"planner.opening": goal + BEYOND, "metrics.success_opening": goal, "metrics.full_travel": 1e-3}
    away = {"task.termination_opening": 10.0, "task.full_travel": 1e-3}
    return [("opened", "open_part", ahead | away), ("shut", "close_part", {"task.start_opening": goal})]


def _both(stage: Any, goal: float, args: argparse.Namespace, row: Row) -> list[str]:
    """Open and shut a part; fill the row, and return what failed."""
    from s2a.core.errors import InputError

    failed = []
    for name, task, keys in both_tasks(goal):
        settings = settings_of(stage, task, keys, args)
        try:
            row |= _episodes(based(stage, settings, row, name), settings, args, row, name)
        except InputError as error:
            row |= {f"{name}_{key}": text for key, text in cause_of(error).items()}
        if any(count < args.num_envs for count in row.get(name, [0])):
            failed.append(f"not {name}" + (f" ({row[key]})" if (key := f"{name}_cause") in row else ""))
    return failed


def based(stage: Any, settings: Any, row: Row, name: str) -> Any:
    """Return the stage with a base for all of a task; the row notes which, and the seconds."""
    from s2a import robot, tasks
    from s2a.motion.part_base import ready_to_move

    begun = time.perf_counter()
    task = tasks.task(settings.task.name)
    path_of = partial(task.tool_path, motion=settings.planner, config=settings.task)
    spec, noise = robot.load(stage.robot), settings.planner.start_noise
    found = ready_to_move(stage, path_of, spec, noise, may_push=task.PUSHES)
    row[f"{name}_by"] = "handle" if found.push is None else "push"
    row[f"{name}_base"] = "prepared" if found is stage else "searched"
    row[f"{name}_base_seconds"] = round(time.perf_counter() - begun, 1)
    return found


def settings_of(stage: Any, task: str, keys: dict[str, float], args: argparse.Namespace) -> Any:
    """Return the settings of s2a evaluate."""
    from s2a.commands.evaluate import Config
    from s2a.core import config

    said = [f"{key}={value}" for key, value in keys.items()]
    # One motor drives both fingers; as two springs of their own they let a lid of 6 kg sag by 2 cm.
    fixed = ["sim.joint.stiffness=0", "sim.coupled_fingers=true"]
    said += [f"stage={stage.path}", f"part={stage.target}", "out=-", f"task={task}", *fixed, *args.set]
    return config.load(Config, config.compose("evaluate", said))


def _episodes(stage: Any, settings: Any, args: argparse.Namespace, row: Row, name: str) -> Row:
    """Return how many worlds did a task, a count a seed, with the largest use of limits, and how long planning took.

    That is the seconds by the clock and of the processor, once for all worlds and seeds; other processes may run.
    """
    from s2a import tasks
    from s2a.learn.evaluate import run_episodes
    from s2a.motion.open import demonstration
    from s2a.motion.policy import Planner
    from s2a.sim.recorder import LimitUse
    from s2a.sim.simulation import Simulation
    from s2a.tasks import make_env

    sim = Simulation(stage, settings.sim, args.num_envs, args.device)
    counts: list[int] = []
    ends: list[float] = []
    used = dict(row.get("limit_use", {}))
    begun, used_before = time.perf_counter(), time.process_time()
    motion = demonstration(
        sim, settings.planner, partial(tasks.task(settings.task.name).tool_path, config=settings.task)
    )
    planning = [time.perf_counter() - begun, time.process_time() - used_before]
    for seed in args.seeds:
        env = make_env(sim, settings.task, settings.metrics, {}, seed)
        planner = Planner(env, settings.planner, [motion])
        if planner.steps + LAG > env.max_episode_length:  # near a singularity, or around an open part, it takes longer
            env = make_env(sim, replace(settings.task, episode_steps=planner.steps + LAG), settings.metrics, {}, seed)
            planner = Planner(env, settings.planner, [motion])
        use = LimitUse(sim)
        columns = run_episodes(env, planner, lambda env=env, use=use: use.watch(env.episode_step == 0))  # type: ignore[misc]
        counts.append(int(columns["final_success"].sum()))
        ends += [float(columns["opening"].min()) if name == "opened" else float(columns["remaining"].max())]
        used = {key: max(used.get(key, 0.0), round(value, 3)) for key, value in use.fractions().items()}
        if "grasp_success" in columns:
            row.setdefault("grasped", []).append(int(columns["grasp_success"].sum()))
    worst = min(ends) if name == "opened" else max(ends)
    times = [round(each, 2) for each in planning]
    return {name: counts, f"{name}_worst": round(worst, 3), "limit_use": used, f"{name}_planning": times}


if __name__ == "__main__":
    main()
