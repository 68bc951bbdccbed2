"""One virtual scan: furnish a room from a seed, scan it, annotate it; write the files of a real scan, and the truth."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import numpy as np

from s2a.errors import InputError
from s2a.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.ranges import CountFromZero
from s2a.scene import Joint, Mesh
from s2a.synth import files, glb
from s2a.synth.annotate import AnnotationConfig, annotated_joints, face_numbers
from s2a.synth.appearance import vertex_colors
from s2a.synth.catalog import Entry, cad, catalog, clean_scene
from s2a.synth.homes import furnish, stream
from s2a.synth.room import Room
from s2a.synth.rooms import ROOMS
from s2a.synth.scanner import ScannerConfig, scan
from s2a.synth.sight import sighted, vertex_normals
from s2a.synth.solids import rotation


@dataclass(frozen=True)
class SampleConfig:
    """One virtual scan.

    Attributes:
        virtual: which rooms: "classic" (five hand-planned ones, the same bytes ever since) or "varied" (drawn ones).
        room: kind of room; the first five exist in both.
        seed: what furnishes it and draws all errors; the same seed gives the same files.
        detail: which of the scanners is used.
        out: folder that is written.
        scanner: the scanners by detail.
        annotation: the annotator's errors.
    """

    virtual: Literal["classic", "varied"]
    room: Literal[
        "office",
        "bedroom",
        "kitchen",
        "bathroom",
        "living_room",
        "dining_room",
        "hallway",
        "laundry",
        "study",
        "workshop",
    ]
    seed: CountFromZero
    detail: Literal["demo", "full", "rgbd", "phone"]
    out: Path
    scanner: dict[str, ScannerConfig]
    annotation: AnnotationConfig


@dataclass(frozen=True)
class Scan:
    """What is written.

    Attributes:
        name: ten hexadecimal digits, as ScanNet++ names its scenes.
        room: the furnished room.
        entries: all its parts.
        mesh: the scanned surface.
        numbers: the part of each of its faces, shape [face].
        joints: the annotated joints by part number.
        paint: colours of points near the surface, in the scene, for a texture.
    """

    name: str
    room: Room
    entries: list[Entry]
    mesh: Mesh
    numbers: np.ndarray
    joints: dict[int, Joint]
    paint: glb.Paint


def sample(config: SampleConfig, out: Path) -> None:
    """Write a virtual scan into a folder, and `truth/` beside it.

    Args:
        config: what is scanned, and how.
        out: folder to write into; it is created.
    """
    write(scan_room(config), config, out)


def scan_room(config: SampleConfig) -> Scan:
    """Furnish, scan and annotate a room; every step draws from a random stream of its own."""
    furniture, errors, paint, annotator = streams(config)
    room = furnished(config, furniture).turned(float(furniture.uniform(0.0, 2 * np.pi)))
    entries = catalog(room.pieces)
    surface, owners = cad(entries)
    T_room_scene = rotation((0.0, 0.0, -room.yaw))
    clean = surface.moved(T_room_scene)
    mesh = ray_mesh(clean.vertices, clean.faces)
    scanner = config.scanner[config.detail]
    bounds = np.stack([surface.vertices.min(axis=0), surface.vertices.max(axis=0)])
    places = room.scanners[: scanner.poses]
    vertices, faces = scan(mesh, surface.dropout, room.yaw, places, bounds, scanner, errors)
    inside, cameras = (points @ T_room_scene[:3, :3].T for points in (vertices, places))

    def seen(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        """Return the true points whose colours and parts a camera sees at points of the surface."""
        return sighted(mesh, points, normals, cameras) if scanner.colors == "camera" else points

    def painted(points: np.ndarray, normals: np.ndarray) -> np.ndarray:
        shown = seen(points @ T_room_scene[:3, :3].T, normals @ T_room_scene[:3, :3].T)
        return vertex_colors(shown, clean, nearest_faces(mesh, shown)[0], paint)

    normals = vertex_normals(inside, faces)
    shown = seen(inside, normals)
    colors = vertex_colors(shown, clean, nearest_faces(mesh, shown)[0], paint)
    centres = seen(inside[faces].mean(axis=1), normals[faces].mean(axis=1))
    numbers = face_numbers(mesh, owners, centres, config.annotation, annotator)
    joints = annotated_joints(entries, config.annotation, annotator)
    return Scan(scan_name(config), room, entries, Mesh(vertices, faces, colors), numbers, joints, painted)


def streams(config: SampleConfig) -> list[np.random.Generator]:
    """Return the random streams of the furniture, the scanner's errors, the colours and the annotator."""
    classic = config.virtual == "classic"
    return (np.random.default_rng(config.seed) if classic else stream(config.room, config.seed)).spawn(4)


