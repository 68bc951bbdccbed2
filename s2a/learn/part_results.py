"""How a policy did on the parts of a pool: part by part, and over them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import numpy as np

from s2a.sim.pool import PoolPart

RESAMPLES = 2000
"""Of the parts, for an interval."""


def by_part(
    rates: Mapping[str, np.ndarray], entries: Sequence[PoolPart], stage_of_env: np.ndarray, seed: int
) -> dict[str, Any]:
    """Return what the episodes of a pool's parts came to.

    Args:
        rates: columns of 0 and 1 by name, shape [episode].
        entries: the parts.
        stage_of_env: index of each episode's part, shape [episode].
        seed: of the intervals' draws.

    Returns:
        "parts": each part's rates; "over_parts": the mean of these rates with its bootstrap 95 % interval over parts, for all,
        and by kind of joint, of handle and of room.
    """
    each = {name: _mean_by(values, stage_of_env, len(entries)) for name, values in rates.items()}
    rows = [
        {**asdict(entry), "episodes": int((stage_of_env == i).sum()), **{n: float(v[i]) for n, v in each.items()}}
        for i, entry in enumerate(entries)
    ]
    groups: dict[str, Callable[[PoolPart], str]] = {
        "kind": lambda entry: entry.kind,
        "handle": lambda entry: entry.handle,
        "room": lambda entry: entry.room.rsplit("_", 1)[0],
    }
    tables: dict[str, Any] = {"all": _group(each, np.arange(len(entries)), seed)}
    for name, key in groups.items():
        keys = np.array([key(entry) for entry in entries])
        tables[name] = {value: _group(each, np.flatnonzero(keys == value), seed) for value in sorted(set(keys))}
    return {"parts": rows, "over_parts": tables}


def _mean_by(values: np.ndarray, stage: np.ndarray, count: int) -> np.ndarray:
    """Return the mean of each stage's values, shape [stage]."""
    return np.bincount(stage, values, count) / np.maximum(np.bincount(stage, minlength=count), 1)


def _group(each: Mapping[str, np.ndarray], members: np.ndarray, seed: int) -> dict[str, Any]:
    """Return how many parts a group has, and the mean of every rate over them with its interval."""
    return {"parts": len(members), **{name: interval(values[members], seed) for name, values in each.items()}}


def interval(values: np.ndarray, seed: int) -> dict[str, float]:
    """Return the mean of some parts' rates with its bootstrap 95 % interval: of the means of parts drawn with replacement."""
    random = np.random.default_rng(seed)
    means = values[random.integers(0, len(values), (RESAMPLES, len(values)))].mean(axis=1)
    low, high = np.quantile(means, (0.025, 0.975))
    return {"rate": float(values.mean()), "low": float(low), "high": float(high)}
