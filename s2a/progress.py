"""How far a long loop is and when it will be done, and what libraries print meanwhile."""

from __future__ import annotations

import io
import sys
from collections.abc import Iterable, Iterator
from typing import TypeVar

T = TypeVar("T")


def track(items: Iterable[T], description: str, total: int | None = None) -> Iterator[T]:
    """Yield the items, with a bar and the estimated time left on stderr while it is a terminal.

    Args:
        items: what the loop goes through.
        description: what the loop does, in a few words.
        total: number of items; needed only where `len(items)` is not known.
    """
    # Rich costs 0.1 s to import, which commands that finish at once should not pay.
    from rich.console import Console
    from rich.progress import track as bar

    console = Console(stderr=True)
    yield from bar(items, description, total, console=console, transient=True, disable=not console.is_terminal)


class Chatter(io.TextIOBase):
    """A stdout for libraries: Warp reports every kernel module that it loads; only that it compiles is worth a line."""

    def __init__(self) -> None:
        self._told = False

    def write(self, text: str) -> int:
        """Drop the text; say once, on stderr, that the wait is for a compiler."""
        if "(compiled)" in text and not self._told:
            sys.stderr.write("s2a: compiling kernels for this machine; later runs find them in Warp's cache\n")
            self._told = True
        return len(text)
