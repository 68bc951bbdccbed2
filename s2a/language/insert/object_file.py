"""An object's file as a clean mesh that is upright and in metres."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from pxr import Usd, UsdGeom
from scipy.spatial import cKDTree

from s2a.core.bounds import Count, Positive
from s2a.core.errors import InputError
from s2a.language.insert.place.stable_pose import AXES, leans_forward, settled_axis
from s2a.scan.bake import bake
from s2a.scan.mesh_files import from_trimesh
from s2a.scene.geometry.mesh_ops import GREY
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh, visible_distance
from s2a.scene.geometry.simplify import decimate
from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import reading, refuse_deep

COARSEST, FINEST, STEP = 8.0, 512.0, 1.5
"""Parts of an object's longest side down to which triangles' edges are split: the first, the last, and from one to the next."""


def textured(path: Path, shape: trimesh.Trimesh, budget: int) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the vertices [vertex 3], triangles [face 3] and colours [vertex 3], uint8, of a shape with a texture.

    Triangles are split where the texture shows more than the colours of their corners, as finely as the budget allows.

    Args:
        path: the file, for warnings.
        shape: as trimesh reads it.
        budget: largest number of triangles.

    Returns:
        None if it has no texture coordinates or no image, or more triangles than the budget.
    """
    source = from_trimesh(path, shape, np.eye(4))
    if np.isnan(source.uv).all() or all(material.texture is None for material in source.materials):
        return None
    side = float(np.ptp(source.vertices, axis=0).max())
    found, parts = bake(source, np.inf), float(COARSEST)
    while len(found.faces) <= budget and parts <= FINEST:
        finer = bake(source, side / parts)
        if len(finer.faces) > budget:
            break
        found, parts = finer, parts * STEP
    return None if len(found.faces) > budget else (found.vertices, found.faces, found.colors)


STAGES = (".usd", ".usda", ".usdc", ".usdz")
MESHES = (".obj", ".ply", ".glb", ".gltf", ".stl", ".off")
WELD = 1e-6
"""Vertices nearer than this share of the object's size are one."""
MAX_COORDINATE = 1e9
"""Coordinate of an object, in whatever unit."""
Shape = tuple[np.ndarray, np.ndarray, np.ndarray | None]
"""Points [vertex 3], triangles [face 3], colours [vertex 3], uint8, or None."""


@dataclass(frozen=True)
class ObjectConfig:
    """Reading of object files.

    Attributes:
        faces: meshes with more faces are decimated to this number.
        aggressiveness: of the decimation.
    """

    faces: Count
    aggressiveness: Positive


@dataclass(frozen=True)
class ObjectFile:
    """What a file holds, in its own unit and axes.

    Attributes:
        mesh: clean: welded, without flat faces, consistently wound outwards; its zero is moved to the middle of its faces.
        unit: metres in a unit of the file, if it says so.
        up: upward axis as the file says, "+y" or "+z", or None. Exporters often leave it at their format's default.
    """

    mesh: Mesh
    unit: float | None
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
        raw, unit, up = _read_stage(path)
    elif ending in MESHES:
        raw, unit, up = _read_mesh(path, config.faces), None, "+y" if ending in (".glb", ".gltf") else None
    else:
        raise InputError(f"{path}: ending {ending!r} is unknown; possible: {', '.join((*MESHES, *STAGES))}")
    try:
        mesh = cleaned(_centered(raw))
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


def _read_mesh(path: Path, faces: int) -> Shape:
    """Return all surfaces of a mesh file as one, colours of materials and textures on its vertices; `faces` at most for those."""
    try:
        scene = trimesh.load_scene(path, process=False)
        shapes = [shape for shape in scene.dump() if isinstance(shape, trimesh.Trimesh)]
    except Exception as error:  # trimesh raises whatever its parsers raise
        # What is not of the format that its name says may look like one that another module would read.
        why = (
            f"not {path.suffix.lower()}, or damaged"
            if isinstance(error, ImportError)
            else " ".join(str(error).split())[:300]
        )
        raise InputError(f"{path}: not a mesh that can be read ({why}); export it again") from error
    budget = faces // max(len(shapes), 1)
    return _together([textured(path, shape, budget) or _plain(shape) for shape in shapes])


def _plain(shape: trimesh.Trimesh) -> Shape:
    return np.asarray(shape.vertices), np.asarray(shape.faces), _painted(shape)


def _painted(shape: trimesh.Trimesh) -> np.ndarray | None:
    """Return the colours of a shape's vertices, shape [vertex 3], uint8, or None."""
    visual = shape.visual
    if isinstance(visual, trimesh.visual.TextureVisuals):
        try:
            colors = np.asarray(visual.to_color().vertex_colors)
        except Exception:  # no coordinates, or a texture that is missing or damaged; the shape is what matters
            colors = np.tile(np.asarray(visual.material.main_color, np.uint8), (len(shape.vertices), 1))
    else:
        colors = np.asarray(visual.vertex_colors)
    return colors[:, :3] if len(colors) == len(shape.vertices) else None


