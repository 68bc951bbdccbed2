"""Some of a test's cases in the fast suite, the others marked slow."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import pytest


def few(cases: Iterable[Any], number: int = 2) -> list[Any]:
    """Return the cases of `pytest.mark.parametrize`; those after the first `number` are marked slow."""
    listed = list(cases)
    rest = [case if isinstance(case, tuple) else (case,) for case in listed[number:]]
    return [*listed[:number], *(pytest.param(*case, marks=pytest.mark.slow) for case in rest)]
