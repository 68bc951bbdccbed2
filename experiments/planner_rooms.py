"""The planner on every part of virtual rooms: how far each part comes, and why no farther.

    python experiments/planner_rooms.py --rooms kitchen office ... --seeds 0 [--detail demo]
        [--parts drawer_14 ...] [--num-envs 4] [--work runs/planner_rooms] [--name planner_rooms]

Scans each room, prepares all its parts, and lets the planner open each from noisy starts. Scans and stages in the work folder
are kept, and so are the rows in experiments/results/NAME.json, which come as a table in NAME.md too. How far a part comes:

no_handle   its front opens by a push; a gripper finds nothing to hold, and the planner does not try
left_out    `s2a prepare` refuses it
no_base     there is no base pose from which the arm follows the path without a collision; the planner does not try
no_plan     the planner finds no joint path from the base pose
not_opened  it does not open by the task's success_opening in every episode
opened      it does, but not in a pinch of its handle in every episode
grasped     it does, in a pinch

scanned is the fraction of the handle's true surface that the scan shows, relief how far what is annotated as the handle stands
out of its front, as a fraction of the truth.
"""

from __future__ import annotations

import argparse
import json
import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from room_file import open_part

from s2a import scan
from s2a.core import config
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.homes.sample import SampleConfig, sample
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scan import ply
from s2a.scene.geometry.mesh_ops import normals, sample_with_faces
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd import geometric, sim_stage

RESULTS = Path(__file__).parent / "results"
OUTCOMES = ("no_handle", "left_out", "no_base", "no_plan", "not_opened", "opened", "grasped")
NEAR, ALIKE, POINTS = 0.01, 0.3, 2000
"""[m] and cosine within which a scanned face shows a point of the true surface; points asked for on a handle."""
Row = dict[str, Any]


def main() -> None:
    """Measure the rooms, writing after each part."""
    args = _arguments()
    wp.config.log_level = wp.LOG_WARNING
    file = RESULTS / f"{args.name}.json"
    rows: list[Row] = json.loads(file.read_text())["rows"] if file.exists() else []
    for room in args.rooms:
        for seed in args.seeds:
            key = {"room": room, "seed": seed, "detail": args.detail}
            done = {row["part"]: row for row in rows if key.items() <= row.items()}
            for row in _room(key, done, args):
                rows = [other for other in rows if not (key | {"part": row["part"]}).items() <= other.items()]
                rows.append(key | row)
                print(*key.values(), json.dumps(row), flush=True)
                _write(rows, file, args)


def _write(rows: list[Row], file: Path, args: argparse.Namespace) -> None:
    """Write all rows, and the table beside them."""
    head = {"num_envs": args.num_envs, "start_seed": 0, **provenance("cpu")}
    lines = ",\n".join(json.dumps(row) for row in rows)
    with atomic_write(file) as out:
        out.write_text(f'{json.dumps(head, indent=1)[:-2]},\n "rows": [\n{lines}\n]}}\n')
    file.with_suffix(".md").write_text("\n".join(table(rows)) + "\n")


