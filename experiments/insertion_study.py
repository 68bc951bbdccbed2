"""Do a hundred objects land where they belong? Ours beside the paper's surface and pose, in five rooms.

    python experiments/insertion_study.py [--llm rules | chat | replay] [--recordings FOLDER] [--methods ours paper]
        [--categories bathroom ... foreign] [--images FOLDER] [--runs runs/insertion] [--name NAME] [--seed 0]
        [--rooms-per-category 1] [llm.model=...]

Writes the zoo (`s2a zoo`) and scans of the rooms below RUNS, unless they are there; then puts every object alone into the
room of its category, and measures what can be measured: its scale against the truth, and in the stage that came out
collisions, support, stability, and the path of every door and drawer. The category "foreign" has objects that nobody
here modelled (foreign.yaml). With more than one room a category its objects are dealt out over rooms of successive seeds.
Prints the table by category, and writes it with a line an object to experiments/results/insertion_NAME.json and .md, and all
records to RUNS/NAME/; categories that are done there are not done again.

With `--llm chat` a model is asked (OPENAI_API_KEY, OPENAI_BASE_URL, llm.model=...), of --at-once objects at a time, and its
answers are kept in FOLDER/<category>.json, and no results are written. `--llm replay`
needs no more than that.

Images are for raters who must not know the method: FOLDER/<object>_<letter>.png shows before and after, wide and close,
and FOLDER/key.json says which letter is which.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from importlib.metadata import distribution
from pathlib import Path
from threading import Lock

import numpy as np
import yaml
from rater_images import rater_images
from scipy.stats import binomtest

from s2a.core import config
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.language.ask import Answer, Model, Request
from s2a.language.client import choose
from s2a.language.insert.batch import open_room
from s2a.language.insert.describe import RoomState
from s2a.language.insert.fit import NoRoom, intersects, reaching_into
from s2a.language.insert.pipeline import Attempt
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import Inserted, InsertSettings, ObjectRequest
from s2a.language.insert.stability import StabilityCheck, drop_check
from s2a.language.insert.supports import nearby
from s2a.scene.geometry.mesh_ops import sample
from s2a.scene.geometry.mesh_query import depth
from s2a.scene.scene import Mesh

RESULTS = Path(__file__).parent / "results"
FOREIGN = Path(__file__).parent / "foreign.yaml"
ROOMS = {c: c for c in ("bathroom", "kitchen", "bedroom")} | {"stationery": "office", "living room": "living_room"}
ROOMS |= {"foreign": "living_room"}
"""The room that objects of a category go to."""
METHODS = {"ours": ["surface=regions", "pose=search"], "paper": ["surface=ransac", "pose=paper", "plans=1"]}
SCALE, DEEPEST, MAX_OVERLAP = 0.25, 0.001, 0.008
"""Max error of the size, penetration depth [m], and overlap with the swept volume of a door [m], whose scan is that noisy."""
CHECKS = ("scale", "free", "stable", "openings")


def main() -> None:
    """Insert every object by every method, and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--llm", default="rules", choices=["rules", "chat", "replay"])
    parser.add_argument("--recordings", type=Path, help="folder of a model's answers, a file a category")
    parser.add_argument("--at-once", type=int, default=1, help="objects that a model is asked of at a time")
    parser.add_argument("--methods", nargs="*", default=list(METHODS), choices=METHODS)
    parser.add_argument("--categories", nargs="*", default=[c for c in ROOMS if c != "foreign"], choices=ROOMS)
    parser.add_argument("--runs", type=Path, default=Path("runs/insertion"))
    parser.add_argument("--name", help="of the results; default: rules, or that of the folder of recordings")
    parser.add_argument("--images", type=Path)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rooms-per-category", type=int, default=1)
    parser.add_argument("settings", nargs="*", help="of `s2a insert`, such as llm.model=gpt-4o-mini")
    args = parser.parse_intermixed_args()
    if (args.llm != "rules") != bool(args.recordings):
        parser.error("--llm chat and --llm replay need --recordings FOLDER, and --llm rules has none")
    name = args.name or (args.recordings.name if args.recordings else args.llm)
    (args.runs / name).mkdir(parents=True, exist_ok=True)
    rows = []
    for number in range(args.rooms_per_category):
        for category in args.categories:
            done = args.runs / name / (f"{category}_{number}.json" if number else f"{category}.json")
            if not done.exists():
                found = _category(category, number, name, args)
                done.write_text(json.dumps(found, indent=1) + "\n")
            rows += json.loads(done.read_text())
            print(table(rows), flush=True)
            if args.llm != "chat":  # what counts is measured without waiting, by --llm replay
                _write(rows, name, args)


