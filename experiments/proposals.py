"""How good are the parts that s2a annotate auto=true proposes? Against the truth of virtual homes.

    python experiments/proposals.py runs/homes/* --out experiments/results/proposals.json

Each folder holds a scan of s2a sample. A proposal's faces are matched with those of a
moving part by intersection over union of areas, best pairs first, one to one. Parts of which the scan shows less than MIN_AREA
are left out. Faces are those of the careful annotator; joints are compared with the truth. Of a phone's scan the textured GLB is
imported, as s2a import mesh=scan.glb floor=false does; each face has the part of the face that it was split from.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np

from s2a.annotate import files
from s2a.annotate.propose.fronts import propose
from s2a.annotate.propose.layers import ProposeConfig
from s2a.annotate.region import GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.scan import folder, imported
from s2a.scan.formats import articulate3d
from s2a.scan.labels import parents
from s2a.scene.scene import Joint

TEXEL = 0.01
"""[m] The default of s2a import, at which the network was trained."""
MIN_AREA, MATCH = 0.005, 0.5
"""[m^2] of the scanned faces of a part, and intersection over union."""


def measured(path: Path) -> list[dict]:
    """Return a row for each moving part and each proposal of a scan."""
    bare = files.read(path)
    surface, source = as_used(path, bare)
    start = time.perf_counter()
    values = config.file("annotate")
    grow = GrowConfig()
    found = propose(surface, config.load(ProposeConfig, values["propose"]), grow)
    seconds = time.perf_counter() - start
    truth = json.loads((path / "truth" / "truth.json").read_text())
    real = true_parts(path, bare, truth, surface, source)
    scores = np.array([[overlap(surface, i.region.faces, f) for _, f, _ in real] for i in found])
    pairs = matched(scores.reshape(len(found), len(real)))
    rows = [row(truth, found, real, scores, i, j) for i, j in pairs]
    for i in set(range(len(found))) - {i for i, _ in pairs}:
        where = {"middle_m": found[i].region.center.round(2).tolist(), "size_m": found[i].region.size.round(2).tolist()}
        rows.append({"room": truth["room"], "proposed": found[i].joint.kind, "score": found[i].score} | where)
    for j in set(range(len(real))) - {j for _, j in pairs}:
        rows.append({"room": truth["room"], "part": real[j][0], "kind": real[j][2].kind})
    return [row | {"seed": truth["seed"], "detail": truth["detail"], "seconds": round(seconds, 1)} for row in rows]


def as_used(path: Path, bare: files.BareScan) -> tuple[SplitSurface, np.ndarray]:
    """Return the surface that is annotated, and the face of the scan that each of its faces comes from."""
    if not (path / "scan.glb").exists():
        return bare.surface, np.arange(len(bare.mesh.faces))
    done = imported.convert(path / "scan.glb", TEXEL, "auto", "auto", False)
    return SplitSurface.of(done.mesh.vertices, done.mesh.faces, done.mesh.colors), done.baked.source_face


def true_parts(
    path: Path, bare: files.BareScan, truth: dict, surface: SplitSurface, source: np.ndarray
) -> list[tuple[str, np.ndarray, Joint]]:
    """Return id, faces (with all that moves along) and true joint of each moving part that the scan shows."""
    annotated = articulate3d.read_parts(folder.find(path).parts, bare.mesh)
    found = []
    for name, facts in truth["parts"].items():
        if "joint" not in facts:
            continue
        scanned = faces_of(name, annotated)
        faces = np.flatnonzero(np.isin(source, scanned))
        if surface.areas[faces].sum() >= MIN_AREA:
            joint = facts["joint"]
            found.append((name, faces, Joint(joint["kind"], joint["axis"], joint["origin"], joint["limits"])))
    return found


def faces_of(name: str, annotated: dict) -> np.ndarray:
    """Return the faces of an annotated part, by its id, with all that moves along; empty where none are annotated."""
    parent = parents({number: part.label for number, part in annotated.items()})
    mine = {int(name.rpartition("_")[2])}
    for other in sorted(annotated):
        mine |= {other} if parent[other] in mine else set()
    return np.unique(np.concatenate([np.zeros(0, int), *(annotated[n].faces for n in mine if n in annotated)]))


def overlap(surface: SplitSurface, one: np.ndarray, other: np.ndarray) -> float:
    """Return the intersection over union of two sets of faces by area."""
    both = surface.areas[np.intersect1d(one, other)].sum()
    return float(both / max(surface.areas[one].sum() + surface.areas[other].sum() - both, 1e-12))


def matched(scores: np.ndarray) -> list[tuple[int, int]]:
    """Return pairs of proposal and part with enough overlap, best first, one to one."""
    pairs, left = [], scores.copy()
    while left.size and left.max() >= MATCH:
        i, j = np.unravel_index(np.argmax(left), left.shape)
        pairs.append((int(i), int(j)))
        left[i], left[:, j] = -1.0, -1.0
    return pairs


def row(truth: dict, found, real, scores: np.ndarray, i: int, j: int) -> dict:
    """Return how a proposal compares with its part."""
    name, _, joint = real[j]
    item = found[i]
    axis, true_axis = np.array(item.joint.axis), np.array(joint.axis)
    out = {"room": truth["room"], "part": name, "kind": joint.kind, "proposed": item.joint.kind}
    out |= {"iou": round(float(scores[i, j]), 3), "score": item.score, "handle": item.grip is not None}
    if item.joint.kind == joint.kind:
        out["axis_deg"] = round(float(np.degrees(np.arccos(np.clip(abs(axis @ true_axis), 0, 1)))), 3)
        out["same_direction"] = bool(axis @ true_axis > 0.7)
        if joint.kind == "revolute":
            offset = np.array(item.joint.origin) - np.array(joint.origin)
            out["origin_m"] = round(float(np.linalg.norm(offset - (offset @ true_axis) * true_axis)), 4)
    return out


def summary(rows: list[dict]) -> dict:
    """Return the figures of some rows."""
    hits = [r for r in rows if "iou" in r]
    proposed, parts_ = sum("proposed" in r for r in rows), sum("part" in r for r in rows)
    angles = np.array([r["axis_deg"] for r in hits if r.get("same_direction")])
    origins = np.array([r["origin_m"] for r in hits if r.get("same_direction") and "origin_m" in r])
    counted = {"parts": parts_, "proposals": proposed, "matched": len(hits)}
    rates = {
        "precision": len(hits) / max(proposed, 1),
        "recall": len(hits) / max(parts_, 1),
        "f1": 2 * len(hits) / max(proposed + parts_, 1),
        "kind_right": sum(r["kind"] == r["proposed"] for r in hits) / max(len(hits), 1),
        "kind_and_direction_right": sum(bool(r.get("same_direction")) for r in hits) / max(len(hits), 1),
    }
    errors = {}
    if len(angles):
        errors = {"axis_deg_median": float(np.median(angles)), "axis_deg_95": float(np.quantile(angles, 0.95))}
        errors |= {"axis_within_1_deg": float((angles <= 1.0).mean())}
    if len(origins):
        errors |= {"hinge_m_median": float(np.median(origins)), "hinge_m_95": float(np.quantile(origins, 0.95))}
    return counted | {key: round(value, 4) for key, value in (rates | errors).items()}


def main() -> None:
    """Measure all folders, print and write the figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="+", type=Path)
    parser.add_argument("--out", type=Path)
    arguments = parser.parse_args()
    rows: list[dict] = []
    for path in arguments.scans:
        found = measured(path)
        rows += found
        mine = [
            r
            for r in rows
            if (r["room"], r["seed"], r["detail"]) == tuple(rows[-1][k] for k in ("room", "seed", "detail"))
        ]
        print(path.name, summary(mine), flush=True)
    figures = {
        detail: summary([r for r in rows if r["detail"] == detail]) for detail in sorted({r["detail"] for r in rows})
    }
    print(json.dumps(figures, indent=1))
    if arguments.out:
        scans = [path.name for path in arguments.scans]
        content = {"provenance": provenance("cpu"), "scans": scans, "figures": figures, "rows": rows}
        arguments.out.write_text(json.dumps(content, indent=1) + "\n")


if __name__ == "__main__":
    main()
