"""Does the planner put inserted objects where the insertion put them? Four objects in each of five rooms.

    python experiments/skill_rooms.py     # once, on any machine
    python experiments/pick_place.py [--num-envs 8] [--device cpu] [--jobs 1] [--rooms office_0 ...] [--seeds 0]

Each object is picked from a free spot near its place (task.start=nearby) and placed as its insertion record says, by
`s2a evaluate task=pick_place`. Objects that have a row are not done again. Writes experiments/results/pick_place.json after each:
a row an object and seed, all episodes together with their Wilson 95 % interval, and the largest use of the robot's limits. An
object that cannot be inserted, freed or planned for counts as so many failures, by its cause.
"""

from __future__ import annotations

import argparse
import json
import re
import time
from pathlib import Path

from skill_jobs import Row, arguments, evaluated, one, results, run, summarized
from skill_rooms import NAMES, ROOMS

RESULTS = Path(__file__).parent / "results/pick_place.json"
COLUMNS = ("grasped", "carried", "released_at_rest", "placed", "undisturbed")
"""In the order in which an episode fails."""
VALUES = ("position_error", "angle_error", "drift")


def main() -> None:
    """Do what has no row, and write the results."""
    parser = arguments(__doc__, RESULTS)
    every = [label for labels in ROOMS.values() for label in labels]
    parser.add_argument("--objects", nargs="*", default=every, choices=every, metavar="LABEL")
    args = parser.parse_args()
    if args.one:
        room, label, seed = args.one
        one(_path(args, room, label, seed), lambda: _row(args, room, label, seed))
        return
    jobs = {
        _path(args, room, label, str(seed)): (room, label, str(seed))
        for seed in args.seeds
        for k in range(max(map(len, ROOMS.values())))
        for room in args.rooms
        for label in ROOMS[NAMES[room]][k : k + 1]
        if label in args.objects
    }
    run(jobs, args, lambda: results(list(jobs), len(jobs), args))


def _path(args: argparse.Namespace, room: str, label: str, seed: str) -> Path:
    name = re.sub(r"\W+", "_", label)
    return args.rows / f"{room}_{name}_{seed}.json"


def _row(args: argparse.Namespace, room: str, label: str, seed: str) -> Row:
    """Plan for an object and execute it; return how it went."""
    folder = args.inputs / room
    found = json.loads((folder / "objects.json").read_text())[label]
    row = {"room": room, "object": label, "seed": int(seed)}
    if not found["free"]:
        return row | {"cause": "prepare" if found["id"] else "insert", "why": found["why"]}
    begun = time.perf_counter()
    metrics = evaluated(
        [f"stage={folder}/room.usd", f"part={found['id']}", "task=pick_place", "sim=pick_place", "task.start=nearby",
         f"task.place={folder}/insert.json", f"num_envs={args.num_envs}", f"device={args.device}", f"seed={seed}", *args.set],
        args.rows / "metrics" / _path(args, room, label, seed).name,
    )  # fmt: skip
    row["seconds"] = round(time.perf_counter() - begun, 1)
    return row | (summarized(metrics, COLUMNS, VALUES) if "success" in metrics else metrics)


if __name__ == "__main__":
    main()
