"""The rooms of the skill experiments: virtual rooms with inserted objects, prepared so that parts open and objects are free.

    python experiments/skill_rooms.py [--runs runs/skills] [--rooms office_0 ...]

Below RUNS: the zoo and the scans; below RUNS/inputs, which is all that pick_place.py, put_in.py and open_close.py read and can be
copied to another machine: ROOM/room.usd (every part that moves, the objects as free bodies, interiors of drawers) and
ROOM/objects.json (what was inserted, the ids, why an object is missing). Objects are inserted with llm=rules and 6 cm of room
around each. What is done is not done again.
"""

from __future__ import annotations

import argparse
import json
import re
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import yaml

ROOMS = {
    ("office", 0): ("stapler", "glue stick", "highlighter", "eraser"),
    ("kitchen", 0): ("banana", "carrot", "Bialetti moka", "glass of red wine"),
    ("bathroom", 1): ("soap dispenser", "shampoo bottle", "rubber duck", "Listerine"),
    ("bedroom", 1): ("candle", "alarm clock", "matryoshka", "photo frame"),
    ("living_room", 2): ("hourglass", "Rubik's cube", "candelabra", "trophy"),
    ("office", 2): ("calculator", "tape dispenser", "pencil", "magnifying glass"),
    ("kitchen", 2): ("wine bottle", "Nutella", "rolling pin", "wedge of cheese"),
    ("bathroom", 0): ("toothpaste tube", "perfume bottle", "shaving brush", "Nivea"),
    ("bedroom", 0): ("lava lamp", "reading glasses", "make-up mirror", "hot-water bottle"),
    ("living_room", 1): ("potted cactus", "snow globe", "model sailing boat", "lantern"),
    ("capture", "s0000"): (
        "glass of red wine",
        "banana",
        "glue stick",
        "candle",
        "Rubik's cube",
        "stapler",
        "toothpaste tube",
        "pencil",
        "trophy",
    ),
    ("capture", "redkitchen"): ("Nutella", "carrot", "wine bottle", "highlighter", "rolling pin", "apple"),
    ("capture", "quest"): (
        "hourglass",
        "eraser",
        "shampoo bottle",
        "matryoshka",
        "alarm clock",
        "snow globe",
        "Post-it notes",
        "wedge of cheese",
        "Bialetti moka",
    ),
    ("capture", "copyroom"): (
        "tape dispenser",
        "calculator",
        "Nivea",
        "soap dispenser",
        "perfume bottle",
        "rubber duck",
    ),
    ("capture", "music"): ("eraser", "glue stick", "Nutella", "apple", "perfume bottle", "highlighter"),
}
"""Kinds and seeds of the rooms, and what is inserted, by its size; of captures their export is below RUNS/capture_NAME."""
NAMES = {f"{kind}_{seed}": (kind, seed) for kind, seed in ROOMS}
DEFAULT = list(NAMES)[:5]
"""The rooms that the experiments take unless others are named: one of each kind."""
ROOM = 0.06
"""[m] Around an object as it is inserted: for the fingers, 15 mm thick and 12 mm off the object, and for half of the hand."""


def main() -> None:
    """Make what is not there."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs/skills"))
    parser.add_argument("--rooms", nargs="*", default=DEFAULT, choices=list(NAMES))
    args = parser.parse_args()
    if not (args.runs / "zoo/list.yaml").exists():
        s2a("zoo", f"out={args.runs}/zoo")
    for name in args.rooms:
        _insert(args.runs, name)
        _prepare(args.runs, name)
        print(f"{args.runs}/inputs/{name}", flush=True)


def _insert(runs: Path, name: str) -> None:
    """Scan a room, and insert its objects."""
    folder, (kind, seed) = runs / name, NAMES[name]
    if kind != "capture" and not (folder / "geometric.usd").exists():
        s2a("sample", f"room={kind}", f"seed={seed}", "detail=demo", f"out={folder}/scan")
        s2a("export", f"scan={folder}/scan", f"out={folder}")
    if not (folder / "ins/insert.json").exists():
        listed = {e["label"]: e for e in yaml.safe_load((runs / "zoo/list.yaml").read_text())}
        entries = [{"object": f"../zoo/{listed[e]['object']}", "label": e} for e in ROOMS[kind, seed]]
        (folder / "list.yaml").write_text(yaml.safe_dump(entries))
        done = s2a("insert", f"stage={folder}/geometric.usd", f"objects={folder}/list.yaml", "llm=rules",
                   f"placement.pose.search.margin={ROOM}", f"out={folder}/ins", check=False)  # fmt: skip
        if not (folder / "ins/insert.json").exists():
            raise SystemExit(f"{name}: {message(done)}")


def _prepare(runs: Path, name: str) -> None:
    """Prepare a room with its objects free, but for those that cannot be freed."""
    out = runs / "inputs" / name
    if (out / "objects.json").exists():
        return
    placed = {e["label"]: e for e in json.loads((runs / name / "ins/insert.json").read_text())["objects"] if "id" in e}
    free, refused = [e["id"] for e in placed.values()], {}
    while True:
        done = s2a("prepare", f"stage={runs}/{name}/ins/insert.usda", "targets=all", f"free=[{','.join(free)}]",
                   "prepare.interior=true", f"out={out}/room.usd", check=False)  # fmt: skip
        if done.returncode == 0:
            break
        text = message(done)
        named = re.search(r"free=(\w+)", text)
        if named is None or named[1] not in free:
            raise SystemExit(text)
        refused[named[1]] = text
        free.remove(named[1])
    rows = {}
    for label in ROOMS[NAMES[name]]:
        found: dict[str, Any] = placed.get(label, {})
        why = refused.get(found.get("id", ""), "" if found else "was not inserted")
        rows[label] = {"id": found.get("id"), "free": bool(found) and not why, "why": why}
    shutil.copy(runs / name / "ins/insert.json", out / "insert.json")
    (out / "objects.json").write_text(json.dumps(rows, indent=1) + "\n")


def s2a(*arguments: str, check: bool = True, timeout: float | None = None) -> subprocess.CompletedProcess[str]:
    """Run a command of s2a; its last line of errors ends this process where it fails and that is not expected.

    Raises:
        TimeoutExpired: it was ended after so many seconds.
    """
    command = [sys.executable, "-m", "s2a", *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False, timeout=timeout)
    if check and done.returncode:
        raise SystemExit(f"{' '.join(arguments)}: {message(done)}")
    return done


def message(done: subprocess.CompletedProcess[str]) -> str:
    """Return the message with which a command failed: its last line but for the time that it took and what Warp prints."""
    lines = [line for line in done.stderr.strip().splitlines() if not re.match(r"\w+: [\d.]+ s$|Warp |Module ", line)]
    return lines[-1] if lines else "no message"


if __name__ == "__main__":
    main()
