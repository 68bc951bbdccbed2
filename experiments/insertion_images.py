"""Does the image of an insertion show the object? The zoo's hundred objects, each alone in its room, by the rules.

    python experiments/insertion_images.py [--runs runs/insertion_images] [--seed 100] [--categories bathroom ...] [--name rules]

Rooms and objects are those of insertion_study.py with the same --runs and --seed. Each image is rendered as `image=` does,
once with the object and once without it; besides, each pixel's rays are cast at the object alone and at the whole room. Shown is
an object of which at least HALF of its own silhouette is visible, that is at most CUT off by the border, that changes at least
PIXELS pixels by more than 12 of 255, and that no wall or furniture stands before the camera of. Prints a line a failure, and
writes a row an object to experiments/results/insertion_images_NAME.json. None of it uses the code that chooses the viewpoint.
"""

from __future__ import annotations

import argparse
import copy
import json
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
from insertion_study import METHODS, RESULTS, ROOMS, _insert_settings, _requests, _stage
from triangle_queries import cast, tree

from s2a.core.provenance import provenance
from s2a.language.client import choose
from s2a.language.insert.batch import open_room
from s2a.language.insert.describe import RoomState
from s2a.language.insert.pipeline import attempt
from s2a.language.insert.review import image_pose
from s2a.language.insert.rules import rules
from s2a.language.insert.settings import Inserted, InsertSettings, ObjectRequest
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.render import CameraPose, OrbitCamera, render
from s2a.scene.scene import Mesh

HALF, CUT, PIXELS, CHANGED = 0.5, 0.1, 250, 12
"""Least visible and largest cut-off fraction of the silhouette, least number of changed pixels, and what counts as changed."""


def main() -> None:
    """Insert every object, and measure its image."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=Path, default=Path("runs/insertion_images"))
    parser.add_argument("--seed", type=int, default=100)
    parser.add_argument("--categories", nargs="*", default=[c for c in ROOMS if c != "foreign"], choices=ROOMS)
    parser.add_argument("--name", default="rules")
    args = parser.parse_args()
    args.llm, args.recordings, args.settings = "rules", None, []
    rows: list[dict] = []
    for category in args.categories:
        settings = _insert_settings(_stage(ROOMS[category], args.seed, args), category, METHODS["ours"], args)
        room = open_room(settings)
        for request, _ in _requests(category, args):
            rows.append({"category": category, **_row(copy.copy(room), request, settings)})
            if not rows[-1]["shown"]:
                print(rows[-1], flush=True)
        _write(rows, args)
    print(json.dumps(summary(rows)))


def _write(rows: list[dict], args: argparse.Namespace) -> None:
    limits = {"visible": HALF, "cut": CUT, "pixels": PIXELS, "changed": CHANGED}
    report = {"llm": "rules", "seed": args.seed, **provenance("cpu"), "limits": limits}
    report |= {"summary": summary(rows), "rows": rows}
    (RESULTS / f"insertion_images_{args.name}.json").write_text(json.dumps(report, indent=1) + "\n")


def summary(rows: list[dict]) -> dict:
    """Return how many were written and shown, and the median and least visible fraction."""
    written = [row for row in rows if row["written"]]
    fractions = [row["visible"] for row in written]
    counts = {"objects": len(rows), "written": len(written), "shown": sum(row["shown"] for row in rows)}
    return counts | {"median_visible": float(np.median(fractions)), "least_visible": min(fractions)}


def _row(room: RoomState, request: ObjectRequest, settings: InsertSettings) -> dict:
    """Return what the image of one object shows."""
    inserted, record = attempt(room, request, choose(settings.llm, None, rules), settings)
    row = {"object": request.file.stem, "written": inserted is not None, "shown": False}
    if inserted is None:
        return row | {"problem": record["problem"][:200]}
    without = [part.mesh for part in room.scene.parts.values()]
    room.add(inserted)
    start = time.perf_counter()
    pose = image_pose(inserted, room.scene, settings.camera)
    return (
        row | _measured(inserted, without, pose, settings.camera) | {"seconds": round(time.perf_counter() - start, 2)}
    )


def _measured(inserted: Inserted, without: list[Mesh], pose: CameraPose, camera: OrbitCamera) -> dict:
    """Return the measures of an image, rendered with one ray a pixel."""
    once = replace(camera, samples=1)
    mesh = inserted.part.mesh
    bare, shown = (render(meshes, pose, once).astype(int) for meshes in (without, [*without, mesh]))
    differ = int((np.abs(shown - bare).max(axis=2) > CHANGED).sum())
    found = silhouette(mesh, merge([Mesh(m.vertices, m.faces) for m in without]), pose, camera)
    said = {"pixels": differ, **found}
    good = found["visible"] >= HALF and found["cut"] <= CUT and differ >= PIXELS and found["before"] > 0.1
    return said | {"shown": bool(good), "target": inserted.candidate.target}


def silhouette(mesh: Mesh, room: Mesh, pose: CameraPose, camera: OrbitCamera) -> dict:
    """Return the visible fraction of an object's silhouette, the fraction that is cut off, and what is before the camera [m].

    Rays go through a field twice as wide and high as the image, so that what is cut off counts. Surfaces of the room count from
    both sides: a wall seen from behind may be left out of the image, but an image from behind a wall is none of a room.
    """
    forward = np.subtract(pose.target, pose.eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0.0, 0.0, 1.0))
    right = right / np.linalg.norm(right) if np.linalg.norm(right) > 1e-9 else np.array([1.0, 0.0, 0.0])
    up, tangent = np.cross(right, forward), np.tan(camera.fov / 2)
    wide = camera.width / camera.height
    x, y = np.meshgrid(np.linspace(-2, 2, camera.width // 2), np.linspace(-2, 2, camera.height // 2))
    rays = forward + tangent * (wide * x.ravel()[:, None] * right + y.ravel()[:, None] * up)
    rays /= np.linalg.norm(rays, axis=1, keepdims=True)
    eyes, far = np.tile(pose.eye, (len(rays), 1)), np.full(len(rays), 50.0)
    own, face = cast(tree(mesh.vertices, mesh.faces), eyes, rays, far)
    hit = face >= 0
    if not hit.any():
        return {"visible": 0.0, "cut": 1.0, "before": 0.0, "distance": 0.0}
    other, _ = cast(tree(room.vertices, room.faces), eyes[hit], rays[hit], far[hit])
    inside = (np.abs(x.ravel()[hit]) <= 1) & (np.abs(y.ravel()[hit]) <= 1)
    seen = (own[hit] <= other + 1e-4) & inside
    image = ~hit & (np.abs(x.ravel()) <= 1) & (np.abs(y.ravel()) <= 1)
    ahead, _ = cast(tree(room.vertices, room.faces), eyes[image], rays[image], far[image])
    said = {
        "visible": seen.mean(),
        "cut": 1 - inside.mean(),
        "before": np.percentile(ahead, 5) if len(ahead) else 50.0,
        "distance": own[hit].min(),
    }
    return {name: round(float(value), 3) for name, value in said.items()}


if __name__ == "__main__":
    main()
