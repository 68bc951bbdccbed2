"""Formats by registration: every module of a package that has `recognise` and `read`, and those that other packages bring."""

import importlib
import pkgutil
from collections.abc import Callable
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, cast


class Format(Protocol):
    """A module that reads one format."""

    NAME: str  # what the format is called in messages
    recognise: Callable[[Path], bool]  # returns whether a path holds this format, from names of files, without an error
    # returns what the path holds; raises an InputError, one line, where it is damaged or incomplete
    read: Callable[[Path], Any]


@cache
def formats(package: str) -> tuple[Format, ...]:
    """Return the formats of a package in the order in which they are asked: by PRIORITY (0 without), largest first, then by name.

    `package`: of the readers, and the group of entry points by which an installed package adds modules of its own.
    """
    home = importlib.import_module(package)
    modules = [importlib.import_module(f"{package}.{each.name}") for each in pkgutil.iter_modules(home.__path__)]
    modules += [point.load() for point in entry_points(group=package)]
    readers = [module for module in modules if hasattr(module, "recognise") and hasattr(module, "read")]
    return tuple(cast(Format, module) for module in sorted(readers, key=_order))


def _order(module: ModuleType) -> tuple[int, str]:
    return -int(getattr(module, "PRIORITY", 0)), module.__name__
