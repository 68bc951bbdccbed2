"""Labelled objects into ten rooms of unseen seeds, each alone: by the rules, by a model, or by its recorded answers.

    python experiments/other_objects.py [--objects other | zoo] [--llm rules | chat | replay] [--recordings FOLDER] [--name NAME]
        [--runs runs/other] [--seeds 100 101] [--rooms kitchen ...] [--draws 2] [--objects-seed 7] [--at-once 20]
        [--images FOLDER] [llm.model=...]

"other" are the fifty kinds of other_kinds.py, each drawn twice; "zoo" are the hundred of `s2a zoo`, dealt out over the rooms of
the seeds. With `--llm chat` a model is asked (OPENAI_API_KEY, OPENAI_BASE_URL), of many objects at a time, and its answers are
kept in FOLDER, a file a room; `--llm replay` needs no more than that. placement_checks.py rates, which shares no code with what
places; it is formulas and a table by hand, no person. Prints a line a room, and writes one an object to
experiments/results/other_objects_NAME.json (zoo_objects_NAME.json), with the failures by check, tokens and dollars. Rooms
that are done are in RUNS/NAME and not done again.

Images are for raters, who must not know the method: wide and close in one file, whose name hides the method; FOLDER/key_NAME.json
has the files of NAME.
"""

from __future__ import annotations

import argparse
import copy
import json
import tarfile
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock

from insertion_study import RESULTS, _in_turn, _insert_settings, _stage, _zoo
from other_kinds import KINDS, other_objects
from rater_images import rater_image
from twelve_at_once import CATEGORY, line_of, parser_of, row_of, study_arguments, summary

from s2a.core.provenance import provenance
from s2a.language.ask import Model, UsageLog
from s2a.language.client import choose
from s2a.language.insert.batch import open_room
from s2a.language.insert.describe import RoomState
from s2a.language.insert.pipeline import attempt
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import InsertSettings, ObjectRequest

RECORDED = Path(__file__).parent / "recordings/other_objects.tar.xz"
"""The objects of the recorded answers."""


def main() -> None:
    """Make the objects, insert each into an empty-handed room, and write what came of it."""
    parser = parser_of(__doc__, Path("runs/other"), list(KINDS))
    parser.add_argument("--objects", default="other", choices=["other", "zoo"])
    parser.add_argument("--draws", type=int, default=2)
    parser.add_argument("--objects-seed", type=int, default=7)
    parser.add_argument("--at-once", type=int, default=1, help="objects that a model is asked of at a time")
    parser.add_argument("--images", type=Path)
    args = study_arguments(parser)
    files, turn = _files(args), Lock()
    with ThreadPoolExecutor(args.at_once) as pool:
        waiting = [
            _begun(name, seed, files[name][number :: len(args.seeds)], turn, pool, args)
            for name in args.rooms
            for number, seed in enumerate(args.seeds)
        ]
        rooms = []
        for finish in waiting:
            rooms.append(finish())
            print(line_of(rooms[-1]), flush=True)
            _write(rooms, args)
    print(json.dumps(summary(rooms)))


def _write(rooms: list[dict], args: argparse.Namespace) -> None:
    about = {"llm": args.llm, "objects": args.objects, "seeds": args.seeds}
    about |= {"objects_seed": args.objects_seed, **provenance("cpu"), "summary": summary(rooms), "usage": usage(rooms)}
    (RESULTS / f"{args.objects}_objects_{args.name}.json").write_text(
        json.dumps(about | {"rooms": rooms}, indent=1) + "\n"
    )


def usage(rooms: list[dict]) -> dict:
    """Return the means an insertion of requests, tokens, US dollars and seconds without the model."""
    rows = [row for room in rooms for row in room["objects"]]
    totals = [row["total"] for row in rows]
    means = {name: sum(total[name] for total in totals) / len(totals) for name in totals[0] if name != "seconds"}
    timed = [row["seconds"] for row in rows if row["seconds"] is not None]
    if timed:
        means["seconds_without_model"] = sum(timed) / len(timed)
    return {name: round(value, 5) for name, value in means.items()}


