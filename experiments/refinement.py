"""Joints that `s2a prepare refine_joints=true` refines, against the truth of virtual scans.

    python experiments/refinement.py SCAN ... [--jobs 1] [--out FILE]

SCAN is a folder that `s2a sample ... annotator=careful|hasty` wrote. Every joint is compared before and after with the one that
the room was built with: angle between the axes, and for hinges the distance of the true origin from the line. The checks are
those that `s2a check` and `s2a certify` ask of a joint; refining does not see them. Writes
experiments/results/refinement.json and prints a table.
"""

from __future__ import annotations

import argparse
import functools
import json
import time
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp

from s2a import scan
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.prepare.refine import refine, with_joints
from s2a.prepare.refine_loss import RefineConfig
from s2a.scan.evidence import Bounds
from s2a.scan.evidence.annotation import moving_part
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.scene import Joint, Scene
from s2a.scene.usd import geometric

RESULTS = Path(__file__).parent / "results/refinement.json"
WORSE = 0.1
"""[deg] The contract: no axis gets worse by more."""
Row = dict[str, Any]


def main() -> None:
    """Refine the joints of all scans, write the figures and print a table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="+", type=Path, help="folders that s2a sample wrote")
    parser.add_argument("--jobs", type=int, default=1, help="scans at once")
    parser.add_argument("--out", type=Path, default=RESULTS, help="file to write")
    args = parser.parse_args()
    start, origin = time.perf_counter(), provenance("cpu")  # the commit that is measured, whatever happens meanwhile
    rows: list[Row] = []
    args.out.parent.mkdir(exist_ok=True)
    with ProcessPoolExecutor(args.jobs) as pool:
        for found in pool.map(measured, args.scans):
            rows += found
            print(_line(found[0]["scan"], found), flush=True)
            groups = {name: summary(some) for name, some in grouped(rows).items()}
            seconds = round(time.perf_counter() - start, 1)
            result = {"groups": groups, "seconds": seconds, "jobs": args.jobs, **origin, "joints": rows}
            args.out.write_text(text(result))  # after each scan: what is there holds if the rest is cut off
    print(table(groups))


def measured(path: Path) -> list[Row]:
    """Return a row for each joint of a scan whose truth is known."""
    wp.config.log_level = wp.LOG_WARNING
    scene, truth = scan.read(path), geometric.read(path / "truth/truth.usda")
    facts = json.loads((path / "truth/truth.json").read_text())
    start = time.perf_counter()
    refined = refine(scene, settings())
    seconds = (time.perf_counter() - start) / len(refined)
    before, after = checks(scene, with_joints(scene, refined))
    who = {
        "scan": f"{facts['room']} {facts['seed']}",
        "annotator": facts.get("annotator", {"name": "careful"})["name"],
    }
    rows = []
    for part, found in refined.items():
        true, change = truth.joint(part), found.change
        row = who | {"part": part, "kind": true.kind}
        row |= {"axis_before": axis_error(change.annotated, true), "axis": axis_error(found.joint, true)}
        row |= {"axis_sigma": round(float(np.degrees(change.angle_sigma)), 3)}
        if true.kind == "revolute":
            row |= {"line_before": line_error(change.annotated, true), "line": line_error(found.joint, true)}
            row |= {"line_sigma": round(1e3 * change.shift_sigma, 1)}
        row |= {"zero": round(change.zero, 4), "unknown": list(change.unknown)}
        row |= {"loss_before": round(found.before, 2), "loss": round(found.after, 2), "seconds": round(seconds, 2)}
        rows.append(row | {"flagged_before": before[part], "flagged": after[part]})
    return rows


@functools.cache
def settings() -> RefineConfig:
    """Return the settings of `s2a prepare`."""
    return config.load(RefineConfig, config.file("refine/default"))


@functools.cache
def _bounds() -> Bounds:
    return Bounds()


def checks(*scenes: Scene) -> list[dict[str, list[str]]]:
    """Return the checks that flag each joint, for each of some annotations of the same scan."""
    surface = ScanSurface(scenes[0])
    fronts = {part: front(surface, part) for part in scenes[0].movable}
    found = []
    for scene in scenes:
        seen = surface.with_scene(scene)
        findings = {part: moving_part(seen, part, one, _bounds()) for part, one in fronts.items()}
        found.append({i: [f.name for f in some if f.status in ("warn", "fail")] for i, some in findings.items()})
    return found


def axis_error(joint: Joint, true: Joint) -> float:
    """Return the angle between two axes [deg]."""
    cross = np.linalg.norm(np.cross(joint.axis, true.axis))
    return round(float(np.degrees(np.arctan2(cross, np.dot(joint.axis, true.axis)))), 4)


def line_error(joint: Joint, true: Joint) -> float:
    """Return the distance of an origin from the true line [mm]."""
    return round(float(1e3 * np.linalg.norm(np.cross(np.subtract(joint.origin, true.origin), true.axis))), 2)


def grouped(rows: Sequence[Row]) -> dict[str, list[Row]]:
    """Return the rows by annotator."""
    found: dict[str, list[Row]] = {}
    for row in rows:
        found.setdefault(row["annotator"], []).append(row)
    return found


def summary(rows: Sequence[Row]) -> dict[str, Any]:
    """Return medians, what got worse, how often the uncertainty holds, and what the checks say."""
    before, after = values(rows, "axis_before"), values(rows, "axis")
    hinges = [row for row in rows if row["kind"] == "revolute"]
    change = after - before
    worst = rows[int(change.argmax())]
    kinds = {kind: [row for row in rows if row["kind"] == kind] for kind in ("prismatic", "revolute")}
    return {
        "joints": len(rows),
        "axis_before": _median(before),
        "axis": _median(after),
        "ratio": round(float(np.median(after) / np.median(before)), 3),
        "ratio_by_kind": {
            kind: round(_median(values(some, "axis")) / _median(values(some, "axis_before")), 3)
            for kind, some in kinds.items()
            if some
        },
        "axis_p90": [round(float(np.quantile(some, 0.9)), 3) for some in (before, after)],
        "worse_by_more_than_0.1_deg": int((change > WORSE).sum()),
        "worst": {"scan": worst["scan"], "part": worst["part"], "by": round(float(change.max()), 3)},
        "axis_within_2_sigma": _share(after <= 2.0 * np.sqrt(2.0) * values(rows, "axis_sigma")),
        "line_before": _median(values(hinges, "line_before")),
        "line": _median(values(hinges, "line")),
        "lines_worse_by_more_than_5_mm": int((values(hinges, "line") - values(hinges, "line_before") > 5.0).sum()),
        "axis_not_known": sum(any("axis" in name for name in row["unknown"]) for row in rows),
        "line_not_known": sum(any("line" in name for name in row["unknown"]) for row in hinges),
        "zero_moved": sum(row["zero"] != 0.0 for row in rows),
        "worse_by_its_own_loss": sum(row["loss"] > row["loss_before"] for row in rows),
        "flagged_before": dict(Counter(check for row in rows for check in row["flagged_before"])),
        "flagged": dict(Counter(check for row in rows for check in row["flagged"])),
        "seconds_per_joint": _median(values(rows, "seconds")),
    }


def values(rows: Iterable[Row], name: str) -> np.ndarray:
    """Return one figure of all rows."""
    return np.array([row[name] for row in rows], float)


def _median(found: np.ndarray) -> float:
    return round(float(np.median(found)), 4) if len(found) else float("nan")


def _share(found: np.ndarray) -> float:
    return round(float(found.mean()), 3)


def text(result: Mapping[str, Any]) -> str:
    """Return the results as JSON, one joint a line."""
    head = json.dumps({name: value for name, value in result.items() if name != "joints"}, indent=1)
    lines = ",\n  ".join(json.dumps(row) for row in result["joints"])
    return f'{head[:-2]},\n "joints": [\n  {lines}\n ]\n}}\n'


def table(groups: Mapping[str, Mapping[str, Any]]) -> str:
    """Return the figures as Markdown."""
    names = "annotator | joints | axis, annotated | refined | ratio | worse by > 0.1 deg | line, annotated | refined"
    lines = [f"| {names} |", "|" + "---|" * 8]
    for name, row in groups.items():
        axis = f"{row['axis_before']:.2f} deg | {row['axis']:.3f} deg | {row['ratio']:.2f}"
        line = f"{row['line_before']:.1f} mm | {row['line']:.1f} mm"
        lines.append(f"| {name} | {row['joints']} | {axis} | {row['worse_by_more_than_0.1_deg']} | {line} |")
    return "\n".join(lines)


def _line(name: str, rows: Sequence[Row]) -> str:
    found = summary(rows)
    worst = f"worst {found['worst']['part']} {found['worst']['by']:+.2f}"
    return f"{name}, {rows[0]['annotator']}: {found['axis_before']:.2f} -> {found['axis']:.3f} deg; {worst}"


if __name__ == "__main__":
    main()
