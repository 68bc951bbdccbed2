"""Are wishes in captures of real rooms heeded, and impossible ones declined? Judged apart from the code that places.

    python experiments/wishes_real.py ROOMS [--wishes wishes_real.yaml] [--llm rules | chat | replay] [--recordings FOLDER]
        [--runs runs/wishes_real] [--rooms s0000 ...] [--name rules] [--images FOLDER] [llm.model=...]

ROOMS holds a folder a capture, by the names of the file, with the geometric.usd of `s2a export`. Puts one object at a time into
a room and judges the result by what the file says that the words mean there, with rays and distances of its own; it must be free
and carried, too (placement_checks.py). Prints a table and writes it to experiments/results/wishes_real_NAME.json.
"""

from __future__ import annotations

import argparse
import json
import time
from pathlib import Path

import numpy as np
import yaml
from insertion_study import RESULTS, _insert_settings, _zoo
from placement_checks import _carried, _free
from rater_images import rater_image
from scipy.spatial import cKDTree
from triangle_queries import Obstacles, cast, spread, tree

from s2a.core.provenance import provenance
from s2a.language.client import choose
from s2a.language.insert.batch import open_room
from s2a.language.insert.pipeline import attempt
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import ObjectRequest
from s2a.scene.scene import Mesh, Scene

OBJECT = "matryoshka"
"""What is put everywhere: small, stands firmly, and belongs nowhere in particular."""
NEAR, AWAY, CONTACT, CORNER, FRONT = 0.5, 0.75, 0.05, 0.2, 0.8
"""Largest gap to what is near, least to what is away, largest to what carries, reach of a corner, depth before a thing [m]."""


