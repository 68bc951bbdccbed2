"""Scan to action: annotated scans of rooms become USD scenes that robots and language models can act in.

`import s2a` is instant: every name below loads its module at the first use.

    load_scene, export, insert, prepare, convert, certify    scenes: `s2a.api`
    make                                                     a task as a gymnasium.vector.VectorEnv: `s2a.tasks.vector_env`

The subpackages insert, prepare, convert and certify share their names with functions: import from them by their full path,
`from s2a.prepare.target import ...`.
"""

from __future__ import annotations

import importlib
import sys
from types import ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from s2a.api import certify as certify
    from s2a.api import convert as convert
    from s2a.api import export as export
    from s2a.api import insert as insert
    from s2a.api import load_scene as load_scene
    from s2a.api import prepare as prepare
    from s2a.tasks.vector_env import make as make

_MODULES = dict.fromkeys(("load_scene", "export", "insert", "prepare", "convert", "certify"), "s2a.api") | {
    "make": "s2a.tasks.vector_env"
}
"""Public name -> module that defines it."""
__all__ = [*_MODULES]  # noqa: PLE0604  (names of lazy attributes)


def __getattr__(name: str) -> Any:
    """Load a public name at its first use (PEP 562)."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; known: {', '.join(_MODULES)}")
    return getattr(importlib.import_module(_MODULES[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *_MODULES})


class _Package(ModuleType):
    """Keeps the functions of the API: the import of a subpackage would replace the attribute of the same name."""

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name in _MODULES and isinstance(value, ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
