"""The time law of a pull: where the gripper's set-point is on its path, over time; the planner takes it for its own ease."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from s2a.core.errors import InputError


@dataclass(frozen=True)
class PullLaw:
    """Set-points at even times, at rest at both ends.

    Attributes:
        seconds: from the first to the last.
        path: of the grasp point [m], 0 at first, shape [sample]; past the goal where the arm would lag behind, or sag.
        goal: where the part shall stand [m].
    """

    seconds: float
    path: tuple[float, ...]
    goal: float

    def at(self, fraction: np.ndarray) -> np.ndarray:
        """Return the set-points [m] at fractions of the time; outside 0 to 1 those of the ends."""
        spline = CubicSpline(np.linspace(0.0, 1.0, len(self.path)), self.path, bc_type="clamped")
        return spline(np.clip(fraction, 0.0, 1.0))

    def progress(self, fraction: np.ndarray) -> np.ndarray:
        """Return the same as fractions of the goal: above 1 past it."""
        return self.at(fraction) / self.goal


def write(law: PullLaw, file: Path) -> None:
    """Write a law as JSON."""
    file.write_text(json.dumps(asdict(law), indent=1))


def read(file: Path) -> PullLaw:
    """Read a law.

    Raises:
        InputError: no such file; not a law.
    """
    if not file.is_file():
        raise InputError(f"no pull law {str(file)!r}; make one with s2a optimize")
    try:
        found = json.loads(file.read_text())
        law = PullLaw(float(found["seconds"]), tuple(map(float, found["path"])), float(found["goal"]))
    except (ValueError, KeyError, TypeError) as error:
        raise InputError(f"{file}: not a pull law ({error}); expected {{seconds, path, goal}}") from error
    numbers = np.array([law.seconds, law.goal, *law.path])
    if (
        len(law.path) < 3
        or law.seconds <= 0.0
        or law.goal <= 0.0
        or law.path[0] != 0.0
        or not np.isfinite(numbers).all()
    ):
        raise InputError(
            f"{file}: not a pull law; seconds and goal must be above 0, and path must begin at 0 and have 3 samples or more"
        )
    return law
