"""A hundred objects of twenty kinds into captures of real rooms without a wish: by rules, by a model, by its recorded answers.

    python experiments/objects_real.py ROOMS [--llm rules | chat | replay] [--recordings FOLDER] [--name rules] [--objects-seed 7]
        [--runs runs/objects_real] [--rooms s0000 ...] [--at-once 20] [--sheets FOLDER] [--shuffle 0] [llm.model=...]

ROOMS holds a folder a capture, by the names of objects_real.yaml, with the geometric.usd of `s2a export`. Puts each object alone
into its room and measures by placement_checks.py, which shares no code with what places: nothing of the scan in it, something
that carries it, upright. The control pushes it 20 mm into what carries it, which must be seen. Prints a line an object and writes
experiments/results/objects_real_NAME.json. FOLDER receives contact sheets, numbered in an order drawn from --shuffle, and
order.json with what is where, for people who judge: experiments/results/ratings_real holds their verdicts.
"""

from __future__ import annotations

import argparse
import json
import random
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from threading import Lock

import numpy as np
import yaml
from insertion_study import RESULTS, _in_turn, _insert_settings, _zoo
from other_kinds import other_objects
from PIL import Image, ImageDraw
from placement_checks import Placed, _carried, _free, _hung, up_and_front
from rater_images import rater_image
from triangle_queries import Obstacles, spread

from s2a.core.provenance import provenance
from s2a.language.ask import Model
from s2a.language.client import choose
from s2a.language.insert.batch import open_room
from s2a.language.insert.describe import RoomState
from s2a.language.insert.pipeline import attempt
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import Inserted, InsertSettings, ObjectRequest
from s2a.scene.scene import Mesh

LIST = Path(__file__).parent / "objects_real.yaml"
PUSH = 0.02
"""How far the control is pushed into what carries the object [m]."""
TILT = 12.0
"""Largest tilt of what stands [degree]."""
SHEET, COLUMNS = 10, 2
"""Images of a contact sheet."""


def main() -> None:
    """Insert every object and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("--runs", type=Path, default=Path("runs/objects_real"))
    parser.add_argument("--seed", type=int, default=0, help="of the zoo")
    parser.add_argument("--objects-seed", type=int, default=7)
    parser.add_argument("--rooms", nargs="*")
    parser.add_argument("--llm", default="rules", choices=["rules", "chat", "replay"])
    parser.add_argument("--recordings", type=Path, help="folder of a model's answers, a file a room")
    parser.add_argument("--at-once", type=int, default=1, help="objects that a model is asked of at a time")
    parser.add_argument("--name", default="rules")
    parser.add_argument("--sheets", type=Path)
    parser.add_argument("--shuffle", type=int, default=0)
    parser.add_argument("settings", nargs="*", help="of `s2a insert`, such as llm.model=gpt-4o-mini")
    args = parser.parse_intermixed_args()
    listed = yaml.safe_load(LIST.read_text())
    rows: list[dict] = []
    for name in args.rooms or listed["rooms"]:
        first, last = listed["rooms"][name]
        rows += _room(name, listed["kinds"][first : last + 1], args)
        about = {"llm": args.llm, "objects_seed": args.objects_seed, **provenance("cpu"), "summary": summary(rows)}
        (RESULTS / f"objects_real_{args.name}.json").write_text(json.dumps(about | {"rows": rows}, indent=1) + "\n")
    print(json.dumps(summary(rows), indent=1))
    if args.sheets:
        sheets(args.sheets, args.shuffle)


def summary(rows: list[dict]) -> dict:
    """Return counts: objects, those that were placed, and of these how many are free, carried and upright, and controls seen."""
    placed = [row for row in rows if row["placed"]]
    counts = {name: sum(row[name] for row in placed) for name in ("free", "carried", "upright", "size", "control")}
    return {"objects": len(rows), "placed": len(placed), **counts}


def _room(name: str, labels: list[str], args: argparse.Namespace) -> list[dict]:
    """Insert the objects of a room, each alone; return their rows."""
    settings = _insert_settings(args.captures / name / "geometric.usd", name, [], args)
    room, turn = open_room(settings), Lock()
    model, found = _in_turn(choose(settings.llm, settings.record, rules), turn), _objects(labels, name, args)

    def insert_one(entry: tuple[Path, dict]) -> dict:
        with turn:  # what does not wait for a model is done one at a time
            return _one(room, name, *entry, model, settings, args)

    with ThreadPoolExecutor(args.at_once) as pool:
        return list(pool.map(insert_one, found))


def _objects(labels: list[str], room: str, args: argparse.Namespace) -> list[tuple[Path, dict]]:
    """Return file and truth of a room's objects: of kinds that are drawn more than once another one for every room."""
    zoo = _zoo(args)
    own = {entry["label"]: (zoo / entry["object"], entry) for entry in _truths(zoo)}
    rooms = list(yaml.safe_load(LIST.read_text())["rooms"])
    drawn = [one for some in other_objects(args.runs / "other", args.objects_seed, 2).values() for one in some]
    found = []
    for label in labels:
        draws = [one for one in drawn if one[1]["label"] == label] or [own[label]]
        found.append(draws[rooms.index(room) % len(draws)])
    return found


