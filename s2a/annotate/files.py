"""An annotation as the folder of a scan: its mesh, Articulate3D's files, and the surfaces that no part covers."""

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from s2a.annotate.annotation import Draft, Item
from s2a.annotate.existing import Existing
from s2a.annotate.surface import ADDED, SplitSurface, connected
from s2a.scan import folder, ply, predictions, recording
from s2a.scan.folder import BareFiles
from s2a.scan.formats import articulate3d
from s2a.scan.imported import SOURCE_FACES
from s2a.scan.ply import ScanMesh
from s2a.scan.ply_file import write_ply
from s2a.scan.predictions import Prediction

LEVEL, UPRIGHT = 0.9, 0.3  # Vertical component of the normals of level faces, at least, and of upright ones, at most
THICK = 0.06  # [m] Faces this near to a wall's, floor's or ceiling's plane are its own
# [m^2] and [m] from which an upright plane is one of the structure: a wall, or a wardrobe's side,
# which a box fits as well
WALL_AREA, WALL_HEIGHT = 1.2, 1.6
TURNS = 36  # Azimuths that are tried, over the full circle
STEP = 0.02  # [m] Bins of the offsets of planes
MIN_OBJECT = 0.02  # [m^2] Smaller pieces go to the structure, whose boxes leave them out


