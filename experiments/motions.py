"""Pulls by gradient, replayed under full contact physics, beside the planner's own and CMA-ES at equal evaluations.

    python experiments/motions.py ROOM.usd ... [--joints 20] [--seed 0] [--out FILE] [--corrected]

Parts of prepared rooms are drawn, slides and hinges in turn; every second one gets dynamics as `s2a identify` would write
them (a mass of 0.5 to 2 times the stage's, 1 to 15 N s/m, 0.5 to 5 N, 1 to 20 N/m at its grasp point), the others keep the
stage's. Parts that the arm cannot follow, or that the planner's own pull does not open, are skipped and named.

Pulls are optimised for the planner's own time and for a free one. `eased_fast` is the planner's ease in the time that the
gradient chose, `eased_faster` in LAG less, so that it arrives as early. CMA-ES gets as many evaluations of the same loss as the
gradient's were, and then goes on, to tell how many it needs for the same cost (--more times as many at most).
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import cma
import numpy as np
from motion_parts import planned, settings_of
from replayed import Replay, replay

from s2a.core import config
from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.joints.pull_optimize import Optimum, PullConfig, PullLoss, optima, optimize
from s2a.joints.pulled import Pulled
from s2a.motion.trajectory import PullLaw

RESULTS = Path(__file__).parent / "results/motions.json"
OPENED = 0.9
"""Fraction of the goal from which the planner's own pull has opened a part."""
END, REST = 0.003, 0.005
"""[m, m/s] Within which a part has arrived."""
HOLD = 1.0
"""[s] For which the set-point stands after the pull."""
SIGMA, POPULATION = 0.05, 11
"""Of CMA-ES: its first step, and its own default population for 14 variables."""
LAG = 0.45
"""[s] After its set-point a part that is pulled with the planner's ease arrives, about."""
REPEATED = ("gradient_same_time", "gradient_free_time")
CURVES = ("planner", *REPEATED)
CLOSE = 1.05
"""Times the gradient's cost, below which CMA-ES has found as good a pull."""