def furnished(config: SampleConfig, rng: np.random.Generator) -> Room:
    """Return the furnished room, in its own frame.

    Raises:
        InputError: the classic rooms have none of this kind.
    """
    if config.virtual == "varied":
        return furnish(config.room, rng)
    if config.room not in ROOMS:
        known = ", ".join(ROOMS)
        raise InputError(f"virtual=classic has no room {config.room!r}; known: {known}; virtual=varied has it")
    return ROOMS[config.room](rng)


def scan_name(config: SampleConfig) -> str:
    """Return the ten hexadecimal digits that name a room of a given kind and seed."""
    varied = "" if config.virtual == "classic" else f"{config.virtual} "
    return hashlib.sha256(f"{varied}{config.room} {config.seed}".encode()).hexdigest()[:10]


def write(scan: Scan, config: SampleConfig, out: Path) -> None:
    """Write the scan's files and the truth."""
    # Here, so that the scanner itself does not wait for USD to load.
    from s2a.usd import geometric

    (out / "truth").mkdir(parents=True, exist_ok=True)
    files.write_ply(out / "mesh_aligned_0.05.ply", scan.mesh)
    if config.scanner[config.detail].glb:
        glb.write(out / "scan.glb", scan.mesh.vertices, scan.mesh.faces, scan.paint)
    segments = {"sceneId": scan.name, "segIndices": list(range(len(scan.mesh.vertices)))}
    files.write_json(out / "segments.json", segments)
    labelled = (scan.name, scan.mesh, scan.numbers, scan.entries)
    files.write_json(out / "segments_anno.json", files.segment_groups(*labelled))
    files.write_json(out / f"{scan.name}_parts.json", files.parts_record(*labelled))
    files.write_json(out / f"{scan.name}_artic.json", files.artic_record(scan.name, scan.entries, scan.joints))
    files.write_json(out / "truth" / "truth.json", truth_record(scan, config))
    geometric.write(clean_scene(scan.name, scan.entries), out / "truth" / "truth.usda")


def truth_record(scan: Scan, config: SampleConfig) -> dict[str, Any]:
    """Return what is exactly true of a scan: room, scanner positions, parts with size and style, joints."""
    return {
        "name": scan.name,
        "room": config.room,
        "seed": config.seed,
        "detail": config.detail,
        "yaw": scan.room.yaw,
        "size": list(scan.room.size),
        "scanners": scan.room.scanners[: config.scanner[config.detail].poses].tolist(),
        "parts": {entry.part_id: _part_truth(entry) for entry in scan.entries},
    }


def _part_truth(entry: Entry) -> dict[str, Any]:
    """Return the exact facts about one part."""
    joint = entry.piece.joint
    facts: dict[str, Any] = {
        "label": entry.label,
        "style": entry.piece.style,
        "size": entry.piece.size.tolist(),
        "pose": entry.piece.pose.tolist(),
    }
    if joint is not None:
        facts["joint"] = {"kind": joint.kind, "axis": joint.axis, "origin": joint.origin, "limits": joint.limits}
    return facts
