"""One virtual scan: furnish a room from a seed, scan it, annotate it; write the files of a real scan, and the truth."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from s2a.core.bounds import CountFromZero
from s2a.homes import files
from s2a.homes.capture import AnnotationConfig, Capture, annotated_joints, overlooked, reversed_joints, without
from s2a.homes.catalog import Entry, cad, catalog, clean_scene, part_truth
from s2a.homes.furnishing import furnish, stream
from s2a.homes.pairs import MAX_TURN, again, revisited
from s2a.homes.room import Room
from s2a.homes.scanner import ScannerConfig
from s2a.scan.ply_file import write_ply
from s2a.scene.scene import Joint, Mesh

RoomKind = Literal[
    "office", "bedroom", "kitchen", "bathroom", "living_room", "dining_room", "hallway", "laundry", "study", "workshop"
]
GENERATION = "varied"
"""In what names a room: another way to furnish rooms would take another word."""


@dataclass(frozen=True)
class SampleConfig:
    """One virtual scan.

    Attributes:
        room: kind of room.
        seed: what furnishes it and draws all errors; the same seed gives the same files.
        detail: which of the scanners is used.
        annotator: whose errors the annotation has.
        open: coordinates of parts that stand open [m] or [rad], by their ids: the same home scanned again; None: all closed.
        moved: number of free objects that stand elsewhere than without it.
        visit: 0: the scanner stands where it always does; n: the n-th later visit to the same home, with scanner positions,
            errors and a scene frame of its own.
        out: folder that is written.
        scanner: the scanners by detail.
        annotators: the annotators' errors by their names.
    """

    room: RoomKind
    seed: CountFromZero
    detail: Literal["demo", "full", "rgbd", "phone"]
    annotator: Literal["careful", "hasty", "wrong"]
    open: dict[str, float] | None
    moved: CountFromZero
    visit: CountFromZero
    out: Path
    scanner: dict[str, ScannerConfig]
    annotators: dict[str, AnnotationConfig]


@dataclass(frozen=True)
class Scan:
    """What is written.

    Attributes:
        name: ten hexadecimal digits, as ScanNet++ names its scenes.
        room: the furnished room.
        entries: all its parts.
        mesh: the scanned surface.
        motions: of the objects that stand elsewhere than in the first scan of this home, by id, in the scene, shape [4 4].
        annotated: the parts that the annotator saw.
        numbers: the annotated part of each face, shape [face].
        joints: the annotated joints by part number.
        mistakes: ids of overlooked handles and of reversed joints.
        paint: colours of points near the surface, in the scene, for a texture.
    """

    name: str
    room: Room
    entries: list[Entry]
    mesh: Mesh
    motions: dict[str, np.ndarray]
    annotated: list[Entry]
    numbers: np.ndarray
    joints: dict[int, Joint]
    mistakes: dict[str, list[str]]
    paint: files.Paint


def sample(config: SampleConfig, out: Path) -> None:
    """Write a virtual scan into a folder, and `truth/` beside it.

    Args:
        config: what is scanned, and how.
        out: folder to write into; it is created.
    """
    write(scan_room(config), config, out)


def scan_room(config: SampleConfig) -> Scan:
    """Furnish, scan and annotate a room; every step draws from a random stream of its own."""
    furniture, errors, paint, annotator, mover = streams(config)
    room = furnish(config.room, furniture)
    motions: dict[str, np.ndarray] = {}
    if config.open or config.moved:
        room, motions = again(room, config.open or {}, config.moved, mover)
    yaw = float(furniture.uniform(0.0, 2 * np.pi))
    if config.visit:
        visitor = streams(config, config.visit)[-1]
        room, errors = revisited(room, visitor), visitor.spawn(1)[0]
        yaw += float(visitor.uniform(-MAX_TURN, MAX_TURN))
    room = room.turned(yaw)
    entries = catalog(room.pieces)
    surface, owners = cad(entries)
    capture = Capture(surface, room, config.scanner[config.detail], paint)
    mesh = capture.scan(errors)
    errs = config.annotators[config.annotator]
    numbers = capture.numbers(mesh, owners, errs, annotator)
    joints, backwards = reversed_joints(annotated_joints(entries, errs, annotator), errs, annotator)
    missed = overlooked(entries, errs, annotator)
    mistakes = {"overlooked": ids_of(entries, missed), "reversed": ids_of(entries, backwards)}
    annotated, numbers = without(entries, numbers, missed)
    return Scan(scan_name(config), room, entries, mesh, motions, annotated, numbers, joints, mistakes, capture.colors)


def ids_of(entries: list[Entry], numbers: set[int]) -> list[str]:
    """Return the ids of parts given by their numbers."""
    return [entry.part_id for entry in entries if entry.number in numbers]


def streams(config: SampleConfig, visits: int = 0) -> list[np.random.Generator]:
    """Return the random streams of the furniture, the scanner's errors, the colours, the annotator, what is moved, and visits."""
    return stream(config.room, config.seed).spawn(5 + visits)


