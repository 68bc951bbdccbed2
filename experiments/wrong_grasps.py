"""Policy and planner where the grasp is seen wrongly -> experiments/results/grasp_error.json.

    python experiments/wrong_grasps.py pools/test/pool.json [--errors 0 0.005 0.01 0.02] [--turns 0 2 5 10] [--every 4]
        [--episodes 8] [--policies pretrained planner] [--device cuda:0] [--jobs 1]
        [--out FILE]

Errors [m] without a turn, and turns [degree] without an error, of every fourth part of the pool. A row that is there is kept.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from s2a.core.outputs import atomic_write

SEED = 7


def main() -> None:
    """Measure the rows that are missing, and write all after each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pool", type=Path)
    parser.add_argument("--errors", type=float, nargs="+", default=[0.0, 0.005, 0.01, 0.02])
    parser.add_argument("--turns", type=float, nargs="+", default=[0.0, 2.0, 5.0, 10.0])
    parser.add_argument("--every", type=int, default=4)
    parser.add_argument("--episodes", type=int, default=8)
    parser.add_argument("--policies", nargs="+", default=["pretrained", "planner"])
    parser.add_argument("--device", default="cuda:0")
    parser.add_argument("--jobs", type=int, default=1, help="that run side by side")
    parser.add_argument("--out", type=Path, default=Path("experiments/results/grasp_error.json"))
    args = parser.parse_args()
    index = every(args.pool, args.every)
    points = [(error, 0.0) for error in args.errors] + [(0.0, turn) for turn in args.turns if turn]
    rows = json.loads(args.out.read_text())["rows"] if args.out.is_file() else []
    there = {(row["policy"], row["grasp_error"], row["grasp_turn"]) for row in rows}
    missing = [
        (policy, *point) for policy in args.policies for point in points if (Path(policy).name, *point) not in there
    ]
    with ThreadPoolExecutor(args.jobs) as jobs:
        for job in as_completed([jobs.submit(_row, args, index, *each) for each in missing]):
            rows.append(job.result())
            print(rows[-1], flush=True)
            with atomic_write(args.out) as file:
                file.write_text(json.dumps({"rows": sorted(rows, key=_order)}, indent=1) + "\n")


def _order(row: dict[str, object]) -> tuple[object, ...]:
    return row["policy"], row["grasp_turn"], row["grasp_error"]


def every(index: Path, step: int) -> Path:
    """Write an index of every `step`-th part beside that of all, and return it."""
    content = json.loads(index.read_text())
    place = index.with_name(f"{index.stem}_every_{step}.json")
    with atomic_write(place) as file:
        file.write_text(json.dumps({**content, "parts": content["parts"][::step]}))
    return place


def _row(args: argparse.Namespace, index: Path, policy: str, error: float, turn: float) -> dict[str, object]:
    with tempfile.TemporaryDirectory() as folder:
        found = Path(folder) / "bench.json"
        keys = [
            f"stage={index}",
            f"policy={policy}",
            f"grasp_error={error}",
            f"grasp_turn={turn}",
            f"device={args.device}",
        ]
        keys += [f"episodes={args.episodes}", f"seed={SEED}", f"out={found}"]
        subprocess.run([sys.executable, "-m", "s2a", "bench", *keys], check=True)
        measured = json.loads(found.read_text())
    over = measured["over_parts"]["all"]
    row = {
        "policy": policy,
        "grasp_error": error,
        "grasp_turn": turn,
        "parts": over["parts"],
        "episodes_a_part": args.episodes,
    }
    row |= {rate: over[rate] for rate in ("success", "grasp_success")}
    return row | {key: measured[key] for key in ("commit", "device")}


if __name__ == "__main__":
    main()
