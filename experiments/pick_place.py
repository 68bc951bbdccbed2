"""Does the planner put inserted objects where the insertion put them? Four objects in each of five rooms.

    python experiments/pick_place.py [--num-envs 8] [--runs runs/pick_place] [--rooms office_0 ...] [--seed 0]

Makes the zoo and the rooms below RUNS, inserts the objects (llm=rules) with 6 cm of room around each, and prepares each room
with them as free objects. Each is picked from the nearest free spot of what it was put on, else of what is near, and placed as
its insertion record says, by `s2a evaluate task=pick_place`. What is done in RUNS is not done again. Writes
experiments/results/pick_place.json: a row an object, and all episodes together with their Wilson 95 % interval. An object that
cannot be inserted, freed or planned for counts as so many failures, by its cause.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
import time
from pathlib import Path

import yaml
from scipy.stats import binomtest

from s2a.provenance import provenance

RESULTS = Path(__file__).parent / "results/pick_place.json"
ROOMS = {
    ("office", 0): ("stapler", "glue stick", "highlighter", "eraser"),
    ("kitchen", 0): ("banana", "carrot", "Bialetti moka", "glass of red wine"),
    ("bathroom", 1): ("soap dispenser", "shampoo bottle", "rubber duck", "Listerine"),
    ("bedroom", 1): ("candle", "alarm clock", "matryoshka", "photo frame"),
    ("living_room", 2): ("hourglass", "Rubik's cube", "candelabra", "trophy"),
}
"""Kinds and seeds of the rooms, and what is inserted: chosen by their size before any was tried."""
ROOM = 0.06
"""[m] Around an object as it is inserted: for the fingers, 15 mm thick and 12 mm off the object, and for half of the hand."""
FAR = 0.9
"""[m] Between the start and the place, at most: an arm of 0.855 m stands between them."""
COLUMNS = ("grasped", "carried", "released_at_rest", "placed", "undisturbed")
"""In the order in which an episode fails."""


def main() -> None:
    """Run what is not done, and write the results."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--num-envs", type=int, default=8)
    parser.add_argument("--runs", type=Path, default=Path("runs/pick_place"))
    parser.add_argument("--rooms", nargs="*", default=[f"{kind}_{seed}" for kind, seed in ROOMS])
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    for (kind, seed), labels in ROOMS.items():
        if f"{kind}_{seed}" in args.rooms:
            _room(kind, seed, labels, args)
    write(args.runs, args.num_envs)


def _room(kind: str, seed: int, labels: tuple[str, ...], args: argparse.Namespace) -> None:
    """Do everything of a room that is not done."""
    folder = args.runs / f"{kind}_{seed}"
    if not (args.runs / "zoo/list.yaml").exists():
        _s2a("zoo", f"out={args.runs}/zoo")
    if not (folder / "geometric.usd").exists():
        _s2a("sample", f"room={kind}", f"seed={seed}", "detail=demo", f"out={folder}/scan")
        _s2a("export", f"scan={folder}/scan", f"out={folder}")
    if not (folder / "ins/insert.json").exists():
        listed = {e["label"]: e for e in yaml.safe_load((args.runs / "zoo/list.yaml").read_text())}
        entries = [{"object": f"../zoo/{listed[e]['object']}", "label": e} for e in labels]
        (folder / "list.yaml").write_text(yaml.safe_dump(entries))
        _s2a("insert", f"stage={folder}/geometric.usd", f"objects={folder}/list.yaml", "llm=rules",
             f"placement.pose.search.margin={ROOM}", f"out={folder}/ins")  # fmt: skip
    placed = {e["label"]: e for e in json.loads((folder / "ins/insert.json").read_text())["objects"] if e.get("id")}
    if not (folder / "free.json").exists():
        (folder / "free.json").write_text(json.dumps(_prepare(folder, [e["id"] for e in placed.values()])))
    free, refused = json.loads((folder / "free.json").read_text())
    for label in labels:
        path = folder / f"{label.replace(' ', '_')}.json"
        if path.exists():
            continue
        row = {"room": f"{kind} {seed}", "object": label}
        found = placed.get(label)
        if found is None:
            row |= {"cause": "insert", "why": "was not inserted"}
        elif found["id"] not in free:
            row |= {"cause": "prepare", "why": refused.get(found["id"], "")}
        else:
            row |= _evaluate(folder, found["id"], args)
        path.write_text(json.dumps(row, indent=1) + "\n")
        print(json.dumps(row), flush=True)
        write(args.runs, args.num_envs)


