"""How well `s2a register` finds joints: pairs of virtual scans of a home, parts opened and clutter moved between them.

    python experiments/registration.py [--rooms kitchen:100 ...] [--detail full] [--parts 5] [--name registration]

Each room is scanned twice, from other scanner poses (`registration_pairs`); pairs in the work folder and rows in
experiments/results/NAME.json are kept. A part counts as found where a proposal of its kind has an IoU of 0.2 or more with its
faces; parts without one are missed, proposals without a part are false. IoU is by area; seen_open is the fraction of the part's
surface that the open scan shows too. The origin's error is the distance of both axes beside the part's middle. axis_z and the
like are errors in the deviations that the proposal states.

"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path
from typing import Any

import numpy as np
import warp as wp
from registration_pairs import joint_of, make

from s2a.core.outputs import atomic_write
from s2a.core.provenance import provenance
from s2a.joints.register import Proposal, Registration, register
from s2a.joints.register_surface import OrientedMesh, match
from s2a.scene.articulation import transform

RESULTS = Path(__file__).parent / "results"
KINDS = ("kitchen", "living_room", "bedroom", "office", "workshop", "laundry", "study")
ROOMS = [f"{kind}:100" for kind in KINDS]
FOUND = 0.2
"""Least IoU of a proposal's faces with those of the part that it is."""
SEEN = 0.01
"""[m] What the open scan shows lies so near to it."""
MIN_SEEN = 0.35
"""Parts of which the open scan shows less are counted, but not as seen."""
Row = dict[str, Any]


def main() -> None:
    """Measure each room, and write after each."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rooms", nargs="+", default=ROOMS, help="kind:seed")
    parser.add_argument("--detail", default="full")
    parser.add_argument("--parts", type=int, default=5, help="parts that are opened in each room, at most")
    parser.add_argument("--work", type=Path, default=Path(".work/pairs"))
    parser.add_argument("--name", default="registration")
    parser.add_argument("--again", action="store_true", help="measure rooms that have rows once more")
    args = parser.parse_args()
    wp.config.log_level = wp.LOG_WARNING
    file = RESULTS / f"{args.name}.json"
    rows: dict[str, Row] = json.loads(file.read_text())["rooms"] if file.exists() else {}
    for spec in args.rooms:
        key = f"{spec}:{args.detail}"
        if key in rows and not args.again:
            continue
        room, seed = spec.split(":")
        rows[key] = measured(make(room, int(seed), args.detail, args.parts, args.work))
        print(key, json.dumps(rows[key], indent=1), flush=True)
        write(rows, file)
    print(json.dumps(summary(rows), indent=1))


def write(rows: dict[str, Row], file: Path) -> None:
    """Write all rows and what they have in common."""
    with atomic_write(file) as out:
        content = {**provenance("cpu"), "summary": summary(rows), "rooms": rows}
        out.write_text(json.dumps(content, indent=1) + "\n")


def measured(pair: dict[str, Any]) -> Row:
    """Return the errors of each part of a pair."""
    closed, opened = (OrientedMesh(pair[key][0].astype(np.float64), pair[key][1]) for key in ("closed", "open"))
    began = time.perf_counter()
    found = register(closed, opened)
    seconds = time.perf_counter() - began
    truth = pair["truth"]
    parts: dict[str, Row] = {}
    used: set[int] = set()
    for name, part in truth["parts"].items():
        mine = np.isin(pair["numbers"], part["numbers"])
        overlap = [iou(proposal.faces, mine, closed) for proposal in found.proposals]
        best = int(np.argmax(overlap)) if overlap else -1
        row: Row = {
            "kind": part["kind"],
            "open": part["open"],
            "scanned_area": round(float(closed.areas[mine].sum()), 4),
        }
        row["seen_open"] = round(seen(part, mine, closed, opened, np.array(truth["open_from_closed"])), 3)
        if best >= 0 and overlap[best] > FOUND:
            used.add(best)
            row |= {"iou": round(overlap[best], 4)} | errors(
                found.proposals[best], part, closed.centroids[mine].mean(axis=0)
            )
        parts[name] = row
    false = [described(p) for i, p in enumerate(found.proposals) if i not in used]
    return {
        "moved_objects": truth["moved"],
        "seconds": round(seconds, 1),
        **frame_errors(found, truth, closed),
        "parts": parts,
        "false": false,
    }


def seen(
    part: dict[str, Any], mine: np.ndarray, closed: OrientedMesh, opened: OrientedMesh, motion: np.ndarray
) -> float:
    """Return the fraction of a part's scanned surface that the open scan shows too, as it truly lies."""
    true = joint_of(part)
    cloud = closed.sample(2000, 0, np.flatnonzero(mine)).moved(motion @ transform(true, part["open"]))
    return float((match(cloud, opened, SEEN).alike > 0.5).mean())


