"""One virtual scan: furnish a room from a seed, scan it, annotate it; write the files of a real scan, and the truth.

The same home can be scanned once more: parts opened, free objects moved, the scanner put up elsewhere; the truth follows.
"""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np

from s2a.core.bounds import CountFromZero
from s2a.core.errors import InputError
from s2a.core.outputs import Output
from s2a.homes import files
from s2a.homes.capture import AnnotationConfig, Capture, annotated_joints, overlooked, reversed_joints, without
from s2a.homes.floor_plan import measured, meet
from s2a.homes.furnishing import furnish, stream
from s2a.homes.room import Entry, Room, cad, catalog, clean_scene, part_truth
from s2a.homes.scanner import ScannerConfig
from s2a.homes.solids import Piece, Surface, at, join
from s2a.scan.ply_file import write_ply
from s2a.scene.articulation import transform
from s2a.scene.geometry.mesh_ops import sample as points_on
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd import geometric

SHIFT = 0.6  # [m] Farthest that an object is moved along each axis
SMALL = 0.6  # [m] Objects that are larger than this along any axis stay where they are
AIR = 0.006  # [m] Least distance of a moved object from everything but what it stands on
LEVEL = 0.003  # [m] Within which an object's whole footprint has to find its support
MAX_ATTEMPTS = 60
SAMPLES = 1500  # Points on an object whose surroundings are asked for: one every centimetre or so
SCANNER_AIR = 0.15  # [m] A scanner position with less air than this, as before a door that is now open, is left out

STEP = (0.3, 0.8)  # [m] How far from its first place the scanner is put up at another visit
RISE = 0.15  # [m] How much higher or lower
HEAD_AIR = 0.25  # [m] Least distance of a scanner from everything
MAX_TURN = 0.05  # [rad] Largest turn of the scene's frame about z between two visits


def again(
    room: Room, opened: Mapping[str, float], moved: int, rng: np.random.Generator
) -> tuple[Room, dict[str, np.ndarray]]:
    """Return a room with some parts open and some objects elsewhere, and the motion of each such object by its id.

    Args:
        room: in its own frame, all closed.
        opened: coordinates of parts by their ids [m] or [rad]; their joints then count from there.
        moved: number of objects that are moved.
        rng: which ones, and where to.

    Raises:
        InputError: a part that is unknown, does not move, or not so far; too few objects that could be moved.
    """
    entries = catalog(room.pieces)
    _check(entries, opened)
    by_piece = {id(entry.piece): opened[entry.part_id] for entry in entries if entry.part_id in opened}
    pieces = tuple(_opened(piece, by_piece) for piece in room.pieces)
    room = replace(room, pieces=pieces)
    motions: dict[str, np.ndarray] = {}
    for entry in _loose(room, rng):
        if len(motions) == moved:
            break
        motion = _elsewhere(room, entry, rng)
        if motion is not None:
            motions[entry.part_id] = motion
            target = entry.piece
            room = replace(room, pieces=tuple(_replaced(piece, target, motion) for piece in room.pieces))
    if len(motions) < moved:
        raise InputError(f"moved={moved}: {len(motions)} objects have another free place; give moved={len(motions)}")
    return replace(room, scanners=_free_scanners(room)), motions


def _check(entries: list[Entry], opened: Mapping[str, float]) -> None:
    joints = {entry.part_id: entry.piece.joint for entry in entries if entry.piece.joint is not None}
    for part_id, q in opened.items():
        if part_id not in joints:
            raise InputError(f"open: {part_id!r} is not a part that moves; possible: {', '.join(joints)}")
        lower, upper = joints[part_id].limits
        if not lower <= q <= upper:
            raise InputError(f"open: {part_id!r} at {q:g} is outside of its range {lower:g} to {upper:g}")


def _opened(piece: Piece, by_piece: Mapping[int, float]) -> Piece:
    """Return a piece whose parts are at given coordinates, by their identity."""
    children = tuple(_opened(child, by_piece) for child in piece.children)
    part = replace(piece, children=children)
    if id(piece) not in by_piece or piece.joint is None:
        return part
    q, joint = by_piece[id(piece)], piece.joint
    part = part.moved(transform(joint, q))
    lower, upper = joint.limits
    return replace(part, joint=Joint(joint.kind, joint.axis, joint.origin, (lower - q, upper - q)))