def _truths(zoo: Path) -> list[dict]:
    return list(json.loads((zoo / "truth.json").read_text())["objects"].values())


def _one(
    room: RoomState,
    name: str,
    file: Path,
    truth: dict,
    model: Model,
    settings: InsertSettings,
    args: argparse.Namespace,
) -> dict:
    """Insert an object; return its row."""
    label = truth["label"]
    inserted, record = attempt(room, ObjectRequest(file, label), model, settings)
    row = {"room": name, "object": label, "placed": inserted is not None, "problem": record["problem"][:400]}
    if inserted is not None:
        row |= _measured(room, inserted, truth)
        if args.sheets:
            rater_image(room.scene, inserted, f"{name}_{label.replace(' ', '_')}", args.name, args.sheets)
    checks = [key for key in ("free", "carried", "upright", "size", "control") if not row.get(key, True)]
    print(f"{name:18} {label:20} {row.get('on', '-'):24} {' '.join(checks)} {row['problem'][:90]}", flush=True)
    return row


def _measured(room: RoomState, inserted: Inserted, truth: dict) -> dict:
    """Return what holds of an object in its place."""
    obstacles, mesh = Obstacles(room.scene), inserted.part.mesh
    points, pose, choice = spread(mesh), inserted.candidate.pose, inserted.candidate.choice
    plan = {"up": inserted.plan.up, "front": inserted.plan.front}
    up, front = up_and_front(plan, truth["up"], truth["front"], pose.quaternion)
    hangs = choice.relation == "hanging"
    if hangs:
        carried = _hung(obstacles, Placed(mesh, up, front, 0.0), points, False)["carried"]
    else:
        carried = _carried(obstacles, points, choice.relation == "against")["carried"]
    toward = -np.asarray(inserted.candidate.normal) if hangs else np.array([0.0, 0.0, -1.0])
    pushed = Mesh((mesh.vertices + PUSH * toward).astype(np.float32), mesh.faces)
    longest = float(max(np.ptp(inserted.mesh.vertices, axis=0))) * inserted.placement.scale
    return {
        "on": f"{choice.relation} {choice.target}",
        "at": mesh.bounds.mean(axis=0).round(2).tolist(),
        "free": bool(_free(obstacles, mesh, points)["free"]),
        "control": not _free(obstacles, pushed, spread(pushed))["free"],
        "carried": bool(carried),
        "upright": bool(np.degrees(np.arccos(np.clip(up[2], -1, 1))) <= TILT),
        "size": bool(abs(longest / max(truth["size"]) - 1.0) <= 0.25),
    }


def sheets(folder: Path, shuffle: int) -> None:
    """Write contact sheets of a folder's images in an order drawn by a seed, and order.json."""
    files = sorted(file for file in folder.glob("*_????.png") if not file.stem.startswith("sheet_"))
    random.Random(shuffle).shuffle(files)
    for number, some in enumerate(_parts(files)):
        images = [Image.open(file).convert("RGB") for file in some]
        width, height = images[0].size
        sheet = Image.new("RGB", (COLUMNS * width, -(-len(some) // COLUMNS) * (height + 14)))
        for i, (file, image) in enumerate(zip(some, images, strict=True)):
            at = (i % COLUMNS * width, i // COLUMNS * (height + 14))
            sheet.paste(image, (at[0], at[1] + 14))
            ImageDraw.Draw(sheet).text((at[0] + 4, at[1]), f"{number * SHEET + i}  {file.stem[:-5]}", fill="white")
        sheet.save(folder / f"sheet_{shuffle}_{number:02d}.png")
    order = {str(i): file.stem for i, file in enumerate(files)}
    (folder / f"order_{shuffle}.json").write_text(json.dumps(order, indent=1) + "\n")


def _parts(files: list[Path]) -> Iterator[list[Path]]:
    for first in range(0, len(files), SHEET):
        yield files[first : first + SHEET]


if __name__ == "__main__":
    main()
