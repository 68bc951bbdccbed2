"""Pairs of virtual scans for `experiments/registration.py`: a home with all parts closed, and at another visit with some open.

A pair is kept as one npz in the work folder: both meshes, the part of every closed face, and the truth: joints in the closed
scan's frame, how far each part stands open, and the motion from the closed scan's frame to the open one's.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core import config
from s2a.core.errors import InputError
from s2a.homes.furnishing import furnish
from s2a.homes.room import Entry, catalog
from s2a.homes.sample import SampleConfig, Scan, scan_room, streams
from s2a.homes.solids import join
from s2a.scene.articulation import displace, lever_arm
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Joint

APART = 0.03
"""[m] Parts that stand open keep so far from each other."""
OPENED = (0.35, 1.0)
"""How far parts are opened, as a fraction of their range."""
MIN_AREA, MIN_TRAVEL = 0.02, 0.05
"""[m^2] and [m] Smallest front, and smallest path of its centre, of a part that is opened."""
MOVED = 4
"""Free objects that stand elsewhere at the second visit."""
DEFAULTS = ["annotator.border=0", "annotator.axis=0", "annotator.origin=0"]
"""Faces and joints as they are, not as an annotator sees them."""


def make(room: str, seed: int, detail: str, parts: int, folder: Path) -> dict[str, Any]:
    """Return a pair of scans with up to so many parts open; one that is in the work folder is read.

    Returns:
        `closed` and `open`: vertices [m] and faces; `numbers`: part of each closed face; `truth`: as JSON.
    """
    file = folder / f"{room}_{seed}_{detail}_{parts}.npz"
    if not file.exists():
        folder.mkdir(parents=True, exist_ok=True)
        keys = [f"room={room}", f"seed={seed}", f"detail={detail}", "out=none", *DEFAULTS]
        first = config.load(SampleConfig, config.compose("sample", keys))
        opened = choose(first, parts)
        closed = scan_room(first)
        open_, moved = _second(replace(first, visit=1, open=opened))
        truth = {"name": closed.name, "moved": moved, **_truth(closed, open_, opened)}
        arrays = {"closed_vertices": closed.mesh.vertices, "closed_faces": closed.mesh.faces, "numbers": closed.numbers}
        arrays |= {"open_vertices": open_.mesh.vertices, "open_faces": open_.mesh.faces}
        np.savez(file.with_suffix(".tmp.npz"), truth=json.dumps(truth), **arrays)
        file.with_suffix(".tmp.npz").rename(file)
    found = np.load(file)
    truth = json.loads(str(found["truth"]))
    meshes = {key: (found[f"{key}_vertices"], found[f"{key}_faces"]) for key in ("closed", "open")}
    return {**meshes, "numbers": found["numbers"], "truth": truth}


def _second(first: SampleConfig) -> tuple[Scan, int]:
    """Return the second scan, with as many moved objects as find another place, at most MOVED."""
    for moved in range(MOVED, 0, -1):
        try:
            return scan_room(replace(first, moved=moved)), moved
        except InputError as error:
            if "moved=" not in str(error):
                raise
    return scan_room(first), 0


def choose(first: SampleConfig, count: int) -> dict[str, float]:
    """Return up to so many parts and how far they are opened, one of each object first; open ones keep apart."""
    room = furnish(first.room, streams(first)[0])
    rng = np.random.default_rng([first.seed, len(first.room), 20])
    entries = catalog(room.pieces)
    shuffled = [entries[i] for i in rng.permutation(len(entries)).tolist()]
    tops = {entry.number: _top(entry, entries) for entry in entries}
    found: dict[str, float] = {}
    clouds: list[np.ndarray] = []
    for _ in range(2):  # one of each object, then a second part of the objects
        used: set[int] = set()
        for entry in shuffled:
            fits = entry.part_id not in found and tops[entry.number] not in used and _opens(entry, entries)
            if len(found) == count or not fits:
                continue
            joint = entry.piece.joint
            q = float(rng.uniform(*OPENED)) * joint.limits[1]
            surface = join(*(e.piece.surface for e in family(entry, entries)))
            surface = replace(surface, vertices=displace(surface.vertices, joint, q))
            tree = ray_mesh(surface.vertices, surface.faces)
            if all(nearest_faces(tree, cloud, 10.0)[1].min() > APART for cloud in clouds):
                found[entry.part_id] = round(q, 4)
                clouds.append(_cloud(surface.vertices, surface.faces))
                used.add(tops[entry.number])
    return found


def _cloud(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return random points on a surface [m], shape [point 3]."""
    rng = np.random.default_rng(0)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    pick = rng.choice(len(faces), 4000, p=area / area.sum())
    u, v = rng.uniform(size=(2, 4000, 1))
    u, v = np.where(u + v > 1, 1 - u, u), np.where(u + v > 1, 1 - v, v)
    return a[pick] + u * (b - a)[pick] + v * (c - a)[pick]


def _opens(entry: Entry, entries: list[Entry]) -> bool:
    """Return whether a part is a front that opens by itself: large enough, moving far enough, on nothing that moves."""
    joint = entry.piece.joint
    by_number = {other.number: other for other in entries}
    above = entry
    while above.parent is not None:
        above = by_number[above.parent]
        if above.piece.joint is not None:
            return False
    if joint is None or joint.limits[1] <= 0.0:
        return False
    extents = np.sort(entry.piece.size)
    travel = OPENED[0] * joint.limits[1] * lever_arm(joint, entry.piece.surface.vertices.mean(axis=0))
    return bool(extents[1] * extents[2] > MIN_AREA and travel > MIN_TRAVEL)


def _top(entry: Entry, entries: list[Entry]) -> int:
    by_number = {other.number: other for other in entries}
    while entry.parent is not None:
        entry = by_number[entry.parent]
    return entry.number


def family(entry: Entry, entries: list[Entry]) -> list[Entry]:
    """Return a part and all parts that belong to it."""
    numbers = {entry.number}
    for other in entries:
        if other.parent in numbers:
            numbers.add(other.number)
    return [other for other in entries if other.number in numbers]


def _truth(closed: Scan, open_: Scan, opened: Mapping[str, float]) -> dict[str, Any]:
    """Return the joints in the closed scan's frame, the numbers of what moves, and the motion of the frames."""
    floors = [next(e.piece.pose for e in scan.entries if e.piece.name == "floor") for scan in (closed, open_)]
    parts = {}
    for entry in closed.entries:
        if entry.part_id in opened:
            joint = entry.piece.joint
            parts[entry.part_id] = {
                "kind": joint.kind,
                "axis": joint.axis,
                "origin": joint.origin,
                "open": opened[entry.part_id],
                "numbers": [e.number for e in family(entry, closed.entries)],
                "area": float(np.prod(np.sort(entry.piece.size)[1:])),
            }
    return {"parts": parts, "open_from_closed": (floors[1] @ np.linalg.inv(floors[0])).tolist()}


def joint_of(part: Mapping[str, Any]) -> Joint:
    """Return the true joint of a part of `truth`, opened to its upper limit."""
    return Joint(part["kind"], part["axis"], part["origin"], (0.0, part["open"]))
