"""An object's file as a clean mesh that is upright and in metres."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from s2a.core.bounds import Count, Positive
from s2a.core.errors import InputError
from s2a.language.insert.stable_pose import AXES, grid_over, leans_forward, settled_axis
from s2a.scan import source as mesh_files
from s2a.scan.imported import bake
from s2a.scan.source import SourceMesh
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh, visible_distance
from s2a.scene.geometry.simplify import decimate
from s2a.scene.scene import Mesh

# Parts of an object's longest side down to which triangles' edges are split: the first, the last, and from one to the
# next
COARSEST, FINEST, STEP = 8.0, 512.0, 1.5
# Points [vertex 3], triangles [face 3], colours [vertex 3], uint8, or None
Shape = tuple[np.ndarray, np.ndarray, np.ndarray | None]


def painted(source: SourceMesh, budget: int) -> Shape:
    """Return a mesh with colours of its vertices; None for the colours where its file has none at all.

    Triangles are split where a texture shows more than the colours of their corners, as finely as the budget allows.

    `budget`: largest number of triangles.
    """
    if not len(source.faces):
        return source.vertices, source.faces, None
    plain = bake(source, np.inf)
    if np.isnan(source.colors).all() and not source.materials:
        return plain.vertices, plain.faces, None
    mesh, parts = plain, float(COARSEST)
    side = float(np.ptp(source.vertices[source.faces].reshape(-1, 3), axis=0).max())
    textured = any(material.texture is not None for material in source.materials)
    while textured and len(mesh.faces) <= budget and parts <= FINEST:
        finer = bake(source, side / parts)
        if len(finer.faces) > budget:
            break
        mesh, parts = finer, parts * STEP
    return mesh.vertices, mesh.faces, mesh.colors


STAGES = (".usd", ".usda", ".usdc", ".usdz")
MESHES = (".obj", ".ply", ".glb", ".gltf", ".stl", ".off")
WELD = 1e-6  # Vertices nearer than this share of the object's size are one
MAX_COORDINATE = 1e9  # Coordinate of an object, in whatever unit
USD_UNIT = 0.01  # [m] USD's unit where a stage states none


@dataclass(frozen=True)
class ObjectConfig:
    """Reading of object files."""

    faces: Count = 60000  # meshes with more faces are decimated to this number
    aggressiveness: Positive = 3.0  # of the decimation


@dataclass(frozen=True)
class ObjectFile:
    """What a file holds, in its own unit and axes."""

    # clean: welded, without flat faces, consistently wound outwards; its zero is moved to the middle of its faces
    mesh: Mesh
    unit: float | None  # metres in a unit of the file, if it says so
    # upward axis as the file says, "+y" or "+z", or None. Exporters often leave it at their format's default
    up: str | None


def read_object(path: Path, config: ObjectConfig) -> ObjectFile:
    """Read an object.

    Raises:
        InputError: no such file, an unknown ending, a damaged file, or nothing but empty or flat surfaces in it.
    """
    if not path.is_file():
        raise InputError(
            f"{path}: no such file; give a mesh ({', '.join(MESHES)}) or a USD stage ({', '.join(STAGES)})"
        )
    ending = path.suffix.lower()
    unit: float | None
    up: str | None
    if ending in STAGES:
        source = mesh_files.read_unchecked(path)
        unit = USD_UNIT if source.stated.unit is None else source.stated.unit
        unit, up = unit if 0.0 < unit < np.inf else None, "+z" if source.stated.up == "z" else "+y"
    elif ending in MESHES:
        source = mesh_files.read_unchecked(path)
        unit, up = None, "+y" if ending in (".glb", ".gltf") else None
    else:
        raise InputError(f"{path}: ending {ending!r} is unknown; possible: {', '.join((*MESHES, *STAGES))}")
    try:
        mesh = cleaned(_centered(painted(_sound(source), config.faces)))
    except (InputError, ValueError) as error:
        raise InputError(f"{path}: {error}; export it again") from error
    if not len(mesh.faces):
        raise InputError(f"{path}: there is no surface in it; export it again with its faces")
    if len(mesh.faces) > config.faces:
        mesh = _lighter(mesh, config)
    return ObjectFile(mesh, unit, up)


def upright(file: ObjectFile, up: str, front: str, scale: float, hangs: bool = False) -> Mesh:
    """Return the mesh standing on z = 0 above the origin, its front towards +x.

    Where it would fall over a little, because the file's axes are not quite its own, it stands as it comes to rest. A panel that
    leans on something behind it looks where it leans back from, whatever `front` says.

    Args:
        file: what was read.
        up: axis of the file that points up, "+x" to "-z".
        front: axis of the file that the object's front looks along, across `up`.
        scale: metres in a unit of the file, times whatever else makes it as large as it should be.
        hangs: Keep the given axes, without settling on a stable pose.
    """
    z, x = AXES[up], AXES[front]
    if not hangs:
        z = settled_axis(file.mesh, z)
        x = (x - x @ z * z) / np.linalg.norm(x - x @ z * z)
        x = -x if leans_forward(file.mesh, z, x) else x
    turned = scale * file.mesh.vertices.astype(np.float64) @ np.stack([x, np.cross(z, x), z]).T
    low, high = turned.min(axis=0), turned.max(axis=0)
    return Mesh(turned - [*(low + high)[:2] / 2, low[2]], file.mesh.faces, file.mesh.colors)


def cleaned(mesh: Mesh) -> Mesh:
    """Return a mesh without doubled vertices, flat or doubled faces, wound outwards where it encloses a volume."""
    if not len(mesh.faces):
        return mesh
    size = float(np.ptp(mesh.bounds, axis=0).max())
    shape = trimesh.Trimesh(mesh.vertices, mesh.faces, vertex_colors=mesh.colors, process=False)
    shape.merge_vertices(merge_tex=True, merge_norm=True, digits_vertex=_digits(size))
    shape.update_faces(shape.nondegenerate_faces(height=WELD * max(size, 1e-12)))
    shape.update_faces(shape.unique_faces())
    shape.remove_unreferenced_vertices()
    if len(shape.faces):
        trimesh.repair.fix_winding(shape)
        trimesh.repair.fix_inversion(shape, multibody=True)
    colors = None if mesh.colors is None else np.asarray(shape.visual.vertex_colors)[:, :3]
    return Mesh(np.asarray(shape.vertices), np.asarray(shape.faces), colors)


def _digits(size: float) -> int:
    """Return the decimals that tell vertices apart in an object of a size."""
    return int(np.ceil(-np.log10(max(size, 1e-12) * WELD)))


def _sound(source: SourceMesh) -> SourceMesh:
    """Return a mesh without faces that are not finite or name vertices which do not exist."""
    faces = source.faces
    inside = np.asarray(((faces >= 0) & (faces < len(source.vertices))).all(axis=1))
    finite = np.append(np.isfinite(source.vertices).all(axis=1), False)
    whole = inside & finite[np.where(inside[:, None], faces, -1)].all(axis=1)
    vertices = np.nan_to_num(source.vertices, posinf=0.0, neginf=0.0)
    parts = {name: getattr(source, name)[whole] for name in ("faces", "uv", "colors", "material")}
    return replace(source, vertices=vertices, **parts)


def _centered(shape: Shape) -> Mesh:
    """Return a shape around zero, where single precision keeps what is small."""
    vertices, faces, colors = shape
    if not np.abs(vertices).max(initial=0.0) <= MAX_COORDINATE:
        raise InputError(
            f"a point is {np.abs(vertices).max():g} units from its zero; expected up to {MAX_COORDINATE:g}"
        )
    middle = vertices[faces].reshape(-1, 3).mean(axis=0) if len(faces) else np.zeros(3)
    return Mesh(vertices - middle, faces, colors)


def _lighter(mesh: Mesh, config: ObjectConfig) -> Mesh:
    """Return a mesh with as many faces as allowed, each vertex coloured like the nearest one before."""
    less = decimate(mesh, config.faces / len(mesh.faces), config.aggressiveness)
    colors = None if mesh.colors is None else mesh.colors[cKDTree(mesh.vertices).query(less.vertices)[1]]
    return Mesh(less.vertices, less.faces, colors)


def colour_spread(mesh: Mesh) -> dict[str, float]:
    """Return for each axis, "+x" to "-z", the spread of the colours seen from there, 0 to 255; empty without colours.

    That is the standard deviation over parallel rays from that side, as the root mean square of the channels.
    """
    if mesh.colors is None or not len(mesh.faces):
        return {}
    # In a box of size 1: files have any unit, and rays are in single precision.
    low, longest = mesh.vertices.min(axis=0), float(np.ptp(mesh.vertices, axis=0).max())
    tree = ray_mesh((mesh.vertices - low) / longest, mesh.faces)
    sides = np.ptp(mesh.vertices, axis=0).astype(np.float64) / longest
    colors = mesh.colors[mesh.faces][:, :, :3].astype(np.float64).mean(axis=1)
    return {name: _spread(colors[_seen(tree, sides, axis)]) for name, axis in AXES.items()}


def _seen(tree: object, sides: np.ndarray, axis: np.ndarray) -> np.ndarray:
    """Return the faces that rays against an axis meet first, shape [hit]."""
    start = grid_over(np.zeros(3), sides, axis) + 0.1 * axis
    reach = float(np.abs(axis) @ sides) + 0.2
    distance, _ = visible_distance(tree, start, -axis, reach)
    hit = distance < reach
    face, _ = nearest_faces(tree, start[hit] - distance[hit, None] * axis)
    return face[face >= 0]


def _spread(colors: np.ndarray) -> float:
    """Return the standard deviation of colours [hit 3]."""
    return round(float(np.sqrt(colors.var(axis=0).mean())), 1) if len(colors) else 0.0
