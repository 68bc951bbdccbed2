"""A finding about an annotation: a number, its bound, a verdict, and what to do."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

Verdict = Literal["pass", "warn", "fail", "unknown"]
"""The surface agrees; it makes the annotation doubtful; it contradicts it; it does not tell."""


@dataclass(frozen=True)
class Finding:
    """One question to the scanned surface, and its answer.

    Attributes:
        check: what is asked, such as "opens_outward".
        part: id of the part; empty for the whole room.
        verdict: the answer.
        value: the number measured; NaN where the surface does not tell.
        bound: the value from which it passes; NaN where there is none.
        unit: of both.
        message: what was found, in words, with its number.
        remedy: what is possible and what to do; empty where nothing has to be done.
    """

    check: str
    part: str
    verdict: Verdict
    value: float = math.nan
    bound: float = math.nan
    unit: str = ""
    message: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        """Return the finding as one line."""
        return f"{self.part or 'room'}: {self.message}" + (f"; {self.remedy}" if self.remedy else "")


def unknown(check: str, part: str, message: str) -> Finding:
    """Return the finding that the surface does not tell."""
    return Finding(check, part, "unknown", message=message)


def bounded_above(
    check: str, part: str, value: float, bound: float, unit: str, message: str, remedy: str, otherwise: Verdict = "fail"
) -> Finding:
    """Return the finding that passes if value <= bound, and is `otherwise` if not."""
    good = value <= bound
    return Finding(check, part, "pass" if good else otherwise, value, bound, unit, message, "" if good else remedy)


def bounded_below(
    check: str, part: str, value: float, bound: float, unit: str, message: str, remedy: str, otherwise: Verdict = "fail"
) -> Finding:
    """Return the finding that passes if value >= bound, and is `otherwise` if not."""
    good = value >= bound
    return Finding(check, part, "pass" if good else otherwise, value, bound, unit, message, "" if good else remedy)
