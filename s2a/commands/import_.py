"""A mesh file, or predictions for a scan -> the folder of a scan."""

from __future__ import annotations

import json
import logging
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from s2a.errors import InputError
from s2a.outputs import atomic_write, refuse_loss
from s2a.ranges import Above, AtLeast
from s2a.scan import folder, imported, ply, predicted, urdf_object
from s2a.scan import predictions as reader

_log = logging.getLogger(__name__)

PREDICTED = "predictions.json"
"""By this file a folder is known to be an earlier import of predictions."""
OVERLAP = 0.5
"""Fraction of the smaller of two masks that both may hold."""


@dataclass(frozen=True)
class Config:
    """Keys of `s2a import`: mesh, or scan and predictions.

    Attributes:
        mesh: GLB, glTF, OBJ, PLY, USDZ or USD file.
        texel: length of edges at which faces stop being split where a texture has detail [m].
        up: the file's up axis; auto: as the file states, or as the floor tells.
        unit: the file's unit; auto: as the file states, or as the room's height tells.
        floor: Move the floor to z 0.
        scan: folder of the scan that predictions belong to.
        predictions: JSON or pickle file with masks and joints, or the URDF of one object, which needs box.
        box: that the object of a URDF fills: centre and extents [m], in the coordinates of the scan's file, and the angle of its
            x axis about z [rad]; null for other predictions.
        min_score: predictions with a lower score are left out.
        out: folder that is written.
    """

    mesh: Path | None
    texel: Annotated[float, Above(0.0)]
    up: Literal["auto", "x", "y", "z", "-x", "-y", "-z"]
    unit: Literal["auto", "m", "cm", "mm", "in"]
    floor: bool
    scan: Path | None
    predictions: Path | None
    box: tuple[float, float, float, float, float, float, float] | None
    min_score: Annotated[float, AtLeast(0.0, 1.0)]
    out: Path


def run(config: Config) -> str:
    """Write the scan folder and return what was found.

    Raises:
        InputError: keys that do not go together, or input that cannot be read.
    """
    if config.mesh and not config.scan and not config.predictions:
        return _import_mesh(config, config.mesh)
    if config.scan and config.predictions and not config.mesh:
        return _import_predictions(config, config.scan, config.predictions)
    raise InputError("give mesh=FILE, or scan=FOLDER with predictions=FILE")


def _import_mesh(config: Config, path: Path) -> str:
    """Convert a mesh file, write the scan, log doubts, and return a summary."""
    refuse_loss(config.out, imported.RECORD, [path])
    done = imported.convert(path, config.texel, config.up, config.unit, config.floor)
    for doubt in done.frame.doubts:
        _log.warning("%s: %s", path, doubt)
    if done.degenerate:
        _log.warning(
            "%s: %d faces have no area; they are kept, so that faces keep their numbers", path, done.degenerate
        )
    with atomic_write(config.out, earlier=imported.RECORD) as out:
        imported.write(done, path, out)
    size = " x ".join(f"{length:.2f}" for length in done.mesh.bounds[1] - done.mesh.bounds[0])
    faces = f"{len(done.mesh.faces)} faces" + (
        f" ({done.source_faces} in the file; {imported.SOURCE_FACES} maps them)"
        if len(done.mesh.faces) != done.source_faces
        else ", as in the file"
    )
    frame = done.frame
    return (
        f"{config.out}: {faces}, {len(done.mesh.vertices)} vertices, {size} m\n"
        f"  up: {frame.up} ({frame.why_up})\n"
        f"  unit: {frame.unit:g} m ({frame.why_unit})\n"
        f"  floor: moved by {done.offset[2]:+.3f} m"
    )


def _import_predictions(config: Config, scan: Path, predictions: Path) -> str:
    """Write the scan with the predictions as its annotation, and return a summary."""
    files = folder.find_bare(scan)
    refuse_loss(config.out, PREDICTED, [files.mesh, predictions])
    surface = ply.read(files.mesh)
    found = _predictions(config, predictions, surface, files.name)
    kept = predicted.choose(found, config.min_score, OVERLAP)
    if not kept:
        scores = f"; the best score is {max(one.score for one in found):.3g}: give min_score=" if found else ""
        raise InputError(
            f"{predictions}: no prediction of {len(found)} has a score of {config.min_score:g} or more{scores}"
        )
    with atomic_write(config.out, earlier=PREDICTED) as out:
        out.mkdir()
        for file, name in ((files.mesh, folder.MESH), *_segments(files)):
            shutil.copyfile(file, out / name)
        predicted.write(out, files.name, kept)
        written = {"scan": str(scan), "predictions": str(predictions), "found": len(found), "kept": len(kept)}
        (out / PREDICTED).write_text(json.dumps(written, indent=1), encoding="utf-8")
    if assumed := sum(one.assumed_range for one in kept):
        _log.warning("%s: %d of %d joints come without a range, and get the usual one", predictions, assumed, len(kept))
    kinds = ", ".join(f"{sum(one.kind == kind for one in kept)} {kind}" for kind in reader.KINDS)
    handles = sum(len(one.handle) > 0 for one in kept)
    counts = f"{len(kept)} of {len(found)} predictions ({kinds}), {handles} with a handle"
    return f"{config.out}: {counts}; next: s2a check scan={config.out}"


def _predictions(config: Config, path: Path, surface: ply.ScanMesh, scene: str) -> list[reader.Prediction]:
    """Return what a file predicts; a URDF is fitted into its box."""
    is_urdf = path.suffix.lower() == urdf_object.SUFFIX
    if is_urdf != (config.box is not None):
        problem = "is a URDF, and key 'box' is null" if is_urdf else "is no URDF, and key 'box' is given"
        raise InputError(f"{path} {problem}; a URDF needs box=[x,y,z,sx,sy,sz,yaw], other predictions none")
    if config.box is None:
        return reader.read(path, surface, scene)
    numbers = np.array(config.box)
    if not np.isfinite(numbers).all() or (numbers[3:6] <= 0.0).any():
        raise InputError(
            f"key 'box' is {list(config.box)}; give a centre, three extents above 0 [m] and an angle [rad]"
        )
    found = urdf_object.read(path, surface, urdf_object.ObjectBox(numbers[:3], numbers[3:6], float(numbers[6])))
    if not found:
        raise InputError(
            f"{path}: no face of the scan lies near a moving link in the box {list(config.box)}; give the object's box"
        )
    return found


def _segments(files: folder.BareFiles) -> list[tuple[Path, str]]:
    """Return the segments of a scan and their names in the new folder."""
    return list(zip(files.segments, (folder.SEGMENTS, folder.GROUPS), strict=True)) if files.segments else []