def _write(rows: list[dict], name: str, args: argparse.Namespace) -> None:
    """Write the rows and their table."""
    preset = {"rooms_per_category": args.rooms_per_category}
    report = {
        "llm": name if args.recordings else args.llm,
        "seed": args.seed,
        **preset,
        **provenance("cpu"),
        "table": summary(rows),
        "rows": rows,
    }
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / f"insertion_{name}.json").write_text(json.dumps(report, indent=1) + "\n")
    (RESULTS / f"insertion_{name}.md").write_text(f"```\n{table(rows)}\n```\n")


def _category(category: str, number: int, name: str, args: argparse.Namespace) -> list[dict]:
    """Insert the objects of a category that one of its rooms gets by every method; return a line an object and method."""
    seed = args.seed + number
    stage = _stage(ROOMS[category], seed, args)
    settings = {method: _insert_settings(stage, category, METHODS[method], args) for method in args.methods}
    first = settings[args.methods[0]]
    room, turn = open_room(first), Lock()
    model = _in_turn(choose(first.llm, first.record, rules), turn)

    def insert_one(entry: tuple[ObjectRequest, float | None]) -> list[dict]:
        with turn:  # what is not waiting for a model is done by one at a time
            return _object(room, *entry, model, settings, args.runs / name, args.images)

    requests = _requests(category, args)[number :: args.rooms_per_category]
    with ThreadPoolExecutor(args.at_once) as pool:
        found = list(track(pool.map(insert_one, requests), category, len(requests)))
    return [{"category": category, "room_seed": seed, **row} for rows in found for row in rows]


def _in_turn(model: Model, turn: Lock) -> Model:
    """Return a model that lets others have their turn while it is asked."""

    def answer(request: Request) -> Answer:
        turn.release()
        try:
            return model(request)
        finally:
            turn.acquire()

    return answer


def _own_script(model: Model) -> Model:
    """Return a model whose scripts are our own: they place an object where the paper's method did; none were recorded."""
    return lambda request: rules(request) if request.step == "script" else model(request)


def _object(
    room: RoomState,
    request: ObjectRequest,
    size: float | None,
    model: Model,
    settings: dict[str, InsertSettings],
    out: Path,
    images: Path | None,
) -> list[dict]:
    """Insert an object by every method; return a line a method. `size` is its true longest side [m], if that is known."""
    rows, done = [], {}
    for method, how in settings.items():
        row, done[method], record = _one(room, request, size, model, how, method)
        rows.append({"object": request.file.stem, "method": method, **row})
        path = out / method / f"{request.file.stem}.json"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(record, indent=1) + "\n")
    if images:
        rater_images(room, request.file.stem, done, images)
    return rows


def _one(
    room: RoomState, request: ObjectRequest, size: float | None, model: Model, settings: InsertSettings, method: str
) -> tuple[dict, Inserted | None, dict]:
    """Insert an object; return what is measured of it, itself, and the record."""
    if method == "paper":
        model = _own_script(model)
    check = drop_check(settings.hulls, settings.placement.drop_test)
    # The paper's method does not check stability; ours does, and tries the next candidate.
    checked = check if method == "ours" else lambda *_: {"problem": ""}
    start, attempt = time.perf_counter(), Attempt(room, request, model, settings, checked)
    attempt.plan()
    inserted = attempt.fix()
    record = attempt.finished()
    said = {"seconds": round(time.perf_counter() - start, 2), "ratio": _ratio(record, size)}
    if inserted is None:
        problem = f"{'no place' if isinstance(attempt.error, NoRoom) else 'error'}: {record['problem'][:300]}"
        said |= {"problem": problem, **dict.fromkeys(CHECKS, False)}
    else:
        said |= _measured(room, inserted, check)
        said["scale"] = said["ratio"] is None or abs(said["ratio"] - 1.0) <= SCALE
        said |= {
            "target": inserted.candidate.target,
            "relation": inserted.candidate.choice.relation,
            "problem": said["fell"],
        }
    said["success"] = all(said[check] for check in CHECKS)
    tokens = {"calls": len(record["answers"])}
    tokens |= {key: sum(one[key] for one in record["answers"]) for key in ("prompt_tokens", "completion_tokens")}
    return said | tokens, inserted, record | {"object": request.file.name, "measured": said}


def _ratio(record: dict, true: float | None) -> float | None:
    """Return an object's longest side over the true one [m]; None if that is unknown, or the object never got a size."""
    size = record.get("scale", {}).get("size")
    return round(max(size) / true, 4) if size and true else None


