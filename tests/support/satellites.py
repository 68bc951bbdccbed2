"""The satellites, without which the package works too: tests of the core that need one are skipped where it is not there."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

COMMANDS = {
    "homes": ("sample", "zoo", "pool"),
    "language": ("insert", "do"),
    "joints": ("register", "identify", "optimize"),
}
"""Commands that each satellite brings."""
MISSING = tuple(room for room in COMMANDS if find_spec(f"s2a.{room}") is None)


def missing(command: str) -> str | None:
    """Return the satellite that would bring a command and is not there; None for all other commands."""
    return next((room for room in MISSING if command in COMMANDS[room]), None)


def need(command: str) -> None:
    """Skip the test if the satellite that brings a command is not there."""
    if room := missing(command):
        pytest.skip(f"needs s2a.{room}")
