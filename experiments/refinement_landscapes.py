"""The loss of refined joints around the truth, as pictures: annotated, true, refined.

    python experiments/refinement_landscapes.py SCAN --parts DRAWER DOOR ... [--out docs/refinement.png]

Each picture varies two parameters of one joint, all else as refined: of a slide the two directions of its axis, of a hinge these
and the two of its line.
"""

from __future__ import annotations

import argparse
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
import warp as wp
from refinement import settings

from s2a import scan
from s2a.prepare.refine import HASTY, annotator
from s2a.prepare.refine_loss import ZERO
from s2a.prepare.refine_room import JointedRoom, RoomFit, fit, joints_of, loss_of, priors
from s2a.scene.scene import Joint
from s2a.scene.usd import geometric

OUT = Path(__file__).parent.parent / "docs/refinement.png"
ANGLE, LENGTH, STEPS = np.radians(3.5), 0.035, 41
"""Half the width of a picture [rad], [m], and its samples along each side."""
NAMES = (
    "axis, in the front's plane [deg]",
    "axis, out of it [deg]",
    "line, in the front's plane [mm]",
    "line, its depth [mm]",
)


def main() -> None:
    """Draw the landscapes."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scan", type=Path, help="folder that s2a sample wrote")
    parser.add_argument("--parts", nargs="+", required=True, help="their ids")
    parser.add_argument("--out", type=Path, default=OUT, help="image to write")
    args = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    scene, truth = scan.read(args.scan), geometric.read(args.scan / "truth/truth.usda")
    room = joints_of(scene, settings())
    free = room.free
    free[:, ZERO] = False
    axis = annotator(fit(room, HASTY, free, settings()), free, settings())
    found = fit(room, axis, free, settings())
    drawn = [(room.parts.index(i), pair) for i in args.parts for pair in ((0, 1), (2, 3))]
    drawn = [(i, pair) for i, pair in drawn if pair == (0, 1) or room.joints[i].kind == "revolute"]
    columns = min(3, len(drawn))
    rows = -(-len(drawn) // columns)
    _, plots = plt.subplots(rows, columns, figsize=(4.3 * columns, 3.9 * rows), squeeze=False)
    for plot in plots.flat[len(drawn) :]:
        plot.axis("off")
    for plot, (number, pair) in zip(plots.flat, drawn, strict=False):
        _draw(plot, room, found, axis, number, pair, truth.joint(room.parts[number]))
    plots.flat[0].legend(loc="lower left")
    plt.tight_layout()
    plt.savefig(args.out, dpi=70)


def _draw(
    plot: plt.Axes, room: JointedRoom, found: RoomFit, axis: float, number: int, pair: tuple[int, int], true: Joint
) -> None:
    """Draw the loss of one joint over two of its parameters."""
    terms, scale, reach = priors(room, axis, settings()), _scale(pair), ANGLE if pair == (0, 1) else LENGTH
    at, values = np.linspace(-reach, reach, STEPS), found.values.copy()
    loss = np.empty((STEPS, STEPS))
    for column, x in enumerate(at):
        for row, y in enumerate(at):
            values[number, list(pair)] = x, y
            loss[row, column] = loss_of(room, number, values, found.turns, terms)
    plot.contourf(scale * at, scale * at, np.log10(loss - loss.min() + 0.3), 30)
    places = {"annotated": (np.zeros(5), "wo"), "true": (parameters(room, number, true), "r*")}
    for name, (place, mark) in (places | {"refined": (found.values[number], "kx")}).items():
        plot.plot(*(scale * place[list(pair)]), mark, markersize=10, label=name)
    plot.set(title=room.parts[number], xlabel=NAMES[pair[0]], ylabel=NAMES[pair[1]])


def _scale(pair: tuple[int, int]) -> float:
    return 180.0 / np.pi if pair == (0, 1) else 1e3


def parameters(room: JointedRoom, number: int, joint: Joint) -> np.ndarray:
    """Return the parameters of another joint than the annotated one, shape [5]."""
    old, axis = room.joints[number], np.array(joint.axis)
    sides, start = np.stack([room.loss.first[number], room.loss.second[number]]), np.array(old.axis)
    tilt = sides @ axis / (axis @ start)
    away = np.array(old.origin) - joint.origin
    line = np.array(joint.origin) + axis * (away @ start) / (axis @ start) - old.origin
    return np.array([*tilt, *(sides @ line), 0.0])


if __name__ == "__main__":
    main()
