"""Pulls of a few joints as replayed: opening and force over time, by the planner's ease and by gradient.

python experiments/motion_curves.py RESULTS_JSON PLOT_PNG [--parts NAME ...]
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

RATE = 30.0
"""Samples a second in the file."""
LABELS = {
    "planner": ("planner's ease, 3 s", "0.5"),
    "gradient_same_time": ("by gradient, 3 s", "tab:blue"),
    "gradient_free_time": ("by gradient, free time", "tab:orange"),
}


def main() -> None:
    """Plot the chosen joints, a column each."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("results", type=Path)
    parser.add_argument("plot", type=Path)
    parser.add_argument("--parts", nargs="+")
    given = parser.parse_args()
    rows = {row["part"]: row for row in json.loads(given.results.read_text())["rows"]}
    names = given.parts or list(rows)[:5]
    figure, axes = plt.subplots(2, len(names), figsize=(3.2 * len(names), 5.4), sharex=True, squeeze=False)
    for (above, below), name in zip(axes.T, names, strict=True):
        row = rows[name]
        for key, (label, color) in LABELS.items():
            pull = row["pulls"][key]
            time = np.arange(len(pull["opening"])) / RATE
            above.plot(time, 1e3 * (np.array(pull["opening"]) - row["goal"]), color=color, label=label)
            below.plot(time, pull["force"], color=color)
            below.axhline(pull["peak_N"], color=color, linewidth=0.6, linestyle=":")
        above.axhspan(-3.0, 3.0, color="0.9")
        above.set(ylim=(-40.0, 12.0), title=f"{name}\n{row['kg_at_grasp']:.1f} kg at the handle")
        below.set(xlabel="time [s]")
    axes[0, 0].set_ylabel("opening - goal [mm]")
    axes[1, 0].set_ylabel("force on the handle [N]")
    axes[0, 0].legend(fontsize=7, loc="lower right")
    figure.tight_layout()
    figure.savefig(given.plot, dpi=110)


if __name__ == "__main__":
    main()
