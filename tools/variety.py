"""Variety of virtual homes: sizes of fronts, handles, plans, without scanning.

    python tools/variety.py --rooms 600 --json experiments/results/variety.json \
        --listing 0a5c013435_prims.json

The listing is of a real scene: its prims with part_id, parent_id, label and depth, as Articulate3D's repository lists them.

handles  distinct by style and the three extents of their box, each rounded to a millimetre
nearest  1 - intersection over union of two floor plans of the same kind, cells of 0.25 m by the name of what stands there, the
         best of four turns and two reflections; for each room the nearest of all others: 0 is the same plan, 1 fractions nothing
"""

from __future__ import annotations

import argparse
import json
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib
import numpy as np
from real_listing import overlap, quantiles

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

from s2a.core.provenance import provenance  # noqa: E402
from s2a.homes.furnishing import HOMES, home  # noqa: E402
from s2a.homes.room import (  # noqa: E402
    Entry,
    Room,  # noqa: E402
    catalog,
    moves,
)

CELL = 0.25
"""[m] Edge of a cell of a floor plan."""
SIDE = 32
"""Cells along each side of a plan."""
STRUCTURE = ("wall", "floor", "ceiling", "ceiling lamp")
PANELS = (
    "width [m]",
    "height [m]",
    "height above floor [m]",
    "travel [m]",
    "opening [deg]",
    "length [mm]",
    "stand-off [mm]",
)
Plan = dict[tuple[int, int], str]


