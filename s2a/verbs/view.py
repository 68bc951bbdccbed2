"""A look at a stage."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from s2a.errors import InputError
from s2a.usd.tree import tree


@dataclass(frozen=True)
class Config:
    """Keys of `s2a view`.

    Attributes:
        path: the stage.
        text: whether to print its tree.
    """

    path: Path
    text: bool


def run(config: Config) -> str:
    """Return the tree of the stage."""
    if not config.text:
        raise InputError(
            "key 'text' is False, but a stage can be shown as text only; give text=true or use a USD viewer"
        )
    return tree(config.path)
