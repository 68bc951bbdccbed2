"""Twelve objects at once into each of ten rooms of unseen seeds, by the rules.

    python experiments/twelve_at_once.py [--runs runs/twelve] [--seeds 100 101] [--rooms kitchen ...] [--count 12] [--name rules]

Rooms and objects are made unless they are there. The objects of a room are drawn from the category of the zoo that belongs
there, by the room's seed. What came of it is rated by placement_checks.py, which shares no code with what places, in the room
with all twelve; right is what passes all its checks. Prints a line a room, and writes one an object to
experiments/results/twelve_NAME.json. Seconds are of reading the room, insertion and files: wall, and CPU of all processes.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

import numpy as np
from insertion_study import RESULTS, ROOMS, _insert_settings, _stage, _zoo
from placement_checks import CHECKS, Placed, Truth, check, up_and_front
from scipy.spatial.transform import Rotation

from s2a.core.provenance import provenance
from s2a.language.ask import Record
from s2a.language.client import choose
from s2a.language.insert.batch import insert_into, open_room
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import Inserted, ObjectRequest

CATEGORY = {room: category for category, room in ROOMS.items() if category != "foreign"}


def main() -> None:
    """Insert into every room and write what came of it."""
    parser = parser_of(__doc__, Path("runs/twelve"), list(CATEGORY))
    parser.add_argument("--count", type=int, default=12)
    args = study_arguments(parser)
    rooms = []
    for seed in args.seeds:
        for name in args.rooms:
            rooms.append(_room(name, seed, args))
            print(line_of(rooms[-1]), flush=True)
            _write(rooms, args)
    print(json.dumps(summary(rooms)))


def parser_of(text: str | None, runs: Path, rooms: list[str]) -> argparse.ArgumentParser:
    """Return the arguments of a program that inserts into virtual rooms."""
    parser = argparse.ArgumentParser(description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=runs)
    parser.add_argument("--seeds", nargs="*", type=int, default=[100, 101])
    parser.add_argument("--rooms", nargs="*", default=rooms, choices=rooms)
    parser.add_argument("--name", default="rules")
    parser.add_argument("--llm", default="rules", choices=["rules", "chat", "replay"])
    parser.add_argument("--recordings", type=Path, help="folder of a model's answers, a file a room")
    parser.add_argument("settings", nargs="*", help="of `s2a insert`, such as llm.model=gpt-4o-mini")
    return parser


def study_arguments(parser: argparse.ArgumentParser) -> argparse.Namespace:
    """Return what was given, with what the functions of the insertion study ask for besides."""
    args = parser.parse_intermixed_args()
    if (args.llm != "rules") != bool(args.recordings):
        parser.error("--llm chat and --llm replay need --recordings FOLDER, and --llm rules has none")
    args.seed = 0
    return args


def _write(rooms: list[dict], args: argparse.Namespace) -> None:
    report = {"llm": args.llm, "seeds": args.seeds, "zoo_seed": 0, **provenance("cpu")}
    report |= {"summary": summary(rooms), "rooms": rooms}
    (RESULTS / f"twelve_{args.name}.json").write_text(json.dumps(report, indent=1) + "\n")


def _room(name: str, seed: int, args: argparse.Namespace) -> dict:
    """Insert the objects of one room; return a row with one an object."""
    stage, zoo = _stage(name, seed, args), _zoo(args)
    settings = _insert_settings(stage, f"{name}_{seed}", [f"out={args.runs / 'out' / f'{name}_{seed}'}"], args)
    truth = _drawn(zoo, CATEGORY[name], seed, args.count)
    requests = [ObjectRequest(zoo / one["object"], one["label"]) for one in truth]
    wall, cpu = time.perf_counter(), _cpu()
    room = open_room(settings)
    opened = time.perf_counter() - wall
    done = insert_into(room, requests, choose(settings.llm, settings.record, rules), settings)
    seconds = {"wall": time.perf_counter() - wall, "cpu": _cpu() - cpu, "opening": opened}
    placed = iter(done.inserted)
    rows = []
    for one, record in zip(truth, done.records, strict=True):
        inserted = None if record["problem"] else next(placed)
        rows.append(row_of(one, inserted, record, room.scene))
    rounded = {key: round(value, 1) for key, value in seconds.items()}
    return {"room": name, "seed": seed, "seconds": rounded, "right": sum(row["right"] for row in rows), "objects": rows}


def row_of(one: dict, inserted: Inserted | None, record: Record, scene) -> dict:
    """Return the row of an object: its line of the zoo's truth, what was made of it, and the independent checks."""
    row = {"object": one["label"], "written": inserted is not None, "right": False}
    if inserted is None:
        return row | {"problem": record["problem"][:300]}
    plan = record.get("plan again", record["plan"])
    up, front = up_and_front(plan, one["up"], one["front"], inserted.placement.orientation)
    known = Truth(one["label"], max(one["size"]), one["size"][2], one["placement"])
    turned = Rotation.from_quat(inserted.placement.orientation).inv().apply(inserted.part.mesh.vertices)
    placed = Placed(inserted.part.mesh, up, front, float(np.ptp(turned, axis=0).max()))
    found = check(scene, placed, known, inserted.placement.part_id)
    return row | found | {"failed": [check for check in CHECKS if not found[check]]}


def _drawn(zoo: Path, category: str, seed: int, count: int) -> list[dict]:
    """Return the truth of some objects of a category."""
    objects = json.loads((zoo / "truth.json").read_text())["objects"].values()
    own = [one for one in objects if one["category"] == category]
    return [own[i] for i in np.random.default_rng(seed).permutation(len(own))[:count]]


def _cpu() -> float:
    """Return the CPU time of this process and its children [s]."""
    return sum(os.times()[:4])


def summary(rooms: list[dict]) -> dict:
    """Return counts over all rooms, failures by check, and the longest times."""
    rows = [row for room in rooms for row in room["objects"]]
    failed = {check: sum(check in row.get("failed", ()) for row in rows) for check in CHECKS}
    longest = {key: max(room["seconds"][key] for room in rooms) for key in ("wall", "cpu")}
    counts = {"objects": len(rows), "right": sum(row["right"] for row in rows)}
    return counts | {"refused": sum(not row["written"] for row in rows), "failed": failed, "longest": longest}


def line_of(room: dict) -> str:
    """Return a room's counts and what is wrong in it, a line each."""
    wrong = [
        f"{row['object']}: {row.get('problem') or row['failed']}"[:110] for row in room["objects"] if not row["right"]
    ]
    head = f"{room['room']} {room['seed']}: {room['right']}/{len(room['objects'])}, {room['seconds']}"
    return "\n  ".join([head, *wrong])


if __name__ == "__main__":
    main()
