"""Recordings of how a part was pulled: its opening and the force on it, over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.errors import InputError

COLUMNS = ("time", "opening", "force")
"""Of a recording: [s]; path of the grasp point from where it was scanned [m]; force on the part along that path [N], which opens
it where it is above 0."""
JITTER = 0.2
"""Fraction of the mean time between samples by which one of them may differ."""


@dataclass(frozen=True)
class Pull:
    """Samples at one rate.

    Attributes:
        opening: path of the grasp point [m], shape [sample].
        force: along it [N] at the same times, shape [sample].
        step: time between samples [s].
    """

    opening: np.ndarray
    force: np.ndarray
    step: float


@dataclass(frozen=True)
class Noise:
    """Standard deviations of a recording's samples.

    Attributes:
        opening: [m].
        force: [N].
    """

    opening: float
    force: float


def read(path: Path) -> Pull:
    """Read a recording: a CSV file with the columns COLUMNS.

    Raises:
        InputError: no such file; a column is missing; not numbers; times that do not rise evenly; fewer than 10 samples.
    """
    if not path.is_file():
        raise InputError(f"no recording {str(path)!r}; give a CSV file with the columns {', '.join(COLUMNS)}")
    if not path.read_bytes().strip():
        raise InputError(f"{path}: empty; give the columns {', '.join(COLUMNS)}")
    try:
        table = np.genfromtxt(path, delimiter=",", names=True, dtype=float, encoding="utf-8")
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}: not a table ({error}); give the columns {', '.join(COLUMNS)}") from error
    names = table.dtype.names or ()
    missing = [name for name in COLUMNS if name not in names]
    if missing:
        raise InputError(
            f"{path}: no column {missing[0]!r} among {', '.join(names) or 'none'}; it needs {', '.join(COLUMNS)}"
        )
    time, opening, force = (np.atleast_1d(table[name]) for name in COLUMNS)
    if len(time) < 10 or not all(np.isfinite(each).all() for each in (time, opening, force)):
        raise InputError(
            f"{path}: {len(time)} samples, or one that is not a number; record 10 or more numbers in each column"
        )
    gaps = np.diff(time)
    if gaps.min() <= 0.0 or np.abs(gaps - gaps.mean()).max() > JITTER * gaps.mean():
        raise InputError(f"{path}: samples {gaps.min():.4g} to {gaps.max():.4g} s apart; resample them at one rate")
    return Pull(opening, force, float(gaps.mean()))


def same_step(pulls: Sequence[Pull]) -> float:
    """Return the time between samples [s] of recordings that share it; InputError where they do not."""
    steps = [pull.step for pull in pulls]
    if max(steps) > (1.0 + JITTER) * min(steps):
        raise InputError(
            f"recordings with samples {min(steps):.4g} and {max(steps):.4g} s apart; resample them at one rate"
        )
    return float(np.mean(steps))
