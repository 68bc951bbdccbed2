"""Are wishes heeded, and impossible ones declined? One small object, the wishes of wishes.yaml, unseen rooms.

    python experiments/wishes.py [--runs runs/wishes] [--seed 100] [--rooms office kitchen ...]
        [--llm rules | chat | replay] [--recordings FOLDER] [--at-once 1] [--name rules] [llm.model=...]

Scans the rooms and makes the zoo unless they are there (`insertion_study.py`; RUNS belongs to one seed). Prints a table by
relation, and writes it with a line a wish to experiments/results/wishes_NAME.json. Heeded is what the check of the result says
(`s2a.language.insert.wish_check`). A wish whose thing the room of this seed happens not to have counts as impossible
(`absent`), and so does one that is not heeded and for which any_place.py finds no place in this room (`nowhere`); as_written
counts it as possible.
"""

from __future__ import annotations

import argparse
import json
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock

import numpy as np
import yaml
from any_place import any_place
from insertion_study import RESULTS, _in_turn, _insert_settings, _stage, _zoo  # the same rooms, objects and settings

from s2a.core.provenance import provenance
from s2a.language.client import choose
from s2a.language.insert.batch import open_room
from s2a.language.insert.pipeline import attempt
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import ObjectRequest
from s2a.language.insert.wish_check import read_wish
from s2a.scene.scene import Mesh

WISHES = Path(__file__).parent / "wishes.yaml"
OBJECT, LABEL = "matryoshka.*", "matryoshka"
"""What is put everywhere: small, stands firmly, and belongs nowhere in particular."""


def main() -> None:
    """Ask for every wish and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs/wishes"))
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--rooms", nargs="*", default=list(yaml.safe_load(WISHES.read_text())))
    parser.add_argument("--llm", default="rules", choices=["rules", "chat", "replay"])
    parser.add_argument("--recordings", type=Path, help="folder of a model's answers, a file a room")
    parser.add_argument("--at-once", type=int, default=1, help="wishes that a model is asked of at a time")
    parser.add_argument("--name", default="rules")
    parser.add_argument("settings", nargs="*", help="of `s2a insert`, such as llm.model=gpt-4o-mini")
    args = parser.parse_intermixed_args()
    if (args.llm != "rules") != bool(args.recordings):
        parser.error("--llm chat and --llm replay need --recordings FOLDER, and --llm rules has none")
    rows: list[dict] = []
    for name in args.rooms:
        rows += _room(name, yaml.safe_load(WISHES.read_text())[name], args)
        print(table(rows), flush=True)
        about = {"seed": args.seed, "llm": args.llm, **provenance("cpu")}
        report = about | {"table": summary(rows), "rows": rows}
        (RESULTS / f"wishes_{args.name}.json").write_text(json.dumps(report, indent=1) + "\n")


def _room(name: str, wishes: list[dict], args: argparse.Namespace) -> list[dict]:
    """Return a row for every wish of one room."""
    placed: list[Mesh] = []
    settings, turn = _insert_settings(_stage(name, args.seed, args), name, [], args), Lock()
    room, model = open_room(settings), _in_turn(choose(settings.llm, settings.record, rules), turn)
    object = next((_zoo(args) / "objects").glob(OBJECT))

    def inserted_row(entry: dict) -> dict:
        with turn:  # what is not waiting for a model is done by one at a time
            start = time.perf_counter()
            inserted, record = attempt(room, ObjectRequest(object, LABEL, entry["wish"]), model, settings)
            there = not read_wish(entry["wish"], room.scene).missing
            row = {"room": name, **entry, "possible": entry["possible"] and there, "absent": not there}
            row |= {"written": inserted is not None, "heeded": bool(record.get("wish", {}).get("heeded"))}
            row |= {"problem": record["problem"]}
            row |= {"seconds": round(time.perf_counter() - start - record["total"]["seconds"], 2)}
            if inserted is not None:
                placed.append(inserted.part.mesh)
            return row

    with ThreadPoolExecutor(args.at_once) as pool:
        rows = list(pool.map(inserted_row, wishes))
    for row in rows:
        missed = row["possible"] and not row["heeded"]
        relations = read_wish(row["wish"], room.scene).relations
        row["nowhere"] = missed and bool(relations) and any_place(room.scene, _at_origin(placed[0]), relations) is None
        row["right"] = row["heeded"] if row["possible"] and not row["nowhere"] else not row["written"]
    return rows


def _at_origin(mesh: Mesh) -> Mesh:
    """Return an upright mesh with the middle of its foot at the origin."""
    low, high = mesh.bounds
    foot = np.array([*(low[:2] + high[:2]) / 2, low[2]], np.float32)
    return Mesh(mesh.vertices - foot, mesh.faces)


def summary(rows: list[dict]) -> list[dict]:
    """Return heeded of possible and declined of impossible wishes by relation, and of all."""
    found = []
    for relation in [*sorted({row["relation"] for row in rows}), "all"]:
        own = [row for row in rows if relation in (row["relation"], "all")]
        written = [row for row in own if row["possible"]]
        can = [row for row in written if not row["nowhere"]]
        cannot = [row for row in own if row not in can]
        counts = {"as_written": len(written), "possible": len(can), "heeded": sum(row["right"] for row in can)}
        counts |= {"impossible": len(cannot), "declined": sum(row["right"] for row in cannot)}
        found.append({"relation": relation, **counts})
    return found


def table(rows: list[dict]) -> str:
    """Return the summary as text."""
    lines = [f"{'relation':12}{'heeded':>12}{'declined':>12}"]
    for line in summary(rows):
        heeded, declined = f"{line['heeded']}/{line['possible']}", f"{line['declined']}/{line['impossible']}"
        lines.append(f"{line['relation']:12}{heeded:>12}{declined:>12}")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