def _loose(room: Room, rng: np.random.Generator) -> list[Entry]:
    """Return the small free objects of a room, in random order."""
    loose = [
        entry
        for entry in catalog(room.pieces)
        if not entry.articulated
        and not entry.piece.contents
        and np.ptp(entry.piece.surface.vertices, axis=0).max() < SMALL
    ]
    return [loose[i] for i in rng.permutation(len(loose)).tolist()]


def _elsewhere(room: Room, entry: Entry, rng: np.random.Generator) -> np.ndarray | None:
    """Return a motion that puts an object on another free place of what it stands on, shape [4 4], or None."""
    thing = entry.piece.surface
    rest = join(*(other.piece.surface for other in catalog(room.pieces) if other.piece is not entry.piece))
    mesh = ray_mesh(rest.vertices, rest.faces)
    swept = measured([piece for piece in room.pieces if piece.children], 0.0).swept
    middle = (thing.vertices.min(axis=0) + thing.vertices.max(axis=0)) / 2
    if not _stands(mesh, thing):
        return None
    for _ in range(MAX_ATTEMPTS):
        shift = rng.uniform(-SHIFT, SHIFT, 2)
        turn = at(middle[0] + shift[0], middle[1] + shift[1], 0.0, float(rng.uniform(0, 360)))
        motion = turn @ at(-middle[0], -middle[1])
        there = thing.moved(motion)
        bounds = np.stack([there.vertices.min(axis=0), there.vertices.max(axis=0)])[None]
        if (
            np.linalg.norm(shift) > 0.08
            and _stands(mesh, there)
            and _is_free(mesh, there)
            and not meet(bounds, swept, AIR)
        ):
            return motion
    return None


def _stands(mesh: RayMesh, thing: Surface) -> bool:
    """Return whether something level is right below the whole footprint of an object."""
    low, high = thing.vertices.min(axis=0), thing.vertices.max(axis=0)
    x, y = np.meshgrid(np.linspace(low[0], high[0], 4), np.linspace(low[1], high[1], 4))
    starts = np.stack([x.ravel(), y.ravel(), np.full(16, low[2] + 0.01)], axis=1)
    hits = first_hits(mesh, starts, np.tile((0.0, 0.0, -1.0), (16, 1)))
    return bool((np.abs(hits - 0.01) < LEVEL).all())


def _is_free(mesh: RayMesh, thing: Surface) -> bool:
    """Return whether an object keeps clear of all that stands beside it."""
    points = np.concatenate([thing.vertices, points_on(thing.mesh, SAMPLES, seed=0)])
    points = points[points[:, 2] > points[:, 2].min() + 2 * AIR]
    middle = (thing.vertices.min(axis=0) + thing.vertices.max(axis=0)) / 2
    rays = points - middle
    far = np.linalg.norm(rays, axis=1)
    hits = first_hits(mesh, np.tile(middle, (len(points), 1)), rays / np.maximum(far, 1e-9)[:, None])
    return bool(len(points) and nearest_faces(mesh, points)[1].min() > AIR and (hits > far).all())


def _replaced(piece: Piece, target: Piece, motion: np.ndarray) -> Piece:
    """Return a piece in which one object, by its identity, has moved."""
    if piece is target:
        return piece.moved(motion)
    children = tuple(_replaced(child, target, motion) for child in piece.children)
    contents = tuple(_replaced(thing, target, motion) for thing in piece.contents)
    if all(a is b for a, b in zip((*children, *contents), (*piece.children, *piece.contents), strict=True)):
        return piece
    return replace(piece, children=children, contents=contents)


def _free_scanners(room: Room) -> np.ndarray:
    """Return the scanner positions that still have air."""
    entries = catalog(room.pieces)
    surface = join(*(entry.piece.surface for entry in entries))
    air = nearest_faces(ray_mesh(surface.vertices, surface.faces), room.scanners)[1]
    return room.scanners[air > SCANNER_AIR]


def revisited(room: Room, rng: np.random.Generator) -> Room:
    """Return a room whose scanner is put up elsewhere: STEP from each first place, in free air, in sight of it."""
    surface = join(*(entry.piece.surface for entry in catalog(room.pieces)))
    mesh = ray_mesh(surface.vertices, surface.faces)
    return replace(room, scanners=np.array([_beside(mesh, place, rng) for place in room.scanners]))


