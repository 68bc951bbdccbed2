"""Independent pieces of work, shared between this process and helpers of its own.

What comes out does not depend on how many helpers there are. The helpers and threads of all commands on a machine share its
cores, so that commands side by side do not slow each other down. Helpers end when this process does, also when it is killed.
"""

import fcntl
import logging
import multiprocessing
import os
import signal
import socket
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, ThreadPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from contextlib import ExitStack, contextmanager
from multiprocessing.connection import Connection
from types import ModuleType
from typing import TypeVar

import numpy as np

from s2a.core import cache
from s2a.core.progress import StdoutFilter

# Threads of a process; and those that we gave a helper, which divides them among its own helpers
THREADS, DIVIDED = "OMP_NUM_THREADS", "S2A_DIVIDED_THREADS"

Item = TypeVar("Item")
Result = TypeVar("Result")
Shared = TypeVar("Shared")


def spread(
    work: Callable[[Shared, Item], Result],
    shared: Shared,
    items: Sequence[Item],
    few: int = 1,
    meanwhile: Callable[[], object] | None = None,
) -> Iterator[Result]:
    """Yield `work(shared, item)` of each item, in their order.

    Helpers begin with the first items; this process does `meanwhile`, and then takes the last ones from them.

    Args:
        work: a function of a module, that helpers can import.
        shared: what all the work needs; sent to each helper once.
        items: the work.
        few: no helper is started for so many items: they are done before it has started.
        meanwhile: other work for this process.
    """
    with _spare_cores(len(items) - few) as helpers:
        if not helpers:
            if meanwhile is not None:
                meanwhile()
            yield from (work(shared, item) for item in items)
            return
        with processes(helpers, shared) as pool:
            with _new_helpers(helpers + 1):
                futures = [pool.submit(_in_helper, work, item) for item in items]
            if meanwhile is not None:
                meanwhile()
            own = _taken_back(work, shared, items, futures)
            for k, future in enumerate(futures):
                yield own[k] if k in own else future.result()


def apart(
    work: Callable[[Shared, Item], Result], shared: Shared, items: Sequence[Item], jobs: int
) -> Iterator[tuple[int, Result | None]]:
    """Yield index and `work(shared, item)` of each item as it is done, each from a process of its own.

    The result is None where that process died, as for want of memory: the others go on. This process waits, so that the first
    one needs no core beside this one's; the others claim theirs before helpers and threads of any do.

    Args:
        work: a function of a module, that helpers can import.
        shared: what all the work needs.
        items: the work.
        jobs: processes at once.
    """
    waiting = list(range(len(items)))
    running: dict[Future[Result], tuple[int, ExitStack]] = {}
    try:
        while waiting or running:
            while waiting and len(running) < jobs:
                index, stack = waiting.pop(0), ExitStack()
                stack.enter_context(_spare_cores(1 if running else 0))
                pool = stack.enter_context(processes(1, shared))
                with _new_helpers(min(jobs, len(items))):
                    running[pool.submit(_in_helper, work, items[index])] = index, stack
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                index, stack = running.pop(future)
                died = isinstance(future.exception(), BrokenProcessPool)
                stack.close()
                yield index, None if died else future.result()
    finally:
        for _, stack in running.values():
            stack.close()


def _taken_back(
    work: Callable[[Shared, Item], Result], shared: Shared, items: Sequence[Item], futures: Sequence[Future[Result]]
) -> dict[int, Result]:
    """Return the results of the last items, by their index, which no helper had begun."""
    return {k: work(shared, items[k]) for k in reversed(range(len(items))) if futures[k].cancel()}


@contextmanager
def processes(helpers: int, shared: object = None) -> Iterator[ProcessPoolExecutor]:
    """Return helper processes; they are ended at once when the context is left, whether or not they are at work."""
    # Processes start afresh: a forked one would share Warp's threads and locks.
    context = multiprocessing.get_context("spawn")
    lifeline, held = context.Pipe(duplex=False)
    pool = ProcessPoolExecutor(helpers, context, _begin, (lifeline, shared))
    try:
        yield pool
    finally:
        held.close()
        pool.shutdown(cancel_futures=True)
        lifeline.close()


