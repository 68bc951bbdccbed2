"""Does the planner put inserted objects into drawers, from shut to shut? One object and one drawer in each of five rooms.

    python experiments/skill_rooms.py     # once, on any machine
    python experiments/put_in.py [--num-envs 8] [--device cpu] [--jobs 1] [--rooms office_0 ...] [--seeds 0]

Pairs are tried from those nearest to each other on: the first pair for which there is a plan is executed, by
`s2a evaluate task=put_in task.start=nearby`, from a free spot near the drawer; why others were refused is in its row. A room
without such a pair counts as so many failures. Rooms that have a row are not done again. Writes
experiments/results/put_in.json after each: a row a room and seed, all episodes together with their Wilson 95 % interval, and
the largest use of the robot's limits.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

from skill_jobs import Row, arguments, evaluated, one, results, run, summarized

RESULTS = Path(__file__).parent / "results/put_in.json"
COLUMNS = ("grasped", "carried", "released_at_rest", "shut_with_it", "stored", "undisturbed")
"""In the order in which an episode fails."""
VALUES = ("position_error", "angle_error", "drift", "remaining")


def main() -> None:
    """Do what has no row, and write the results."""
    args = arguments(__doc__, RESULTS).parse_args()
    if args.one:
        room, seed = args.one
        one(args.rows / f"{room}_{seed}.json", lambda: _row(args, room, seed))
        return
    jobs = {args.rows / f"{room}_{seed}.json": (room, str(seed)) for seed in args.seeds for room in args.rooms}
    run(jobs, args, lambda: results(list(jobs), len(jobs), args))


def _row(args: argparse.Namespace, room: str, seed: str) -> Row:
    """Put the first object that can be into the first drawer that takes it; return how it went."""
    row: Row = {"room": room, "seed": int(seed)}
    refused = []
    for name, part in _pairs(args.inputs / room):
        begun = time.perf_counter()
        metrics = evaluated(
            [f"stage={args.inputs}/{room}/room.usd", f"part={name}", "task=put_in", "sim=put_in", "task.start=nearby",
             f"task.place={part}", f"num_envs={args.num_envs}", f"device={args.device}", f"seed={seed}", *args.set],
            args.rows / "metrics" / f"{room}_{seed}.json",
        )  # fmt: skip
        seconds = round(time.perf_counter() - begun, 1)
        if "success" in metrics:
            row |= {"object": name, "drawer": part, "seconds": seconds, "refused": refused}
            return row | summarized(metrics, COLUMNS, VALUES)
        refused.append({"object": name, "drawer": part, "seconds": seconds, **metrics})
        print(json.dumps(refused[-1]), flush=True)
    return row | {"cause": "no plan", "why": "no pair of an object and a drawer has a plan", "refused": refused}


def _pairs(folder: Path) -> list[tuple[str, str]]:
    """Return the objects and drawers of a room, those nearest to each other first."""
    import numpy as np

    from s2a.scene.usd import sim_stage

    room = sim_stage.read(folder / "room.usd", visuals=False)
    ids = [each["id"] for each in json.loads((folder / "objects.json").read_text()).values() if each["free"]]
    drawers = {i: np.array(a.grasp.point) for i, a in room.articulations.items() if a.joint.kind == "prismatic"}
    away = {(i, d): float(np.linalg.norm(np.subtract(room.free[i].position, drawers[d]))) for i in ids for d in drawers}
    return sorted(away, key=lambda pair: away[pair])


if __name__ == "__main__":
    main()