def scan_name(config: SampleConfig) -> str:
    """Return the ten hexadecimal digits that name a room of a given kind and seed, or a later scan of it."""
    words = [GENERATION, config.room, str(config.seed)]
    if config.open or config.moved:
        words += [json.dumps(config.open or {}, sort_keys=True), str(config.moved)]
    words += [f"visit {config.visit}"] if config.visit else []
    return hashlib.sha256(" ".join(words).encode()).hexdigest()[:10]


def write(scan: Scan, config: SampleConfig, out: Path) -> None:
    """Write the scan's files and the truth."""
    # Here, so that the scanner itself does not wait for USD to load.
    from s2a.scene.usd import geometric

    (out / "truth").mkdir(parents=True, exist_ok=True)
    write_ply(out / "mesh_aligned_0.05.ply", scan.mesh)
    if config.scanner[config.detail].glb:
        files.write(out / "scan.glb", scan.mesh.vertices, scan.mesh.faces, scan.paint)
    segments = {"sceneId": scan.name, "segIndices": list(range(len(scan.mesh.vertices)))}
    files.write_json(out / "segments.json", segments)
    labelled = (scan.name, scan.mesh, scan.numbers, scan.annotated)
    files.write_json(out / "segments_anno.json", files.segment_groups(*labelled))
    files.write_json(out / f"{scan.name}_parts.json", files.parts_record(*labelled))
    files.write_json(out / f"{scan.name}_artic.json", files.artic_record(scan.name, scan.annotated, scan.joints))
    files.write_json(out / "truth" / "truth.json", truth_record(scan, config))
    geometric.write(clean_scene(scan.name, scan.entries), out / "truth" / "truth.usda")


def truth_record(scan: Scan, config: SampleConfig) -> dict[str, Any]:
    """Return what is exactly true of a scan: room, scanner positions, parts with size and style, joints."""
    ids = {entry.number: entry.part_id for entry in scan.entries}
    record = {
        "name": scan.name,
        "room": config.room,
        "seed": config.seed,
        "detail": config.detail,
        "yaw": scan.room.yaw,
        "size": list(scan.room.size),
        "scanners": scan.room.scanners[: config.scanner[config.detail].poses].tolist(),
        "parts": {entry.part_id: part_truth(entry, ids) for entry in scan.entries},
    }
    if config.annotator != "careful":
        record["annotator"] = {"name": config.annotator, **scan.mistakes}
    if config.open or config.moved:
        record["again"] = {"open": config.open or {}, "moved": {i: m.tolist() for i, m in in_scene(scan).items()}}
    if config.visit:
        record["visit"] = config.visit
    return record


def in_scene(scan: Scan) -> dict[str, np.ndarray]:
    """Return the motions of the objects that stand elsewhere, in the scene, shape [4 4] each."""
    floor = next(entry.piece.pose for entry in scan.entries if entry.piece.name == "floor")
    return {part_id: floor @ motion @ np.linalg.inv(floor) for part_id, motion in scan.motions.items()}
