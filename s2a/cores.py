"""Work on all processors that this process may use; Warp's kernels run without Python's lock, one processor a launch."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")


def in_parallel(work: Callable[..., Result], *arguments: Iterable) -> list[Result]:
    """Return what `map` would, from threads; what is raised in one is raised here."""
    with ThreadPoolExecutor(count()) as pool:
        return list(pool.map(work, *arguments))


def count() -> int:
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def shares(length: int) -> list[slice]:
    """Return a share of so many items for each processor; none is empty."""
    ends = np.unique(np.linspace(0, length, count() + 1).astype(int)).tolist()
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
