"""Golden record: what a version of s2a makes of the same inputs, as hashes and figures in one JSON file.

    python tools/golden_record.py --inputs INPUTS --work WORK --out RECORD.json [--only sample planner ...]
    python tools/golden_record.py --compare OLD.json NEW.json

It drives s2a by its command line alone (`python -m s2a`, of the version that PYTHONPATH names), so that the same program runs
before and after a redesign. Sections, each of which can run alone:

    sample      ten virtual homes with seed 300, exported: hashes of all files
    prepare     sim.usd of five of them: hashes
    planner     every drawer of the rooms below INPUTS/rooms, opened by the planner
    pick_place  every object below INPUTS/skills, placed where it was inserted
    put_in      the object and the drawer that INPUTS/skills/put_in.json names for each room
    policy      the bundled policy on each part of INPUTS/pool/pool.json, an episode each
    ppo         five iterations on the CPU, the default and +experiment=best: hashes of the last checkpoint and the logged scalars

INPUTS are files that one version made, so that all versions act in the same rooms: rooms/NAME/room.usd, prepared by
`s2a prepare targets=all`; skills/ROOM/{room.usd,insert.json,objects.json} of experiments/skill_rooms.py; a pool. WORK is filled
with what the version makes. Hashes are of content: layers as text, JSON without keys that name a commit, a version or a file.
Metrics keep all digits: two records of one version are equal, or their "repeated" rows say that they are not.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import torch
from pxr import Sdf, Usd
from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

KINDS = (
    "office", "bedroom", "kitchen", "bathroom", "living_room", "dining_room", "hallway", "laundry", "study", "workshop"
)  # fmt: skip
SEED = 300
PREPARED = KINDS[:5]
EPISODES, LONGER = 4, 1500
"""Episodes of each evaluation, and control steps of those that are repeated since none of the first ones succeeded."""
VOLATILE = {"commit", "versions", "device", "seconds", "virtual", "stage", "policy"}
"""Keys of JSON files that differ between versions that act alike."""
TIMES = ("fps", "time", "Perf", "wall")
"""In the names of logged scalars that measure the machine."""
Row = dict[str, Any]


def s2a(*arguments: str, cache: Path | None = None) -> Row:
    """Run a command of s2a; return nothing, or the last line of its errors without paths."""
    environment = {**os.environ, "HYDRA_FULL_ERROR": "0"} | ({"S2A_CACHE": str(cache)} if cache else {})
    done = subprocess.run(
        [sys.executable, "-m", "s2a", *arguments], capture_output=True, text=True, check=False, env=environment
    )
    if done.returncode == 0:
        return {}
    text = (done.stderr.strip() or "no output").splitlines()[-1]
    return {"error": re.sub(r"(/[\w.+-]+)+/", "", text)}


def digest(content: bytes | str) -> str:
    """Return the start of the SHA-256 of some content."""
    return hashlib.sha256(content.encode() if isinstance(content, str) else content).hexdigest()[:32]


def content_hash(file: Path) -> str:
    """Return the hash of a file's content, without what is volatile."""
    if file.suffix in (".usd", ".usda", ".usdc"):
        return digest(_layer_text(file))
    if file.suffix == ".json":
        return digest(json.dumps(without_volatile(json.loads(file.read_text())), sort_keys=True))
    return digest(file.read_bytes())


def _layer_text(file: Path) -> str:
    layer = Sdf.Layer.OpenAsAnonymous(str(file))
    layer.customLayerData = {k: v for k, v in layer.customLayerData.items() if k.split(":")[-1] not in VOLATILE}
    layer.comment = layer.documentation = ""
    return str(layer.ExportToString())


def without_volatile(value: Any) -> Any:
    """Return a JSON value without volatile keys, at any depth."""
    if isinstance(value, dict):
        return {key: without_volatile(each) for key, each in value.items() if key not in VOLATILE}
    return [without_volatile(each) for each in value] if isinstance(value, list) else value


def hashes(folder: Path) -> dict[str, str]:
    """Return the content's hash of each file below a folder."""
    return {str(f.relative_to(folder)): content_hash(f) for f in sorted(folder.rglob("*")) if f.is_file()}


