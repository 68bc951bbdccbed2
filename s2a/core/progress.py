"""Progress bars, and a filter for what libraries print meanwhile."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def track(items: Iterable[T], description: str, total: int | None = None) -> Iterator[T]:
    """Yield the items with a progress bar and the remaining time, if stderr is a terminal.

    Args:
        items: items of the loop.
        description: caption of the bar.
        total: number of items; needed only where `len(items)` is not known.
    """
    # Rich costs 0.1 s to import, which commands that finish at once should not pay.
    from rich.console import Console
    from rich.progress import track as bar

    console = Console(stderr=True)
    yield from bar(items, description, total, console=console, transient=True, disable=not console.is_terminal)


class StdoutFilter(io.TextIOBase):
    """A stdout that drops what libraries print, such as Warp's report of every kernel module that it loads."""

    def __init__(self) -> None:
        self._reported = False

    def write(self, text: str) -> int:
        """Drop the text; report once, on stderr, that kernels are being compiled."""
        if "(compiled)" in text and not self._reported:
            sys.stderr.write("s2a: compiling kernels for this machine; later runs find them in Warp's cache\n")
            self._reported = True
        return len(text)