def main() -> None:
    """Optimise all pulls, replay them, write the file, and print the medians."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("rooms", type=Path, nargs="+", metavar="ROOM")
    parser.add_argument("--joints", type=int, default=20)
    parser.add_argument("--more", type=int, default=10)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--out", type=Path, default=RESULTS)
    parser.add_argument("--corrected", action="store_true", help="repeat pulls of --out that missed")
    given = parser.parse_args()
    pulls = config.load(PullConfig, config.compose("pull/default")["pull"])
    if given.corrected:
        return corrected(given, pulls)
    with tempfile.TemporaryDirectory() as folder:
        parts, skipped = planned(given.rooms, given.joints, given.seed, Path(folder))
        found, about = searched(parts, pulls, given)
        rows = []
        for i, part in enumerate(parts):
            if sum(row["kind"] == part["kind"] for row in rows) < given.joints / 2:
                row = _row(part, {name: each[i] for name, each in found.items()}, given.seed)
                if row["pulls"]["planner"]["opened"] < OPENED:
                    skipped[part["part"]] = "the planner's own pull does not open it"
                else:
                    rows.append(row)
    about |= {"seed": given.seed, "pull": asdict(pulls), "skipped": skipped, **provenance("cpu")}
    write(given.out, about, rows)


def write(file: Path, about: dict[str, Any], rows: Sequence[dict[str, Any]]) -> None:
    """Write rows with what they come to, and print that."""
    both = {key: summary([row["pulls"][key] for row in rows]) for key in rows[0]["pulls"]}
    with atomic_write(file) as out:
        out.write_text(json.dumps({**about, "figures": both, "rows": rows}))
    print(json.dumps({**about, **both}, indent=1))


def corrected(given: argparse.Namespace, pulls: PullConfig) -> None:
    """Repeat the gradient's pulls of a file that missed by more than END, optimised for what they missed: `*_again`.

    Where the first pull was good it counts.
    """
    about = json.loads(given.out.read_text())
    rows = about.pop("rows")
    about.pop("figures")
    for row in rows:
        for name in REPEATED:
            first = row["pulls"][name]
            row["pulls"][f"{name}_again"] = {key: first[key] for key in first if key not in ("opening", "force")}
    missed = [row for row in rows if any(abs(row["pulls"][name]["end_mm"]) > 1e3 * END for name in REPEATED)]
    with tempfile.TemporaryDirectory() as folder:
        names = {row["part"] for row in missed}
        parts = {part["part"]: part for part in planned(given.rooms, given.joints, given.seed, Path(folder), names)[0]}
        ordered = [parts[row["part"]] for row in missed]
        laws = {}
        for name in REPEATED:
            offsets = [1e-3 * row["pulls"][name]["later_mm"] for row in missed]
            known = [replace(part["pulled"], offset=off) for part, off in zip(ordered, offsets, strict=True)]
            seconds = np.array([part["seconds"] for part in ordered]) if name == REPEATED[0] else None
            laws[name] = [found.law for found in optimize(known, pulls, seconds)[0]]
        for i, (row, part) in enumerate(zip(missed, ordered, strict=True)):
            of_part = [each[i] for each in laws.values()]
            replays = replay(part["stage"], settings_of(part["stage"]), of_part, HOLD, given.seed)
            for name, motion in zip(laws, replays, strict=True):
                if abs(row["pulls"][name]["end_mm"]) > 1e3 * END:
                    row["pulls"][f"{name}_again"] = figures(motion, row["goal"]) | {"repeated": True}
            print(row["part"], {name: round(row["pulls"][f"{name}_again"]["end_mm"], 2) for name in laws}, flush=True)
    write(given.out, about, rows)


def searched(
    about: Sequence[dict[str, Any]], pulls: PullConfig, given: argparse.Namespace
) -> tuple[dict[str, list[Optimum]], dict[str, Any]]:
    """Return pulls of every part by gradient and CMA-ES, in the planner's time and in a free one, and what they took."""
    parts, own = [part["pulled"] for part in about], np.array([part["seconds"] for part in about])
    found, took = {}, {}
    for name, seconds in (("same_time", own), ("free_time", None)):
        began = time.monotonic()
        gradient, rounds = optimize(parts, pulls, seconds)
        took[name] = {"parts": len(parts), "evaluations": rounds, "gradient_seconds": time.monotonic() - began}
        costs, began = np.array([each.cost for each in gradient]), time.monotonic()
        evolved, needed = evolve(parts, pulls, seconds, rounds, given.more, costs, given.seed)
        took[name] |= {"cma_seconds": time.monotonic() - began, "cma_needs": needed}
        print(name, took[name], flush=True)
        found |= {f"gradient_{name}": gradient, f"cma_{name}": evolved}
    return found, took


