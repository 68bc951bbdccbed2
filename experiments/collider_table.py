"""How good are the colliders of scanned handles, measured against what was really there?

    python experiments/collider_table.py SCAN ... [--methods handle coacd one_hull] [--styles bar knob ...]
        [--each 2] [--out FILE]
    python experiments/collider_table.py --merge FILE ... [--out FILE]

Each SCAN is a folder that `s2a sample` wrote. Of every handle style in it the first `--each` movable parts are given
colliders by every method, without any cache, and compared with `truth/`. Renews these rows of
experiments/results/colliders.json after each scan, keeps its others, and prints its table. Scans are measured side by side with
an --out of their own each, and --merge then puts the rows of these files there. Of each part:

- scan: mean distance of the handle as scanned from the true one [mm]; `bias` is the mean signed one of the faces that
  look out of the furniture (positive: the scan stands out too far).
- fit: mean distance of the handle as scanned (what of it is handle, borders tidied) from the colliders [mm].
- symmetric: error of the colliders at the handle [mm], the larger one of true (true handle to hulls) and hull (back), as
  handle_error.py defines it.
- gap: fraction of the space of two fingers at the true handle that colliders fill [%].
- behind: fraction of the free space between a handle and its front, behind the handle, that colliders fill [%]; not of cups.
- web: fraction of the lines across a bar, behind it, that the scanned surface blocks [%].
- seconds: processor time, of all threads.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections import defaultdict
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "support"))
from closeness import gap_points
from handle_error import MARGIN, TrueHandle, behind, distances, filled_behind, symmetric_error, union_surface

from s2a import scan
from s2a.core import config
from s2a.core.provenance import provenance
from s2a.prepare.grasp import find_grasp, find_target
from s2a.prepare.part_hulls import ColliderConfig, find_handle, target_colliders
from s2a.scene.geometry.front_panel import FingerSpace, finger_space, fraction_inside
from s2a.scene.geometry.mesh_ops import centroids, merge, normals, sample, sample_with_faces
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Mesh, Scene
from s2a.scene.usd import geometric

RESULTS = Path(__file__).parent / "results/colliders.json"
POINTS = 1500
MARGINS = np.array([[-MARGIN], [MARGIN]])
STYLES = ("bar", "bar upright", "knob", "cup", "edge", "lever", "bow", "rail", "recess", "square", "strap", "t")
"""Handles' styles and families."""
MEASURES = (
    *("scan_mm", "bias_mm", "fit_mm", "symmetric_mm", "true_mm", "hull_mm"),
    *("gap_pct", "behind_pct", "web_pct", "hulls", "vertices", "seconds"),
)


def main() -> None:
    """Measure all parts of all scans with all methods."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("scans", nargs="*", type=Path)
    parser.add_argument(
        "--merge", nargs="+", type=Path, default=[], help="files of this command whose rows are taken over"
    )
    parser.add_argument("--methods", nargs="+", default=["handle", "coacd", "one_hull"])
    parser.add_argument("--each", type=int, default=2)
    parser.add_argument("--styles", nargs="+", default=list(STYLES), choices=STYLES)
    parser.add_argument("--out", type=Path, default=RESULTS)
    args = parser.parse_args()
    rows = json.loads(args.out.read_text())["rows"] if args.out.exists() else []
    for path in args.merge:
        measured = json.loads(path.read_text())
        rows = write(args.out, rows, measured["rows"], {key: measured[key] for key in provenance("cpu")})
    for folder in args.scans:
        rows = write(args.out, rows, measure_scan(folder, args.methods, args.styles, args.each), provenance("cpu"))
    print("\n".join(summary(table(rows))))


def write(path: Path, rows: list[dict], new: list[dict], measured: dict[str, object]) -> list[dict]:
    """Write rows with new ones in place of those of the same scan, part and method, and return all; `measured`: how, where."""
    replaced = {_key(row) for row in new}
    rows = [row for row in rows if _key(row) not in replaced] + new
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(json.dumps({**measured, "table": table(rows), "rows": rows}, indent=1) + "\n")
    return rows


def measure_scan(folder: Path, methods: list[str], styles: list[str], each: int) -> list[dict]:
    """Return one row per part and method of one scan."""
    facts = json.loads((folder / "truth/truth.json").read_text())
    scanned, true = scan.read(folder), geometric.read(folder / "truth/truth.usda")
    name = f"{facts['room']} {facts['seed']} {facts['detail']}"
    rows, taken = [], defaultdict(int)
    for target in scanned.movable:
        style = style_of(true, target, facts)
        if style not in styles or taken[style] >= each:
            continue
        taken[style] += 1
        for method in methods:
            rows.append({"scan": name, "target": target, "style": style, "method": method})
            rows[-1] |= measure(scanned, true, target, method)
            print(" ".join(f"{key}={_short(value)}" for key, value in rows[-1].items()), flush=True)
    return rows


def style_of(true: Scene, target: str, facts: dict) -> str | None:
    """Return the style or family of a part's handle, or None if it has none; bars are classified by their orientation."""
    held = facts["parts"][true.grasp_parts(target)[0]]
    style = held.get("facts", {}).get("family", held["style"])
    if style != "bar":
        return style or None
    along = Rotation.from_quat(find_grasp(true, target).orientation).as_matrix()[:, 0]
    return "bar upright" if abs(along[2]) > 0.7 else "bar"


