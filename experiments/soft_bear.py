"""Does the planner put a soft teddy bear onto the bed? Twenty trials in the bedroom of the skill experiments.

    python experiments/skill_rooms.py --rooms bedroom_1     # once, on any machine
    python experiments/soft_bear.py [--device cpu] [--jobs 1] [--seeds 0 1 ... 19]

Each trial is `s2a evaluate task=pick_place physics=soft num_envs=1 seed=SEED`: start, place and the arm's noise are drawn by the
seed. Trials that have a row are not done again. Writes experiments/results/soft_bear.json after each: a row a trial, what they
come to with the Wilson 95 % interval, and the seconds that they took.
"""

from __future__ import annotations

import argparse
import time
from pathlib import Path

from skill_jobs import Row, arguments, evaluated, one, results, run

RESULTS = Path(__file__).parent / "results/soft_bear.json"
ROOM, START, PLACE = "bedroom_1", "nearby", "blanket_43"
"""From a free spot near the bed onto it."""
TRIALS = 20


def main() -> None:
    """Do what has no row, and write the results."""
    parser = arguments(__doc__, RESULTS)
    parser.set_defaults(seeds=list(range(TRIALS)), num_envs=1, rooms=[ROOM])
    args = parser.parse_args()
    if args.one:
        (seed,) = args.one
        one(args.rows / f"{seed}.json", lambda: _row(args, int(seed)))
        return
    jobs = {args.rows / f"{seed}.json": (str(seed),) for seed in args.seeds}
    run(jobs, args, lambda: results(list(jobs), len(jobs), args))


def _row(args: argparse.Namespace, seed: int) -> Row:
    """Do a trial; return how it went."""
    begun = time.perf_counter()
    metrics = evaluated(
        [f"stage={args.inputs}/{ROOM}/room.usd", "task=pick_place", "physics=soft", f"task.start={START}",
         f"task.place={PLACE}", "task.start_shift=0.03", "task.start_turn=0.8", "num_envs=1", f"device={args.device}",
         f"seed={seed}", f"states={args.rows}/{seed}.npz", *args.set],
        args.rows / "metrics" / f"{seed}.json",
    )  # fmt: skip
    row: Row = {"seed": seed, "seconds": round(time.perf_counter() - begun, 1)}
    if "trials" not in metrics:
        return row | {"cause": metrics["cause"], "why": metrics["why"]}
    (trial,) = metrics["trials"]
    if "cause" in trial:
        return row | {"cause": "no plan", "why": trial["cause"]}
    failed = [name for name, value in trial.items() if value is False and name != "success"]
    return row | trial | {"success": float(trial["success"]), "cause": f"not {failed[0]}" if failed else "", "why": ""}


if __name__ == "__main__":
    main()