def _beside(mesh: RayMesh, place: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return a free place near a scanner's [m], shape [3]; its own where there is none."""
    far, angle = rng.uniform(*STEP, MAX_ATTEMPTS), rng.uniform(0.0, 2 * np.pi, MAX_ATTEMPTS)
    rise = rng.uniform(-RISE, RISE, MAX_ATTEMPTS)
    steps = np.stack([far * np.cos(angle), far * np.sin(angle), rise], axis=1)
    length = np.linalg.norm(steps, axis=1)
    seen = first_hits(mesh, np.tile(place, (MAX_ATTEMPTS, 1)), steps / length[:, None]) > length
    free = np.flatnonzero(seen & (nearest_faces(mesh, place + steps)[1] > HEAD_AIR))
    return place + steps[free[0]] if len(free) else place


RoomKind = Literal[
    "office", "bedroom", "kitchen", "bathroom", "living_room", "dining_room", "hallway", "laundry", "study", "workshop"
]
GENERATION = "varied"  # In what names a room: another way to furnish rooms would take another word


@dataclass(frozen=True)
class SampleConfig:
    """One virtual scan.

    Attributes:
        room: kind of room.
        seed: seed of furniture and all errors; the same seed gives the same files.
        detail: the scanner: demo (laser, half a minute, 0.1 to 0.25 million vertices), full (laser, a minute or two, 0.8 to 1.9
            million), rgbd (depth camera, as ScanNet), phone (1 to 3 cm, smoothed, with a textured GLB).
        annotator: errors of parts and joints: careful, hasty, or wrong (hasty, and one axis in ten reversed).
        open: coordinates of open parts [m] or [rad], by their ids: the same home scanned again; null: all closed.
        moved: number of free objects that are moved elsewhere.
        visit: 0: the default scanner positions; n: the n-th later visit to the same home, with scanner positions,
            errors and a scene frame of its own.
        out: folder that is written.
    """

    room: RoomKind
    seed: CountFromZero
    detail: ScannerConfig
    annotator: AnnotationConfig
    open: dict[str, float] | None
    moved: CountFromZero
    visit: CountFromZero
    out: Output


@dataclass(frozen=True)
class Scan:
    """What is written."""

    name: str  # ten hexadecimal digits, as ScanNet++ names its scenes
    room: Room  # the furnished room
    entries: list[Entry]  # all its parts
    mesh: Mesh  # the scanned surface
    # of the objects that stand elsewhere than in the first scan of this home, by id, in the scene, shape [4 4]
    motions: dict[str, np.ndarray]
    annotated: list[Entry]  # the parts that the annotator saw
    numbers: np.ndarray  # the annotated part of each face, shape [face]
    joints: dict[int, Joint]  # the annotated joints by part number
    mistakes: dict[str, list[str]]  # ids of overlooked handles and of reversed joints
    paint: files.Paint  # colours of points near the surface, in the scene, for a texture


def sample(config: SampleConfig, out: Path) -> None:
    """Write a virtual scan into a folder, and `truth/` beside it. `out`: folder to write into; it is created."""
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
    capture = Capture(surface, room, config.detail, paint)
    mesh = capture.scan(errors)
    errs = config.annotator
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
    (out / "truth").mkdir(parents=True, exist_ok=True)
    write_ply(out / "mesh_aligned_0.05.ply", scan.mesh)
    if config.detail.glb:
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
        "detail": config.detail.name,
        "yaw": scan.room.yaw,
        "size": list(scan.room.size),
        "scanners": scan.room.scanners[: config.detail.poses].tolist(),
        "parts": {entry.part_id: part_truth(entry, ids) for entry in scan.entries},
    }
    if config.annotator.name != "careful":
        record["annotator"] = {"name": config.annotator.name, **scan.mistakes}
    if config.open or config.moved:
        record["again"] = {"open": config.open or {}, "moved": {i: m.tolist() for i, m in in_scene(scan).items()}}
    if config.visit:
        record["visit"] = config.visit
    return record


def in_scene(scan: Scan) -> dict[str, np.ndarray]:
    """Return the motions of the objects that stand elsewhere, in the scene, shape [4 4] each."""
    floor = next(entry.piece.pose for entry in scan.entries if entry.piece.name == "floor")
    return {part_id: floor @ motion @ np.linalg.inv(floor) for part_id, motion in scan.motions.items()}
