"""What the skill experiments share: jobs side by side in processes, a row each, and what the rows come to."""

from __future__ import annotations

import argparse
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path
from typing import Any

from scipy.stats import binomtest
from skill_rooms import DEFAULT, NAMES

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.motion.grasps import Ungraspable

SEGMENT = re.compile(r": (grasp|base|place|approach and lift|lowering and retreat|reach|carry|handle)\b")
"""In a planner's refusal: which segment of the plan fails."""
Row = dict[str, Any]


def arguments(doc: str | None, results: Path) -> argparse.ArgumentParser:
    """Return a parser of what all skill experiments take."""
    parser = argparse.ArgumentParser(description=doc, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--inputs", type=Path, default=Path("runs/skills/inputs"), help="of experiments/skill_rooms.py")
    parser.add_argument("--rows", type=Path, default=Path("runs/skills") / results.stem, help="a file for each job")
    parser.add_argument("--out", type=Path, default=results)
    parser.add_argument("--rooms", nargs="*", default=DEFAULT, choices=list(NAMES))
    parser.add_argument("--num-envs", type=int, default=8)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--jobs", type=int, default=1, help="processes side by side")
    parser.add_argument("--seeds", type=int, nargs="+", default=[0])
    parser.add_argument("--set", nargs="*", default=[], help="further keys of s2a evaluate, such as sim.iterations=50")
    parser.add_argument("--one", nargs="+", help="do one job in this process and write its row")
    return parser


def one(path: Path, row: Callable[[], Row]) -> None:
    """Write the row of one job."""
    found = row()
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as temporary:
        temporary.write_text(json.dumps(found, indent=1) + "\n")
    print(json.dumps(found), flush=True)


def run(jobs: Mapping[Path, Sequence[str]], args: argparse.Namespace, write: Callable[[], None]) -> None:
    """Do the jobs whose row is missing, each in a process of its own: this script with `--one` and what the job is called by.

    `write` is called after each, so that the results hold what was done when all is cut off.
    """
    common = [
        f"--inputs={args.inputs}",
        f"--rows={args.rows}",
        f"--num-envs={args.num_envs}",
        f"--device={args.device}",
    ]
    threads = str(max(1, len(os.sched_getaffinity(0)) // args.jobs))
    limits = {name: threads for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")}

    def start(path: Path, names: Sequence[str]) -> None:
        lists = ["--seeds", *map(str, args.seeds), "--set", *args.set, "--one", *names]
        command = [sys.executable, sys.argv[0], *common, *lists]
        done = subprocess.run(command, capture_output=True, text=True, check=False, env={**os.environ, **limits})
        print(" ".join(names), (done.stdout or done.stderr or "no output").strip().splitlines()[-1], flush=True)
        if done.returncode:  # such as a crash of a driver; not written as a row, so that the next start tries again
            print(done.stderr[-2000:], file=sys.stderr, flush=True)

    with ThreadPoolExecutor(args.jobs) as pool:
        for future in as_completed([pool.submit(start, *job) for job in jobs.items() if not job[0].exists()]):
            future.result()
            write()
    write()


def evaluated(keys: Sequence[str], out: Path) -> Row:
    """Return what `s2a evaluate` writes with some keys, or the cause for which it refuses."""
    from s2a.commands import evaluate
    from s2a.core import config

    settings = config.load(evaluate.Config, config.compose("evaluate", [*keys, f"out={out}"]))
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        evaluate.run(settings)
    except InputError as error:
        return cause_of(error)
    return dict(json.loads(out.read_text()))


def cause_of(error: InputError) -> Row:
    """Return the cause of a failure before any episode, and what was said."""
    if isinstance(error.__cause__ or error, Ungraspable):  # what a command raises names its output, and has a cause
        return {"cause": "does not fit the gripper", "why": str(error)}
    if "the search ended" in str(error):
        return {"cause": "search ended", "why": str(error)}
    found = SEGMENT.search(str(error))
    spot = "no free spot" if "spot that is free for" in str(error) else "refused"
    return {"cause": f"no plan: {found[1]}" if found else spot, "why": str(error)}


def summarized(metrics: Row, columns: Sequence[str], values: Sequence[str]) -> Row:
    """Return of an evaluation the rates of columns, the largest of values, the limits used, and the first column that failed."""
    row = {c: metrics[c]["rate"] for c in ("success", *columns)} | {c: round(metrics[c]["max"], 4) for c in values}
    failed = [c for c in columns if metrics[c]["rate"] < 1.0]
    row |= {"limit_use": {name: round(x, 3) for name, x in metrics["limit_use"].items()}}
    errors = {c: metrics[c] for c in ("invalid", "row_overflow", "contact_overflow") if metrics[c]}
    return row | errors | {"cause": f"not {failed[0]}" if failed else "", "why": ""}


def results(paths: Sequence[Path], of: int, args: argparse.Namespace) -> None:
    """Write the rows that are done, what they come to (Wilson 95 %), and the peaks of the robot's limits over all of them."""
    rows = [json.loads(path.read_text()) for path in paths if path.exists()]
    if not rows:
        return
    total = totals(rows, of, args.num_envs)
    head = {**provenance(args.device), "num_envs": args.num_envs, "seeds": args.seeds, "set": args.set, "total": total}
    args.out.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(args.out) as temporary:
        temporary.write_text(json.dumps({**head, "peaks": _peaks(rows), "rows": rows}, indent=1) + "\n")


def totals(rows: Sequence[Row], of: int, num_envs: int) -> Row:
    """Return what rows come to, with the Wilson 95 % interval; `planned` are the episodes of what the planner has a plan for."""
    sizes = [row.get("episodes", num_envs) for row in rows]
    planned = sum(row.get("planned", n if "success" in row else 0) for n, row in zip(sizes, rows, strict=True))
    hits, count = round(sum(n * row.get("success", 0.0) for n, row in zip(sizes, rows, strict=True))), sum(sizes)
    low, high = binomtest(hits, count).proportion_ci(0.95, method="wilson")
    causes = {row["cause"]: sum(r["cause"] == row["cause"] for r in rows) for row in rows if row["cause"]}
    total = {"rows": len(rows), "of": of, "episodes": count, "planned": planned, "success": hits}
    total |= {"fraction": round(hits / count, 4), "low": round(float(low), 4), "high": round(float(high), 4)}
    return total | {"fraction_of_planned": round(hits / max(planned, 1), 4), "rows_by_cause_of_failure": causes}


def _peaks(rows: Sequence[Row]) -> dict[str, float]:
    """Return the largest fraction of each of the robot's limits in any row."""
    used = [row["limit_use"] for row in rows if "limit_use" in row]
    return {name: max(each[name] for each in used) for name in (used[0] if used else ())}
