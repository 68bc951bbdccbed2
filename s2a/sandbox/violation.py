"""Why a script was not accepted, in words that its author can act on."""

from __future__ import annotations

from typing import Literal

from s2a.errors import InputError


class PolicyViolation(InputError):
    """A script was refused, or failed; the stage is untouched.

    Attributes:
        step: what refused it: its text was not allowed, it failed or overran in its process, or it made something else
            than was planned.
        reason: what is wrong, and what is possible instead.
        line: of the script, from 1; None where no single line is to blame.
    """

    def __init__(
        self, step: Literal["allowlist", "process", "comparison"], reason: str, line: int | None = None
    ) -> None:
        self.step, self.reason, self.line = step, reason, line
        super().__init__(f"script refused ({step}){'' if line is None else f', line {line}'}: {reason}")
