"""What training runs came to, from the files that they left; how a table says it."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

POINTS = 80
"""Of a curve that is kept."""
CURVES = {
    "success": "/success",
    "final_success": "/final_success",
    "handle_use_of_successes": "/handle_use_of_successes",
    "opening": "/opening",
    "reward": "Train/mean_reward",
}
"""Name in the results -> tag in the TensorBoard log."""


def last_checkpoint(folder: Path) -> Path | None:
    """Return the last model_N.pt in a folder of `s2a train`, or None."""
    return max(folder.glob("model_*.pt"), key=iterations, default=None)


def iterations(checkpoint: Path) -> int:
    """Return how many iterations a checkpoint was trained for: model_N.pt is written after iteration N, counted from 0."""
    return int(checkpoint.stem.removeprefix("model_")) + 1


def curve(folder: Path, steps: int) -> dict[str, list[float | None]]:
    """Return what the TensorBoard log of a run says, also of one that was cut.

    Args:
        folder: where `s2a train` wrote.
        steps: environment steps of an iteration.

    Returns:
        env_steps and each of CURVES, at evenly spaced iterations up to the last; None where nothing was logged.
    """
    events = EventAccumulator(str(folder), size_guidance={"scalars": 0})
    events.Reload()
    known = events.Tags()["scalars"]
    logged = {name: {e.step: e.value for e in events.Scalars(tag)} for name, tag in CURVES.items() if tag in known}
    every = sorted({step for values in logged.values() for step in values})
    kept = every[:: -max(1, -(-len(every) // POINTS))][::-1]
    columns = {name: [_short(values.get(step)) for step in kept] for name, values in logged.items()}
    return {"env_steps": [(step + 1) * steps for step in kept], **columns}


def write(results: dict[str, Any], path: Path, table: Sequence[str]) -> None:
    """Write results as JSON, a run a line, with their table beside them; print the table."""
    path.parent.mkdir(parents=True, exist_ok=True)
    head = json.dumps({name: value for name, value in results.items() if name != "runs"}, indent=1)
    runs = ",\n".join(json.dumps(run) for run in results["runs"])
    path.write_text(f'{head[:-2]},\n "runs": [\n{runs}\n]}}\n')
    path.with_suffix(".md").write_text("\n".join(table) + "\n")
    print("\n".join(table))


def percent(shares: Iterable[float]) -> str:
    """Return shares as percentages, seed by seed: "100 / 99.7 %"."""
    return " / ".join(f"{100.0 * share:.3g}" for share in shares) + " %"


def _short(value: float | None) -> float | None:
    """Return a value with four significant digits."""
    return None if value is None else float(f"{value:.4g}")
