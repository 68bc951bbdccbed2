"""Command `s2a import`: turn a mesh file into a scan, or predictions for a scan into an annotated one."""

import json
import logging
import math
import shutil
from collections.abc import Callable
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np

from s2a import scan as scans
from s2a.core.bounds import Above, AtLeast, Count
from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write, refuse_loss, require_png
from s2a.core.progress import track
from s2a.scan import folder, imported, ply, recording, recording_formats, source, urdf_object
from s2a.scan import predictions as predicted
from s2a.scan import predictions as reader
from s2a.scan.urdf_object import ObjectBox
from s2a.scene.geometry.depth_fusion import DepthFusion, Image, measured_points
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.planes import min_area_rectangle
from s2a.scene.geometry.render import room_image, write_png
from s2a.scene.scene import Mesh

_log = logging.getLogger(__name__)

PREDICTED = "predictions.json"  # By this file a folder is known to be an earlier import of predictions
TRUNCATION = 4.0  # Distance behind a measured surface from which on space is unknown [voxel]
MARKS = 100  # Frames whose points say where voxels are needed
# Least weight of a voxel, one over the square of its distance for each frame [1/m^2]: two or three frames at 2 m
SEEN = 0.6
OVERLAP = 0.5  # Fraction of the smaller of two masks that both may hold


@dataclass(frozen=True)
class Config:
    """Keys of `s2a import`: mesh, or frames, or scan and predictions.

    Attributes:
        mesh: GLB, glTF, OBJ, PLY, USDZ, USD, STL or OFF file, or the JSON file of a Quest scene.
        labels: file of labelled boxes in the mesh's coordinates, which become objects, or null.
        frames: folder, or .r3d file, of a recording of posed depth and colour images.
        color_camera: colour camera of frames where depth is not registered to colour: fx, fy, cx, cy [pixel] and the x, y, z
            [m] that are added to a point in the depth camera's coordinates; null: as the format states.
        voxel: edge of the voxels that frames are fused in [m].
        far: larger depths are left out [m].
        every: use every n-th frame.
        texel: length of edges at which faces stop being split where a texture has detail [m].
        up: the file's up direction, an axis or a vector; auto: as the file states, or by the room's surfaces.
        level: Rotate a slightly tilted room so that its floor is horizontal.
        unit: the file's unit; auto: as the file states, or by the room's height.
        floor: Move the floor to z 0.
        image: PNG file with the levelled room and its axes, or null.
        scan: folder of the scan that predictions belong to.
        predictions: JSON or pickle file with masks and joints, or the URDF of one object, which needs box or object.
        box: box that the object of a URDF fills: centre and extents [m], in the scan file's coordinates, and the angle of its
            x axis about z [rad]; null for other predictions.
        object: id of the part of the scan that the URDF describes, instead of its box; null otherwise.
        min_score: predictions with a lower score are left out.
        out: folder that is written.
    """

    mesh: Path | None
    labels: Path | None
    frames: Path | None
    color_camera: tuple[float, float, float, float, float, float, float] | None
    voxel: Annotated[float, AtLeast(0.002, 0.1)]
    far: Annotated[float, Above(0.0)]
    every: Count
    texel: Annotated[float, Above(0.0)]
    up: str | tuple[float, float, float]
    level: bool
    unit: Literal["auto", "m", "cm", "mm", "in"]
    floor: bool
    image: Output | None
    scan: Path | None
    predictions: Path | None
    box: tuple[float, float, float, float, float, float, float] | None
    object: str | None
    min_score: Annotated[float, AtLeast(0.0, 1.0)]
    out: Output


def run(config: Config) -> str:
    """Write the scan folder and return what was found.

    Raises:
        InputError: keys that do not go together, or input that cannot be read.
    """
    if config.mesh and not config.scan and not config.predictions and not config.frames:
        return _import_mesh(config, config.mesh)
    if config.frames and not config.scan and not config.predictions and not config.mesh:
        return _import_frames(config, config.frames)
    if config.scan and config.predictions and not config.mesh:
        return _import_predictions(config, config.scan, config.predictions)
    raise InputError("give mesh=FILE, or frames=FOLDER, or scan=FOLDER with predictions=FILE")


def _import_mesh(config: Config, path: Path) -> str:
    """Convert a mesh file, write the scan, log doubts, and return a summary."""
    refuse_loss(config.out, imported.RECORD, [path])
    if config.image:
        require_png(config.image)
    done = imported.convert(path, config.texel, config.up, config.unit, config.floor, config.level, config.labels)
    return _written(config, path, done)


