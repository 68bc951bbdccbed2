"""What robots do: one folder a task, found by its name."""

from __future__ import annotations

import importlib
import pkgutil
from typing import Any

from s2a import config
from s2a.env.task import MdpConfig, Task
from s2a.errors import InputError


def names() -> list[str]:
    """Return the names of all tasks: the folders beside this file."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if module.ispkg)


def task(name: str) -> type[Task]:
    """Return a task by its name; InputError for an unknown one."""
    if name not in names():
        raise InputError(f"task {name!r} is unknown{config.nearest(name, names())}")
    return importlib.import_module(f"s2a.tasks.{name}").TASK


def load_mdp(values: dict[str, Any]) -> MdpConfig:
    """Return a task's settings from plain values, whose `name` says which task."""
    return config.load(task(str(values.get("name"))).Config, values)
