"""Draw how runs learned: episodes that opened the drawer, that have it open at their end, that opened it by its handle.

    python experiments/curves.py RESULTS_JSON PICTURE_PNG

RESULTS_JSON is the file of a table in experiments/results, of which a colour is a row and a line a seed, or the metrics.json of
one run, as `s2a train` writes it.
"""

from __future__ import annotations

import argparse
import json
import math
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt

TITLES = ("opened by 0.20 m", "open at the end", "both fingers on the handle")


def main() -> None:
    """Read the results and write the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("results", type=Path)
    parser.add_argument("picture", type=Path)
    args = parser.parse_args()
    try:
        results = json.loads(args.results.read_text())
        runs = results["runs"] if "runs" in results else [as_run(results)]
    except (OSError, ValueError, KeyError, TypeError) as error:
        parser.error(f"{args.results}: not results of a table, nor the metrics.json of one run ({error!r})")
    draw(runs, args.picture)


def as_run(metrics: dict[str, Any]) -> dict[str, Any]:
    """Return what metrics.json says of a run in the form of a table's runs."""
    rows = metrics["curve"]
    steps = metrics["env_steps"] / (1 + max(row["iteration"] for row in rows))
    names = ("success", "final_success", "handle_use_of_successes")
    curve = {name: [row.get(name) for row in rows] for name in names}
    about = f"{metrics['worlds']} worlds, seed {metrics['seed']}, {metrics['seconds'] / 60.0:.1f} minutes on {metrics['device']}"
    return {"about": about, "curve": {"env_steps": [steps * (1 + row["iteration"]) for row in rows], **curve}}


def draw(runs: list[dict[str, Any]], picture: Path) -> None:
    """Draw the share of recent training episodes over environment steps."""
    figure, panels = plt.subplots(1, 3, figsize=(10.0, 4.0), layout="constrained", sharey=True)
    rows = list(dict.fromkeys(run["about"] for run in runs))
    colours = plt.get_cmap("tab10" if len(rows) <= 10 else "tab20").colors
    for run in runs:
        place, known = rows.index(run["about"]), run["curve"]
        millions = [steps / 1e6 for steps in known["env_steps"]]
        opened, final = (
            [math.nan if share is None else 100.0 * share for share in known.get(name, [])]
            for name in ("success", "final_success")
        )
        by_handle = [
            share * (use or 0.0) for share, use in zip(opened, known.get("handle_use_of_successes", []), strict=False)
        ]
        for panel, values in zip(panels, (opened, final, by_handle), strict=True):
            panel.plot(millions[: len(values)], values, color=colours[place], label=run["about"], linewidth=1.2)
    for panel, title in zip(panels, TITLES, strict=True):
        panel.set(title=title, xlabel="environment steps, millions", ylim=(-2, 102))
        panel.grid(alpha=0.3)
    panels[0].set_ylabel("share of recent episodes [%]")
    labels = dict(zip(*panels[0].get_legend_handles_labels()[::-1], strict=True))
    figure.legend(labels.values(), labels.keys(), fontsize="small", loc="outside lower center", ncols=2, frameon=False)
    figure.savefig(picture, dpi=110)


if __name__ == "__main__":
    main()
