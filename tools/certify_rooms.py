"""Prepare and certify every movable part of virtual rooms; the pass rate for each style of handle.

    python tools/certify_rooms.py --rooms office kitchen --seeds 0 1 2 --detail demo --work runs/certify \
        --out experiments/results/certificates.json
    python tools/certify_rooms.py --rooms kitchen:1 study:3 --work runs/certify --out FILE.json

A room with a colon has its own seed. Handles are counted by family ("rail", "bow").
With `--planner 4` the planner then opens each part in 4 worlds, and the file says where it and the certificate's "graspable"
disagree, with the reasons of both.

What lies in the work folder already (scans, stages, reports of the same stage and settings) is kept, so that an
interrupted run goes on where it stopped.
"""

from __future__ import annotations

import argparse
import dataclasses
import functools
import json
import logging
import multiprocessing
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.table import Table

from s2a import scan
from s2a.certify import report
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.commands import evaluate
from s2a.core import config
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.progress import track
from s2a.core.provenance import provenance
from s2a.homes.sample import SampleConfig, sample
from s2a.learn.evaluate import rate, run_episodes
from s2a.motion.policy import Planner
from s2a.prepare.grasp import find_target
from s2a.prepare.part import ALL
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.scene import Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.stamp import content_hash
from s2a.sim.simulation import Simulation
from s2a.tasks import make_env


def main() -> None:
    """Certify the parts, write the reports and print a table."""
    asked = _arguments()
    logging.disable(logging.WARNING)
    rooms = [(room, seed, asked) for name in asked.rooms for room, seed in _seeded(name, asked.seeds)]
    found = []
    # Processes start afresh: a forked one would share Warp's and MuJoCo's threads and locks.
    with ProcessPoolExecutor(asked.processes, multiprocessing.get_context("spawn")) as pool:
        parts = [(*part, asked) for found in pool.map(_parts, rooms) for part in found]
        for result in track(pool.map(_part, parts), "certifying", len(parts)):
            found.append(result)
            whole = {
                "detail": asked.detail,
                "prepare": asked.prepare,
                "styles": rates(found),
                **({"planner": agreement(found)} if asked.planner else {}),
                "parts": found,
            }
            with atomic_write(asked.out) as out:
                out.write_text(json.dumps(whole | provenance("cpu"), indent=1))
    Console(width=160).print(_table(rates(found)))
    if asked.planner:
        print(json.dumps(agreement(found), indent=1))
    for part in found:
        if not part["passed"]:
            print(f"{part['room']} {part['seed']} {part['target']} ({part['style']}): {'; '.join(part['failed'])}")


def rates(found: list[dict[str, Any]]) -> dict[str, dict[str, int]]:
    """Count by style of handle: parts, passed, parts that a gripper can hold."""
    styles: dict[str, dict[str, int]] = {}
    for part in found:
        counts = styles.setdefault(part["style"], {"parts": 0, "passed": 0, "graspable": 0})
        counts["parts"] += 1
        counts["passed"] += part["passed"]
        counts["graspable"] += part["graspable"] is True
    return dict(sorted(styles.items()))


def agreement(found: list[dict[str, Any]]) -> dict[str, Any]:
    """Return how often certificate and planner agree on parts with a verdict of both, and the parts on which they do not.

    The planner's verdict is that it grasps the part in most worlds. It has none of a part that it cannot reach: without a free
    base or a plan; of a part that is not prepared there is neither.
    """
    judged = [part for part in found if part["graspable"] is not None and part["planner"] is not None]
    both = [part for part in judged if part["planner"]["grasped"] is not None]
    pairs = [(part["graspable"], 2 * part["planner"]["grasped"] > part["planner"]["worlds"]) for part in both]
    kinds = {"both": (True, True), "neither": (False, False), "certificate": (True, False), "planner": (False, True)}
    seconds = [part["seconds"] for part in judged]
    counts = {kind: pairs.count(pair) for kind, pair in kinds.items()}
    apart = [part for part, (certificate, planner) in zip(both, pairs, strict=True) if certificate != planner]
    return {
        "parts": len(both),
        "agree": rate(sum(a == b for a, b in pairs), len(both)) if both else None,
        "graspable_by": counts,
        "out_of_reach": [
            f"{p['room']} {p['seed']} {p['target']}: {p['planner']['text']}" for p in judged if p not in both
        ],
        "certificate_seconds": {"mean": float(np.mean(seconds)), "max": max(seconds)} if seconds else None,
        "apart": [
            f"{p['room']} {p['seed']} {p['target']} ({p['style']}): certificate: {p['closure']}; planner: {p['planner']['text']}"
            for p in apart
        ],
    }