def _import_frames(config: Config, folder: Path) -> str:
    """Fuse a recording, write the scan with its keyframes, and return a summary."""
    refuse_loss(config.out, imported.RECORD, [folder])
    if config.image:
        require_png(config.image)
    walk = recording_formats.read(folder, config.color_camera)
    try:
        doubts = [recording.check(walk), recording.check_color(walk)]
    except InputError as error:
        raise InputError(f"{folder}: {error}") from error
    for doubt in filter(None, doubts):
        _log.warning("%s: %s", folder, doubt)
    surface, sharp = _fused(walk, config)
    done = imported.place(
        folder,
        source.colored(surface.vertices, surface.faces, surface.colors, source.Stated(walk.gravity, 1.0, walk.kind)),
        (),
        config.texel,
        config.up,
        config.unit,
        config.floor,
        config.level,
        walk.up,
    )
    chosen = recording.keyframes(walk, sharp)
    summary = _written(
        config, folder, done, lambda out: recording.write_keyframes(out, walk, chosen, imported.matrix(done), sharp)
    )
    lost = f", {walk.lost} without a pose" if walk.lost else ""
    used = len(walk.frames[:: config.every])
    registered = "" if walk.registered else ", colour by its own camera"
    return f"{summary}\n  {walk.kind} recording: {used} frames fused{lost}{registered}, {len(chosen)} keyframes kept"