@contextmanager
def _new_helpers(at_once: int) -> Iterator[None]:
    """Have helpers that start take what is meant for them.

    The main module is hidden: each would run it, which a script without a guard does not expect. Threads of NumPy, Torch and
    CoACD, which they count as they are imported, are those of `at_once` processes on this machine, or of this process where
    it is a helper itself, unless the user says else.
    """
    main, before = sys.modules["__main__"], {name: os.environ.get(name) for name in (THREADS, DIVIDED)}
    sys.modules["__main__"] = ModuleType("__main__")
    threads = before[THREADS]
    if threads is None or threads == before[DIVIDED]:
        os.environ[THREADS] = os.environ[DIVIDED] = str(max(1, int(threads or count()) // at_once))
    try:
        yield
    finally:
        sys.modules["__main__"] = main
        for name, value in before.items():
            os.environ.pop(name, None)
            os.environ.update({name: value} if value is not None else {})


_given: list = []  # In a helper: what all its work needs


def _begin(lifeline: Connection, shared: object) -> None:
    """Keep in a helper what all its work needs; end it once the other end of its lifeline is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal interrupts helpers too, but their work is ended for them
    threading.Thread(target=_end_with, args=(lifeline,), daemon=True).start()
    logging.disable(logging.WARNING)
    sys.stdout = StdoutFilter()  # what libraries print, such as Warp's kernel modules, is nobody's output
    _given.append(shared)


def _end_with(lifeline: Connection) -> None:
    lifeline.poll(None)
    os._exit(1)


def _in_helper(work: Callable[[Shared, Item], Result], item: Item) -> Result:
    return work(_given[0], item)


@contextmanager
def _spare_cores(limit: int, fraction: float = 0.5) -> Iterator[int]:
    """Claim cores for helpers or threads, at most so many, that nobody else has claimed; yield their number.

    The claims are locks on files beside the cache, one for each core but the first that this process may use; they end with
    this process. No command claims more than a fraction of the cores, and of several processes that torchrun started on this
    machine each its share, or the first would leave the others to work alone.
    """
    claims: list[int] = []
    try:
        cores = sorted(os.sched_getaffinity(0))
        fraction = min(fraction, 1 / int(os.environ.get("LOCAL_WORLD_SIZE", "1")))
        limit = min(limit, max(1, int(len(cores) * fraction)))
        for core in cores[1:]:
            if len(claims) >= limit:
                break
            if (claim := _claim(core)) is not None:
                claims.append(claim)
        yield len(claims)
    finally:
        for claim in claims:
            os.close(claim)


def _claim(core: int) -> int | None:
    """Return the descriptor that holds a core's lock; None where another process holds it, or none can be made."""
    path = cache.folder() / "cores" / f"{socket.gethostname()}-{core}"
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        claim = os.open(path, os.O_CREAT | os.O_RDWR | os.O_CLOEXEC, 0o600)
    except OSError:
        return None
    try:
        fcntl.flock(claim, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(claim)
        return None
    return claim


CHUNKS_PER_CORE = 8  # Few enough to keep the overhead small, enough to balance the load
MIN_ITEMS = 10_000  # Smallest chunk that is worth a launch of its own


def in_parallel(work: Callable[..., Result], *arguments: Iterable) -> list[Result]:
    """Return what `map` would, from threads on this core and spare ones; what is raised in one is raised here.

    The first call is made before threads begin. It loads the kernel, which two threads must not do at once, and leaves the
    processor's vector registers as kernels want them: threads inherit those of the thread that starts them, and after some
    of NumPy's routines kernels took twice the time.
    """
    calls = list(zip(*arguments, strict=True))
    results = [work(*call) for call in calls[:1]]
    if len(calls) > 1:
        with _spare_cores(len(calls) - 2, 1.0) as spare, ThreadPoolExecutor(1 + spare) as pool:
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