def table(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a Markdown table: how far the parts of each room came, and of each kind of rooms and scanner."""
    yield "| rooms | scanner | parts | " + " | ".join(OUTCOMES) + " |"
    yield "|---" * (3 + len(OUTCOMES)) + "|"
    for detail in dict.fromkeys(row["detail"] for row in rows):
        of_kind = [row for row in rows if row["detail"] == detail]
        rooms = dict.fromkeys((row["room"], row["seed"]) for row in of_kind)
        for room in rooms:
            own = [row for row in of_kind if (row["room"], row["seed"]) == room]
            yield _line(f"{room[0]} {room[1]}", detail, own)
        yield _line(f"**{len(rooms)} room{'s' * (len(rooms) > 1)}**", detail, of_kind)
    yield ""
    yield from _failures(rows)


def _line(name: str, detail: str, rows: Sequence[Row]) -> str:
    count = Counter(row["outcome"] for row in rows)
    return f"| {name} | `{detail}` | {len(rows)} | " + " | ".join(str(count[outcome]) for outcome in OUTCOMES) + " |"


def _failures(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a table of the parts that were not grasped."""
    yield "| room | part | handle | length [mm] | height [m] | scanned | relief | outcome | why |"
    yield "|---|---|---|---|---|---|---|---|---|"
    for row in rows:
        if row["outcome"] in ("grasped", "no_handle"):
            continue
        room = f"{row['room']} {row['seed']} `{row['detail']}`"
        share, relief = ("" if row.get(name) is None else f"{row[name]:.0%}" for name in ("scanned", "relief"))
        size = "" if row["length"] is None else f"{1e3 * row['length']:.0f}"
        where = f"{row['part']} | {row['handle']} | {size} | {row['height']:.2f} | {share} | {relief}"
        yield f"| {room} | {where} | {row['outcome']} | {row['why']} |"


def _room(key: Row, done: dict[str, Row], args: argparse.Namespace) -> Iterator[Row]:
    """Yield a row for each part of a room; what its opening came to is kept where it is done, by part."""
    folder = args.work / "_".join(map(str, key.values()))
    if not (folder / "scan/truth/truth.json").exists():
        keys = [*(f"{name}={value}" for name, value in key.items()), f"out={folder / 'scan'}"]
        sample(config.load(SampleConfig, config.compose("sample", keys)), folder / "scan")
    scene = scan.read(folder / "scan")
    stage = folder / "sim.usd"
    refused = _prepared(scene, args.parts or ALL, stage, folder / "left_out.json")
    facts = _handles(folder / "scan", scene)
    room = sim_stage.read(stage, visuals=False).articulations if stage.exists() else {}
    for part in sorted(args.parts or scene.movable):
        if facts[part]["handle"] == "none":
            yield facts[part] | {"outcome": "no_handle", "why": "nothing to hold"}
            continue
        if part in done:
            yield done[part] | facts[part]
            continue
        if part not in room:
            yield facts[part] | {"outcome": "left_out", "why": refused.get(part, "")}
            continue
        bases = room[part].bases.values()
        if not any(base.free for base in bases):
            yield facts[part] | {"outcome": "no_base", "why": next(base.reason for base in bases)}
            continue
        yield facts[part] | _outcome(open_part(stage, part, args.num_envs, 0))


def _prepared(scene: Scene, parts: str | Sequence[str], stage: Path, record: Path) -> dict[str, str]:
    """Prepare parts of a room, unless that was done; return why some were left out, by part."""
    if record.exists():
        return json.loads(record.read_text())
    refused: dict[str, str] = {}

    class Listener(logging.Handler):
        """Keeps the warnings about parts that are left out."""

        def emit(self, entry: logging.LogRecord) -> None:
            """Keep a warning."""
            if "is left out" in str(entry.msg) and isinstance(entry.args, tuple):
                refused[str(entry.args[0])] = str(entry.args[1])

    log, listener = logging.getLogger("s2a.prepare"), Listener()
    log.addHandler(listener)
    room = prepare(scene, parts, config.load(PrepareConfig, config.compose("prepare")["prepare"]))
    log.removeHandler(listener)
    sim_stage.write(room, stage)
    record.write_text(json.dumps(refused, indent=1))
    return refused


def _handles(folder: Path, scene: Scene) -> dict[str, Row]:
    """Return by part what is true of its handle, and how much of it was scanned."""
    truth = json.loads((folder / "truth/truth.json").read_text())["parts"]
    clean = geometric.read(folder / "truth/truth.usda")
    surface = ply.read(folder / "mesh_aligned_0.05.ply")
    scanned = Mesh(surface.vertices, surface.faces)
    found = {}
    for part in scene.movable:
        held = [i for i in clean.grasp_parts(part) if i != part and i in truth]
        handle = truth[held[0]] if held else {}
        facts = handle.get("facts", {})
        found[part] = {
            "part": part,
            "joint": scene.joint(part).kind,
            "handle": facts.get("family", handle.get("style")) or "none",
            "length": max(handle["size"]) if held else None,
            "clearance": facts.get("clearance"),
            "height": round(float(clean.grasp_point(part)[2]), 3),
            "scanned": _scanned(clean.parts[held[0]].mesh, scanned) if held else None,
            "relief": _relief(scene.parts[held[0]].mesh, handle) if held and held[0] in scene.parts else None,
        }
    return found


def _relief(annotated: Mesh, handle: Row) -> float:
    """Return how far what was annotated as a handle stands out of its front, as a fraction of what the handle does."""
    if not len(annotated.faces):
        return 0.0
    pose, facts = np.array(handle["pose"]), handle.get("facts", {})
    true = facts["clearance"] + facts["depth"] if "depth" in facts else max(handle["size"])
    out = (annotated.vertices - pose[:3, 3]) @ pose[:3, 0]
    return round(float(np.quantile(out, 0.95)) / true, 2)


def _scanned(true: Mesh, scan_mesh: Mesh) -> float:
    """Return the fraction of a true surface within NEAR of scanned faces that face alike."""
    points, faces = sample_with_faces(true, POINTS, seed=0)
    near, _ = nearest_faces(ray_mesh(scan_mesh.vertices, scan_mesh.faces), points, NEAR)
    alike = np.einsum("ij,ij->i", normals(scan_mesh)[near], normals(true)[faces]) > ALIKE
    return round(float(np.mean(alike & (near >= 0))), 3)


def _outcome(found: Row) -> Row:
    """Return how far the planner came with a part, and what says so."""
    if "error" in found:
        return {"outcome": "no_plan", "why": found["error"]}
    count = found["num_envs"]
    far = f"{found['success']} of {count} open, mean {found['opening']['mean']:.2f} m of {found['travel']:.2f} m"
    held = f"{found['grasp_success']} grasped, {found['handle_success']} with both fingers on the handle"
    outcome = "grasped" if found["grasp_success"] == count else "opened" if found["success"] == count else "not_opened"
    return {"outcome": outcome, "why": f"{far}; {held}", **found}


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", default=["office", "bedroom", "kitchen", "bathroom", "living_room"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--detail", default="demo")
    parser.add_argument("--parts", nargs="+", help="ids of the parts to open; else all of each room")
    parser.add_argument("--num-envs", type=int, default=4)
    parser.add_argument("--work", type=Path, default=Path("runs/planner_rooms"))
    parser.add_argument("--name", default="planner_rooms")
    return parser.parse_args()


if __name__ == "__main__":
    main()
