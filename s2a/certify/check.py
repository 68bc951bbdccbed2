"""A validation report: the checks of one part of a stage."""

from __future__ import annotations

from dataclasses import dataclass, field

from s2a.core.check import Check, failed


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
        return failed(self.checks)

    @property
    def passed(self) -> bool:
        """No check failed."""
        return not self.failed