def _begun(
    name: str, seed: int, files: list[tuple[Path, dict]], turn: Lock, pool: ThreadPoolExecutor, args: argparse.Namespace
) -> Callable[[], dict]:
    """Open a room and begin to insert some objects, each alone; return what waits for them and has their rows."""
    done = args.runs / args.name / f"{name}_{seed}_{args.objects}.json"
    if done.exists():
        return lambda: json.loads(done.read_text())
    settings = _insert_settings(_stage(name, seed, args), f"{name}_{seed}_{args.objects}", [], args)
    with turn:
        room = open_room(settings)
    model = _in_turn(choose(settings.llm, settings.record, rules), turn)
    started = [pool.submit(_one, room, model, settings, file, f"{name}_{seed}", turn, args) for file in files]
    return lambda: _finished(name, seed, [future.result() for future in started], done)


def _one(
    room: RoomState,
    model: Model,
    settings: InsertSettings,
    file: tuple[Path, dict],
    where: str,
    turn: Lock,
    args: argparse.Namespace,
) -> dict:
    """Insert an object; return its row. What does not wait for a model is done one at a time."""
    path, truth = file
    with turn:
        alone = copy.copy(room)
        inserted, record = attempt(alone, ObjectRequest(path, truth["label"]), model, settings)
        if inserted is not None and args.images:
            rater_image(alone.scene, inserted, f"{where}_{path.parent.name}_{path.stem}", args.name, args.images)
        if inserted is not None:
            alone.add(inserted)
        row = row_of(truth, inserted, record, alone.scene)
    steps = [step for name, step in record.items() if isinstance(step, dict) and name != "total"]
    # Of several at once each waits for its turn, too, which is none of its time.
    seconds = sum(step.get("seconds", 0.0) for step in steps) - record["total"]["seconds"]
    more = {
        name: {key: record[name].get(key) for key in ("right", "problem", "kept")}
        for name in ("review",)
        if name in record
    }
    return row | {
        "file": path.name,
        "seconds": round(seconds, 2) if args.at_once == 1 else None,
        **more,
        "total": UsageLog(settings.llm.prices, [one | {"replayed": False} for one in record["answers"]]).total(),
    }


def _finished(name: str, seed: int, rows: list[dict], done: Path) -> dict:
    """Return the row of a room, and keep it."""
    seconds = {"wall": round(sum(row["seconds"] or 0.0 for row in rows), 1), "cpu": 0.0}
    room = {"room": name, "seed": seed, "seconds": seconds, "right": sum(row["right"] for row in rows), "objects": rows}
    done.parent.mkdir(parents=True, exist_ok=True)
    done.write_text(json.dumps(room, indent=1) + "\n")
    return room


def _files(args: argparse.Namespace) -> dict[str, list[tuple[Path, dict]]]:
    """Return path and truth of the objects, by room; those of one room are dealt out over its seeds."""
    if args.objects == "other" and args.llm == "replay":
        if (args.objects_seed, args.draws) != (7, 2):
            raise SystemExit("recorded answers are of objects_seed=7 and draws=2: leave out --objects-seed and --draws")
        with tarfile.open(RECORDED) as archive:
            archive.extractall(args.runs, filter="data")
        rows = json.loads((args.runs / "recorded/truth.json").read_text())
        return {room: [(args.runs / "recorded" / file, truth) for file, truth in own] for room, own in rows.items()}
    if args.objects == "other":
        return other_objects(args.runs / "other", args.objects_seed, args.draws)
    zoo = _zoo(args)
    entries = json.loads((zoo / "truth.json").read_text())["objects"].values()
    return {
        room: [(zoo / one["object"], one) for one in entries if one["category"] == CATEGORY[room]] for room in KINDS
    }


if __name__ == "__main__":
    main()
