"""Sentences executed by a robot that drives, each in one simulation of a live room: does it end right, and what is hit how hard?

    python experiments/driven.py ROOMS [--count 50] [--jobs 4] [--limit 480] [--seed 0] [--out FOLDER]
    python experiments/driven.py ROOMS --goal [--objects 5] [--jobs 4] [--limit 3600] [--seed 0] [--out FOLDER]

ROOMS holds NAME/room.usd for each room (`skill_rooms.py` writes such a folder). The sentences name ids, so that their plans are
right: parts that are opened, opened and closed, two parts one after the other, objects that are put on what carries another
object, or into a drawer. They are drawn by the seed, as many of each room, whatever the robot can reach. Each is a process of one
thread that ends after --limit seconds at most. Prints a line a sentence and writes driven.json after each: what came of it, its
peaks of base and contact forces, and jumps between control steps.

With --goal each room is one task: every part that moves stands open, objects lie where they were scanned, and all parts are to be
shut and so many objects to be on what carries another object, as the seed draws. Writes tidy.json: how many relations hold in the
end, judged on the room as it stands.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import time
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import yaml
from insertion_study import RESULTS
from skill_rooms import message, s2a

from s2a.core.provenance import provenance
from s2a.language.do.facts import gather
from s2a.scene.usd import sim_stage

LIMIT = 20.0  # [N] Of contact forces of base and arm, and of the gripper outside of its grasp


def main() -> None:
    """Execute the sentences and write what came of them."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", type=Path)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--count", type=int, default=50)
    parser.add_argument("--jobs", type=int, default=4)
    parser.add_argument("--limit", type=float, default=480.0, help="[s] of a sentence")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--robot", default="panda_mobile")
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--goal", action="store_true")
    parser.add_argument("--objects", type=int, default=5, help="of a goal")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    names = args.only or sorted(path.parent.name for path in args.rooms.glob("*/room.usd"))
    if args.goal:
        rows: list[dict[str, Any]] = [{"room": name, "goal": goal(name, args)} for name in names]
    else:
        each = [sentences(args.rooms / name / "room.usd", args.seed, -(-args.count // len(names))) for name in names]
        # A sentence of each room in turn: what an interrupted run leaves is of all rooms
        rows = [
            {"room": name, "sentence": some[k]}
            for k in range(max(map(len, each), default=0)) for name, some in zip(names, each, strict=True)
            if k < len(some)
        ][: args.count]  # fmt: skip
    count = counted_goals if args.goal else counted
    args.out.mkdir(parents=True, exist_ok=True)
    about = {**provenance(args.device), "seed": args.seed, "robot": args.robot, "limit": args.limit}
    os.environ["OMP_NUM_THREADS"] = "1"  # of each process
    with ThreadPoolExecutor(args.jobs) as pool:
        for future in as_completed([pool.submit(execute, row, args) for row in rows]):
            future.result()
            ended = [row for row in rows if "done" in row]
            record = {**about, **count(ended, len(rows)), "rows": ended}
            (args.out / ("tidy.json" if args.goal else "driven.json")).write_text(json.dumps(record, indent=1) + "\n")
    print(count(rows, len(rows)))


def counted_goals(rows: list[dict[str, Any]], count: int) -> dict[str, Any]:
    """Return how many relations of the goals that ended hold; `count`: of all rooms."""
    relations = [(words, words in row["unmet"]) for row in rows for words in row["goal"]]
    shut, placed = (
        [unmet for words, unmet in relations if words.endswith(" shut") == is_shut] for is_shut in (True, False)
    )
    return {
        "rooms": count,
        "ended": len(rows),
        "parts shut": f"{shut.count(False)} of {len(shut)}",
        "objects placed": f"{placed.count(False)} of {len(placed)}",
        "with a jump": sum(bool(row["jumps"]) for row in rows),
        f"base or arm above {LIMIT:.0f} N": sum(row["body"] > LIMIT for row in rows),
    }


def goal(name: str, args: argparse.Namespace) -> list[str]:
    """Write the goal of a room beside its record; return its relations."""
    room, draw = sim_stage.read(args.rooms / name / "room.usd", visuals=False), random.Random(f"{name} {args.seed}")
    facts = gather(room, None, {}, "panda")
    carriers = sorted({str(facts[i].on) for i in room.free if facts[i].on and facts[str(facts[i].on)].kind == "fixed"})
    objects = draw.sample(list(room.free), min(args.objects, len(room.free)))
    places = {i: draw.choice(others) for i in objects if (others := [each for each in carriers if each != facts[i].on])}
    file = _record(name, "goal", args).with_suffix(".yaml")
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(yaml.safe_dump({"shut": "all", "on": places}))
    return [*(f"{i} shut" for i in room.articulations), *(f"{i} on {place}" for i, place in places.items())]


def _record(room: str, words: str, args: argparse.Namespace) -> Path:
    return args.out / "driven" / f"{room}_{words.replace(' ', '_')}.json"


def counted(rows: list[dict[str, Any]], count: int) -> dict[str, int]:
    """Return how many of the rows that ended are what; `count`: of all sentences."""
    planned = [row for row in rows if row["skills"]]
    return {
        "sentences": count,
        "ended": len(rows),
        "with a plan that was simulated": len(planned),
        "done": sum(row["done"] for row in rows),
        "beyond the limit": sum(row["late"] for row in rows),
        "with a jump": sum(bool(row["jumps"]) for row in planned),
        f"base or arm above {LIMIT:.0f} N": sum(row["body"] > LIMIT for row in planned),
    }


def sentences(stage: Path, seed: int, count: int) -> list[str]:
    """Return different sentences of a room."""
    room, draw = sim_stage.read(stage, visuals=False), random.Random(f"{stage.parent.name} {seed}")
    facts = gather(room, None, {}, "panda")
    parts, objects = list(room.articulations), list(room.free)
    drawers = [i for i in parts if room.articulations[i].joint.kind == "prismatic"]
    supports = sorted({str(facts[i].on) for i in objects if facts[i].on and facts[str(facts[i].on)].kind == "fixed"})
    every = [f"open {i}" for i in parts] + [f"open {i} and then close {i}" for i in parts]
    every += [f"open {a} and then open {b}" for a in parts for b in parts if a != b]
    placed = [f"put {o} on {s}" for o in objects for s in supports if s != facts[o].on]
    placed += [f"put {o} into {d}" for o in objects for d in drawers]
    draw.shuffle(every)
    draw.shuffle(placed)
    half = min(len(placed), count // 2)
    return [*placed[:half], *every[: count - half]]


def execute(row: dict[str, Any], args: argparse.Namespace) -> None:
    """Do a sentence, and note what came of it."""
    words = row.get("sentence", "goal")
    out = _record(row["room"], words, args)
    out.parent.mkdir(parents=True, exist_ok=True)
    out.unlink(missing_ok=True)  # a refusal leaves an earlier record as it was
    begun, stage = time.perf_counter(), args.rooms / row["room"] / "room.usd"
    keys = [
        f"robot={args.robot}",
        f"stage={stage}",
        "llm=rules",
        f"device={args.device}",
        f"seed={args.seed}",
        f"out={out}",
    ]
    late, problem = False, ""
    try:
        task = [f"goal={out.with_suffix('.yaml')}", "opened=all"] if "goal" in row else [words]
        problem = message(s2a("do", *task, *keys, check=False, timeout=args.limit))
    except subprocess.TimeoutExpired:
        late, problem = True, f"not done within {args.limit:.0f} s"
    record = json.loads(out.read_text()) if out.exists() else {}
    tries = [one for skill in record.get("skills", []) for one in skill["tries"] if "contacts" in one]
    row |= {
        "done": bool(record.get("done")),
        "problem": record["problem"] if record else problem,
        "late": late,
        "skills": len(tries),
        "jumps": record.get("jumps", {}),
        "base_peaks": record.get("base_peaks", {}),
        "body": max((one["contacts"]["body"] for one in tries), default=0.0),
        "gripper": max((one["contacts"]["gripper"] for one in tries), default=0.0),
        "robot_seconds": record.get("robot_seconds", 0.0),
        "seconds": round(time.perf_counter() - begun, 1),
    }
    if "goal" in row:  # without a record none holds
        row["unmet"] = record.get("unmet", dict.fromkeys(row["goal"], problem))
    print(row["room"], words, row["seconds"], row["problem"] or "done", flush=True)


if __name__ == "__main__":
    main()
