"""Common to all flavours: stages, meshes, and attributes in the namespace `s2a:`."""

import os
from collections.abc import Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from pxr import Gf, Sdf, Tf, Usd, UsdGeom, UsdPhysics, UsdUtils, UsdValidation, Vt

from s2a.core.color_space import to_bytes, to_linear
from s2a.core.errors import InputError
from s2a.core.outputs import full_disk_reported
from s2a.scene.scene import Mesh, Scene

ROOT = "/scene"  # Path of the default prim of every flavour
# Prims that are no parts; no part may be called so
RESERVED = ("joints", "visual", "grasp", "static", "physics", "materials", "colliders", "region")
# Bytes of a file's name beyond which USD's temporary one may be longer than 255, the most that file systems take
LONG = 240
# How USD's text begins; bytes that are read at once; brackets within brackets
TEXT, BLOCK, DEEPEST = b"#usda", 1 << 22, 5000
BRACKETS = np.zeros(256, np.int8)
BRACKETS[list(b"([{")], BRACKETS[list(b")]}")] = 1, -1
ENCODINGS = (".usd", ".usda", ".usdc")  # File names end so: binary, text, binary
# Ending of a room with all its files in one; a scanning app's package is no room, which opening it says
PACKAGE = ".usdz"


def new_stage() -> Usd.Stage:
    """Return an empty stage in memory: metres, kilograms, z up, `/scene` as its default prim."""
    stage = Usd.Stage.CreateInMemory()
    UsdGeom.SetStageMetersPerUnit(stage, 1.0)
    UsdGeom.SetStageUpAxis(stage, UsdGeom.Tokens.z)
    UsdPhysics.SetStageKilogramsPerUnit(stage, 1.0)
    stage.SetDefaultPrim(UsdGeom.Xform.Define(stage, ROOT).GetPrim())
    return stage


def save(stage: Usd.Stage, path: Path) -> None:
    """Write a stage made by `new_stage` to exactly this path; its ending decides the encoding.

    Raises:
        InputError: the ending is not USD's, or the file cannot be written.
    """
    save_layer(stage.GetRootLayer(), path, ENCODINGS)


def save_layer(layer: Sdf.Layer, path: Path, endings: Collection[str] = (".usda",)) -> None:
    """Write one layer, which may name others that are not there yet, to exactly this path.

    Raises:
        InputError: another ending, or the file cannot be written.
    """
    if path.suffix not in endings:
        raise InputError(f"{path}: {path.suffix or 'no'} ending; such a file ends in {', '.join(endings)}")
    # USD writes beside it first, under a longer name: of a name that leaves no room for that, a short one stands in.
    short = len(os.fsencode(path.name)) > LONG
    place = path.with_name(f".{path.suffix[1:]}{path.suffix}") if short else path
    try:
        with full_disk_reported(path):
            written = layer.Export(str(place))
            if short and written:
                os.replace(place, path)
    except Tf.ErrorException:
        written = False
    if not written:
        raise InputError(f"{path}: cannot be written; check that its folder exists, may be written, and has space")


def referable(name: str) -> str:
    """Return the name of a file that another is to name, which USD cannot where a control character is in it.

    Raises:
        InputError: there is one.
    """
    if any(ord(letter) < 32 or ord(letter) == 127 for letter in name):
        raise InputError(f"{name!r} holds a control character, and USD cannot refer to it; choose another name")
    return name


def open_stage(path: Path, *, payloads: bool = True) -> Usd.Stage:
    """Open a stage of any flavour, as it is on disk now; without `payloads`, what lies in files that they name is not loaded.

    Raises:
        InputError: no such file, not USD, no default prim `/scene`, or not in metres with z up.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such file; give a .usd, .usda or .usdc file")
    refuse_deep(path)
    with reading(path):
        stage = Usd.Stage.Open(str(path), Usd.Stage.LoadAll if payloads else Usd.Stage.LoadNone)
        # USD keeps a layer for as long as anybody holds it, and hands that out even if the file has been rewritten.
        stage.Reload()
    if stage.GetDefaultPrim().GetPath() != ROOT:
        raise InputError(
            f"{path}: its default prim is not {ROOT}; expected a stage that s2a wrote: s2a import mesh= reads other ones"
        )
    if UsdGeom.GetStageMetersPerUnit(stage) != 1.0 or UsdGeom.GetStageUpAxis(stage) != UsdGeom.Tokens.z:
        unit, up = UsdGeom.GetStageMetersPerUnit(stage), UsdGeom.GetStageUpAxis(stage)
        raise InputError(f"{path}: metersPerUnit {unit:g}, upAxis {up}; expected 1 and Z: convert it first")
    return stage


def check_ids(scene: Scene) -> None:
    """Raise an InputError if a part's id cannot be the name of its prim."""
    anchors = [f"{i}_anchor" for i in scene.movable if scene.parts[i].parent is None]
    taken = [*RESERVED, *anchors]
    for part_id in scene.parts:
        if not Sdf.Path.IsValidIdentifier(part_id) or part_id in taken:
            raise InputError(
                f"part id {part_id!r} of scene {scene.name!r} cannot name a prim; use letters, digits and _, "
                f"no digit first, and none of: {', '.join(taken)}"
            )


