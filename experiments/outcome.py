"""What training runs came to, from the files that they left; how a table says it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from s2a.core import provenance

HOLDS = {
    "grasp_success": "grasped",
    "handle_success": "both fingers on the handle",
    "single_finger_success": "one finger on it",
    "off_handle_success": "fingers off it",
    "body_success": "another link",
}
"""Columns of an evaluation that say what held the part, and their titles in a table."""
POINTS = 80
"""Of a curve that is kept."""
CURVES = ("success", "final_success", "grasp_success", "handle_success", "opening", "grasped_fraction", "reward")


def curve(run: Path, steps: int) -> dict[str, list[float | None]]:
    """Return what the log of a run says, also of one that was cut.

    Args:
        run: the folder that `s2a train` wrote.
        steps: environment steps of an iteration.

    Returns:
        env_steps and each of CURVES, at evenly spaced iterations up to the last; None where there was nothing to log.
    """
    rows = provenance.curve(run)
    kept = rows[:: -max(1, -(-len(rows) // POINTS))][::-1]
    columns = {name: [_short(row.get(name)) for row in kept] for name in CURVES}
    return {"env_steps": [(int(row["iteration"]) + 1) * steps for row in kept], **columns}


def logged(curve: Mapping[str, Sequence[float | None]], name: str) -> list[float]:
    """Return a column of a curve, point by point; NaN where nothing was logged, nothing at all if it never was."""
    return [math.nan if value is None else value for value in curve.get(name, [])]


def half_after(curve: Mapping[str, Sequence[float | None]]) -> str:
    """Return after how many million environment steps half of the recent episodes opened with both fingers on the handle."""
    rates = logged(curve, "handle_success")
    steps = next((n for n, rate in zip(curve["env_steps"], rates, strict=False) if rate >= 0.5), None)
    return "not yet" if steps is None else f"{steps / 1e6:.0f}"


def write(results: dict[str, Any], path: Path, table: Sequence[str]) -> None:
    """Write results as JSON, a run a line, with their table beside them; print the table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = json.dumps({name: value for name, value in results.items() if name != "runs"}, indent=1)
    runs = ",\n".join(json.dumps(run) for run in results["runs"])
    path.write_text(f'{head[:-2]},\n "runs": [\n{runs}\n]}}\n')
    path.with_suffix(".md").write_text("\n".join(table) + "\n")
    print("\n".join(table))


def percent(fractions: Iterable[float]) -> str:
    """Return fractions as percentages, seed by seed: "100 / 99.7 %"; "not run" without any."""
    text = " / ".join(f"{100.0 * fraction:.3g}" for fraction in fractions)
    return f"{text} %" if text else "not run"


def trained(runs: Iterable[dict[str, Any]]) -> str:
    """Return millions of environment steps, seed by seed: "98.3 / 20.6 (cut)"."""
    return " / ".join(f"{run['env_steps'] / 1e6:.3g}{'' if run['finished'] else ' (cut)'}" for run in runs)


def _short(value: float | None) -> float | None:
    """Return a value with four significant digits."""
    return None if value is None else float(f"{value:.4g}")
