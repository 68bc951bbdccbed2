"""Parallel work on all cores of this process; Warp releases Python's lock and runs one core per launch."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")

CHUNKS_PER_CORE = 8
"""Few enough to keep the overhead small, enough to balance the load."""
MIN_ITEMS = 10_000
"""Smallest chunk that is worth a launch of its own."""


def in_parallel(work: Callable[..., Result], *arguments: Iterable) -> list[Result]:
    """Return what `map` would, from threads; what is raised in one is raised here.

    The first call is made before threads begin. It loads the kernel, which two threads must not do at once, and leaves the
    processor's vector registers as kernels want them: threads inherit those of the thread that starts them, and after some
    of NumPy's routines kernels took twice the time.
    """
    calls = list(zip(*arguments, strict=True))
    results = [work(*call) for call in calls[:1]]
    if len(calls) > 1:
        with ThreadPoolExecutor(count()) as pool:
            results += pool.map(lambda call: work(*call), calls[1:])
    return results


def count() -> int:
    """Return the number of cores that this process may use."""
    return len(os.sched_getaffinity(0))


def chunks(length: int) -> list[slice]:
    """Split a range of items into chunks for all cores: at least one, none empty unless there are no items."""
    number = int(np.clip(length // MIN_ITEMS, 1, CHUNKS_PER_CORE * count()))
    ends = np.linspace(0, length, number + 1).astype(int).tolist()
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