def evolve(
    parts: Sequence[Pulled],
    pulls: PullConfig,
    seconds: np.ndarray | None,
    evaluations: int,
    more: int,
    costs: np.ndarray,
    seed: int,
) -> tuple[list[Optimum], list[int | None]]:
    """Return what CMA-ES finds of each part in so many evaluations, and in how many it finds CLOSE times given costs.

    The latter in `more` times as many at most, None: in none of them. Gradient and CMA-ES start at the planner's own ease.
    """
    loss = PullLoss(parts, pulls, seconds, copies=POPULATION)
    starts = loss.start()[::POPULATION]
    about = {"bounds": [0.0, 1.0], "popsize": POPULATION, "seed": seed + 1, "verbose": -9, "maxiter": 10**6}
    each = [cma.CMAEvolutionStrategy(np.clip(x, 0.01, 0.99), SIGMA, about) for x in starts]
    best, needed, found = np.full(len(parts), np.inf), [None] * len(parts), starts.copy()
    for generation in range(-(-evaluations * more // POPULATION)):
        points = [search.ask() for search in each]
        values = loss.costs(np.array(points).reshape(-1, loss.variables)).reshape(len(parts), -1)
        for i, search in enumerate(each):
            search.tell(points[i], values[i].tolist())
            if values[i].min() < best[i]:
                best[i] = values[i].min()
                if (generation + 1) * POPULATION <= evaluations + POPULATION // 2:
                    found[i] = points[i][values[i].argmin()]
            if needed[i] is None and best[i] <= CLOSE * costs[i]:
                needed[i] = (generation + 1) * POPULATION
        if None not in needed and generation * POPULATION > evaluations:
            break
    return optima(PullLoss(parts, pulls, seconds), found), needed


def _row(part: dict[str, Any], found: dict[str, Optimum], seed: int) -> dict[str, Any]:
    """Return how a part's pulls were predicted and replayed."""
    stage, target = part["stage"], part["pulled"]
    settings, fast = settings_of(stage), found["gradient_free_time"].law.seconds
    laws: dict[str, PullLaw | float] = {"planner": settings.planner.pull_time}
    laws |= {name: each.law for name, each in found.items()} | {
        "eased_fast": fast,
        "eased_faster": max(fast - LAG, 0.3),
    }
    replays = dict(zip(laws, replay(stage, settings, list(laws.values()), HOLD, seed), strict=True))
    rows = {name: figures(each, target.goal) for name, each in replays.items()}
    for name, each in found.items():
        rows[name] |= {"cost": each.cost, "predicted": _predicted(each, target.goal)}
    for name in CURVES:
        rows[name] |= {
            "opening": np.round(replays[name].opening[::2], 4).tolist(),
            "force": np.round(replays[name].force[::2], 2).tolist(),
        }
    print(part["part"], {name: (round(r["end_mm"], 2), round(r["peak_N"], 2)) for name, r in rows.items()}, flush=True)
    about = {key: part[key] for key in ("part", "kind", "identified")}
    return {
        **about,
        "goal": target.goal,
        "kg_at_grasp": target.body.inertia,
        "dynamics": target.dynamics,
        "pulls": rows,
    }


def figures(motion: Replay, goal: float) -> dict[str, Any]:
    """Return what a pull came to: errors when its set-point stands and half a second later, peak force, work, arrival."""
    rate = 60.0
    end, later = round(motion.seconds * rate) - 1, round((motion.seconds + 0.5) * rate) - 1
    there = (np.abs(motion.opening - goal) <= END) & (np.abs(motion.speed) <= REST)
    away = np.flatnonzero(~there)
    arrived = None if not there[-1] else float((away[-1] + 2 if len(away) else 1) / rate)
    return {
        "seconds": motion.seconds,
        "stretched": bool(motion.stretched),
        "end_mm": 1e3 * float(motion.opening[end] - goal),
        "end_mm_s": 1e3 * float(motion.speed[end]),
        "later_mm": 1e3 * float(motion.opening[later] - goal),
        "later_mm_s": 1e3 * float(motion.speed[later]),
        "arrived": arrived,
        "opened": float(motion.opening[-1] / goal),
        "peak_N": float(motion.force.max()),
        "highest_N": float(motion.highest.max()),
        "work_J": float(np.maximum(motion.force * motion.speed, 0.0).sum() / rate),
    }


def _predicted(found: Optimum, goal: float) -> dict[str, float]:
    """Return the same of the model's motion."""
    end = round(found.law.seconds * 60.0)
    return {
        "end_mm": 1e3 * float(found.opening[end] - goal),
        "end_mm_s": 1e3 * float(found.speed[end]),
        "peak_N": float(found.force.max()),
        "work_J": float(np.maximum(found.force * found.speed, 0.0).sum() / 60.0),
    }


def summary(rows: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Return medians over parts, worst end, and how many end within END at REST."""
    there = [abs(row["end_mm"]) <= 1e3 * END and abs(row["end_mm_s"]) <= 1e3 * REST for row in rows]
    arrived = [row["arrived"] for row in rows if row["arrived"] is not None]
    return {
        "within_3mm_at_rest": sum(there),
        "median_end_mm": float(np.median([abs(row["end_mm"]) for row in rows])),
        "worst_end_mm": max(abs(row["end_mm"]) for row in rows),
        "median_end_mm_s": float(np.median([abs(row["end_mm_s"]) for row in rows])),
        "arrive": len(arrived),
        "median_arrived": float(np.median(arrived)) if arrived else None,
        **{f"median_{key}": float(np.median([row[key] for row in rows])) for key in ("seconds", "peak_N", "work_J")},
        "stretched": sum(row["stretched"] for row in rows),
    }


if __name__ == "__main__":
    main()
