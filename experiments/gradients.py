"""What is a gradient worth? The same losses minimised with it, with finite differences, and by CMA-ES.

    python experiments/gradients.py ROOM.usd ... [--joints 64] [--batches 1 64 1024] [--device cpu] [--out FILE]

Losses are those of `s2a identify`: parts of prepared rooms, each with random dynamics, pulled twice (`recorded_pulls`). Gradient:
SciPy's L-BFGS-B with Warp's tape. Black box: the same with forward differences, an evaluation for each of the seven variables and
one more. CMA-ES: the package cma, from the same start, of a standard deviation that reaches the truths. A joint is solved where
its loss comes within 0.5 of the least that any of them found, half a unit of log-likelihood: less, noise does not tell.
Then seconds of one evaluation of loss and gradient for batches of joints. Rows are kept by device in the file.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

import cma
import numpy as np
import warp as wp

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from identification import NOISE, drawn
from recorded_pulls import record

from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.joints.dynamics import LOWER, UPPER, JointWorlds
from s2a.joints.identify import STARTS, minimize_together, parameters, slopes, variables
from s2a.joints.pull import Pull
from s2a.joints.pulled import Moving

RESULTS = Path(__file__).parent / "results/gradients.json"
SOLVED = 0.5
BUDGET = 600
"""Evaluations of each joint's loss at most; one with its gradient counts as one, for it takes as long as two or three."""
DIFFERENCE = 1e-3
"""Of a variable, in forward differences: float32 losses tell no smaller ones."""
Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class Counted:
    """Losses of many joints, and how low each came by how many evaluations.

    Attributes:
        least: lowest loss so far, after every evaluation, shape [evaluation joint].
        points: where the lowest loss was, shape [joint variable].
    """

    def __init__(self, evaluate: Evaluate, joints: int) -> None:
        """Count from zero."""
        self._evaluate, self.least = evaluate, [np.full(joints, np.inf)]
        self.points = np.zeros((joints, STARTS.shape[1]))

    def __call__(self, x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return losses and gradients."""
        values, gradients = self._evaluate(x)
        better = values < self.least[-1]
        self.points[better] = x[better]
        self.least.append(np.where(better, values, self.least[-1]))
        return values, gradients

    def until(self, target: np.ndarray) -> np.ndarray:
        """Return the evaluations after which each loss was at most `target` [joint]; infinite where never."""
        met = np.array(self.least) <= target
        return np.where(met.any(axis=0), met.argmax(axis=0).astype(float), np.inf)


def main() -> None:
    """Compare, time batches, write the file and print it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("rooms", type=Path, nargs="+", metavar="ROOM")
    parser.add_argument("--joints", type=int, default=64)
    parser.add_argument("--batches", type=int, nargs="+", default=[1, 64, 1024])
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--device", default="cpu")
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    names, bodies, truths = drawn(args.rooms, 1 + args.joints // 40, args.seed)
    bodies, truths = bodies[: args.joints], truths[: args.joints]
    pulls = [
        [record(body, truth, NOISE, 500 * i + k) for k in range(2)]
        for i, (body, truth) in enumerate(zip(bodies, truths, strict=True))
    ]
    methods = compare(bodies, pulls, args.device)
    batches = {size: seconds(bodies, pulls, size, args.device) for size in args.batches}
    row = {
        "joints": len(bodies),
        "seed": args.seed,
        "methods": methods,
        "seconds_by_batch": batches,
        **provenance(args.device),
    }
    known = json.loads(args.out.read_text()) if args.out.is_file() else {}
    with atomic_write(args.out) as out:
        out.write_text(json.dumps({**known, args.device: row}, indent=1))
    print(json.dumps(row, indent=1))


def compare(bodies: list[Moving], pulls: list[list[Pull]], device: str) -> dict[str, dict[str, float | None]]:
    """Return for each method how many joints it solves, by how many evaluations and in how many seconds."""
    worlds = JointWorlds(bodies, pulls, pulls[0][0].step, NOISE, device)

    def evaluate(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        loss, gradient = worlds.loss(parameters(x))
        return loss, gradient * slopes(x)

    runs, times = {}, {}
    for name, method in (("gradient", by_gradient), ("black_box", by_differences), ("cma_es", by_cma)):
        runs[name], start = Counted(evaluate, len(bodies)), time.monotonic()
        method(runs[name], len(bodies))
        times[name] = time.monotonic() - start
    target = np.min([run.least[-1] for run in runs.values()], axis=0) + SOLVED
    return {
        name: {
            "solved": float(np.isfinite(run.until(target)).mean()),
            "evaluations_median": quantile(run.until(target), 0.5),
            "evaluations_p90": quantile(run.until(target), 0.9),
            "evaluations_in_all": len(run.least) - 1,
            "seconds_in_all": times[name],
        }
        for name, run in runs.items()
    }


def quantile(evaluations: np.ndarray, fraction: float) -> float | None:
    """Return after how many evaluations [joint] that fraction of the joints is solved; None where they never are."""
    found = float(np.quantile(evaluations, fraction, method="inverted_cdf"))
    return found if np.isfinite(found) else None


def by_gradient(evaluate: Counted, joints: int) -> None:
    """As `s2a identify` does, from its first start alone."""
    begin = np.repeat(variables(STARTS[:1]), joints, axis=0)
    minimize_together(evaluate, begin, variables(LOWER), variables(UPPER), 60, np.ones(joints, bool))


def by_differences(evaluate: Counted, joints: int) -> None:
    """L-BFGS-B that knows values alone: forward differences."""

    def differences(x: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        values, steps = evaluate(x)[0], np.eye(x.shape[1]) * DIFFERENCE
        ahead = [evaluate(x + step)[0] for step in steps]
        return values, np.stack([(each - values) / DIFFERENCE for each in ahead], axis=1)

    begin = np.repeat(variables(STARTS[:1]), joints, axis=0)
    minimize_together(
        differences, begin, variables(LOWER), variables(UPPER), BUDGET // (1 + STARTS.shape[1]), np.ones(joints, bool)
    )


def by_cma(evaluate: Counted, joints: int) -> None:
    """CMA-ES, one for each joint, their samples evaluated together."""
    bounds = [variables(LOWER).tolist(), variables(UPPER).tolist()]
    keys = {"bounds": bounds, "verbose": -9, "maxfevals": BUDGET}
    each = [cma.CMAEvolutionStrategy(variables(STARTS[0]), 0.5, {**keys, "seed": i + 1}) for i in range(joints)]
    for _ in range(BUDGET // each[0].popsize):
        asked = np.array([search.ask() for search in each])  # [joint sample variable]
        values = np.stack([evaluate(asked[:, k])[0] for k in range(asked.shape[1])], axis=1)
        for search, points, found in zip(each, asked, values, strict=True):
            search.tell(list(points), found.tolist())


def seconds(bodies: list[Moving], pulls: list[list[Pull]], size: int, device: str) -> float:
    """Return the seconds of an evaluation of loss and gradient of so many joints, the given ones repeated."""
    index = np.arange(size) % len(bodies)
    worlds = JointWorlds([bodies[i] for i in index], [pulls[i] for i in index], pulls[0][0].step, NOISE, device)
    x = np.repeat(STARTS[:1], size, axis=0)
    worlds.loss(x)
    start = time.monotonic()
    for _ in range(5):
        worlds.loss(x)
    return (time.monotonic() - start) / 5


if __name__ == "__main__":
    wp.config.log_level = wp.LOG_WARNING
    main()
