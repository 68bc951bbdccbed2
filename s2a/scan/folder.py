"""A folder of a scan: its files on a mesh of ScanNet, ScanNet++ or nobody, and the registered formats that read it.

A format is every module of a package that has `recognise` and `read`, and those that other packages bring.
"""

import importlib
import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from types import ModuleType
from typing import Any, Protocol, cast

from s2a.core.errors import InputError

MESH = "mesh_aligned_0.05.ply"
SEGMENTS = "segments.json"
GROUPS = "segments_anno.json"
# Ending of ScanNet's mesh; beside it lie `<scene>_vh_clean_2.0.010000.segs.json` and `<scene>.aggregation.json`
SCANNET = "_vh_clean_2.ply"
# Endings of meshes that have to be converted to PLY first
FOREIGN = (".obj", ".glb", ".gltf", ".stl", ".off", ".dae", ".usdz", ".fbx")


@dataclass(frozen=True)
class BareFiles:
    """The files of a scan whose motions nobody annotated."""

    name: str  # the scan's name ("0a5c013435")
    mesh: Path  # ScanNet++'s mesh, which everything else counts in
    # ScanNet++'s segments and groups of segments, or None where the folder has neither
    segments: tuple[Path, Path] | None


@dataclass(frozen=True)
class ScanFiles(BareFiles):
    """The files of one scan: Articulate3D's `parts`, `<name>_parts.json`, and motions, `<name>_artic.json`, too."""

    parts: Path
    articulations: Path


def is_articulate3d(path: Path) -> bool:
    """Return True if a folder holds any of Articulate3D's files, maybe not all."""
    patterns = ("[!.]*_parts.json", "[!.]*_artic.json", "[!.]*_articulation.json")
    return any(any(folder.glob(pattern)) for folder in _folders(path) for pattern in patterns)


def has_mesh(path: Path) -> bool:
    """Return True if a folder holds one or several meshes."""
    return bool(_meshes(path))


def scannet_mesh(path: Path) -> Path | None:
    """Return ScanNet's decimated mesh in a folder, which its segments count in; None without one."""
    return next((file for each in _folders(path) for file in sorted(each.glob(f"[!.]*{SCANNET}"))), None)


def find_bare(path: Path) -> BareFiles:
    """Find ScanNet++'s mesh, or the only PLY file, in a folder or in its subfolder `scans`, and the segments beside it.

    The scan is named after the folder.

    Raises:
        InputError: no mesh there, several, or only one of the two files of segments.
    """
    meshes = _meshes(path)
    if len(meshes) != 1:
        names = ", ".join(file.name for file in meshes[:4]) or "none"
        raise InputError(f"{path}: expected one mesh, {MESH} (found: {names}); give the folder of one scan")
    whole = path.resolve()
    name = whole.parent.name if whole.name == "scans" else whole.name
    return BareFiles(name, meshes[0], _segments(path, _folders(path)))


def find(path: Path) -> ScanFiles:
    """Find the files of one scan in a folder, or in its subfolder `scans` where ScanNet++ keeps the mesh.

    Raises:
        InputError: no scan there, several, or an incomplete one.
    """
    folders = _folders(path)
    parts = [file for folder in folders for file in sorted(folder.glob("[!.]*_parts.json"))]
    if len(parts) != 1:
        raise no_scan(path)
    name = parts[0].name.removesuffix("_parts.json")
    return ScanFiles(
        name=name,
        mesh=_required(folders, _missing_mesh(folders), MESH),
        parts=parts[0],
        # The second name is the one that the file had before the release.
        articulations=_required(
            folders, f"it comes with {parts[0].name}", f"{name}_artic.json", f"{name}_articulation.json"
        ),
        segments=_segments(path, folders),
    )


def no_scan(path: Path) -> InputError:
    """Return the error for a path that is not the folder of one scan."""
    if path.is_dir():
        parts = [file for folder in _folders(path) for file in sorted(folder.glob("[!.]*_parts.json"))]
        return InputError(f"{path}: {_why_not_one(path, parts)}")
    if remedy := mesh_remedy(path):
        return InputError(f"{path}: {remedy}, in a folder of its own, and give that folder")
    what = "is a file" if path.exists() else "does not exist"
    return InputError(f"{path}: {what}; give the folder of one scan, which holds <scene>_parts.json")


def mesh_remedy(path: Path) -> str | None:
    """Return how to convert a mesh file of another format to the scan's mesh; None for any other file or a folder.

    Only what keeps the order of faces is of use: annotations count in it.
    """
    if not path.is_file() or path.suffix.lower() not in FOREIGN:
        return None
    if path.suffix.lower() in (".dae", ".fbx"):
        return f"{path.name} is not a PLY: export it from your scanning app or Blender as PLY, z up, in metres, named {MESH}"
    if path.suffix.lower() == ".usdz":
        return f"{path.name} is not a PLY: give s2a import mesh={path.name} out=FOLDER"
    up = ", and turn it z up (glTF has y up)" if path.suffix.lower() in (".glb", ".gltf") else ""
    call = f"trimesh.load({path.name!r}, force='mesh', process=False).export({MESH!r})"
    return (
        f"{path.name} is not a PLY: give s2a import mesh={path.name} out=FOLDER; for annotations that count its faces, convert "
        f"it in Python, which keeps the order of its faces: {call}{up}"
    )