def divide(surface: SplitSurface, free: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return labels and faces of what is left of a scan. `free`: which faces nobody has, shape [face]."""
    left = free & (surface.source >= 0)
    structure = [(label, faces) for label, faces in _level(surface, left) if len(faces)]
    for _, faces in structure:
        left[faces] = False
    walls = _walls(surface, left)
    for faces in walls:
        left[faces] = False
    structure += [("wall", faces) for faces in walls]
    some = np.flatnonzero(left)
    if not len(some):
        return structure
    number = connected(surface.adjacent(some), len(some))
    large = np.bincount(number, surface.areas[some]) >= MIN_OBJECT
    objects = [("object", some[number == index]) for index in np.flatnonzero(large)]
    bits = some[~large[number]]
    if len(bits) and structure:
        structure[0] = (structure[0][0], np.sort(np.concatenate([structure[0][1], bits])))
    return structure + objects


def _level(surface: SplitSurface, left: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return the floor and the ceiling: level faces near the lowest, and the highest, height with much of them."""
    level_faces = []
    height = surface.centroids[:, 2]
    for label, sign in (("floor", 1.0), ("ceiling", -1.0)):
        level = left & (sign * surface.normals[:, 2] > LEVEL)
        planes = _planes(sign * height[level], surface.areas[level], WALL_AREA)
        if planes:
            level_faces.append((label, np.flatnonzero(level & (np.abs(sign * height - min(planes)) < THICK))))
    return level_faces


def _walls(surface: SplitSurface, left: np.ndarray) -> list[np.ndarray]:
    """Return the faces of each upright plane that is large and high."""
    left, walls = left.copy(), []
    upright = np.abs(surface.normals[:, 2]) < UPRIGHT
    azimuth = np.arctan2(surface.normals[:, 1], surface.normals[:, 0])
    sector = ((azimuth + np.pi) / (2 * np.pi) * TURNS).astype(int) % TURNS
    areas = np.bincount(sector[upright & left], surface.areas[upright & left], TURNS)
    for index in np.argsort(-areas):
        near = np.isin(sector, [(index + k) % TURNS for k in (-1, 0, 1)]) & upright & left
        if surface.areas[near].sum() < WALL_AREA:
            continue
        normal = surface.areas[near] @ surface.normals[near] * [1.0, 1.0, 0.0]
        offset = surface.centroids @ (normal / np.linalg.norm(normal))
        for plane in _planes(offset[near], surface.areas[near], WALL_AREA):
            faces = np.flatnonzero(near & left & (np.abs(offset - plane) < THICK))
            if surface.areas[faces].sum() >= WALL_AREA and np.ptp(surface.centroids[faces, 2]) > WALL_HEIGHT:
                walls.append(faces)
                left[faces] = False
    return walls


def _planes(offsets: np.ndarray, areas: np.ndarray, least: float) -> list[float]:
    """Return the offsets [m] around which there is so much area [m^2], most first."""
    if not len(offsets):
        return []
    low = offsets.min()
    full = np.bincount(((offsets - low) / STEP).astype(int), areas)
    reach = round(THICK / STEP)
    peaks: list[float] = []
    while True:
        sums = np.convolve(full, np.ones(2 * reach + 1), "same")
        peak = int(np.argmax(sums))
        if sums[peak] < least:
            return peaks
        window = slice(max(peak - reach, 0), peak + reach + 1)
        places = low + (np.arange(len(full))[window] + 0.5) * STEP
        peaks.append(float(np.average(places, weights=full[window])))
        full[window] = 0.0


# By this file a folder is known to be an earlier output; it says what was annotated, and which handles were added
RECORD = "annotate.json"


@dataclass(frozen=True)
class BareScan:
    """A scan whose annotation, if it has one, is not read."""

    files: BareFiles  # of its folder
    mesh: ScanMesh  # as its file holds it

    @property
    def surface(self) -> SplitSurface:
        """Its mesh, to annotate."""
        return SplitSurface.of(self.mesh.vertices, self.mesh.faces, self.mesh.colors)


def read(path: Path) -> BareScan:
    """Read the mesh in the folder of a scan; InputError: no mesh there, several, or a damaged one."""
    files = folder.find_bare(path)
    return BareScan(files, ply.read(files.mesh))


def write(annotation: Draft, scan: BareScan, out: Path, existing: Existing | None = None, **facts: Any) -> None:
    """Write the annotated scan into a new folder.

    Of what nobody annotated, floor, walls and connected objects become parts that do not move, unless the scan has segments.
    Faces of the scan keep their numbers. Where some were split or added, the mesh is written again with the further faces
    behind them, and source_faces.npy holds for each face the scan's face that it is a piece of, or -1.

    Args:
        annotation: its parts without a joint are left out.
        scan: what was annotated.
        out: the folder, which does not exist.
        existing: the scan's annotation that was edited: parts that were not keep their records.
        facts: what else annotate.json says.
    """
    out.mkdir()
    surface, items = _compact(annotation, existing)
    same = np.array_equal(surface.faces, scan.mesh.faces)
    origin = scan.mesh.origin if same else np.zeros(3)
    sources = scan.files.mesh.with_name(SOURCE_FACES)
    if same:
        shutil.copyfile(scan.mesh.path, out / folder.MESH)
        _copy_segments(scan.files, out)
        if existing and sources.is_file():
            shutil.copyfile(sources, out / SOURCE_FACES)
    else:
        write_ply(out / folder.MESH, surface.mesh())
        np.save(out / SOURCE_FACES, _first_source(surface, existing).astype(np.int32))
        _write_segments(scan.files, surface, len(scan.mesh.vertices), out)
    recording.copy_keyframes(scan.files.mesh.parent, out, origin - scan.mesh.origin)
    if existing:
        existing.write(out, surface, items, origin, same)
    else:
        fixed = [] if scan.files.segments else divide(surface, _free(surface, items))
        predictions.write(out, scan.files.name, [_prediction(item, origin) for item in items], fixed)
    record = {**facts, "faces": len(surface.faces), "scan_faces": len(scan.mesh.faces)}
    record |= {"scan_minus_written_m": (scan.mesh.origin - origin).tolist()}
    record |= {"parts": [_record(item) for item in items]}
    (out / RECORD).write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _first_source(surface: SplitSurface, existing: Existing | None) -> np.ndarray:
    """Return for each face the face of the first scan that it is a piece of, or ADDED, shape [face]."""
    if existing is None:
        return surface.source
    return np.where(surface.source == ADDED, ADDED, existing.source[surface.source])


def _compact(annotation: Draft, existing: Existing | None) -> tuple[SplitSurface, list[Item]]:
    """Return the surface without shapes of handles that were given up, and the parts with joints, renumbered."""
    items = [item for item in annotation.items if item.joint is not None and len(item.front)]
    surface = annotation.surface
    keep = existing.kept(surface) if existing else surface.source != ADDED
    for item in items:
        keep[item.handle] = True
    number = np.cumsum(keep) - 1
    # No vertex of the scan is dropped, for segments count in them.
    compact = SplitSurface(surface.vertices, surface.faces[keep], surface.colors, surface.source[keep])
    return compact, [
        replace(item, region=replace(item.region, faces=number[item.region.faces]), handle=number[item.handle])
        for item in items
    ]


def _free(surface: SplitSurface, items: list[Item]) -> np.ndarray:
    free = np.ones(len(surface.faces), bool)
    for item in items:
        free[item.region.faces] = free[item.handle] = False
    return free


def _prediction(item: Item, origin: np.ndarray) -> Prediction:
    """Return a part with a joint as what `predicted.write` takes, in the coordinates of the written mesh."""
    joint = item.joint
    assert joint is not None
    kind = articulate3d.TYPES[joint.kind]
    place = np.array(joint.origin) + origin
    return Prediction(
        item.name, kind, np.array(joint.axis), place, joint.limits, item.score, item.region.faces, item.handle
    )


def _record(item: Item) -> dict[str, Any]:
    return {
        "label": item.name,
        "faces": len(item.front),
        "handle_faces": len(item.handle),
        "completed_handle": item.completed or None,
        "rectangle_m": item.region.corners.round(4).tolist(),
    }


def _copy_segments(files: BareFiles, out: Path) -> None:
    if files.segments:
        for path, name in zip(files.segments, (folder.SEGMENTS, folder.GROUPS), strict=True):
            shutil.copyfile(path, out / name)


def _write_segments(files: BareFiles, surface: SplitSurface, count: int, out: Path) -> None:
    """Write the segments of a scan for a mesh with further vertices: each is in the segment of the face that it divides."""
    if not files.segments:
        return
    content = json.loads(files.segments[0].read_text(encoding="utf-8-sig"))
    segments = np.array(content["segIndices"])
    wider = np.concatenate([segments, np.full(len(surface.vertices) - count, -1)])
    for face in np.flatnonzero((surface.faces >= count).any(axis=1) & (surface.source != ADDED)):
        corners = surface.faces[face]
        old = corners[corners < count]
        wider[corners[(corners >= count) & (wider[corners] == -1)]] = segments[old[0]] if len(old) else -1
    content["segIndices"] = wider.tolist()
    (out / folder.SEGMENTS).write_text(json.dumps(content, separators=(",", ":")), encoding="utf-8")
    shutil.copyfile(files.segments[1], out / folder.GROUPS)