def _read_stage(path: Path) -> tuple[Shape, float | None, str]:
    """Return the surfaces that show in a USD stage as one in its world, with its unit, if it says one, and its up axis."""
    refuse_deep(path)
    with reading(path):
        stage = Usd.Stage.Open(str(path))
        found = []
        for prim in stage.Traverse(Usd.TraverseInstanceProxies()):
            if prim.IsA(UsdGeom.Mesh) and _shows(UsdGeom.Imageable(prim)):
                found.append(_read_prim(UsdGeom.Mesh(prim), path))
        unit = float(UsdGeom.GetStageMetersPerUnit(stage))
        up = "+y" if UsdGeom.GetStageUpAxis(stage) == UsdGeom.Tokens.y else "+z"
        return _together(found), unit if 0.0 < unit < np.inf else None, up


def _shows(prim: UsdGeom.Imageable) -> bool:
    """Return whether a renderer shows a prim: colliders and stand-ins have another purpose."""
    seen = prim.ComputeVisibility() != UsdGeom.Tokens.invisible
    return seen and prim.ComputePurpose() in (UsdGeom.Tokens.default_, UsdGeom.Tokens.render)


def _read_prim(mesh: UsdGeom.Mesh, path: Path) -> Shape:
    """Return points in the stage's world, triangles (fans of larger faces) and colours."""
    points = np.asarray(mesh.GetPointsAttr().Get() or [], np.float64).reshape(-1, 3)
    matrix = np.array(mesh.ComputeLocalToWorldTransform(Usd.TimeCode.Default()))
    counts = np.asarray(mesh.GetFaceVertexCountsAttr().Get() or [], int)
    corners = np.asarray(mesh.GetFaceVertexIndicesAttr().Get() or [], int)
    if counts.min(initial=0) < 0 or counts.sum() != len(corners):
        raise InputError(
            f"{path}: the faces of {mesh.GetPath()} have {counts.sum()} corners, and {len(corners)} are listed; "
            "it is damaged: export it again"
        )
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(int)
    fans = [
        np.stack([starts[counts > k], starts[counts > k] + k - 1, starts[counts > k] + k], 1)
        for k in range(2, max(counts, default=0))
    ]
    faces = corners[np.concatenate(fans)] if fans else np.empty((0, 3), int)
    if mesh.GetOrientationAttr().Get() == UsdGeom.Tokens.leftHanded:
        faces = faces[:, ::-1]
    colors = mesh.GetDisplayColorPrimvar().ComputeFlattened()
    painted = None if colors is None or len(colors) != len(points) else (255 * np.clip(colors, 0, 1)).astype(np.uint8)
    return points @ matrix[:3, :3] + matrix[3, :3], faces, painted


def _together(shapes: list[Shape]) -> Shape:
    """Return shapes as one; what is not finite is left out; grey where only some have colours."""
    vertices, faces, colors, start = [np.empty((0, 3))], [np.empty((0, 3), int)], [np.empty((0, 3), np.uint8)], 0
    for points, triangles, paint in shapes:
        triangles = triangles[((triangles >= 0) & (triangles < len(points))).all(axis=1)]
        finite = np.asarray(np.isfinite(points).all(axis=1))
        triangles = triangles[finite[triangles].all(axis=1)]
        vertices.append(np.nan_to_num(points, posinf=0.0, neginf=0.0))
        faces.append(triangles + start)
        colors.append(np.full(points.shape, GREY, np.uint8) if paint is None else paint)
        start += len(points)
    painted = any(paint is not None for _, _, paint in shapes)
    return np.concatenate(vertices), np.concatenate(faces), np.concatenate(colors) if painted else None


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


GRID = 24
"""Rays along a side of the grid, at each end."""


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
    up = int(np.abs(axis).argmax())
    across = [i for i in range(3) if i != up]
    middles = (np.stack(np.meshgrid(*[np.arange(GRID)] * 2), axis=-1).reshape(-1, 2) + 0.5) / GRID
    start = np.empty((len(middles), 3))
    start[:, across] = middles * sides[across]
    start[:, up] = sides[up] if axis[up] > 0 else 0.0
    start += 0.1 * axis
    reach = float(sides[up]) + 0.2
    distance, _ = visible_distance(tree, start, -axis, reach)
    hit = distance < reach
    face, _ = nearest_faces(tree, start[hit] - distance[hit, None] * axis)
    return face[face >= 0]


def _spread(colors: np.ndarray) -> float:
    """Return the standard deviation of colours [hit 3]."""
    return round(float(np.sqrt(colors.var(axis=0).mean())), 1) if len(colors) else 0.0
