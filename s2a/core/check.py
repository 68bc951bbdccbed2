"""A check: one question to a file, its answer as a number against a bound, and what to do; suites and reports of checks."""

import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Generic, Literal, TypeVar

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


S = TypeVar("S")
C = TypeVar("C")
Of = Literal["room", "part"]
# What a check has to pass for: physics would tell of another stage, an image could not be
# rendered (which includes physics)
Need = Literal["nothing", "physics", "images"]
Question = Callable[[S, C], Check | Iterable[Check]]  # A check: a function of its subject and its bounds


class Suite(Generic[S, C]):
    """Checks of one kind of subject, in the order of their definition.

    A check is one function with a decorator, in the module of its suite:

        @STRUCTURE.check("room")
        def no_cameras(contents: Contents, config: ShapeConfig) -> Check:
            cameras = [(str(p.GetPath()), "a camera") for p in contents.stage.Traverse() if p.IsA(UsdGeom.Camera)]
            return no_problems("no_cameras", cameras, "remove the cameras")

    Attributes:
        rules: the functions, with what they are asked of and what they are needed for.
    """

    def __init__(self) -> None:
        self.rules: list[tuple[Question[S, C], Of, Need]] = []

    def check(self, of: Of = "part", needed_for: Need = "physics") -> Callable[[Question[S, C]], Question[S, C]]:
        """Return the decorator that adds a check; its answer bears the function's name where it is needed for something.

        `of`: what it is asked of, once: the whole room, or each articulated part; `needed_for`: what has no meaning
        where the check does not pass.
        """

        def add(question: Question[S, C]) -> Question[S, C]:
            self.rules.append((question, of, needed_for))
            return question

        return add

    def ask(self, subject: S, config: C, of: Of = "part") -> list[Check]:
        """Return the answers to all checks of the room, or of a part."""
        answers = [question(subject, config) for question, asked_of, _ in self.rules if asked_of == of]
        return [check for answer in answers for check in ([answer] if isinstance(answer, Check) else answer)]

    def needed(self, *needs: Need) -> frozenset[str]:
        """Return the names of the checks that are needed for one of these."""
        return frozenset(question.__name__ for question, _, need in self.rules if need in needs)


@dataclass(frozen=True)
class ValidationReport:
    """How ready for simulation a stage is."""

    stage: str  # the file
    sha256: str  # of its content (`s2a.scene.usd.stamp.content_hash`)
    target: str  # id of the part that moves; empty if the stage names none
    checks: tuple[Check, ...]  # every check, in order
    graspable: bool | None  # A parallel gripper can hold and pull the grasp region; None if that check was skipped
    settings: dict[str, object]  # bounds and measurement settings, as plain values
    seconds: float  # it took [s]
    provenance: dict[str, object] = field(default_factory=dict)  # code, versions, machine

    @property
    def failed(self) -> tuple[Check, ...]:
        """The checks that failed."""
        return failed(self.checks)

    @property
    def passed(self) -> bool:
        """No check failed."""
        return not self.failed