def _prepare(folder: Path, ids: list[str]) -> tuple[list[str], dict[str, str]]:
    """Prepare a room with free objects; return those that are free, and why the others are not."""
    part = next(i for i in _jointed(folder))
    free, refused = list(ids), {}
    while free:
        done = _s2a(
            "prepare", f"stage={folder}/ins/insert.usda", f"targets={part}", f"free=[{','.join(free)}]",
            f"out={folder}/room.usd", check=False,
        )  # fmt: skip
        if done.returncode == 0:
            break
        text = done.stderr.strip().splitlines()[-1]
        named = re.search(r"free=(\w+)", text)
        if named is None or named[1] not in free:
            raise SystemExit(text)
        refused[named[1]] = text
        free.remove(named[1])
    return free, refused


def _jointed(folder: Path) -> list[str]:
    """Return the parts of a room that move on joints: a room is prepared for one at least."""
    from s2a.usd import geometric

    return list(geometric.read(folder / "geometric.usd").movable)


def _evaluate(folder: Path, name: str, args: argparse.Namespace) -> dict:
    """Plan for an object and execute it; return how it went."""
    room, record = folder / "room.usd", folder / "ins/insert.json"
    support = _support(room, name)
    start = time.perf_counter()
    done = _s2a(
        "evaluate", f"stage={room}", f"part={name}", "task=pick_place", "sim=pick_place", f"task.start={support}",
        f"task.place={record}", f"num_envs={args.num_envs}", "device=cpu", f"seed={args.seed}", f"out={folder}/{name}.json",
        check=False,
    )  # fmt: skip
    row: dict = {"support": support, "seconds": round(time.perf_counter() - start, 1)}
    if done.returncode:
        text = done.stderr.strip().splitlines()[-1]
        segment = re.search(r": (grasp|base|place|approach and lift|lowering and retreat|reach|carry)\b", text)
        cause = f"no plan: {segment[1]}" if segment else "no free spot" if "no level spot" in text else "refused"
        return row | {"cause": cause, "why": text.removeprefix("s2a: ")}
    metrics = json.loads((folder / f"{name}.json").read_text())
    row |= {"success": metrics["success"]["rate"], **{c: metrics[c]["rate"] for c in COLUMNS}}
    row |= {c: round(metrics[c]["max"], 4) for c in ("position_error", "angle_error", "drift")}
    failed = [c for c in COLUMNS if metrics[c]["rate"] < 1.0]
    return row | {"cause": f"not {failed[0]}" if failed else "", "why": ""}


def _support(path: Path, name: str) -> str:
    """Return the part from whose nearest free spot an object is picked: what it was put on, else what is nearest to it."""
    import numpy as np

    from s2a.errors import InputError
    from s2a.planner.obstacles import RoomHulls
    from s2a.planner.places import free_placements, scanned
    from s2a.usd import sim_stage

    room = sim_stage.read(path, visuals=False)
    place = scanned(room, name)
    near = RoomHulls(room, {name}, place[:3])
    own = near.below(place[None, :3])[1][0]
    bounds = {
        i: np.concatenate([h.vertices for h in near.hulls_of(i)])
        for i in dict.fromkeys(near.names)
        if i not in room.free
    }
    away = {
        i: float(np.linalg.norm(np.clip(place[:3], p.min(axis=0), p.max(axis=0)) - place[:3]))
        for i, p in bounds.items()
    }
    for support in [own, *sorted(away, key=lambda i: away[i])]:
        try:
            start = next(free_placements(room, name, support, place))
        except InputError:
            continue
        if np.linalg.norm(start[:3] - place[:3]) <= FAR:
            return support
    return own


def _s2a(*arguments: str, check: bool = True) -> subprocess.CompletedProcess[str]:
    """Run a command of s2a."""
    done = subprocess.run([sys.executable, "-m", "s2a", *arguments], capture_output=True, text=True, check=False)
    if check and done.returncode:
        raise SystemExit(f"{' '.join(arguments)}: {done.stderr.strip().splitlines()[-1]}")
    return done


def write(runs: Path, num_envs: int) -> None:
    """Write the rows that are done, and what they come to."""
    paths = [runs / f"{kind}_{seed}" / f"{e.replace(' ', '_')}.json" for (kind, seed), es in ROOMS.items() for e in es]
    rows = [json.loads(path.read_text()) for path in paths if path.exists()]
    if not rows:
        return
    hits, count = round(sum(num_envs * row.get("success", 0.0) for row in rows)), num_envs * len(rows)
    low, high = binomtest(hits, count).proportion_ci(0.95, method="wilson")
    causes = {row["cause"]: sum(r["cause"] == row["cause"] for r in rows) for row in rows if row["cause"]}
    total = {"objects": len(rows), "of": sum(map(len, ROOMS.values())), "episodes": count, "success": hits}
    total |= {"low": round(low, 4), "high": round(high, 4), "objects_by_cause_of_failure": causes}
    RESULTS.write_text(
        json.dumps({**provenance("cpu"), "num_envs": num_envs, "total": total, "rows": rows}, indent=1) + "\n"
    )


if __name__ == "__main__":
    main()