def rooms(count: int) -> Iterator[tuple[str, Room]]:
    """Yield so many rooms, kind by kind in turn."""
    kinds = list(HOMES)
    for i in range(count):
        kind = kinds[i % len(kinds)]
        yield kind, home(kind, i // len(kinds))


def measure(found: Iterator[tuple[str, Room]]) -> dict[str, Any]:
    """Return the figures of some rooms."""
    values: dict[str, list[float]] = {name: [] for name in PANELS}
    styles: Counter[str] = Counter()
    handles: set[tuple] = set()
    plans: dict[str, list[np.ndarray]] = defaultdict(list)
    counts: dict[str, list[int]] = {
        "movables a room": [],
        "parts a room": [],
        "objects a room": [],
        "parts of an object": [],
    }
    labels: Counter[str] = Counter()
    movable: set[str] = set()
    for kind, room in found:
        entries = catalog(room.pieces)
        _fronts(entries, values, styles, handles)
        plans[kind].append(_plan(room))
        counts["movables a room"].append(sum(e.piece.joint is not None for e in entries))
        counts["parts a room"].append(len(entries))
        counts["objects a room"].append(sum(e.parent is None for e in entries))
        labels.update(e.piece.name for e in entries)
        movable.update(e.piece.name for e in entries if e.piece.joint is not None)
        below = Counter(root(e, entries) for e in entries if e.articulated)
        counts["parts of an object"] += below.values()
    nearest = [d for kind in plans for d in _nearest(plans[kind])]
    return {
        "values": values,
        "styles": dict(styles),
        "handles": len(handles),
        "nearest": nearest,
        "counts": counts,
        "labels": dict(labels),
        "movable": movable,
    }


def root(entry: Entry, entries: list[Entry]) -> int:
    """Return the number of the object that a part belongs to; numbers count from 1 in the order of the entries."""
    while entry.parent is not None:
        entry = entries[entry.parent - 1]
    return entry.number


def _fronts(entries: list[Entry], values: dict[str, list[float]], styles: Counter[str], handles: set[tuple]) -> None:
    """Add what is measured of all parts that open and of all handles of a room."""
    below = {e.parent for e in entries if e.piece.style is not None}
    for entry in entries:
        piece, joint = entry.piece, entry.piece.joint
        if joint is not None:
            values["width [m]"].append(piece.size[1])
            values["height [m]"].append(piece.size[2])
            values["height above floor [m]"].append(float(piece.surface.vertices[:, 2].mean()))
            slides = joint.kind == "prismatic"
            values["travel [m]" if slides else "opening [deg]"].append(
                joint.limits[1] if slides else float(np.degrees(joint.limits[1]))
            )
            if entry.number not in below and not piece.children:
                styles["none"] += 1
        if piece.style is not None:
            styles[str(piece.facts.get("family", piece.style))] += 1
            values["length [mm]"].append(1e3 * piece.size[1:].max())
            values["stand-off [mm]"].append(1e3 * piece.size[0])
            handles.add((piece.style, *np.round(1e3 * piece.size).astype(int).tolist()))


def _plan(room: Room) -> np.ndarray:
    """Return a room's floor plan about its middle: a number for the name of what stands in each cell, shape [SIDE SIDE]."""
    plan = np.zeros((SIDE, SIDE), np.int64)
    middle = np.array(room.size[:2]) / 2
    for piece in room.pieces:
        if piece.name in STRUCTURE or not (moves(piece) or np.ptp(piece.surface.vertices[:, :2], axis=0).max() > 0.5):
            continue
        points = piece.surface.vertices[:, :2] - middle
        low, high = (
            np.clip(np.round(p / CELL) + SIDE // 2, 0, SIDE).astype(int)
            for p in (points.min(axis=0), points.max(axis=0))
        )
        plan[low[0] : max(high[0], low[0] + 1), low[1] : max(high[1], low[1] + 1)] = _number(piece.name)
    return plan


def _number(name: str) -> int:
    """Return a number that stands for a name."""
    return int.from_bytes(name.encode()[:6].ljust(6), "big") + 1


def _nearest(plans: list[np.ndarray]) -> list[float]:
    """Return each plan's distance to the nearest other one."""
    turned = [[np.rot90(p, k) for p in (plan, plan[::-1]) for k in range(4)] for plan in plans]
    distance = np.ones((len(plans), len(plans)))
    for i, plan in enumerate(plans):
        for j in range(i):
            distance[i, j] = distance[j, i] = min(_apart(plan, other) for other in turned[j])
    return distance.min(axis=1).tolist() if len(plans) > 1 else []


def _apart(a: np.ndarray, b: np.ndarray) -> float:
    """Return 1 - intersection over union of two plans."""
    union = ((a > 0) | (b > 0)).sum()
    return 1.0 - float(((a == b) & (a > 0)).sum()) / max(int(union), 1)


def plot(figures: dict[str, Any], out: Path) -> None:
    """Plot histograms of all figures."""
    fig, axes = plt.subplots(3, 3, figsize=(12, 9), layout="constrained")
    for axis, name in zip(axes.flat, PANELS, strict=False):
        values = figures["values"][name]
        axis.hist(values, np.linspace(0.0, np.percentile(values, 99.5), 41), density=True, histtype="stepfilled")
        axis.set_title(name)
    styles = dict(sorted(figures["styles"].items()))
    axes.flat[7].barh(list(styles), np.array(list(styles.values())) / sum(styles.values()))
    axes.flat[7].set_title("handles by family")
    axes.flat[8].hist(figures["nearest"], np.linspace(0, 1, 41), density=True)
    axes.flat[8].set_title("distance to the nearest plan")
    out.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(out, dpi=90)


def summary(figures: dict[str, Any]) -> dict[str, Any]:
    """Return the figures of some rooms with quantiles in place of all values."""
    lists = {**figures["values"], "nearest plan": figures["nearest"]}
    lists |= figures["counts"]
    numbers = {name: len(figures[name]) for name in ("styles", "labels")}
    return {
        "distinct handles": figures["handles"],
        **numbers,
        "handles by family": dict(sorted(figures["styles"].items())),
        "quantiles": {name: quantiles(values) for name, values in lists.items()},
    }


def main() -> None:
    """Measure, print and plot."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", type=int, default=600)
    parser.add_argument("--out", type=Path, default=Path("runs/variety.png"))
    parser.add_argument("--json", type=Path)
    parser.add_argument("--listing", type=Path, help="a real scan's list of prims, as JSON")
    args = parser.parse_args()
    figures = measure(rooms(args.rooms))
    report: dict[str, Any] = {"rooms": args.rooms, "first_seed": 0, **provenance("cpu"), **summary(figures)}
    if args.listing:
        report["real listing"] = overlap(figures["labels"], figures["movable"], args.listing)
    plot(figures, args.out)
    text = json.dumps(report, indent=1)
    print(text)
    if args.json:
        args.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