def _planner(stage: Path, part: str, worlds: int) -> dict[str, Any]:
    """Return how often the planner opens and pinches a part, or why it does not try: `grasped` is None then.

    A region wider than the gripper opens is not pinched, though the task's metric counts one finger there.
    """
    keys = [f"stage={stage}", f"part={part}", "out=-", f"num_envs={worlds}", "device=cpu"]
    settings = config.load(evaluate.Config, config.compose("evaluate", keys))
    try:
        stages = settings.read_stages()
        sim = Simulation(stages, settings.sim, worlds, "cpu")
        env = make_env(sim, settings.task, settings.metrics, {}, settings.seed)
        base = stages[0].room.articulations[part].bases[stages[0].robot]
        if not base.free:
            return {"worlds": worlds, "opened": None, "grasped": None, "text": f"no base: {base.reason}"}
        planner = Planner(env, settings.planner)
    except InputError as error:
        return {"worlds": worlds, "opened": None, "grasped": None, "text": f"no plan: {error}"}
    env.lengthen(planner.episode_steps)
    columns = run_episodes(env, planner)
    opened, grasped = (int(columns[name].sum()) for name in ("success", "grasp_success"))
    text = f"opened {opened}, grasped {grasped} of {worlds}"
    if float(stages[0].grasp_size[1]) >= sim.robot.gripper.max_opening and not stages[0].internal:
        return {"worlds": worlds, "opened": opened, "grasped": 0, "text": f"{text}, by one finger: too wide to pinch"}
    return {"worlds": worlds, "opened": opened, "grasped": grasped, "text": text}


def _seeded(name: str, seeds: list[int]) -> list[tuple[str, int]]:
    """Return a room with its own seed ("kitchen:1"), or with each of those given for all."""
    room, _, own = name.partition(":")
    return [(room, int(seed)) for seed in ([own] if own else seeds)]


def _folder(room: str, seed: int, asked: argparse.Namespace) -> Path:
    return asked.work / f"{room}_{seed}_{asked.detail}"


def _parts(case: tuple[str, int, argparse.Namespace]) -> list[tuple[str, int, str]]:
    """Scan and prepare a room, unless that was done before, and return room, seed and id of each articulated part."""
    room, seed, asked = case
    logging.disable(logging.WARNING)
    folder = _folder(room, seed, asked)
    if not (folder / "scan/truth/truth.json").exists():
        keys = [f"room={room}", f"seed={seed}", f"detail={asked.detail}"]
        keys.append(f"out={folder / 'scan'}")
        with atomic_write(folder / "scan", earlier="truth/truth.json") as out:
            sample(config.load(SampleConfig, config.compose("sample", keys)), out)
    stage = _stage(folder, asked)
    if not stage.exists():
        values = config.compose("prepare", [f"prepare={asked.prepare}", "stage=x", "out=y"])
        ready = prepare(_scene(folder), ALL, config.load(PrepareConfig, values["prepare"]))
        with atomic_write(sim_stage.visuals_file(stage)) as visuals, atomic_write(stage) as out:
            sim_stage.write(ready, out, visuals)
    return [(room, seed, part) for part in _scene(folder).movable]


def _stage(folder: Path, asked: argparse.Namespace) -> Path:
    return folder / f"{asked.prepare}.usd"


