"""What training runs came to, from the files that they left; how a table says it."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from s2a.rl import run_folder

POINTS = 80
"""Of a curve that is kept."""
CURVES = ("success", "final_success", "handle_use_of_successes", "opening", "reward")


def curve(run: Path, steps: int) -> dict[str, list[float | None]]:
    """Return what the log of a run says, also of one that was cut.

    Args:
        run: the folder that `s2a train` wrote.
        steps: environment steps of an iteration.

    Returns:
        env_steps and each of CURVES, at evenly spaced iterations up to the last; None where there was nothing to log.
    """
    rows = run_folder.curve(run)
    kept = rows[:: -max(1, -(-len(rows) // POINTS))][::-1]
    columns = {name: [_short(row.get(name)) for row in kept] for name in CURVES}
    return {"env_steps": [(int(row["iteration"]) + 1) * steps for row in kept], **columns}


def by_handle(curve: dict[str, list[float | None]]) -> list[float]:
    """Return the share of recent episodes that opened with both fingers on the handle, point by point; NaN before the first."""
    opened, use = curve.get("success", []), curve.get("handle_use_of_successes", [])
    return [math.nan if o is None else o * (part or 0.0) for o, part in zip(opened, use, strict=False)]


def half_after(curve: dict[str, list[float | None]]) -> str:
    """Return after how many million environment steps half of the recent episodes first opened by the handle."""
    steps = next((n for n, share in zip(curve["env_steps"], by_handle(curve), strict=False) if share >= 0.5), None)
    return "not yet" if steps is None else f"{steps / 1e6:.0f}"


def write(results: dict[str, Any], path: Path, table: Sequence[str]) -> None:
    """Write results as JSON, a run a line, with their table beside them; print the table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = json.dumps({name: value for name, value in results.items() if name != "runs"}, indent=1)
    runs = ",\n".join(json.dumps(run) for run in results["runs"])
    path.write_text(f'{head[:-2]},\n "runs": [\n{runs}\n]}}\n')
    path.with_suffix(".md").write_text("\n".join(table) + "\n")
    print("\n".join(table))


def percent(shares: Iterable[float]) -> str:
    """Return shares as percentages, seed by seed: "100 / 99.7 %"; "not run" without any."""
    told = " / ".join(f"{100.0 * share:.3g}" for share in shares)
    return f"{told} %" if told else "not run"


def trained(runs: Iterable[dict[str, Any]]) -> str:
    """Return millions of environment steps, seed by seed: "98.3 / 20.6 (cut)"."""
    return " / ".join(f"{run['env_steps'] / 1e6:.3g}{'' if run['finished'] else ' (cut)'}" for run in runs)


def _short(value: float | None) -> float | None:
    """Return a value with four significant digits."""
    return None if value is None else float(f"{value:.4g}")
