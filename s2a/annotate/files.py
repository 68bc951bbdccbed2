"""An annotation -> the folder of a scan: its mesh, Articulate3D's two files, and how its faces map to those that were scanned."""

from __future__ import annotations

import json
import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from s2a.annotate import rest
from s2a.annotate.annotation import Draft, Item
from s2a.annotate.existing import Existing
from s2a.annotate.surface import ADDED, SplitSurface
from s2a.scan import folder, joint_records, ply, predicted
from s2a.scan.folder import BareFiles
from s2a.scan.imported import SOURCE_FACES
from s2a.scan.ply import ScanMesh
from s2a.scan.ply_writer import write_ply
from s2a.scan.predictions import Prediction

RECORD = "annotate.json"
"""By this file a folder is known to be an earlier output; it says what was annotated, and which handles were added."""


@dataclass(frozen=True)
class BareScan:
    """A scan whose annotation, if it has one, is not read.

    Attributes:
        files: of its folder.
        mesh: as its file holds it.
    """

    files: BareFiles
    mesh: ScanMesh

    @property
    def surface(self) -> SplitSurface:
        """Its mesh, to annotate."""
        return SplitSurface.of(self.mesh.vertices, self.mesh.faces, self.mesh.colors)


def read(path: Path) -> BareScan:
    """Read the mesh in the folder of a scan.

    Raises:
        InputError: no mesh there, several, or a damaged one.
    """
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
    if existing:
        existing.write(out, surface, items, origin, same)
    else:
        fixed = [] if scan.files.segments else rest.divide(surface, _free(surface, items))
        predicted.write(out, scan.files.name, [_prediction(item, origin) for item in items], fixed)
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
    kept = SplitSurface(surface.vertices, surface.faces[keep], surface.colors, surface.source[keep])
    return kept, [
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
    kind = joint_records.TYPES[joint.kind]
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
