"""Draw how success and handle use grew in a training run.

    python experiments/ppo_curve.py METRICS_JSON PICTURE_PNG

METRICS_JSON is what `s2a train` writes into its folder.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib.pyplot as plt

CURVES = {
    "success": "opened by 0.20 m at any time",
    "final_success": "open by 0.20 m at the end",
    "handle_use_of_successes": "of the successes: both fingers on the handle",
}


def main() -> None:
    """Read the curve and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("metrics", type=Path)
    parser.add_argument("picture", type=Path)
    args = parser.parse_args()
    run = json.loads(args.metrics.read_text())
    last = max(row["iteration"] for row in run["curve"])
    minutes = [row["iteration"] / last * run["seconds"] / 60.0 for row in run["curve"]]
    figure, axes = plt.subplots(figsize=(6.4, 3.2), layout="constrained")
    for key, label in CURVES.items():
        axes.plot(minutes, [100.0 * row.get(key, 0.0) for row in run["curve"]], label=label)
    title = f"{run['worlds']} worlds, {run['env_steps'] / 1e6:.0f} M steps, seed {run['seed']}, {run['device']}"
    axes.set(xlabel="minutes of training", ylabel="share of recent episodes [%]", ylim=(-2, 102), title=title)
    axes.legend(loc="center right", fontsize="small")
    axes.grid(alpha=0.3)
    figure.savefig(args.picture, dpi=110)


if __name__ == "__main__":
    main()