def _fused(walk: recording.RgbdRecording, config: Config) -> tuple[Mesh, np.ndarray]:
    """Return the surface that frames show together, and the sharpness of each frame, NaN where it was not used."""

    def placed(frame: recording.PosedFrame, depth: np.ndarray, color: np.ndarray | None) -> Image:
        cameras = astuple(frame.depth_camera), astuple(frame.color_camera)
        return Image(depth, color, frame.pose, *cameras, None if walk.registered else walk.color_from_depth)

    used = len(walk.frames[:: config.every])
    marks = recording.images(walk, config.every * max(1, used // MARKS), config.far)
    fusion = DepthFusion(measured_points(placed(*image) for image in marks), config.voxel, TRUNCATION * config.voxel)
    sharp = np.full(len(walk.frames), np.nan)
    frames = track(recording.images(walk, config.every, config.far), "fuse", used)
    for index, (frame, depth, color) in enumerate(frames):
        fusion.add(placed(frame, depth, color))
        sharp[index * config.every] = recording.sharpness(color)
    return fusion.surface(SEEN), sharp


def _written(
    config: Config, path: Path, done: imported.Imported, more: Callable[[Path], None] = lambda out: None
) -> str:
    """Write a scan, log doubts, and return a summary."""
    for doubt in done.frame.doubts:
        _log.warning("%s: %s", path, doubt)
    if done.degenerate:
        _log.warning(
            "%s: %d faces have no area; they are kept, so that faces keep their numbers", path, done.degenerate
        )
    with atomic_write(config.out, earlier=imported.RECORD) as out:
        labelled = imported.write(done, path, out)
        more(out)
    if config.image:
        write_png(room_image(done.mesh), config.image)
    size = " x ".join(f"{length:.2f}" for length in done.mesh.bounds[1] - done.mesh.bounds[0])
    faces = f"{len(done.mesh.faces)} faces" + (
        f" ({done.source_faces} in the file, split where a texture has detail; {imported.SOURCE_FACES} maps them)"
        if len(done.mesh.faces) != done.source_faces
        else ", as in the file"
    )
    frame = done.frame
    return (
        f"{config.out}: {faces}, {len(done.mesh.vertices)} vertices, {size} m\n"
        f"  {frame.summary()}\n"
        f"  up {frame.why_up}; unit: {frame.why_unit}\n"
        f"  floor: moved by {done.offset[2]:+.3f} m" + (f"\n  labels: {labelled} objects" if done.boxes else "")
    )


def _import_predictions(config: Config, scan: Path, predictions: Path) -> str:
    """Write the scan with the predictions as its annotation, and return a summary."""
    files = folder.find_bare(scan)
    refuse_loss(config.out, PREDICTED, [files.mesh, predictions])
    surface = ply.read(files.mesh)
    box = _box(config, predictions, surface)
    candidates = _predictions(predictions, surface, files.name, box)
    chosen = predicted.choose(candidates, config.min_score, OVERLAP)
    if not chosen:
        scores = (
            f"; the best score is {max(one.score for one in candidates):.3g}: give min_score=" if candidates else ""
        )
        raise InputError(
            f"{predictions}: no prediction of {len(candidates)} has a score of {config.min_score:g} or more{scores}"
        )
    with atomic_write(config.out, earlier=PREDICTED) as out:
        out.mkdir()
        for file, name in ((files.mesh, folder.MESH), *_segments(files)):
            shutil.copyfile(file, out / name)
        recording.copy_keyframes(files.mesh.parent, out)
        predicted.write(out, files.name, chosen)
        written = {"scan": str(scan), "predictions": str(predictions), "found": len(candidates), "kept": len(chosen)}
        written |= {} if box is None else {"box": str(box)}
        (out / PREDICTED).write_text(json.dumps(written, indent=1), encoding="utf-8")
    if assumed := sum(one.assumed_range for one in chosen):
        _log.warning("%s: %d of %d joints have no range; the usual one is assumed", predictions, assumed, len(chosen))
    kinds = ", ".join(f"{sum(one.kind == kind for one in chosen)} {kind}" for kind in reader.KINDS)
    handles = sum(len(one.handle) > 0 for one in chosen)
    counts = f"{len(chosen)} of {len(candidates)} predictions ({kinds}), {handles} with a handle"
    if config.object is not None:
        counts += f", in the box of {config.object}, {box}"
    return f"{config.out}: {counts}; next: s2a check scan={config.out}"


def _predictions(path: Path, surface: ply.ScanMesh, scene: str, box: ObjectBox | None) -> list[reader.Prediction]:
    """Return what a file predicts; a URDF is fitted into its box."""
    if box is None:
        return reader.read(path, surface, scene)
    candidates = urdf_object.read(path, surface, box)
    if not candidates:
        raise InputError(f"{path}: no face of the scan lies near a moving link in the box {box}; give the object's box")
    return candidates


def _box(config: Config, path: Path, surface: ply.ScanMesh) -> ObjectBox | None:
    """Return the box that the object of a URDF fills; None for other predictions."""
    given = [key for key, value in (("box", config.box), ("object", config.object)) if value is not None]
    if path.suffix.lower() != urdf_object.SUFFIX:
        if given:
            raise InputError(f"{path} is not a URDF, and key {given[0]!r} is given; other predictions need none")
        return None
    if len(given) != 1:
        raise InputError(
            f"{path} is a URDF, and keys 'box' and 'object' are {'both given' if given else 'null'}; "
            "a URDF needs box=[x,y,z,sx,sy,sz,yaw] or object=ID, of a part of the scan"
        )
    return _given_box(config.box) if config.box is not None else _box_of(config, path, surface)


def _given_box(values: tuple[float, ...]) -> ObjectBox:
    numbers = np.array(values)
    if not np.isfinite(numbers).all() or (numbers[3:6] <= 0.0).any():
        raise InputError(f"key 'box' is {list(values)}; give a centre, three extents above 0 [m] and an angle [rad]")
    return ObjectBox(numbers[:3], numbers[3:6], float(numbers[6]))


def _box_of(config: Config, path: Path, surface: ply.ScanMesh) -> ObjectBox:
    """Return the box of a part of the scan and of all below it, turned as the URDF fits best."""
    room, part = scans.read(Path(str(config.scan))), str(config.object)
    room.part(part)
    points = merge([room.parts[i].mesh for i in (part, *room.descendants(part))]).vertices.astype(float)
    return urdf_object.best(path, surface, _boxes(points + surface.origin))


def _boxes(points: np.ndarray) -> list[ObjectBox]:
    """Return the upright box around points [m], shape [point 3], with its x axis to each of its four sides.

    Raises:
        InputError: the points lie in a plane or a line.
    """
    size = np.ptp(points, axis=0)
    if len(points) < 4 or size.min() < 1e-3:
        raise InputError(f"extents {size.round(3).tolist()} m hold no object; give box=[x,y,z,sx,sy,sz,yaw]")
    turn = np.eye(3)
    turn[:2, :2] = min_area_rectangle(points[:, :2])
    low, high = (points @ turn).min(axis=0), (points @ turn).max(axis=0)
    center, yaw = turn @ (low + high) / 2, math.atan2(turn[1, 0], turn[0, 0])
    yaws = [(yaw + k * math.pi / 2 + math.pi) % (2 * math.pi) - math.pi for k in range(4)]
    return [ObjectBox(center, (high - low)[[k % 2, 1 - k % 2, 2]], each) for k, each in enumerate(yaws)]


def _segments(files: folder.BareFiles) -> list[tuple[Path, str]]:
    """Return the segments of a scan and their names in the new folder."""
    return list(zip(files.segments, (folder.SEGMENTS, folder.GROUPS), strict=True)) if files.segments else []