def main() -> None:
    """Try every wish and write what came of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("captures", type=Path)
    parser.add_argument("--wishes", type=Path, default=Path(__file__).parent / "wishes_real.yaml")
    parser.add_argument("--runs", type=Path, default=Path("runs/wishes_real"))
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--rooms", nargs="*")
    parser.add_argument("--llm", default="rules", choices=["rules", "chat", "replay"])
    parser.add_argument("--recordings", type=Path, help="folder of a model's answers, a file a room")
    parser.add_argument("--name", default="rules")
    parser.add_argument("--images", type=Path)
    parser.add_argument("settings", nargs="*", help="of `s2a insert`, such as llm.model=gpt-4o-mini")
    args = parser.parse_intermixed_args()
    wishes = yaml.safe_load(args.wishes.read_text())
    rows: list[dict] = []
    for name in args.rooms or wishes:
        rows += _room(name, wishes[name], args)
        report = {"llm": args.llm, "seed": args.seed, **provenance("cpu"), "table": summary(rows), "rows": rows}
        (RESULTS / f"wishes_real_{args.name}.json").write_text(json.dumps(report, indent=1) + "\n")
    print(json.dumps(summary(rows), indent=1))


def _room(name: str, wishes: list[dict], args: argparse.Namespace) -> list[dict]:
    """Return a row for every wish of one room."""
    settings = _insert_settings(args.captures / name / "geometric.usd", name, [], args)
    room, model = open_room(settings), choose(settings.llm, settings.record, rules)
    zoo, obstacles, rows = _zoo(args) / "objects", Obstacles(room.scene), list[dict]()
    for number, entry in enumerate(wishes):
        label, start = entry.get("object", OBJECT), time.perf_counter()
        file = next(zoo.glob(f"{label.replace(' ', '_')}.*"))
        inserted, record = attempt(room, ObjectRequest(file, label, entry["wish"]), model, settings)
        row = {"room": name, "wish": entry["wish"], "possible": "be" in entry, "written": inserted is not None}
        row |= {"heeded": record.get("wish", {}).get("heeded"), "problem": record["problem"]}
        row["relations"] = [[one["words"], one["met"]] for one in record.get("wish", {}).get("relations", ())]
        if inserted is not None:
            mesh = inserted.part.mesh
            row["judged"] = [[*map(str, each), holds(room.scene, mesh, *each)] for each in entry.get("be", ())]
            points = spread(mesh, 2000)
            hung = inserted.candidate.choice.relation == "hanging"
            row["free"] = _free(obstacles, mesh, points)["free"]
            row["carried"] = hung or bool(_carried(obstacles, points, False)["carried"])
            row["at"] = mesh.bounds.mean(axis=0).round(2).tolist()
            if args.images:
                rater_image(room.scene, inserted, f"{name}_{number:02d}", args.name, args.images)
        met = inserted is not None and all(each[-1] for each in row["judged"]) and row["free"] and row["carried"]
        row["right"] = met if "be" in entry else inserted is None
        row["half"] = bool(row["heeded"]) and not (met and "be" in entry)
        rows.append(row | {"seconds": round(time.perf_counter() - start, 2)})
        print(
            name,
            "ok  " if row["right"] else "BAD ",
            row["wish"],
            row.get("judged", ""),
            row["problem"][:150],
            flush=True,
        )
    return rows


def summary(rows: list[dict]) -> dict:
    """Return counts of all rows: possible wishes met, impossible ones declined, and half met ones that are called heeded."""
    can, cannot = [row for row in rows if row["possible"]], [row for row in rows if not row["possible"]]
    counts = {"possible": len(can), "met": sum(row["right"] for row in can)}
    counts |= {"impossible": len(cannot), "declined": sum(row["right"] for row in cannot)}
    return counts | {"half met and called heeded": sum(row["half"] for row in rows)}


def holds(scene: Scene, mesh: Mesh, kind: str, *of: object) -> bool:
    """Return True if an object in its place [m] has a relation; of a list of ids any part may be meant."""
    if of and isinstance(of[0], list):
        return any(holds(scene, mesh, kind, one, *of[1:]) for one in of[0])
    low, high = mesh.bounds.astype(float)
    middle = (low + high) / 2
    if kind == "level":
        return bool(of[0] <= low[2] <= of[1])
    if kind == "wall":
        walls = [
            part.mesh for part in scene.parts.values() if part.label.lower().endswith("wall") and len(part.mesh.faces)
        ]
        return bool(low[2] > 0.5 and min(_gap(mesh, wall) for wall in walls) <= 2 * CONTACT)
    part = scene.parts[str(of[0])].mesh
    corners = part.vertices[:, :2].astype(float)
    if kind == "on":
        floor = scene.parts[str(of[0])].label == "floor" and abs(low[2] - np.median(part.vertices[:, 2])) <= CONTACT
        return bool(floor or _share(mesh, part, -1.0, CONTACT) > 0.2)  # the floor under a table may be labelled as that
    if kind == "in":
        first, last = part.bounds.astype(float)
        inside = ((middle >= first - 0.02) & (middle <= last + 0.02)).all()
        return bool(inside and low[2] < last[2] - 0.02 and _walled(part, middle))
    if kind == "under":  # below a surface of it, or at the foot of what hangs
        aside = float(cKDTree(corners).query(middle[:2])[0])
        return bool(_share(mesh, part, 1.0, 3.0) > 0.5 or (high[2] <= part.bounds[0, 2] + 0.02 and aside <= 0.4))
    if kind == "over":
        return bool(low[2] > np.median(part.vertices[:, 2]) and cKDTree(corners).query(middle[:2])[0] <= 0.4)
    if kind in ("near", "away"):
        return _gap(mesh, part) <= NEAR if kind == "near" else _gap(mesh, part) >= AWAY
    if kind == "between":
        other = scene.parts[str(of[1])].mesh.vertices[:, :2].astype(float)
        a, b = (points[cKDTree(points).query(middle[:2])[1]] - middle[:2] for points in (corners, other))
        return bool(a @ b <= -0.3 * np.linalg.norm(a) * np.linalg.norm(b))
    if kind in ("front", "left", "right", "end"):
        toward = np.asarray(of[1], float) / np.linalg.norm(of[1])
        toward = {"left": np.array([toward[1], -toward[0]]), "right": np.array([-toward[1], toward[0]])}.get(
            kind, toward
        )
        ahead, own = corners @ toward, float(middle[:2] @ toward)
        across = np.array([-toward[1], toward[0]])
        aside = corners @ across
        level = aside.min() - 0.3 <= middle[:2] @ across <= aside.max() + 0.3
        first, last = np.quantile(ahead, (0.02, 0.98))
        if kind == "end":
            return bool(level and own >= first + (last - first) * 0.6)
        return bool(level and last - 0.15 <= own <= last + FRONT)
    if kind in ("corner", "middle"):
        angles = np.radians(np.arange(0, 90, 3))
        turns = [np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) for a in angles]
        turn = min(turns, key=lambda turn: np.prod(np.ptp(corners @ turn.T, axis=0)))
        first, last = (np.quantile(corners @ turn.T, q, axis=0) for q in (0.01, 0.99))
        foot = mesh.vertices[:, :2].astype(float) @ turn.T
        gap = np.minimum(foot.min(axis=0) - first, last - foot.max(axis=0))
        off = np.abs(turn @ middle[:2] - (first + last) / 2) / (last - first)
        return bool((gap <= np.maximum(CORNER, 0.2 * (last - first))).all() if kind == "corner" else (off <= 0.2).all())
    raise ValueError(f"{kind!r} is no relation of the judge")


def _gap(mesh: Mesh, part: Mesh) -> float:
    """Return the distance of points all over two surfaces [m]."""
    return float(cKDTree(spread(part, 20000)).query(spread(mesh, 500))[0].min())


def _share(mesh: Mesh, part: Mesh, sign: float, reach: float) -> float:
    """Return which fraction of vertical rays from an object's underside, or its top, meets a part within some metres."""
    low, high = mesh.bounds.astype(float)
    grid = np.linspace(0.2, 0.8, 5)
    places = np.array([low[:2] + (x, y) * (high - low)[:2] for x in grid for y in grid])
    start = np.column_stack([places, np.full(25, high[2] if sign > 0 else low[2] + 0.03)])
    ray = np.tile([0.0, 0.0, sign], (25, 1))
    _, face = cast(tree(part.vertices, part.faces), start, ray, np.full(25, reach + (0.03 if sign < 0 else 0.0)))
    return float((face >= 0).mean())


def _walled(part: Mesh, middle: np.ndarray) -> bool:
    """Return True if most level rays from a point meet a part."""
    angles = np.arange(16) * np.pi / 8
    ray = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(16)])
    start = np.tile(middle, (16, 1))
    _, face = cast(tree(part.vertices, part.faces), start, ray, np.full(16, 3.0))
    return bool((face >= 0).mean() >= 0.6)


if __name__ == "__main__":
    main()
