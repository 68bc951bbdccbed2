"""Work on all processors that this process may use; Warp's kernels run without Python's lock, one processor a launch."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

import numpy as np

Result = TypeVar("Result")

PIECES = 8
"""Shares for each processor: what is done before threads begin is then little, and none waits long for the last."""
WORTH = 10_000
"""Items below which a share is not worth a launch of its own."""


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
    """Return the number of processors that this process may use."""
    return len(os.sched_getaffinity(0))


def shares(length: int) -> list[slice]:
    """Return so many items in shares for all processors, one share at least; none is empty unless there are no items."""
    pieces = int(np.clip(length // WORTH, 1, PIECES * count()))
    ends = np.linspace(0, length, pieces + 1).astype(int).tolist()
    return [slice(a, b) for a, b in zip(ends[:-1], ends[1:], strict=True)]
