"""A validation report, and suites: checks that register themselves where they are defined."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Generic, Literal, TypeVar

from s2a.core.check import Check, failed

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
