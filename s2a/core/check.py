"""A check: one question to a scan or a stage, its answer as a number against a bound, and what to do; checks as text and JSON."""

import dataclasses
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

# pass: within its bound. warn: doubtful. fail: contradicted, or broken. skipped: a precondition does not hold, or the
# data are not conclusive. info: a measurement without a bound
Status = Literal["pass", "warn", "fail", "skipped", "info"]
STATUSES: tuple[Status, ...] = ("fail", "warn", "pass", "skipped", "info")


@dataclass(frozen=True)
class Check:
    """One question and its answer."""

    name: str  # of the property checked, such as "joint_limits"
    status: Status  # the answer
    value: float | None = None  # the number measured, or None where there is none
    bound: float | None = None  # the value up to which, or from which on, it passes; or None
    unit: str = ""  # of both
    prim: str = ""  # path of the prim at fault, or of the one asked; empty for the whole stage, and for a scan
    message: str = ""  # the result in words, one line
    remedy: str = ""  # what is possible and what to do; empty where nothing has to be done
    part: str = ""  # id of the annotated part asked about; empty for the whole room, and where `prim` says it

    def __str__(self) -> str:
        return f"{self.prim or self.part or 'room'}: {self.message}" + (f"; {self.remedy}" if self.remedy else "")


def at_most(
    name: str, value: float, bound: float, unit: str = "", *, otherwise: Status = "fail", remedy: str = "", **where: str
) -> Check:
    """Return the check that passes if value <= bound, and is `otherwise` if not; NaN is not.

    Args:
        name: of the check.
        value: what was measured.
        bound: the largest value that passes.
        unit: of both.
        otherwise: its status beyond the bound.
        remedy: what to do then.
        where: `prim`, `part` and `message` of the check.
    """
    return _bounded(name, value <= bound, otherwise, value, bound, unit, remedy, where)


def at_least(
    name: str, value: float, bound: float, unit: str = "", *, otherwise: Status = "fail", remedy: str = "", **where: str
) -> Check:
    """Return the check that passes if value >= bound, and is `otherwise` if not; arguments as those of `at_most`."""
    return _bounded(name, value >= bound, otherwise, value, bound, unit, remedy, where)


def _bounded(
    name: str, good: bool, otherwise: Status, value: float, bound: float, unit: str, remedy: str, where: dict[str, str]
) -> Check:
    return Check(name, "pass" if good else otherwise, value, bound, unit, remedy="" if good else remedy, **where)


def no_problems(name: str, problems: list[tuple[str, str]], remedy: str, message: str = "", prim: str = "") -> Check:
    """Return the check that passes if there is no problem. `problems`: path of the prim and what is wrong with it."""
    if not problems:
        return Check(name, "pass", 0.0, 0.0, "problems", prim, message)
    text = "; ".join(dict.fromkeys(problem for _, problem in problems[:5]))
    more = f"; and {len(problems) - 5} more" if len(problems) > 5 else ""
    return Check(name, "fail", float(len(problems)), 0.0, "problems", problems[0][0], text + more, remedy)


def failed(checks: Iterable[Check]) -> tuple[Check, ...]:
    """Return the checks that failed."""
    return tuple(check for check in checks if check.status == "fail")


def doubtful(checks: Sequence[Check]) -> list[Check]:
    """Return the checks that failed, and then those that warn."""
    return [check for status in ("fail", "warn") for check in checks if check.status == status]


def count_text(checks: Sequence[Check]) -> str:
    """Return how many checks there are of each status: "1 fail, 20 pass"."""
    counts = {status: sum(check.status == status for check in checks) for status in STATUSES}
    return ", ".join(f"{count} {status}" for status, count in counts.items() if count)


def text(checks: Sequence[Check]) -> str:
    """Return what failed and what warns, a line each, and how many of each status there are."""
    lines = [f"  {check.status} {check.name}: {check}" for check in doubtful(checks)]
    return "\n".join([*lines, f"  {count_text(checks)}"])


def as_json(value: Any) -> Any:
    """Return checks, and what contains them, as JSON has it: fields by name, tuples as lists, NaN and infinity as null."""
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): as_json(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [as_json(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
