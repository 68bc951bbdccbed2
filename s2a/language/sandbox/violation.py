"""Violations of the policy, in words that the author of the script can act on."""

from __future__ import annotations

from typing import Literal

from s2a.core.errors import InputError, printable


class PolicyViolation(InputError):
    """A script was rejected or failed; the stage is unchanged.

    Attributes:
        step: "allowlist" (its text), "process" (it failed or exceeded a limit) or "comparison" (its result differs
            from the plan).
        reason: what is wrong, and what is possible instead.
        line: of the script, from 1; None where no single line is to blame.
    """

    def __init__(
        self, step: Literal["allowlist", "process", "comparison"], reason: str, line: int | None = None
    ) -> None:
        self.step, self.reason, self.line = step, printable(reason), line
        super().__init__(f"script refused ({step}){'' if line is None else f', line {line}'}: {self.reason}")