def measure(scanned: Scene, true: Scene, target: str, method: str) -> dict:
    """Return what one method makes of one part."""
    settings = config.load(ColliderConfig, config.compose("prepare", [f"prepare={method}"])["prepare"]["colliders"])
    start = time.process_time()
    part = find_target(scanned, target)
    handle, others = find_handle(part)
    colliders = target_colliders(part, handle, others, settings)
    seconds = time.process_time() - start
    pieces = [collider.mesh for collider in colliders]
    truth, (frame, front) = true_handle(true, target), true_front(true, target)
    space = true_space(true, target, frame, front)
    surface = merge([scanned.parts[i].mesh for i in (target, *scanned.descendants(target))])
    own = [collider.mesh for collider in colliders if collider.part in part.grasp_parts]
    error = symmetric_error(own, [c.mesh for c in colliders if c.part not in part.grasp_parts], truth)
    asked = _outside(gap_points(space), true, target)
    whole, _ = union_surface(pieces, handle.region.bounds + MARGINS)
    return {
        **scan_error(scanned, true, target, part.frame),
        "fit_mm": 1e3 * float(distances(sample(handle.region, POINTS, 0), whole).mean()),
        "symmetric_mm": error.symmetric_mm,
        "true_mm": error.true_mm,
        "hull_mm": error.hull_mm,
        "behind_pct": filled_behind(pieces, behind(truth, frame, front)),
        "gap_pct": 1e2 * fraction_inside(pieces, asked) if len(asked) else None,
        "web_pct": webbed(surface, space, frame),
        "hulls": len(pieces),
        "vertices": sum(len(piece.vertices) for piece in pieces),
        "seconds": seconds,
    }


def scan_error(scanned: Scene, true: Scene, target: str, frame: np.ndarray) -> dict:
    """Return how far the scanned handle is from the true one [mm]: of all faces, and signed of those that look outwards."""
    mesh = merge([scanned.parts[i].mesh for i in scanned.grasp_parts(target)])
    points, faces = sample_with_faces(mesh, POINTS, 0)
    gap, sign = _signed(points, merge([true.parts[i].mesh for i in (target, *true.descendants(target))]))
    facing = normals(mesh)[faces] @ -frame[:, 2] > 0.5
    bias = 1e3 * float((gap * sign)[facing].mean()) if facing.any() else None
    return {"scan_mm": 1e3 * float(gap.mean()), "bias_mm": bias}


def true_handle(true: Scene, target: str) -> TrueHandle:
    """Return what was really there of a part's handle, of what moves with it, and of the furniture around."""
    grasped, root = true.grasp_parts(target), true.root(target)
    rest = [i for i in true.members(target) if i not in grasped]
    others = [i for i in (root, *true.descendants(root)) if i not in (*grasped, *rest)]
    return TrueHandle(*(merge([true.parts[i].mesh for i in ids]) for ids in (grasped, rest, others)))


