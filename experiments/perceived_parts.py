"""Draw what a depth camera shows of some parts of a pool, and what the network makes of it.

    python experiments/perceived_parts.py pools/test/pool.json docs/perception.png

Each panel is a frame seen from the robot: points by their height above the front, the true grasp in green, the estimated one in
red; a line along which the fingers close, another that the grasp point takes first when the part opens.
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from s2a.learn.perception.network import load, of_pool
from s2a.tasks import pool
from s2a.tasks.mdp.seen import Description, of_vector, truth

PANELS = 8
LENGTH = 0.08
"""[m] Of the lines."""


def main(index: Path, image: Path) -> None:
    """Draw parts evenly spread over the pool."""
    entries, clouds, stages = pool.read(index), of_pool(index), pool.stages(index, "panda")
    network = load(Path("pretrained"), "cpu")
    chosen = np.linspace(0, len(entries) - 1, PANELS).astype(int)
    figure, axes = plt.subplots(2, PANELS // 2, figsize=(16, 9))
    for axis, i in zip(axes.flat, chosen, strict=True):
        cloud = clouds[i][0]
        points = cloud.points.astype(float) + cloud.center
        shown = axis.scatter(
            -points[:, 1],
            points[:, 2],
            c=np.clip(1000.0 * cloud.height, -30.0, 60.0),
            s=5,
            cmap="viridis",
            vmin=-30,
            vmax=60,
        )
        known, found = truth(stages[i]), of_vector(network.estimate([cloud])[0])
        for each, colour in ((known, "tab:green"), (found, "tab:red")):
            _mark(axis, each, colour)
        off = 1000.0 * np.linalg.norm(found.point - known.point)
        kind = "slide" if found.slides > 0.5 else "hinge"
        axis.set_title(
            f"{entries[i].room[:-4]} {entries[i].part} ({entries[i].handle})\n{kind}, grasp {off:.0f} mm off",
            fontsize=10,
        )
        part = points[cloud.is_part]
        axis.set_xlim(-part[:, 1].max() - 0.05, -part[:, 1].min() + 0.05)
        axis.set_ylim(part[:, 2].min() - 0.05, part[:, 2].max() + 0.05)
        axis.set_aspect("equal")
        axis.tick_params(labelsize=8)
    figure.colorbar(shown, ax=axes, label="height above the front [mm]", shrink=0.8)
    figure.savefig(image, dpi=80, bbox_inches="tight")


def _mark(axis: plt.Axes, part: Description, colour: str) -> None:
    axis.plot(-part.point[1], part.point[2], "o", color=colour, markersize=7, markerfacecolor="none", markeredgewidth=2)
    for direction, style in ((part.across, "-"), (part.along, ":")):
        end = part.point + LENGTH * direction
        axis.plot([-part.point[1], -end[1]], [part.point[2], end[2]], style, color=colour, linewidth=2)


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]))
