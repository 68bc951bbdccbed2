"""Progress bars: how far a long loop is, and when it will be done."""

from __future__ import annotations

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
