"""A validation report: its checks, each with its number, the bound, the prim at fault and what to do."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

Status = Literal["pass", "fail", "skipped", "info"]
"""A check of status "info" is a measurement without a bound; "skipped": its preconditions do not hold."""


@dataclass(frozen=True)
class Check:
    """One question to a stage, and its answer.

    Attributes:
        name: of the property checked, such as "joint_limits".
        status: the answer.
        value: the number measured, or None where there is none.
        bound: max value that passes, or None.
        unit: of both.
        prim: path of the prim at fault, or of the one asked; empty for the whole stage.
        message: the result in words, one line.
        remedy: what to do about it; empty where nothing has to be done.
    """

    name: str
    status: Status
    value: float | None = None
    bound: float | None = None
    unit: str = ""
    prim: str = ""
    message: str = ""
    remedy: str = ""


@dataclass(frozen=True)
class ValidationReport:
    """How ready for simulation a stage is.

    Attributes:
        stage: the file.
        sha256: of its content (`s2a.scene.usd.stamp.content_hash`).
        target: id of the part that moves; empty if the stage names none.
        checks: every check, in order.
        graspable: A parallel gripper can hold and pull the grasp region; None if that check was skipped.
        settings: bounds and measurement settings, as plain values.
        seconds: it took [s].
        provenance: code, versions, machine.
    """

    stage: str
    sha256: str
    target: str
    checks: tuple[Check, ...]
    graspable: bool | None
    settings: dict[str, object]
    seconds: float
    provenance: dict[str, object] = field(default_factory=dict)

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return tuple(check for check in self.checks if check.status == "fail")

    @property
    def passed(self) -> bool:
        """No check failed."""
        return not self.failed


def check_bound(
    name: str, value: float, bound: float, unit: str = "", *, prim: str = "", message: str = "", remedy: str = ""
) -> Check:
    """Return the check that passes if value <= bound; NaN fails."""
    good = value <= bound
    return Check(name, "pass" if good else "fail", value, bound, unit, prim, message, "" if good else remedy)


def decide(name: str, problems: list[tuple[str, str]], remedy: str, message: str = "", prim: str = "") -> Check:
    """Return the check that passes if there is no problem.

    Args:
        name: of the check.
        problems: path of the prim and what is wrong with it.
        remedy: what to do about them.
        message: what to say if all is well.
        prim: path of the prim asked.
    """
    if not problems:
        return Check(name, "pass", 0.0, 0.0, "problems", prim, message)
    text = "; ".join(dict.fromkeys(problem for _, problem in problems[:5]))
    more = f"; and {len(problems) - 5} more" if len(problems) > 5 else ""
    return Check(name, "fail", float(len(problems)), 0.0, "problems", problems[0][0], text + more, remedy)