def _missing_mesh(folders: list[Path]) -> str:
    """Say where the scan's mesh may be had, from what lies in its place."""
    files = [file for folder in folders for file in sorted(folder.iterdir())]
    meshes = [file.name for file in files if file.suffix.lower() == ".ply" and not file.name.startswith(".")]
    if meshes:
        return f"found {', '.join(meshes[:3])}: rename the mesh whose faces were annotated to {MESH}"
    if remedy := next(filter(None, map(mesh_remedy, files)), None):
        return remedy
    return "put the annotated mesh there under this name (a ScanNet++ release has it in the scan's folder `scans`)"


def _folders(path: Path) -> list[Path]:
    """Return the folder, and its subfolder `scans`, as far as they exist."""
    return [folder for folder in (path, path / "scans") if folder.is_dir()]


def _meshes(path: Path) -> list[Path]:
    """Return ScanNet++'s mesh alone if it is there, or else every PLY file."""
    folders = _folders(path)
    mesh = _first(folders, MESH) or scannet_mesh(path)
    return [mesh] if mesh else [file for folder in folders for file in sorted(folder.glob("[!.]*.ply"))]


def _why_not_one(path: Path, parts: list[Path]) -> str:
    if parts:
        names = ", ".join([file.name for file in parts[:4]] + ["..."] * (len(parts) > 4))
        return f"holds {len(parts)} scans ({names}); keep each scan in a folder of its own"
    below = sorted({file.parent.name for file in path.glob("*/[!.]*_parts.json")})[:4]
    if below:
        return f"holds no annotated scan, but its subfolders do; give one of them: {', '.join(below)}"
    files = sorted(path.iterdir())
    if remedy := next(filter(None, map(mesh_remedy, files)), None):
        return f"holds no PLY mesh; {remedy}"
    names = ", ".join(file.name for file in files[:6]) or "nothing"
    readable = ", ".join(each.NAME for each in formats("s2a.scan.formats"))
    return (
        f"holds no annotated scan: <scene>_parts.json is missing (found: {names}); possible: {readable} (docs/own_scan.md "
        "lists their files); give the folder of one scan"
    )


def _segments(path: Path, folders: list[Path]) -> tuple[Path, Path] | None:
    """Return ScanNet++'s two annotation files, None if there are none, or raise an InputError if one is missing."""
    segments, groups = _first(folders, SEGMENTS), _first(folders, GROUPS)
    if not segments and not groups and (scannet := scannet_mesh(path)):
        scene = scannet.name.removesuffix(SCANNET)
        segments = next(iter(sorted(scannet.parent.glob(f"{scene}{SCANNET[:-4]}.*.segs.json"))), None)
        groups = _first(folders, f"{scene}.aggregation.json")
    if segments and groups:
        return segments, groups
    if segments or groups:
        missing, other = (GROUPS, SEGMENTS) if segments else (SEGMENTS, GROUPS)
        raise InputError(f"{path}: {missing} is missing beside {other}; add it, or remove both")
    return None


def _first(folders: list[Path], *names: str) -> Path | None:
    """Return the first file of some names in some folders that exists, or None."""
    candidates = (folder / name for name in names for folder in folders)
    return next((file for file in candidates if file.is_file()), None)


def _required(folders: list[Path], remedy: str, *names: str) -> Path:
    """Return a file of the scan, or raise an InputError that says where to get it."""
    file = _first(folders, *names)
    if file is None:
        raise InputError(f"{folders[0]}: {names[0]} is missing; {remedy}")
    return file


class Format(Protocol):
    """A module that reads one format."""

    NAME: str  # what the format is called in messages
    recognise: Callable[[Path], bool]  # returns whether a path holds this format, from names of files, without an error
    # returns what the path holds; raises an InputError, one line, where it is damaged or incomplete
    read: Callable[[Path], Any]


@cache
def formats(package: str) -> tuple[Format, ...]:
    """Return the formats of a package in the order in which they are asked: by PRIORITY (0 without), largest first, then by name.

    `package`: of the readers, and the group of entry points by which an installed package adds modules of its own.
    """
    home = importlib.import_module(package)
    modules = [importlib.import_module(f"{package}.{each.name}") for each in pkgutil.iter_modules(home.__path__)]
    modules += [point.load() for point in entry_points(group=package)]
    readers = [module for module in modules if hasattr(module, "recognise") and hasattr(module, "read")]
    return tuple(cast(Format, module) for module in sorted(readers, key=_order))


def _order(module: ModuleType) -> tuple[int, str]:
    return -int(getattr(module, "PRIORITY", 0)), module.__name__
