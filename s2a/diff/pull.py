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
    """Read a recording: a CSV file with the columns COLUMNS; see `table`."""
    rows, step = table(path, COLUMNS)
    return Pull(rows[:, 1], rows[:, 2], step)


def header(path: Path) -> tuple[str, ...]:
    """Return the names of a CSV file's columns; none where it has no text."""
    with path.open(errors="replace") as file:
        return tuple(name.strip() for name in file.readline().split(","))


def table(path: Path, columns: Sequence[str]) -> tuple[np.ndarray, float]:
    """Return columns of a CSV file, shape [sample column], and the time between its samples [s]; the first is `time`.

    Raises:
        InputError: no such file; a column is missing; not numbers; times that do not rise evenly; fewer than 10 samples.
    """
    if not path.is_file():
        raise InputError(f"no recording {str(path)!r}; give a CSV file with the columns {', '.join(columns)}")
    if not path.read_bytes().strip():
        raise InputError(f"{path}: empty; give the columns {', '.join(columns)}")
    try:
        found = np.genfromtxt(path, delimiter=",", names=True, dtype=float, encoding="utf-8")
    except (ValueError, IndexError) as error:
        raise InputError(f"{path}: not a table ({error}); give the columns {', '.join(columns)}") from error
    names = found.dtype.names or ()
    missing = [name for name in columns if name not in names]
    if missing:
        raise InputError(
            f"{path}: no column {missing[0]!r} among {', '.join(names) or 'none'}; it needs {', '.join(columns)}"
        )
    rows = np.stack([np.atleast_1d(found[name]) for name in columns], axis=1)
    if len(rows) < 10 or not np.isfinite(rows).all():
        raise InputError(
            f"{path}: {len(rows)} samples, or one that is not a number; record 10 or more numbers in each column"
        )
    gaps = np.diff(rows[:, 0])
    if gaps.min() <= 0.0 or np.abs(gaps - gaps.mean()).max() > JITTER * gaps.mean():
        raise InputError(f"{path}: samples {gaps.min():.4g} to {gaps.max():.4g} s apart; resample them at one rate")
    return rows, float(gaps.mean())


def same_step(pulls: Sequence[Pull]) -> float:
    """Return the time between samples [s] of recordings that share it; InputError where they do not."""
    steps = [pull.step for pull in pulls]
    if max(steps) > (1.0 + JITTER) * min(steps):
        raise InputError(
            f"recordings with samples {min(steps):.4g} and {max(steps):.4g} s apart; resample them at one rate"
        )
    return float(np.mean(steps))