def _measured(room: RoomState, inserted: Inserted, check: StabilityCheck) -> dict:
    """Return what holds of an object in its place."""
    scene, mesh, candidate = room.scene, inserted.part.mesh, inserted.candidate
    around = nearby(scene, *(mesh.bounds + [[-0.05], [0.05]]))
    deepest = depth(mesh, around)
    surface = np.concatenate([mesh.vertices, sample(mesh, 2000, seed=1)])
    volumes = reaching_into(room.volumes, *mesh.bounds, scene, candidate.target)
    stops = sorted({volume.part for volume in volumes if intersects(volume, surface, MAX_OVERLAP)})
    standing = Mesh(
        np.asarray(mesh.vertices, np.float64) - np.asarray(candidate.pose.position), mesh.faces, mesh.colors
    )
    still = replace(candidate, pose=replace(candidate.pose, quaternion=(0.0, 0.0, 0.0, 1.0)))
    fell = check(standing, still, scene)
    return {
        "free": deepest <= DEEPEST,
        "stable": not fell["problem"],
        "openings": not stops,
        "depth": round(deepest, 5),
        "drift": fell["drift"],
        "tilt": fell["tilt"],
        "stops": stops,
        "fell": fell["problem"],
    }


def summary(rows: list[dict]) -> list[dict]:
    """Return the table: successes by category and method, with Wilson 95 % intervals."""
    found = []
    for category in [*dict.fromkeys(row["category"] for row in rows), "all"]:
        for method in dict.fromkeys(row["method"] for row in rows):
            own = [row for row in rows if row["method"] == method and category in (row["category"], "all")]
            hits = sum(row["success"] for row in own)
            low, high = binomtest(hits, len(own)).proportion_ci(0.95, method="wilson")
            checks = {check: sum(row[check] for row in own) for check in CHECKS}
            interval = {"low": round(low, 4), "high": round(high, 4)}
            found.append({"category": category, "method": method, "n": len(own), "success": hits, **interval, **checks})
    return found


def table(rows: list[dict]) -> str:
    """Return the summary as text."""
    lines = [f"{'category':12} {'method':6} {'success':>8} {'Wilson 95 %':>16}" + "".join(f"{c:>10}" for c in CHECKS)]
    for line in summary(rows):
        ratio = f"{line['success']}/{line['n']}"
        span = f"{100 * line['low']:.0f} to {100 * line['high']:.0f} %"
        counts = "".join(f"{line[check]:>10}" for check in CHECKS)
        lines.append(f"{line['category']:12} {line['method']:6} {ratio:>8} {span:>16}{counts}")
    return "\n".join(lines)


def _insert_settings(stage: Path, category: str, method: list[str], args: argparse.Namespace) -> InsertSettings:
    """Return the settings of `s2a insert` for a method."""
    llm = [f"llm={args.llm}"]
    if args.recordings:
        file = args.recordings / f"{category.replace(' ', '_')}.json"
        llm.append(f"record={file}" if args.llm == "chat" else f"llm.answers={file}")
    return config.load(
        InsertSettings, config.compose("insert", [f"stage={stage}", "out=unused", *llm, *method, *args.settings])
    )


def _requests(category: str, args: argparse.Namespace) -> list[tuple[ObjectRequest, float | None]]:
    """Return the objects of a category, with their true longest sides [m] where these are known."""
    if category == "foreign":
        entries = yaml.safe_load(FOREIGN.read_text())
        files = [Path(str(distribution(entry["package"]).locate_file(entry["file"]))) for entry in entries]
        return [
            (ObjectRequest(file, entry["label"], ""), entry["size"]) for file, entry in zip(files, entries, strict=True)
        ]
    zoo = _zoo(args)
    truth = {entry["object"]: entry for entry in json.loads((zoo / "truth.json").read_text())["objects"].values()}
    entries = [entry for entry in yaml.safe_load((zoo / "list.yaml").read_text()) if entry["category"] == category]
    return [(ObjectRequest(zoo / e["object"], e["label"], ""), max(truth[e["object"]]["size"])) for e in entries]


def _zoo(args: argparse.Namespace) -> Path:
    """Return the folder of the objects; make it if it is not there."""
    zoo = args.runs / "zoo"
    if not zoo.exists():
        _s2a("zoo", f"out={zoo}", f"seed={args.seed}")
    return zoo


def _stage(room: str, seed: int, args: argparse.Namespace) -> Path:
    """Return the stage of a room; scan it if it is not there."""
    folder = args.runs / (room if seed == args.seed else f"{room}_{seed}")
    if not (folder / "geometric.usd").exists():
        _s2a("sample", f"room={room}", f"seed={seed}", f"out={folder / 'scan'}")
        _s2a("export", f"scan={folder / 'scan'}", f"out={folder}")
    return folder / "geometric.usd"


def _s2a(*arguments: str) -> None:
    subprocess.run([sys.executable, "-m", "s2a", *arguments], check=True)


if __name__ == "__main__":
    main()