def true_space(true: Scene, target: str, frame: np.ndarray, front: float | None) -> FingerSpace:
    """Return where fingers go at the true handle."""
    if front is None:
        return FingerSpace(None, ())
    region = merge([true.parts[i].mesh for i in true.grasp_parts(target)])
    return finger_space(region, true.grasp_point(target), frame, front)


def true_front(true: Scene, target: str) -> tuple[np.ndarray, float | None]:
    """Return the true grasp frame's axes [3 3], and the coordinate of the front on its z axis [m], None without one.

    The front is where lines along z through the handle first meet the part that carries it: what lies deeper is inside of it.
    """
    frame = Rotation.from_quat(find_grasp(true, target).orientation).as_matrix()
    region = merge([true.parts[i].mesh for i in true.grasp_parts(target)])
    starts = sample(region, POINTS, 0) @ frame
    starts[:, 2] = starts[:, 2].min() - 0.01
    front = true.parts[target].mesh
    hits = first_hits(ray_mesh(front.vertices, front.faces), starts @ frame.T, np.tile(frame[:, 2], (POINTS, 1)))
    met = np.isfinite(hits)
    return frame, float(np.median((starts[:, 2] + hits)[met])) if met.mean() > 0.25 else None


def webbed(surface: Mesh, space: FingerSpace, frame: np.ndarray) -> float | None:
    """Return the fraction of the lines across a bar, behind it, that the scanned surface blocks [%]; None without a gap."""
    if space.behind is None:
        return None
    points = gap_points(FingerSpace(space.behind, ()))
    y = points @ frame[:, 1]
    low, high = y.min(), y.max()
    starts = points + np.outer(low - 0.005 - y, frame[:, 1])
    hits = first_hits(ray_mesh(surface.vertices, surface.faces), starts, np.tile(frame[:, 1], (len(points), 1)))
    return 1e2 * float((hits < high - low + 0.01).mean())


def table(rows: list[dict]) -> list[dict]:
    """Return means by style and method, the worst gap, hulls and time, and `free_pct` of parts with a gap fill below 1 %."""
    found = []
    for method in dict.fromkeys(row["method"] for row in rows):
        for style in STYLES:
            group = [row for row in rows if row["method"] == method and row["style"] == style]
            if group:
                means = {key: _mean(row[key] for row in group) for key in MEASURES}
                asked = ("gap_pct", "hulls", "seconds")
                worst = {f"worst_{key}": max(row[key] or 0.0 for row in group) for key in asked}
                gaps = [row["gap_pct"] for row in group if row["gap_pct"] is not None]
                free = {"free_pct": 1e2 * float(np.mean([gap < 1.0 for gap in gaps])) if gaps else None}
                found.append({"method": method, "style": style, "parts": len(group), **means, **free, **worst})
    return found


def summary(rows: list[dict]) -> list[str]:
    """Return the table as lines."""
    keys = list(rows[0]) if rows else []
    return [" ".join(f"{key[:12]:>12}" for key in keys)] + [
        " ".join(f"{_short(row[key]):>12}" for key in keys) for row in rows
    ]


def _key(row: dict) -> tuple[str, str, str]:
    return row["scan"], row["target"], row["method"]


def _outside(points: np.ndarray, true: Scene, target: str) -> np.ndarray:
    """Return the points that lie in nothing that is really there."""
    if not len(points):
        return points
    gap, sign = _signed(points, merge([true.parts[i].mesh for i in (target, *true.descendants(target))]))
    return points[(sign > 0) & (gap > 5e-4)]


def _signed(points: np.ndarray, mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return the distance of points from a surface [m], and 1 before or -1 behind its nearest face, shape [point] each."""
    faces, gap = nearest_faces(ray_mesh(mesh.vertices, mesh.faces), points)
    side = np.einsum("ij,ij->i", points - centroids(mesh)[faces], normals(mesh)[faces])
    return gap, np.where(side >= 0, 1.0, -1.0)


def _mean(values: object) -> float | None:
    known = [value for value in values if value is not None]  # type: ignore[attr-defined]
    return float(np.mean(known)) if known else None


def _short(value: object) -> str:
    return f"{value:.2f}" if isinstance(value, float) else str(value)


if __name__ == "__main__":
    main()