def sample(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Scan and export the virtual homes."""
    for kind in KINDS:
        yield f"{kind}_{SEED}", _home(kind, args.work / f"homes/{kind}")


def _home(kind: str, folder: Path) -> Row:
    shutil.rmtree(folder, ignore_errors=True)
    keys = [f"room={kind}", f"seed={SEED}", "detail=demo", f"out={folder}/scan"]
    failure = s2a("sample", *keys, "virtual=varied")
    if "virtual" in failure.get("error", ""):  # a version with one generation of homes has no such key
        failure = s2a("sample", *keys)
    return failure or s2a("export", f"scan={folder}/scan", f"out={folder}") or {"files": hashes(folder)}


def prepare(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Prepare the first homes, with an empty cache."""
    for kind in PREPARED:
        folder, out = args.work / f"homes/{kind}", args.work / f"prepared/{kind}"
        failure = {} if (folder / "geometric.usd").exists() else _home(kind, folder)
        shutil.rmtree(out, ignore_errors=True)
        shutil.rmtree(args.work / "cache", ignore_errors=True)
        keys = [f"stage={folder}/geometric.usd", "targets=all", f"out={out}/room.usd"]
        if failure.get("error"):
            yield kind, failure
        else:
            yield kind, s2a("prepare", *keys, cache=args.work / "cache") or {"files": hashes(out)}


def planner(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Open every drawer of the prepared rooms; the first two drawers twice."""
    drawers = [
        (room, part) for room in sorted((args.inputs / "rooms").iterdir()) for part in _drawers(room / "room.usd")
    ]
    jobs = {f"{room.name}/{part}": [f"stage={room}/room.usd", f"part={part}", "sim=planner"] for room, part in drawers}
    yield from evaluations(args, "planner", jobs, repeated=2)


def _drawers(file: Path) -> list[str]:
    stage = Usd.Stage.Open(str(file), Usd.Stage.LoadNone)
    joints = [prim.GetName() for prim in stage.Traverse() if prim.GetTypeName() == "PhysicsPrismaticJoint"]
    return [name for name in joints if re.fullmatch(r"drawer_\d+", name)]


def pick_place(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Pick every inserted object near its place, and place it."""
    jobs = {}
    for room in sorted(each.parent for each in (args.inputs / "skills").glob("*/objects.json")):
        for each in json.loads((room / "objects.json").read_text()).values():
            if each["free"]:
                jobs[f"{room.name}/{each['id']}"] = [
                    f"stage={room}/room.usd", f"part={each['id']}", "task=pick_place", "sim=pick_place",
                    "task.start=nearby", f"task.place={room}/insert.json",
                ]  # fmt: skip
    yield from evaluations(args, "pick_place", jobs)


def put_in(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Put an object into a drawer of each room."""
    folder = args.inputs / "skills"
    jobs = {
        f"{room}/{name}": [
            f"stage={folder}/{room}/room.usd", f"part={name}", "task=put_in", "sim=put_in", "task.start=nearby",
            f"task.place={drawer}",
        ]
        for room, (name, drawer) in json.loads((folder / "put_in.json").read_text()).items()
    }  # fmt: skip
    yield from evaluations(args, "put_in", jobs)


def policy(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Let the bundled policy open every part of the pool, once."""
    index = args.inputs / "pool/pool.json"
    count = len(json.loads(index.read_text())["parts"])
    out = args.work / "policy.json"
    failure = s2a(
        "evaluate", f"stage={index}", "policy=pretrained", f"num_envs={count}", "seed=7", "device=cpu", f"out={out}"
    )
    if failure:
        yield "all", failure
        return
    metrics = json.loads(out.read_text())
    yield "all", figures(metrics)
    for row in metrics["parts"]:
        yield f"{row['room'].removesuffix('.usd')}/{row['part']}", {k: row[k] for k in ("success", "grasp_success")}


def evaluations(
    args: argparse.Namespace, section: str, jobs: dict[str, list[str]], repeated: int = 0
) -> Iterator[tuple[str, Row]]:
    """Evaluate the planner with the keys of each job, some of them twice; yield what came out, in the order of the jobs."""

    def run(name: str, suffix: str = "") -> Row:
        out = args.work / section / f"{re.sub(r'[^a-z0-9]+', '_', name)}{suffix}.json"
        out.parent.mkdir(parents=True, exist_ok=True)
        begun = time.monotonic()
        common = [f"num_envs={EPISODES}", "seed=0", "device=cpu", f"out={out}"]
        row = s2a("evaluate", *jobs[name], *common) or figures(json.loads(out.read_text()))
        if section == "planner" and row.get("rates", {}).get("success") == 0.0:  # the episode may cut the plan off
            longer = f"task.episode_steps={LONGER}"
            row = s2a("evaluate", *jobs[name], *common, longer) or figures(json.loads(out.read_text()))
            row["episode_steps"] = LONGER
        return row | {"seconds": round(time.monotonic() - begun, 1)}

    jobs = {name: keys for name, keys in jobs.items() if re.search(args.rows, name)}
    with ThreadPoolExecutor(args.jobs) as pool:
        yield from zip(jobs, pool.map(run, jobs), strict=True)
        for name in list(jobs)[:repeated]:
            yield f"{name}, again", run(name, "_again")


def figures(metrics: Row) -> Row:
    """Return the rates of an evaluation, its values' means with all digits, and a hash of all that is not volatile."""
    rates = {name: value["rate"] for name, value in metrics.items() if isinstance(value, dict) and "rate" in value}
    means = {name: value["mean"] for name, value in metrics.items() if isinstance(value, dict) and "mean" in value}
    return {"rates": rates, "means": means, "hash": digest(json.dumps(without_volatile(metrics), sort_keys=True))}


def ppo(args: argparse.Namespace) -> Iterator[tuple[str, Row]]:
    """Train five iterations with 16 worlds on the CPU: the default twice, and from demonstrations."""
    room = min((args.inputs / "rooms").glob("office*"))
    part = _drawers(room / "room.usd")[0]
    keys = [f"stage={room}/room.usd", f"part={part}", "num_envs=16", "ppo.iterations=5", "seed=0", "device=cpu"]
    for name, experiment in (
        ("paper", []),
        ("paper, again", []),
        ("best", ["+experiment=best", "ppo.cuda_graph=false"]),
    ):
        out = args.work / f"ppo/{name.replace(', ', '_')}"
        shutil.rmtree(out, ignore_errors=True)
        yield name, s2a("train", *experiment, *keys, f"out={out}") or _training(out)


def _training(folder: Path) -> Row:
    """Return hashes of the last checkpoint's tensors and of all logged scalars but times, and the rewards as logged."""
    last = max(folder.glob("model_*.pt"), key=lambda file: int(file.stem.split("_")[1]))
    tensors = sorted(_tensors(torch.load(last, map_location="cpu", weights_only=True)))
    log = EventAccumulator(str(folder)).Reload()
    tags = [tag for tag in sorted(log.Tags()["scalars"]) if not any(word in tag for word in TIMES)]
    scalars = {tag: [(event.step, repr(event.value)) for event in log.Scalars(tag)] for tag in tags}
    return {
        "checkpoint": last.name,
        "tensors": digest("".join(f"{shape}{value}" for _, shape, value in tensors)),
        "names": [name for name, _, _ in tensors],
        "scalars": digest(json.dumps(sorted(scalars.values()))),
        "rewards": {tag: [value for _, value in values] for tag, values in scalars.items() if "reward" in tag.lower()},
    }


def _tensors(value: Any, name: str = "") -> Iterator[tuple[str, str, str]]:
    """Yield name, shape and hash of each tensor of a checkpoint."""
    if isinstance(value, torch.Tensor):
        yield name, str(tuple(value.shape)), digest(value.contiguous().numpy().tobytes())
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from _tensors(each, f"{name}.{key}")
    elif isinstance(value, list | tuple):
        for index, each in enumerate(value):
            yield from _tensors(each, f"{name}.{index}")


SECTIONS: dict[str, Callable[[argparse.Namespace], Iterator[tuple[str, Row]]]] = {
    each.__name__: each for each in (sample, prepare, planner, pick_place, put_in, policy, ppo)
}


def compare(old: Row, new: Row) -> Iterator[str]:
    """Yield a line for each row that differs between two records, and one for each section."""
    for section in old.keys() & new.keys():
        before, after = (_plain(record[section]["rows"]) for record in (old, new))
        both = [name for name in before if name in after]
        different = [name for name in both if before[name] != after[name]]
        for name in different:
            yield f"{section} {name}\n    {json.dumps(before[name])[:900]}\n    {json.dumps(after[name])[:900]}"
        rates = sum(before[name].get("rates") == after[name].get("rates") for name in both)
        yield (
            f"{section}: {len(both) - len(different)} of {len(both)} rows are equal, {rates} in their rates; "
            f"{len(before) - len(both)} are missing"
        )


def _plain(rows: dict[str, Row]) -> dict[str, Row]:
    return {name: {key: value for key, value in row.items() if key != "seconds"} for name, row in rows.items()}


def main() -> None:
    """Run the sections; write the record after each row."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=Path)
    parser.add_argument("--work", type=Path)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--only", nargs="+", choices=list(SECTIONS), default=list(SECTIONS))
    parser.add_argument(
        "--rows", default="", help="regular expression: the evaluations to run; others stay in the record"
    )
    parser.add_argument("--jobs", type=int, default=1, help="evaluations side by side")
    parser.add_argument("--compare", type=Path, nargs=2, metavar=("OLD", "NEW"))
    args = parser.parse_args()
    if args.compare:
        print("\n".join(compare(*(json.loads(file.read_text()) for file in args.compare))))
        return
    args.inputs, args.work = args.inputs.absolute(), args.work.absolute()
    for section in args.only:
        begun, rows = time.monotonic(), {}
        for name, row in SECTIONS[section](args):
            rows[name] = row
            print(section, name, json.dumps(row)[:200], flush=True)
            # Read anew each time: sections that run side by side write the same record.
            record = json.loads(args.out.read_text()) if args.out.exists() else {}
            earlier = record.get(section, {}).get("rows", {}) if args.rows else {}
            seconds, merged = round(time.monotonic() - begun, 1), earlier | rows
            record[section] = {"seconds": seconds, "rows": merged, "repeated": _repeated(merged)}
            args.out.write_text(json.dumps(record, indent=1) + "\n")


def _repeated(rows: dict[str, Row]) -> dict[str, bool]:
    """Return for each row that was run twice whether both came out equal."""
    plain = _plain(rows)
    return {name: row == plain[f"{name}, again"] for name, row in plain.items() if f"{name}, again" in plain}


if __name__ == "__main__":
    main()
