"""Seconds per stage of insertions into a stage: objects of a list, each into the room as it is, without a model.

    s2a zoo out=zoo
    python tools/bench_insert.py GEOMETRIC_USD zoo/list.yaml --labels stapler eraser [--out experiments/results/bench_insert.json]

Without labels all objects of the list are tried. Exits with 1 where one takes more than 2 s once the stage is open, files
written included. The record also holds the processor time and the load of the machine: wall times count where nothing else ran.
"""

from __future__ import annotations

import argparse
import copy
import json
import os
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import yaml
from rich import box
from rich.console import Console
from rich.table import Table

from s2a.core.config import compose, load
from s2a.core.errors import InputError
from s2a.core.provenance import provenance
from s2a.language.client import choose
from s2a.language.insert.batch import RECORD, insert_into, open_room
from s2a.language.insert.describe import RoomState
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import InsertSettings, ObjectRequest

LIMIT = 2.0
"""What an insertion may take on two cores [s]."""
STAGES = {"plan": ("plan", "plan again", "scale"), "pose": ("pose",), "drop": ("verify",), "script": ("script",)}
"""Steps of an insertion's record by the column that has their time; the rest is reading the object and writing files."""


def measure(room: RoomState, request: ObjectRequest, config: InsertSettings) -> dict[str, Any]:
    """Return wall and processor time [s] of one insertion, and the wall time of its stages."""
    times, start = os.times(), time.perf_counter()
    record: dict[str, Any] = {}
    with tempfile.TemporaryDirectory() as folder:
        there = replace(config, out=Path(folder, "out"))
        try:
            insert_into(copy.copy(room), [request], choose(config.llm, None, rules), there)
            (record,) = json.loads((there.out / RECORD).read_text())["objects"]
        except InputError as error:
            print(f"{request.label}: {error}", file=sys.stderr)
        wall, after = time.perf_counter() - start, os.times()
    stages = {name: sum(record[key]["seconds"] for key in keys if key in record) for name, keys in STAGES.items()}
    row = {**stages, "files": wall - sum(stages.values()), "wall": wall}
    row |= {"cpu": sum(after[:4]) - sum(times[:4]), "load": os.getloadavg()[0]}
    rounded = {name: round(value, 2) for name, value in row.items()}
    return {"label": request.label, "on": record["surface"]["target"] if record else "nowhere", **rounded}


def main() -> None:
    """Measure, print the table, and check_bound."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path, help="a geometric.usd")
    parser.add_argument("list", type=Path, help="a YAML list of {object, label}, such as a zoo's")
    parser.add_argument("--labels", nargs="*", help="of the objects to insert; all if none is given")
    parser.add_argument("--out", type=Path, help="a JSON file for the record")
    given = parser.parse_args()
    entries = [(entry["object"], entry["label"]) for entry in yaml.safe_load(given.list.read_text())]
    if unknown := set(given.labels or ()) - {label for _, label in entries}:
        sys.exit(f"not in {given.list}: {', '.join(sorted(unknown))}")
    requests = [ObjectRequest(given.list.parent / file, label, "") for file, label in entries]
    requests = [request for request in requests if not given.labels or request.label in given.labels]
    values = [f"stage={given.stage}", f"objects={given.list}", "out=none", "llm=rules"]
    config = load(InsertSettings, compose("insert", values))
    start = time.perf_counter()
    room = open_room(config)
    volume = round(time.perf_counter() - start, 1)
    rows = [measure(room, request, config) for request in requests]
    faces = sum(len(part.mesh.faces) for part in room.scene.parts.values())
    title = f"{given.stage}, {faces} faces, opened in {volume} s; seconds on {os.cpu_count()} cores"
    table = Table(*rows[0], title=title, box=box.SIMPLE)
    for row in rows:
        table.add_row(*(value if isinstance(value, str) else f"{value:.2f}" for value in row.values()))
    if given.out:
        record = {"faces": faces, "cores": os.cpu_count(), "opening_s": volume, "objects": rows}
        given.out.write_text(json.dumps(provenance("cpu") | record, indent=1) + "\n")
    Console().print(table)
    if any(row["wall"] > LIMIT for row in rows):
        sys.exit(1)


if __name__ == "__main__":
    main()
