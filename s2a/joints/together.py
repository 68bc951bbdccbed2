"""Many small problems of minimisation whose functions are evaluated together."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]
"""Points [problem variable] -> values [problem] and gradients [problem variable]."""


@dataclass(frozen=True)
class Minima:
    """What was found.

    Attributes:
        points: shape [problem variable].
        values: shape [problem].
        rounds: how often all problems were evaluated.
    """

    points: np.ndarray
    values: np.ndarray
    rounds: int


def minimize_together(
    evaluate: Evaluate, starts: np.ndarray, lower: np.ndarray, upper: np.ndarray, rounds: int, chosen: np.ndarray
) -> Minima:
    """Minimise each problem by SciPy's L-BFGS-B, a thread each, which wait for each other at every evaluation.

    Args:
        evaluate: of all problems at once; a problem that has ended is evaluated where it ended.
        starts: shape [problem variable].
        lower: bounds, shape [variable] or [problem variable].
        upper: likewise.
        rounds: at most, about.
        chosen: which problems to minimise, shape [problem]; the others stay at their starts, of infinite value.
    """
    points = starts.copy()
    low, high = (np.broadcast_to(bound, starts.shape) for bound in (lower, upper))
    asked: queue.Queue[int] = queue.Queue()
    answers: list[queue.Queue[tuple[float, np.ndarray]]] = [queue.Queue() for _ in starts]
    values = np.full(len(starts), np.inf)

    def solve(i: int) -> None:
        def ask(x: np.ndarray) -> tuple[float, np.ndarray]:
            points[i] = x
            asked.put(i)
            return answers[i].get()

        try:
            limits = list(zip(low[i], high[i], strict=True))
            found = minimize(ask, starts[i], jac=True, method="L-BFGS-B", bounds=limits, options={"maxfun": rounds})
            points[i], values[i] = found.x, found.fun
        finally:
            asked.put(~i)

    running, done = set(np.flatnonzero(chosen).tolist()), 0
    threads = [threading.Thread(target=solve, args=(i,), daemon=True) for i in running]
    for thread in threads:
        thread.start()
    while running:
        waiting = [asked.get() for _ in running]
        running -= {~i for i in waiting if i < 0}
        if running:
            found, gradients = evaluate(points)
            done += 1
            for i in running:
                answers[i].put((float(found[i]), gradients[i]))
    return Minima(points, values, done)