@functools.lru_cache(maxsize=1)
def _scene(folder: Path) -> Scene:
    return scan.read(folder / "scan")


def _part(case: tuple[str, int, str, argparse.Namespace]) -> dict[str, Any]:
    """Return the report of a movable part."""
    room, seed, target, asked = case
    logging.disable(logging.WARNING)
    folder = _folder(room, seed, asked)
    truth = json.loads((folder / "scan/truth/truth.json").read_text())["parts"]
    held = [truth[part] for part in _scene(folder).grasp_parts(target) if part in truth]
    styles = {part.get("facts", {}).get("family", part["style"]) for part in held}
    style = ", ".join(sorted(filter(None, styles))) or "none"
    row = {"room": room, "seed": seed, "target": target, "style": style, **_certified(folder, target, asked)}
    if not asked.planner:
        return row
    return {**row, "planner": _planned(folder, target, asked) if "closure" in row else None}


def _planned(folder: Path, part: str, asked: argparse.Namespace) -> dict[str, Any]:
    """Return the planner's verdict of a part; one of the same stage by the same code is kept."""
    stage, record = _stage(folder, asked), folder / asked.prepare / f"{part}.planner.json"
    about = {"sha256": content_hash(stage), "worlds": asked.planner, **provenance("cpu")}
    if record.exists() and not str(about["commit"]).endswith("+"):
        earlier = json.loads(record.read_text())
        if earlier["about"] == about:
            return earlier["verdict"]
    verdict = _planner(stage, part, asked.planner)
    with atomic_write(record) as out:
        out.write_text(json.dumps({"about": about, "verdict": verdict}))
    return verdict


def _certified(folder: Path, part: str, asked: argparse.Namespace) -> dict[str, Any]:
    """Certify one part of a prepared room; what could not be prepared has not passed."""
    stage, record = _stage(folder, asked), folder / asked.prepare / f"{part}.json"
    if part not in sim_stage.read(stage, visuals=False).articulations:
        return {"passed": False, "graspable": None, "failed": [f"not prepared: {_reason(folder, part)}"]}
    settings = config.load(CertifyConfig, config.compose("certify", ["stage=x", "out=y"])["certify"])
    asked_of = dataclasses.asdict(settings)
    done = report.kept(record, content_hash(stage), asked_of, provenance("cpu"), [part])
    (result,) = done or certify(stage, settings, part)
    with atomic_write(record) as out:
        out.write_text(report.to_json([result]))
    by_name = {check.name: check for check in result.checks}
    numbers = {
        name: by_name[name].value for name in ("finger_gap", "grasp_hold", "sweep_penetration") if name in by_name
    }
    failed = [f"{check.name} at {check.prim}: {report.number(check)} {check.message}" for check in result.failed]
    return {
        "passed": result.passed, "graspable": result.graspable, "failed": failed, "seconds": result.seconds,
        "closure": by_name["grasp_hold"].message if "grasp_hold" in by_name else "", "values": numbers,
    }  # fmt: skip


def _reason(folder: Path, part: str) -> str:
    """Return why a part cannot be prepared."""
    try:
        find_target(_scene(folder), part)
    except InputError as error:
        return str(error)
    return "s2a prepare said why"


def _table(styles: dict[str, dict[str, int]]) -> Table:
    table = Table("handle", "parts", "passed", "graspable")
    for style, counts in styles.items():
        table.add_row(style, *(str(counts[key]) for key in ("parts", "passed", "graspable")))
    return table


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", default=["office"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[0])
    parser.add_argument("--detail", default="demo")
    parser.add_argument("--prepare", default="handle", help="settings of conf/prepare")
    parser.add_argument("--planner", type=int, default=0, help="worlds in which the planner opens each part")
    parser.add_argument("--processes", type=int, default=1)
    parser.add_argument("--work", type=Path, required=True)
    parser.add_argument("--out", type=Path, required=True)
    return parser.parse_args()


if __name__ == "__main__":
    main()
