"""Recordings of how a part was pulled: its opening and the force on it, over time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.joints import lerobot

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


def read(path: Path, episodes: Sequence[int] = ()) -> list[Pull]:
    """Read recordings with the columns COLUMNS; see `tables`."""
    return [Pull(rows[:, 1], rows[:, 2], step) for rows, step in tables(path, COLUMNS, episodes)]


def header(path: Path) -> tuple[str, ...]:
    """Return the names of a CSV file's columns, or of a LeRobot dataset's; none where there is no file or no text in it."""
    if path.is_dir():
        return lerobot.names(path)
    if not path.is_file():
        return ()
    with path.open(errors="replace") as file:
        return tuple(name.strip() for name in file.readline().split(","))


def tables(path: Path, columns: Sequence[str], episodes: Sequence[int] = ()) -> list[tuple[np.ndarray, float]]:
    """Return columns of recordings, shape [sample column], and the time between samples [s]; the first column is `time`.

    Args:
        path: a CSV file, one recording; or the folder of a LeRobot dataset, a recording an episode.
        columns: their names.
        episodes: of a dataset, by number; none: all.

    Raises:
        InputError: no such file; a column is missing; not numbers; times that do not rise evenly; fewer than 10 samples.
    """
    if path.is_dir():
        return [(rows, _step(where, rows)) for where, rows in lerobot.tables(path, columns, episodes)]
    rows = _csv(path, columns)
    return [(rows, _step(str(path), rows))]


def _csv(path: Path, columns: Sequence[str]) -> np.ndarray:
    """Return columns of a CSV file, shape [sample column]."""
    if not path.is_file():
        raise InputError(
            f"no recording {str(path)!r}; give a CSV file with the columns {', '.join(columns)}, or a LeRobot dataset's folder"
        )
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
    return np.stack([np.atleast_1d(found[name]) for name in columns], axis=1)


def _step(where: str, rows: np.ndarray) -> float:
    """Return the time between samples [s] of a recording, shape [sample column]; `where` is what to call it."""
    if len(rows) < 10 or not np.isfinite(rows).all():
        raise InputError(
            f"{where}: {len(rows)} samples, or one that is not a number; record 10 or more numbers in each column"
        )
    gaps = np.diff(rows[:, 0])
    if gaps.min() <= 0.0 or np.abs(gaps - gaps.mean()).max() > JITTER * gaps.mean():
        raise InputError(f"{where}: samples {gaps.min():.4g} to {gaps.max():.4g} s apart; resample them at one rate")
    return float(gaps.mean())


def same_step(pulls: Sequence[Pull]) -> float:
    """Return the time between samples [s] of recordings that share it; InputError where they do not."""
    steps = [pull.step for pull in pulls]
    if max(steps) > (1.0 + JITTER) * min(steps):
        raise InputError(
            f"recordings with samples {min(steps):.4g} and {max(steps):.4g} s apart; resample them at one rate"
        )
    return float(np.mean(steps))
