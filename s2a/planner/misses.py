"""Why nothing was planned: the segment that came farthest, and by how much it misses."""

from __future__ import annotations

import math
from dataclasses import dataclass

from s2a.core.errors import InputError


class Unreachable(InputError):
    """No plan: which segment fails, by how much, and what to change."""


@dataclass
class Misses:
    """How far attempts came: the last segment that any attempt failed in, and its nearest miss [m]."""

    stage: int = -1
    depth: float = math.inf
    text: str = (
        "base: there is no free floor within the arm's reach of start and place; choose a place nearer to free floor"
    )

    def note(self, stage: int, depth: float, text: str) -> None:
        """Keep the failure of an attempt that came farther than all before, or missed by less."""
        if (stage, -depth) > (self.stage, -self.depth):
            self.stage, self.depth, self.text = stage, depth, text
