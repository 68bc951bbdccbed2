"""Random draws from ranges and weighted lists, in one place so that every family reads the same."""

from collections.abc import Mapping, Sequence
from typing import TypeVar

import numpy as np

from s2a.homes.solids import Color

Item = TypeVar("Item")
Range = tuple[float, float]


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


def random_color(rng: np.random.Generator, low: int, high: int) -> Color:
    """Return a colour whose three channels are each at least `low` and below `high`."""
    red, green, blue = rng.integers(low, high, 3).tolist()
    return red, green, blue


def integer(rng: np.random.Generator, low: int, high: int) -> int:
    """Return a whole number from low to high, both possible."""
    return int(rng.integers(low, high + 1))
