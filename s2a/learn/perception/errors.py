"""How far estimates of parts are from the truth."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from s2a.tasks.part_description import NUMBERS


def error_table(
    estimates: Sequence[np.ndarray], known: Sequence[np.ndarray], kinds: Sequence[str]
) -> dict[str, dict[str, float]]:
    """Return median and 95th percentile of each error over all frames of all parts.

    Args:
        estimates: of each part, shape [frame NUMBERS].
        known: the truth of each, shape [NUMBERS].
        kinds: of each part's joint.
    """
    found = np.concatenate(estimates)
    true = np.repeat(np.stack(known), [len(each) for each in estimates], axis=0)
    hinge = np.repeat(np.array(kinds) == "revolute", [len(each) for each in estimates])
    if found.shape[1] != NUMBERS:
        raise ValueError(f"estimates of {found.shape[1]} numbers, expected {NUMBERS}")
    columns = {
        "grasp point [m]": np.linalg.norm(found[:, :3] - true[:, :3], axis=1),
        "across [degree]": _angles(found, true, 3, lines=True),
        "inwards [degree]": _angles(found, true, 6),
        "axis [degree]": _angles(found, true, 9),
        "along [degree]": _angles(found, true, 12),
        "thickness [m]": np.abs(found[:, 16] - true[:, 16]),
        "lever arm of hinges [m]": np.abs(found[hinge, 19] - true[hinge, 19]),
        "travel [m]": np.abs(found[:, 20] - true[:, 20]),
        "wrong kind": ((found[:, 18] > 0.5) != (true[:, 18] > 0.5)).astype(float),
    }
    return {
        name: {"median": float(np.median(v)), "p95": float(np.quantile(v, 0.95)), "mean": float(v.mean())}
        for name, v in columns.items()
        if len(v)
    }


def _angles(a: np.ndarray, b: np.ndarray, first: int, lines: bool = False) -> np.ndarray:
    """Return the angles between directions, or between lines, in columns from `first` on [degree], shape [row]."""
    cosine = np.einsum("rk,rk->r", a[:, first : first + 3], b[:, first : first + 3])
    return np.degrees(np.arccos(np.clip(np.abs(cosine) if lines else cosine, -1.0, 1.0)))
