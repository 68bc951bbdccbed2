"""Draw how the runs of a table learned: episodes that opened the drawer, and those that opened it by its handle.

    python experiments/curves.py RESULTS_JSON PICTURE_PNG

RESULTS_JSON is a file of experiments/results with curves by environment steps; a colour is a row, a line a seed.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

TITLES = ("opened by 0.20 m", "opened by the handle")


def main() -> None:
    """Read the results and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("picture", type=Path)
    args = parser.parse_args()
    draw(json.loads(args.results.read_text())["runs"], args.picture)


def draw(runs: list[dict[str, Any]], picture: Path) -> None:
    """Draw the share of recent training episodes over environment steps."""
    figure, panels = plt.subplots(1, 2, figsize=(8.0, 4.4), layout="constrained", sharey=True)
    rows = list(dict.fromkeys(run["about"] for run in runs))
    for run in runs:
        place, known = rows.index(run["about"]), run["curve"]
        millions = [steps / 1e6 for steps in known["env_steps"]]
        opened = [100.0 * (share or 0.0) for share in known.get("success", [])]
        by_handle = [
            share * (use or 0.0) for share, use in zip(opened, known.get("handle_use_of_successes", []), strict=False)
        ]
        for panel, values in zip(panels, (opened, by_handle), strict=True):
            panel.plot(millions[: len(values)], values, color=f"C{place}", label=run["about"], linewidth=1.2)
    for panel, title in zip(panels, TITLES, strict=True):
        panel.set(title=title, xlabel="environment steps, millions", ylim=(-2, 102))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("share of recent training episodes [%]")
    labels = dict(zip(*panels[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(labels.values(), labels.keys(), fontsize="small", loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main()
