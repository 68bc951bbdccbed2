"""Random draws from ranges and weighted lists, in one place so that every family reads the same."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

Item = TypeVar("Item")
Range = tuple[float, float]


def uniform(rng: np.random.Generator, span: Range) -> float:
    """Return a number from a range."""
    return float(rng.uniform(*span))


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Return True with a given probability."""
    return bool(rng.uniform() < probability)


def pick(rng: np.random.Generator, options: Sequence[Item]) -> Item:
    """Return one of several options, all equally probable."""
    return options[int(rng.integers(len(options)))]


def weighted(rng: np.random.Generator, options: Mapping[Item, float]) -> Item:
    """Return one of several options, each as probable as its weight."""
    weights = np.array(list(options.values()), float)
    return list(options)[int(rng.choice(len(weights), p=weights / weights.sum()))]


def integer(rng: np.random.Generator, low: int, high: int) -> int:
    """Return a whole number from low to high, both possible."""
    return int(rng.integers(low, high + 1))
