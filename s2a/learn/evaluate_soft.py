"""Evaluation of the planner with a soft body: trials one after the other, counted as `s2a.learn.evaluate` counts worlds."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from typing import Any

import numpy as np

from s2a.core.progress import track
from s2a.learn.evaluate import rate
from s2a.motion.settings import PlannerConfig
from s2a.sim.soft import SoftSimulation
from s2a.tasks.soft import SoftTrial, run_trial
from s2a.tasks.soft_metrics import COLUMNS, VALUES, SoftMetrics

EVERY = 15
"""Control steps between two states that are kept."""
VERSION = 2
"""Of the metrics."""


class SoftStates:
    """Where robot and body were in every trial, at every EVERYth control step."""

    def __init__(self) -> None:
        """Begin without a trial."""
        self._trials: list[dict[str, Any]] = []

    def begin(self, trial: SoftTrial) -> None:
        """Begin a trial."""
        self._trials.append({"trial": trial, "joints": [], "particles": []})

    def watch(self, step: int, sim: SoftSimulation) -> None:
        """Look at a trial after a control step."""
        if step % EVERY == 0:
            self._trials[-1]["joints"].append(sim.joints)
            self._trials[-1]["particles"].append(sim.particles)

    def arrays(self) -> dict[str, np.ndarray]:
        """Return all of it, frames of all trials one after the other: `frames` says how many each has.

        Joints [frame joint] and vertices against the place [frame vertex 3]; of each trial start, goal and base (7-vectors) and
        the height of the pedestal [m].
        """
        every = [(each["trial"], np.array(each["joints"]), np.array(each["particles"])) for each in self._trials]
        return {
            "frames": np.array([len(joints) for _, joints, _ in every]),
            "joints": np.concatenate([joints for _, joints, _ in every]).astype(np.float32),
            "particles": np.concatenate([at - trial.goal[:3] for trial, _, at in every]).astype(np.float16),
            "start": np.array([trial.start for trial, *_ in every]),
            "goal": np.array([trial.goal for trial, *_ in every]),
            "base": np.array([trial.plan.base for trial, *_ in every]),
            "pedestal": np.array([trial.plan.pedestal for trial, *_ in every]),
        }


def evaluate_soft(
    trials: Iterable[SoftTrial | str],
    count: int,
    planner: PlannerConfig,
    metrics: SoftMetrics,
    seed: int,
    device: str,
    states: SoftStates,
) -> Iterator[dict[str, Any]]:
    """Simulate trials; yield after each what all of them so far came to.

    Args:
        trials: each planned, or why it is not: it failed.
        count: of them.
        planner: times of the motion, and the noise of the arm's start.
        metrics: the thresholds.
        seed: of the noise, with the trial's number.
        device: of Warp.
        states: are told of every trial.

    Yields:
        Number of trials; version and thresholds of the metrics; the rate of every COLUMN with its Wilson 95 % interval; mean, min
        and max of VALUES over the trials that were simulated; the largest fraction of each of the robot's limits; a row a trial.
    """
    rows: list[dict[str, Any]] = []
    for number, trial in zip(track(range(count), "evaluate"), trials, strict=False):
        begun = time.perf_counter()
        row: dict[str, Any] = {"trial": number}
        if isinstance(trial, str):
            row |= {"success": False, "cause": trial}
        else:
            states.begin(trial)
            row |= run_trial(trial, planner, metrics, [seed, number], device, states.watch)
        rows.append(row | {"seconds": round(time.perf_counter() - begun, 2)})
        yield _summary(rows, metrics)


def _summary(rows: list[dict[str, Any]], metrics: SoftMetrics) -> dict[str, Any]:
    """Return what rows came to."""
    found: dict[str, Any] = {"episodes": len(rows), "metrics_version": VERSION, "thresholds": asdict(metrics)}
    found |= {name: rate(sum(row.get(name, False) for row in rows), len(rows)) for name in COLUMNS}
    simulated = [row for row in rows if "limit_use" in row]
    for name in VALUES if simulated else ():
        values = [row[name] for row in simulated]
        found[name] = {"mean": float(np.mean(values)), "min": min(values), "max": max(values)}
    limits = simulated[0]["limit_use"] if simulated else ()
    used = {name: max(row["limit_use"][name] for row in simulated) for name in limits}
    return found | {"limit_use": used, "trials": rows}