def frame_errors(found: Registration, truth: dict[str, Any], closed: OrientedMesh) -> Row:
    """Return how far off the alignment of the rooms is: mean over the closed scan [mm], and its overlap."""
    off = found.alignment.motion @ np.array(truth["open_from_closed"]) - np.eye(4)
    gap = np.linalg.norm(closed.centroids @ off[:3, :3].T + off[:3, 3], axis=1).mean()
    return {"frame_error_mm": round(1e3 * float(gap), 3), "overlap": round(found.alignment.overlap, 4)}


def described(proposal: Proposal) -> Row:
    """Return a proposal in a few numbers."""
    joint = proposal.joint
    return {"kind": joint.kind, "open": round(joint.limits[1], 4), "explained": round(proposal.explained, 4)}


def iou(faces: np.ndarray, mine: np.ndarray, closed: OrientedMesh) -> float:
    """Return the area in both of two sets of faces (indices, and a mask [face]) over the area in either."""
    proposed = np.zeros(len(mine), bool)
    proposed[faces] = True
    either = closed.areas[proposed | mine].sum()
    return float(closed.areas[proposed & mine].sum() / either) if either else 0.0


def errors(proposal: Proposal, part: dict[str, Any], middle: np.ndarray) -> Row:
    """Return the errors of a proposal: axis [deg], origin [mm], range [%], and each in its own standard deviations."""
    true, joint = joint_of(part), proposal.joint
    if true.kind != joint.kind:
        return {"wrong_kind": joint.kind}
    a, b = np.array(joint.axis), np.array(true.axis)
    angle = float(np.arctan2(np.linalg.norm(np.cross(a, b)), a @ b))
    places = [np.array(j.origin) + v * ((middle - np.array(j.origin)) @ v) for j, v in ((joint, a), (true, b))]
    origin = float(np.linalg.norm(places[0] - places[1])) if joint.kind == "revolute" else None
    open_ = joint.limits[1] - part["open"]
    return {
        "axis_deg": round(float(np.degrees(angle)), 4),
        "origin_mm": None if origin is None else round(1e3 * origin, 3),
        "range_percent": round(100 * abs(open_) / part["open"], 3),
        "axis_z": round(angle / proposal.axis_deviation, 2),
        "origin_z": None if origin is None else round(origin / proposal.origin_deviation, 2),
        "range_z": round(abs(open_) / proposal.open_deviation, 2),
    }


def summary(rows: dict[str, Row]) -> Row:
    """Return medians over the parts that were found, and how many there are."""
    parts = [part for row in rows.values() for part in row["parts"].values()]
    found = [part for part in parts if "axis_deg" in part]
    result: Row = {
        "pairs": len(parts),
        "found": len(found),
        "wrong_kind": sum("wrong_kind" in part for part in parts),
        "missed": sum("iou" not in part for part in parts),
        "missed_though_seen": sum("iou" not in part and part["seen_open"] >= MIN_SEEN for part in parts),
        "false": sum(len(row["false"]) for row in rows.values()),
    }
    for key in ("axis_deg", "origin_mm", "range_percent", "iou"):
        values = [part[key] for part in found if part[key] is not None]
        if values:
            result[key] = {
                "median": round(float(np.median(values)), 3),
                "worst_tenth": round(float(np.quantile(values, 0.1 if key == "iou" else 0.9)), 3),
            }
    for kind in ("prismatic", "revolute"):
        values = [part["axis_deg"] for part in found if part["kind"] == kind]
        result[f"axis_deg_{kind}"] = round(float(np.median(values)), 3) if values else None
    for key in ("axis_z", "origin_z", "range_z"):
        values = [part[key] for part in found if part[key] is not None]
        result[f"within_2_deviations_{key[:-2]}"] = round(float(np.mean(np.array(values) < 2)), 3) if values else None
    return result


if __name__ == "__main__":
    main()
