"""Shows what identification changes: five joints pulled by a hand that is a spring: true, as in the stage, and identified.

    python experiments/identified_pulls.py ROOMS [--out docs/identification.png]

Joints, truths and estimates are those of results/identification.json: two slides and three hinges, of a median mass error
and worse. Each is pulled as in `identification.held_out`, by a hand that knows nothing of it.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from identification import RESULTS
from recorded_pulls import RATE, Truth, record

from s2a.joints.pull import Noise
from s2a.joints.pulled import Moving, moving
from s2a.scene.usd import sim_stage

STAGE = Truth(1.0, 1.0, 1.0, spring=10.0)
"""Dynamics that a part without identification has in conf/sim, but for its friction, which depends on its mass."""
SILENT = Noise(0.0, 0.0)
PARTS = {"prismatic": (0.5, 0.9), "revolute": (0.5, 0.75, 0.9)}
"""Quantiles of the mass' relative error that are plotted."""


def main() -> None:
    """Plot and save."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("rooms", type=Path, help="folder with the rooms of the results, ROOM/room.usd")
    parser.add_argument("--out", type=Path, default=Path("docs/identification.png"))
    args = parser.parse_args()
    rows = chosen(json.loads(RESULTS.read_text())["rows"])
    figure, axes = plt.subplots(1, len(rows), figsize=(3.0 * len(rows), 2.8), sharey=False)
    for axis, row in zip(axes, rows, strict=True):
        room, part = row["part"].split("/")
        scene = sim_stage.read(args.rooms / room / "room.usd", visuals=False)
        plot(axis, moving(scene, part), row, scene.articulations[part].friction)
        axis.set_title(f"{row['part']}\n{row['truth']['mass'] * row['kg_at_grasp']:.1f} kg at its handle", fontsize=8)
    axes[0].set_ylabel("opening [m]")
    axes[0].legend(fontsize=7)
    figure.supxlabel("time [s]", fontsize=9)
    figure.tight_layout()
    figure.savefig(args.out, dpi=110)


def chosen(rows: list[dict]) -> list[dict]:
    """Return the rows at PARTS."""
    found = []
    for kind, quantiles in PARTS.items():
        own = [row for row in rows if row["kind"] == kind]
        own.sort(key=lambda row: abs(row["found"]["mass"] / row["truth"]["mass"] - 1.0))
        found += [own[round(q * (len(own) - 1))] for q in quantiles]
    return found


def plot(axis: plt.Axes, body: Moving, row: dict, friction: float) -> None:
    """Plot the three openings of one joint."""
    names = row["truth"]  # results of before a soft close was known have no more
    found = Truth(**{name: row["found"][name] for name in names})
    stage = Truth(1.0, STAGE.damping / body.lever**2, friction / abs(body.lever), spring=STAGE.spring)
    for label, truth, style in (
        ("true", Truth(**row["truth"]), {"color": "black", "linewidth": 2.5}),
        ("the stage's", stage, {"color": "tab:orange"}),
        ("identified", found, {"color": "tab:blue", "linestyle": "--"}),
    ):
        opening = record(body, truth, SILENT, 7777).opening
        axis.plot(np.arange(len(opening)) / RATE, opening, label=label, **style)


if __name__ == "__main__":
    main()
