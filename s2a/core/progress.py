"""Progress bars, warnings as lines, and text without control characters, for a terminal."""

import io
import logging
import os
import signal
import sys
import threading
import time
import warnings
from collections.abc import Iterable, Iterator, Sized
from datetime import timedelta
from typing import Any, TextIO, TypeVar

from s2a.core.errors import InputError, printable

T = TypeVar("T")
LINE_EVERY = 10.0  # [s] Between two lines of progress in a log


def track(items: Iterable[T], description: str, total: int | None = None) -> Iterator[T]:
    """Yield the items with a progress bar and the remaining time; where stderr is no terminal, with a line every LINE_EVERY.

    `total`: number of items; needed only where `len(items)` is not known.
    """
    if not is_terminal():
        yield from _in_lines(items, description, total)
        return
    # Rich costs 0.1 s to import, which commands that finish at once should not pay.
    from rich.console import Console
    from rich.progress import track as bar

    yield from bar(items, description, total, console=Console(stderr=True), transient=True)


def _in_lines(items: Iterable[T], description: str, total: int | None) -> Iterator[T]:
    """Yield the items; write every LINE_EVERY how many are done, and the remaining time; once while the first one lasts."""
    begun = last = time.monotonic()
    count = len(items) if total is None and isinstance(items, Sized) else total
    first = threading.Timer(LINE_EVERY, note, [f"{description}: 0 of {count}" if count else f"{description}: 0"])
    first.daemon = True
    first.start()
    try:
        for done, item in enumerate(items):
            if done:
                first.cancel()
            if done and (now := time.monotonic()) - last >= LINE_EVERY:
                last = now
                left = timedelta(seconds=round((now - begun) / done * (count - done))) if count else None
                note(f"{description}: {done} of {count}, {left} left" if count else f"{description}: {done}")
            yield item
    finally:
        first.cancel()


def is_terminal() -> bool:
    """Return whether somebody sees a progress bar: stderr is a terminal."""
    return sys.stderr is not None and sys.stderr.isatty()


class StdoutFilter(io.TextIOBase):
    """A stdout that drops what libraries print, such as Warp's report of every kernel module that it loads."""

    def __init__(self) -> None:
        self._reported = False

    def write(self, text: str) -> int:
        """Drop the text; report once, on stderr, that kernels are being compiled."""
        if "(compiled)" in text and not self._reported:
            report("compiling kernels for this machine; later runs find them in Warp's cache")
            self._reported = True
        return len(text)


class Terminated(KeyboardInterrupt):
    """Somebody ended this process: timeout, Slurm, or a user with kill."""


def set_up() -> None:
    """Show letters that the terminal does not know by their numbers; let SIGTERM and SIGHUP clean up as an interrupt does.

    A standard stream that is closed is opened to nothing: else the next file that is opened would take its number, and with it
    what libraries print.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _stop)


def show(text: str) -> None:
    """Print lines on stdout; they may hold the words of a file or of an endpoint.

    Raises:
        InputError: stdout is a file that cannot be written. If its reader has exited, as head does, nothing is raised.
    """
    if (error := _print(text, sys.stdout)) and not isinstance(error, BrokenPipeError):
        raise InputError(f"stdout cannot be written: {error.strerror}; choose another file for it") from error


def note(text: str) -> None:
    """Print lines on stderr, if anybody reads it."""
    _print(text, sys.stderr)


def report(message: str) -> None:
    """Print a message as one line on stderr."""
    note(f"s2a: {' '.join(message.split())}")


def _print(text: str, stream: TextIO | None) -> OSError | None:
    """Print lines; return what keeps the system from writing them, which then drops all that follows."""
    if stream is None:  # it was closed at the start
        return None
    try:
        print("\n".join(map(printable, text.split("\n"))), file=stream, flush=True)
    except OSError as error:
        nowhere = os.open(os.devnull, os.O_WRONLY)
        os.dup2(nowhere, stream.fileno())
        os.close(nowhere)
        return error
    return None


def log_in_lines(debug: bool = False) -> None:
    """Print logged warnings; hide Python's own warnings, which are for developers, unless `--debug` or -W asks for them."""
    root = logging.getLogger()
    if not any(isinstance(handler, _Lines) for handler in root.handlers):
        root.addHandler(_Lines(logging.WARNING))
    if not debug and not sys.warnoptions:
        warnings.simplefilter("ignore")


class _Lines(logging.Handler):
    """Writes each log record to stderr as one line."""

    def emit(self, record: logging.LogRecord) -> None:
        report(f"{record.levelname.lower()}: {record.getMessage()}")


def _stop(number: int, frame: Any) -> None:
    raise Terminated
