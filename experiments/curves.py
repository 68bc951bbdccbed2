"""Plot learning curves: episodes that opened the part, that have it open at their end, that opened it by its handle or a grasp.

    python experiments/curves.py RESULTS_JSON PLOT_PNG

RESULTS_JSON is a table in experiments/results, of which a row is a panel with a line of each of FRACTIONS a seed, or the
metrics.json of one run, as `s2a train` writes it.
"""

from __future__ import annotations

import argparse
import json
import math
import textwrap
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
from outcome import logged

from s2a.core import aliases

FRACTIONS = {
    "success": ("opened by 0.20 m", "tab:gray"),
    "final_success": ("open at the end", "tab:orange"),
    "handle_success": ("both fingers on the handle", "tab:blue"),
    "grasp_success": ("grasped", "tab:green"),
}
"""What is drawn: column, label and colour."""
COLUMNS = 4
"""Of panels."""


def main() -> None:
    """Read the results and write the image."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("image", type=Path)
    args = parser.parse_args()
    try:
        results = json.loads(args.results.read_text())
        runs = results["runs"] if "runs" in results else [as_run(results)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        parser.error(f"{args.results}: not results of a table, nor the metrics.json of one run ({error!r})")
    plot(runs, args.image)


def as_run(metrics: dict[str, Any]) -> dict[str, Any]:
    """Return what metrics.json says of a run in the form of a table's runs."""
    rows = metrics["curve"]
    steps = metrics["env_steps"] / (1 + max(row["iteration"] for row in rows))
    curve = {name: [row.get(name) for row in rows] for name in {name: None for row in rows for name in row}}
    metrics = aliases.renamed(metrics, {"worlds": "num_envs"})
    about = f"{metrics['num_envs']} worlds, seed {metrics['seed']}, {metrics['seconds'] / 60.0:.1f} minutes on "
    return {
        "about": about + metrics["device"],
        "curve": {**curve, "env_steps": [steps * (1 + row["iteration"]) for row in rows]},
    }


def plot(runs: list[dict[str, Any]], image: Path) -> None:
    """Plot FRACTIONS of recent training episodes over environment steps: a panel a row, a line of each a seed."""
    rows = list(dict.fromkeys(run["about"] for run in runs))
    columns = min(len(rows), COLUMNS)
    lines = math.ceil(len(rows) / columns)
    figure, panels = plt.subplots(
        lines,
        columns,
        figsize=(2.8 * max(columns, 2), 2.2 * lines + 0.9),
        layout="constrained",
        sharex=True,
        sharey=True,
        squeeze=False,
    )
    for panel, row in zip(panels.flat, rows, strict=False):
        for run in (run for run in runs if run["about"] == row):
            for (label, colour), values in zip(FRACTIONS.values(), fractions(run["curve"]), strict=True):
                millions = [steps / 1e6 for steps in run["curve"]["env_steps"]]
                panel.plot(millions[: len(values)], values, color=colour, label=label, linewidth=1.2)
        panel.set_title(textwrap.fill(row, 40), fontsize="small")
        panel.set(ylim=(-3, 103))
        panel.grid(alpha=0.3)
    for panel in list(panels.flat)[len(rows) :]:
        panel.set_axis_off()
    figure.supxlabel("environment steps, millions", fontsize="medium")
    figure.supylabel("fraction of recent episodes [%]", fontsize="medium")
    labels = dict(zip(*panels.flat[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(
        labels.values(),
        labels.keys(),
        loc="outside upper center",
        ncols=len(labels) if columns > 1 else 2,
        frameon=False,
    )
    figure.savefig(image, dpi=110)
    plt.close(figure)


def fractions(curve: dict[str, list[float | None]]) -> list[list[float]]:
    """Return what FRACTIONS names, in percent, point by point; NaN where nothing was logged."""
    return [[100.0 * fraction for fraction in logged(curve, name)] for name in FRACTIONS]


if __name__ == "__main__":
    main()