def write_mesh(stage: Usd.Stage, path: str, mesh: Mesh, *, purpose: str | None = None) -> UsdGeom.PointBased:
    """Define a Mesh prim: triangles without subdivision, colours per vertex where the mesh has them.

    A mesh without triangles becomes a Points prim instead: Newton 1.8 refuses a stage with an empty Mesh.

    Args:
        stage: where to.
        path: path of the prim.
        mesh: points in scene coordinates; may be empty (an extent is authored only where there are points).
        purpose: USD's purpose, such as "guide" for what is not to be seen.

    Returns:
        The prim's schema object; `read_mesh` gives the same arrays back, bit for bit.
    """
    prim = (UsdGeom.Mesh if len(mesh.faces) else UsdGeom.Points).Define(stage, path)
    prim.CreatePointsAttr(Vt.Vec3fArray.FromNumpy(mesh.vertices))
    if len(mesh.vertices):
        corners = np.stack([mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)])
        prim.CreateExtentAttr(Vt.Vec3fArray.FromNumpy(corners))
    if mesh.colors is not None:
        prim.CreateDisplayColorPrimvar(UsdGeom.Tokens.vertex).Set(Vt.Vec3fArray.FromNumpy(to_linear(mesh.colors)))
    if purpose is not None:
        prim.CreatePurposeAttr(purpose)
    if len(mesh.faces):
        _write_faces(prim, mesh.faces)
    return prim


def read_mesh(prim: Usd.Prim, frame: Usd.Prim | None = None) -> Mesh:
    """Read a Mesh or Points prim; its transform, if it has one, is applied.

    `frame`: a prim above it, in whose frame its points are returned; None: in scene coordinates.

    Raises:
        InputError: neither a Mesh nor Points, not triangles, or arrays that do not fit each other.
    """
    if not prim.IsA(UsdGeom.Mesh) and not prim.IsA(UsdGeom.Points):
        raise InputError(f"{where(prim)} is a {prim.GetTypeName() or 'prim without type'}; expected a Mesh or Points")
    geometry = UsdGeom.PointBased(prim)
    points = np.asarray(geometry.GetPointsAttr().Get() or [], dtype=np.float32).reshape(-1, 3)
    try:
        return Mesh(_placed(prim, points, frame), _read_faces(prim), _read_colors(geometry))
    except ValueError as error:
        raise InputError(f"{where(prim)}: {error}; export it again") from error


def placement(prim: Usd.Prim) -> np.ndarray | None:
    """Return the transform that an editor gave a prim or what is above it, shape [4 4], float64, for points as rows.

    None where there is none, so that what no editor touched stays the same to the last bit.
    """
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return None if np.array_equal(matrix, np.eye(4)) else matrix


def write_attribute(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: Any, *, terse: bool = False) -> None:
    """Author the attribute `s2a:<name>` on a prim.

    Args:
        prim: where to.
        name: without the namespace.
        kind: one of `Sdf.ValueTypeNames`.
        value: tuples and arrays are taken as USD's vectors.
        terse: leave out that it is custom and does not vary over time, which no reader needs.

    Raises:
        InputError: a text that USD cannot store (it would end at a zero byte, and its binary files would be damaged).
    """
    if isinstance(value, str) and ("\0" in value or any("\ud800" <= letter <= "\udfff" for letter in value)):
        raise InputError(f"{prim.GetName()}: {name} {value!r} has a zero byte or half a character; fix it in the scan")
    variability = Sdf.VariabilityVarying if terse else Sdf.VariabilityUniform
    attribute = prim.CreateAttribute(f"s2a:{name}", kind, not terse, variability)
    attribute.Set(kind.type.pythonClass(*value) if isinstance(value, (tuple, np.ndarray)) else value)


def read_attribute(prim: Usd.Prim, name: str, kind: type, default: Any = None) -> Any:
    """Return the value of the attribute `s2a:<name>` (vectors as tuples), or the default if there is none.

    Raises:
        InputError: the value is of another type.
    """
    value = prim.GetAttribute(f"s2a:{name}").Get()
    if value is None:
        return default
    value = tuple(value) if isinstance(value, (Gf.Vec2d, Gf.Vec3d)) else value
    if not isinstance(value, kind):
        raise InputError(f"{where(prim)}: s2a:{name} is {value!r}; expected {kind.__name__}: export the scan again")
    return value


def where(prim: Usd.Prim) -> str:
    """Return the file and the path of a prim, for messages."""
    return f"{prim.GetStage().GetRootLayer().realPath}: {prim.GetPath()}"


