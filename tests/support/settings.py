"""The settings of one file of conf/, for tests."""

from __future__ import annotations

from typing import Any

from s2a import tasks
from s2a.core import config


def load(cls: type, name: str, **changes: Any) -> Any:
    """Return the settings in conf/<name>.yaml as `cls` (a plain dictionary for dict), with some values changed."""
    values = {**config.compose(name)[name.split("/")[0]], **changes}
    return values if cls is dict else config.load(cls, values)


def skills() -> dict[str, Any]:
    """Return the task of each skill of `s2a do`."""
    values = config.compose("do", ["sentence=-", "stage=-", "out=-"])["skills"]
    return {name: tasks.of(each) for name, each in values.items()}
