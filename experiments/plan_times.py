"""How long does the planner take to plan for the worlds of open_close.py? Nothing is executed.

    python experiments/skill_rooms.py     # once, on any machine
    python experiments/plan_times.py [--num-envs 64] [--device cpu] [--rooms office_0 ...]

Writes experiments/results/plan_times.json: a row a part with the seconds by the clock, for opening and for shutting: of the
search for a base, and of planning for all worlds from there, which is what the last line sums up. Run nothing beside it.
"""

from __future__ import annotations

import argparse
import json
import time
from functools import partial
from pathlib import Path

import numpy as np
from open_close import based, both_tasks, goal_of, settings_of
from skill_jobs import Row
from skill_rooms import DEFAULT, NAMES

from s2a import tasks
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.motion.open import demonstration
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import Simulation
from s2a.sim.world import read_stage

LIMIT = 2.0
"""[s] That planning should take at most."""


def main() -> None:
    """Plan for every part, print and write the seconds."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=Path, default=Path("runs/skills/inputs"), help="of experiments/skill_rooms.py")
    parser.add_argument("--rooms", nargs="*", default=DEFAULT, choices=list(NAMES))
    parser.add_argument("--num-envs", type=int, default=64)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--set", nargs="*", default=[], help="further keys of s2a evaluate")
    parser.add_argument("--out", type=Path, default=Path(__file__).parent / "results/plan_times.json")
    args = parser.parse_args()
    rows: list[Row] = []
    for room in args.rooms:
        for part in sim_stage.read(args.inputs / room / "room.usd", visuals=False).articulations:
            rows.append({"room": room, "part": part} | _row(args, room, part))
            print(json.dumps(rows[-1]), flush=True)
            content = {**provenance(args.device), "num_envs": args.num_envs, "total": _total(rows), "rows": rows}
            with atomic_write(args.out) as file:
                file.write_text(json.dumps(content, indent=1) + "\n")
    print(json.dumps(_total(rows)))


def _total(rows: list[Row]) -> Row:
    """Return what rows come to."""
    seconds = np.array([row[name] for row in rows for name in ("opened", "shut") if name in row])
    if not len(seconds):
        return {"plans": 0}
    within = {f"within_{LIMIT:.0f}_s": int((seconds <= LIMIT).sum())}
    return {
        "plans": len(seconds),
        "median": round(float(np.median(seconds)), 2),
        "most": float(seconds.max()),
        **within,
    }


def _row(args: argparse.Namespace, room: str, part: str) -> Row:
    """Return the seconds that opening and shutting a part took to plan; none where there is no plan."""
    row: Row = {}
    stage = read_stage(args.inputs / room / "room.usd", part)
    for name, task, keys in both_tasks(goal_of(stage)):
        settings = settings_of(stage, task, keys, args)
        try:
            sim = Simulation(based(stage, settings, row, name), settings.sim, args.num_envs, args.device)
            begun = time.perf_counter()
            demonstration(sim, settings.planner, partial(tasks.task(task).tool_path, config=settings.task))
        except InputError:
            continue
        row[name] = round(time.perf_counter() - begun, 2)
    return row


if __name__ == "__main__":
    main()
