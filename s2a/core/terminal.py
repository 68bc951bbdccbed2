"""Between commands and a terminal: lines without control characters, warnings as lines, and signals."""

from __future__ import annotations

import io
import logging
import signal
import sys
import threading
import warnings
from typing import Any, TextIO

from s2a.core.errors import printable


class Terminated(KeyboardInterrupt):
    """Somebody ended this process: timeout, Slurm, or a user with kill."""


def set_up() -> None:
    """Show letters that the terminal does not know by their numbers; let SIGTERM and SIGHUP clean up as an interrupt does."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")
    if threading.current_thread() is threading.main_thread():
        for number in (signal.SIGTERM, signal.SIGHUP):
            if signal.getsignal(number) is signal.SIG_DFL:
                signal.signal(number, _stop)


def show(text: str, stream: TextIO | None = None) -> None:
    """Print lines, on stdout by default; they may hold the words of a file or of an endpoint."""
    print("\n".join(map(printable, text.split("\n"))), file=stream or sys.stdout)


def report(message: str) -> None:
    """Print a message as one line on stderr."""
    show(f"s2a: {' '.join(message.split())}", sys.stderr)


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