def refuse_deep(path: Path) -> None:
    """Raise an InputError for a text file whose brackets nest so deeply that USD's parser would end this process."""
    with path.open("rb") as file:
        if file.read(len(TEXT)) != TEXT:
            return
        depth = 0
        while block := file.read(BLOCK):
            depths = depth + np.cumsum(BRACKETS[np.frombuffer(block, np.uint8)], dtype=np.int64)
            if depths.max() > DEEPEST:
                raise InputError(f"{path}: its brackets nest deeper than {DEEPEST}; it is damaged: export it again")
            depth = int(depths[-1])


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Turn what USD raises on a damaged file inside the block into an InputError.

    Its own warnings, of files that are missing, say, are not printed: whoever needs such a file raises an error.
    """
    collected = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    except Tf.ErrorException as error:
        raise InputError(f"{path}: not a USD file, or a damaged one; export it again") from error
    finally:
        collected.TakeUncoalescedDiagnostics()


def xyzw(quat: Gf.Quatd | Gf.Quatf) -> tuple[float, float, float, float]:
    """Return a quaternion of USD as xyzw."""
    x, y, z = quat.GetImaginary()
    return x, y, z, quat.GetReal()


def world_pose(prim: Usd.Prim) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """Return where a prim is in the scene: position [m], shape [3], and orientation xyzw."""
    matrix = UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default())
    return np.array(matrix.ExtractTranslation()), xyzw(matrix.ExtractRotationQuat())


def world_points(prim: Usd.Prim) -> np.ndarray:
    """Return a mesh's points in the scene [m], shape [point 3], float64."""
    local = np.asarray(UsdGeom.PointBased(prim).GetPointsAttr().Get() or [], np.float64).reshape(-1, 3)
    matrix = np.array(UsdGeom.Xformable(prim).ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    return local @ matrix[:3, :3] + matrix[3, :3]


def _write_faces(mesh: UsdGeom.Mesh, faces: np.ndarray) -> None:
    """Author triangles [face 3] as they are: not a cage to subdivide, and seen from both sides."""
    mesh.CreateFaceVertexCountsAttr(Vt.IntArray(len(faces), 3))
    mesh.CreateFaceVertexIndicesAttr(Vt.IntArray.FromNumpy(faces.ravel()))
    mesh.CreateSubdivisionSchemeAttr(UsdGeom.Tokens.none)
    # Scans are open surfaces: a viewer that drops faces seen from behind would show holes.
    mesh.CreateDoubleSidedAttr(True)


def _read_faces(prim: Usd.Prim) -> np.ndarray:
    """Return triangles [face 3]; none for a prim that is no Mesh. A ValueError says that other faces are there."""
    counts = np.asarray(UsdGeom.Mesh(prim).GetFaceVertexCountsAttr().Get() or [] if prim.IsA(UsdGeom.Mesh) else [])
    if not len(counts):
        return np.zeros((0, 3), dtype=np.int32)
    indices = np.asarray(UsdGeom.Mesh(prim).GetFaceVertexIndicesAttr().Get() or [], dtype=np.int32)
    if (counts != 3).any() or len(indices) != 3 * len(counts):
        raise ValueError("its faces are not triangles")
    return indices.reshape(-1, 3)


def _placed(prim: Usd.Prim, points: np.ndarray, frame: Usd.Prim | None) -> np.ndarray:
    """Apply the transform of a prim into a frame above it (None: the scene), if there is one, in float64."""
    matrix, outer = placement(prim), None if frame is None else placement(frame)
    if outer is not None:
        assert matrix is not None
        matrix = None if np.array_equal(matrix, outer) else matrix @ np.linalg.inv(outer)
    return points if matrix is None else points.astype(np.float64) @ matrix[:3, :3] + matrix[3, :3]


def _read_colors(geometry: UsdGeom.PointBased) -> np.ndarray | None:
    """Return colours per vertex as uint8 [vertex 3], or None where none are authored."""
    primvar = geometry.GetDisplayColorPrimvar()
    if not primvar.HasAuthoredValue():
        return None
    colors = np.asarray(primvar.ComputeFlattened(), dtype=np.float32).reshape(-1, 3)
    if primvar.GetInterpolation() == UsdGeom.Tokens.constant:
        colors = np.broadcast_to(colors[:1], (len(geometry.GetPointsAttr().Get()), 3))
    return to_bytes(colors)


SERIOUS = (UsdValidation.ValidationErrorType.Error, UsdValidation.ValidationErrorType.Warn)


def problems(path: Path) -> list[str]:
    """Run all validators that usd-core ships (core, geometry, physics, shading ...) over a stage.

    Returns:
        One line for each error or warning, with the rule's name; empty where the stage is sound.

    Raises:
        InputError: the file is not a stage in metres with z up and the default prim `/scene`.
    """
    return broken_rules(open_stage(path))


def broken_rules(stage: Usd.Stage) -> list[str]:
    """Run all validators over an open stage of any kind; one line for each error or warning."""
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    errors = UsdValidation.ValidationContext(validators).Validate(stage)
    return [" ".join(error.GetErrorAsString().split()) for error in errors if error.GetType() in SERIOUS]
