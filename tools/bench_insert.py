"""Seconds per stage of insertions into a stage: objects of a list, each into the room as it is, without a model.

    s2a zoo out=zoo
    python tools/bench_insert.py GEOMETRIC_USD zoo/list.yaml stapler eraser "cup of pencils" [--out FILE.json]

Without labels all objects of the list are tried. Exits with 1 where an insertion takes more than 2 s, without opening the
stage. The record also holds the processor time and the load of the machine: wall times count where nothing else ran.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import yaml
from rich.console import Console
from rich.table import Table

from s2a.config import compose, load
from s2a.edit.insert import Room, Thing
from s2a.edit.llm import choose
from s2a.edit.record import Record
from s2a.provenance import provenance
from s2a.verbs import insert as verb

LIMIT = 2.0
"""What an insertion may take on two cores [s]."""
STAGES = {
    "plan": ("plan", "plan again"),
    "scale": ("scale",),
    "pose": ("pose",),
    "drop": ("verify",),
    "script": ("script",),
}
"""Steps of the record by the column that has their time; what is left is reading the object."""


def measure(room: Room, thing: Thing, config: verb.Config) -> tuple[dict[str, Any], Record]:
    """Return wall and processor time [s] of one insertion, stage by stage, and its record."""
    times, start = os.times(), time.perf_counter()
    found, record = verb.attempt(room, thing, choose(config.llm, None), config, {"label": thing.label})
    wall, after = time.perf_counter() - start, os.times()
    stages = {
        name: sum(record[key]["seconds"] for key in keys if "seconds" in record.get(key, {}))
        for name, keys in STAGES.items()
    }
    row = {"read": wall - sum(stages.values()), **stages, "wall": wall}
    row |= {"cpu": sum(after[:4]) - sum(times[:4]), "load": os.getloadavg()[0]}
    rounded = {name: round(value, 3) for name, value in row.items()}
    target = record["surface"]["target"] if found else "nowhere"
    return {"label": thing.label, **rounded, "on": target}, record


def main() -> None:
    """Measure, print the table, and judge."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("stage", type=Path, help="a geometric.usd")
    parser.add_argument("list", type=Path, help="a YAML list of {object, label}, such as a zoo's")
    parser.add_argument("labels", nargs="*", help="of the objects to insert; all if none is given")
    parser.add_argument("--out", type=Path, help="a JSON file for the times")
    parser.add_argument("--records", type=Path, help="a JSON file for what `s2a insert` would record of each")
    given = parser.parse_args()
    entries = yaml.safe_load(given.list.read_text())
    things = [Thing(given.list.parent / entry["object"], entry["label"], "") for entry in entries]
    if unknown := set(given.labels) - {thing.label for thing in things}:
        sys.exit(f"not in {given.list}: {', '.join(sorted(unknown))}")
    things = [thing for thing in things if not given.labels or thing.label in given.labels]
    with tempfile.TemporaryDirectory() as folder:
        values = [f"stage={given.stage}", f"objects={given.list}", f"out={folder}", "llm=rules"]
        config = load(verb.Config, compose("insert", values))
    start = time.perf_counter()
    room = verb.open_room(config)
    opening = time.perf_counter() - start
    measured = [measure(room, thing, config) for thing in things]
    rows = [row for row, _ in measured]
    faces = sum(len(part.mesh.faces) for part in room.scene.parts.values())
    title = f"{given.stage}, {faces} faces, opened in {opening:.1f} s; {os.cpu_count()} cores; seconds"
    table = Table(*rows[0], title=title)
    for row in rows:
        table.add_row(*(value if isinstance(value, str) else f"{value:.2f}" for value in row.values()))
    if given.out:
        record = {"faces": faces, "cores": os.cpu_count(), "opening_s": round(opening, 2), "objects": rows}
        given.out.write_text(json.dumps(provenance("cpu") | record, indent=1) + "\n")
    if given.records:
        given.records.write_text(json.dumps([record for _, record in measured], indent=1) + "\n")
    Console().print(table)
    if any(row["wall"] > LIMIT for row in rows):
        sys.exit(1)


if __name__ == "__main__":
    main()
