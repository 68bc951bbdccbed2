"""Decimation of the static room, which only has to be seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import pyfqmr
from scipy.spatial import cKDTree

from s2a.core.bounds import Above, Count, Positive
from s2a.core.cache import recall
from s2a.core.progress import track
from s2a.scene.geometry.mesh_ops import centroids, keep, merge, normals, sample, weld
from s2a.scene.geometry.mesh_query import RayMesh, nearest_faces, ray_mesh
from s2a.scene.scene import Mesh, Scene, pack, unpack
from s2a.scene.usd.sim_scene import Reduction


@dataclass(frozen=True)
class Deviation:
    """Distances between two surfaces [m], each the larger one of both directions."""

    mean: float  # of all sampled points
    p99: float  # 99th percentile
    max: float  # maximum


def deviation(a: Mesh, b: Mesh, count: int, seed: int = 0, tree: RayMesh | None = None) -> Deviation:
    """Return the distance between two surfaces, the larger of a to b and b to a; inf if one is empty.

    Args:
        a: a surface.
        b: another one.
        count: points sampled on either, evenly by area.
        seed: of the points.
        tree: `ray_mesh` of a, if it exists.
    """
    empty = [not mesh.face_areas.any() for mesh in (a, b)]
    if any(empty):
        return Deviation(*(0.0 if all(empty) else math.inf,) * 3)
    there = nearest_faces(ray_mesh(b.vertices, b.faces), sample(a, count, seed))[1]
    back = nearest_faces(tree or ray_mesh(a.vertices, a.faces), sample(b, count, seed))[1]
    both = [(float(d.mean()), float(np.quantile(d, 0.99)), float(d.max())) for d in (there, back)]
    return Deviation(*(max(pair) for pair in zip(*both, strict=True)))


# Times that the range of possible reductions is halved (on a logarithmic scale) to find the largest allowed one
HALVINGS = 6
# Height of the fin on an open edge over its length: a tip on a grid of squares or cubes meets no other vertex
FIN = 0.618
FEWEST = 0.01  # Smallest fraction of the faces that mode "error" tests


STRUCTURE_LABELS = ("wall", "walls", "floor", "ceiling")  # Last words of the labels of a room's structure


@dataclass(frozen=True)
class DecimateConfig:
    """Decimation of the static room.

    Attributes:
        mode: "ratio" (keep a fraction of the faces), "error" (as few as an error allows) or "none" (keep all).
        structure: fraction of the faces of walls, floor and ceiling that mode "ratio" keeps.
        other: fraction of the faces of all other parts that mode "ratio" keeps.
        max_error: 99th percentile of the distance between the surfaces in mode "error" [m].
    """

    mode: Literal["ratio", "error", "none"]
    structure: Annotated[float, Above(0.0, 1.0)]
    other: Annotated[float, Above(0.0, 1.0)]
    max_error: Positive
    structure_labels: tuple[str, ...] = STRUCTURE_LABELS  # words in the labels of walls, floor and ceiling
    # how fast the bound on the collapses grows from pass to pass; smaller is slower and more exact
    aggressiveness: Positive = 5.0
    samples: Count = 100000  # points on either surface by which the error is measured


@dataclass(frozen=True, eq=False)
class Decimated:
    """The room with fewer faces."""

    mesh: Mesh  # all parts in one
    parts: tuple[str, ...]  # their ids
    face_part: np.ndarray  # index into `parts` of the part that each face belongs to, shape [face], int32
    reductions: tuple[Reduction, ...]  # what happened to walls, floor and ceiling, and to the rest


def is_structure(label: str, structure_labels: tuple[str, ...]) -> bool:
    """Return True for labels of walls, floor and ceiling; "wall cabinet" and "floor lamp" are none."""
    words = label.lower().replace("_", " ").split()
    return bool(words) and words[-1] in structure_labels


def decimate_room(scene: Scene, parts: Sequence[str], config: DecimateConfig) -> Decimated:
    """Return parts as one mesh with fewer faces, with the colours and the part of each face carried over."""
    flat = np.array([is_structure(scene.parts[i].label, config.structure_labels) for i in parts], bool)
    groups = [("structure", flat, config.structure), ("other", ~flat, config.other)]
    results = [
        _decimate_group(scene, name, [(k, i) for k, i in enumerate(parts) if chosen[k]], ratio, config)
        for name, chosen, ratio in track(groups, "decimate")
        if chosen.any()
    ]
    meshes, owners, reductions = zip(*results, strict=True) if results else ((), (), ())
    owner = np.concatenate(owners) if owners else np.empty(0)
    return Decimated(merge(meshes), tuple(parts), owner.astype(np.int32), tuple(reductions))


def decimate(mesh: Mesh, ratio: float, aggressiveness: float) -> Mesh:
    """Return a mesh with a fraction of the faces, by quadric edge collapses, without colours.

    Faces go where they are needed: moving an open border along the surface costs as much as moving the surface itself.
    """
    target = round(ratio * len(mesh.faces))
    if target >= len(mesh.faces) or len(mesh.faces) < 8:
        return Mesh(mesh.vertices, mesh.faces)
    for effort in (1.0, 2.0):
        less = _collapse(mesh, target, effort * aggressiveness)
        if len(less.faces) <= 1.01 * target:
            break
    return less


def decimate_within(mesh: Mesh, tree: RayMesh, config: DecimateConfig) -> tuple[Mesh, Deviation]:
    """Return a mesh with as few faces as keep 99 % of the points of both surfaces within `config.max_error`."""
    low, high = math.log(FEWEST), 0.0
    best, error = mesh, Deviation(0.0, 0.0, 0.0)
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        tried = decimate(mesh, math.exp(middle), config.aggressiveness)
        offset = deviation(mesh, tried, config.samples, tree=tree)
        if offset.p99 <= config.max_error:
            best, error, high = tried, offset, middle
        else:
            low = middle
    return best, error


def _decimate_group(
    scene: Scene, name: str, members: Sequence[tuple[int, str]], ratio: float, config: DecimateConfig
) -> tuple[Mesh, np.ndarray, Reduction]:
    """Return the decimated mesh of some parts, the number of the part that each face belongs to, and what was done."""
    meshes = [scene.parts[i].mesh for _, i in members]
    number = np.array([k for k, _ in members])
    owner = np.repeat(np.arange(len(meshes)), [len(mesh.faces) for mesh in meshes])

    def make() -> dict[str, np.ndarray]:
        mesh, part, wanted, error = _fewer(weld(merge(meshes)), owner, ratio, config)
        figures = np.array([wanted, error.mean, error.p99, error.max])
        return {**pack([mesh]), "part": part, "figures": figures}

    record = recall("decimate", [*meshes, name, repr((ratio, config))], make)
    mesh, (wanted, *error) = unpack(record)[0], record["figures"].tolist()
    return mesh, number[record["part"]], Reduction(name, len(owner), len(mesh.faces), round(wanted), *error)


def _fewer(
    whole: Mesh, owner: np.ndarray, ratio: float, config: DecimateConfig
) -> tuple[Mesh, np.ndarray, int, Deviation]:
    """Return a mesh with fewer faces, the owner of each, how many were requested, and how far off its surface is.

    The mesh stays as it is where so few faces are asked for that nothing would be left of it.
    """
    if config.mode == "none" or not whole.face_areas.sum() > 0:
        return whole, owner, len(whole.faces), Deviation(0.0, 0.0, 0.0)
    tree = ray_mesh(whole.vertices, whole.faces)
    if config.mode == "error":
        fewer, error = decimate_within(whole, tree, config)
        wanted = len(fewer.faces)
    else:
        fewer, wanted = decimate(whole, ratio, config.aggressiveness), round(ratio * len(whole.faces))
        error = deviation(whole, fewer, config.samples, tree=tree)
    if len(fewer.faces) == len(whole.faces) or not fewer.face_areas.any():
        return whole, owner, wanted, Deviation(0.0, 0.0, 0.0)
    colored = Mesh(fewer.vertices, fewer.faces, _nearest_colors(whole, tree, fewer.vertices))
    return colored, owner[nearest_faces(tree, centroids(fewer))[0]], wanted, error


def _collapse(mesh: Mesh, target: int, aggressiveness: float) -> Mesh:
    """Return a mesh whose edges were collapsed down to `target` faces, if the error that the effort allows suffices.

    pyfqmr either freezes open borders, which costs a scan full of holes most of its faces, or lets them shrink for nothing.
    Hence the boundary constraints of Garland and Heckbert (Surface simplification using quadric error metrics, 1997, sec.
    6): fins upright on the border, whose planes its vertices remember. Collapsing a fin is free, so they go first.
    """
    tips, fins = _fins(mesh)
    vertices = np.concatenate([mesh.vertices.astype(np.float64), tips])
    simplify = pyfqmr.Simplify()
    simplify.setMesh(vertices, np.concatenate([fins, mesh.faces]).astype(np.int32))
    simplify.simplify_mesh(target_count=target, aggressiveness=aggressiveness, preserve_border=False, verbose=False)
    vertices, faces, _ = simplify.getMesh()
    left = cKDTree(tips).query(vertices, distance_upper_bound=1e-9)[0] == 0.0
    return keep(Mesh(vertices, faces), ~left[faces].any(axis=1))


def _fins(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return a triangle upright on each open edge: tips [m], shape [fin 3], that follow the mesh's vertices, and faces."""
    starts, ends = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    edge = np.minimum(starts, ends).astype(np.int64) * len(mesh.vertices) + np.maximum(starts, ends)
    order = np.argsort(edge)  # a third of the time of np.unique
    differs = np.diff(edge[order], prepend=-1, append=-1) != 0
    single = order[differs[:-1] & differs[1:]]
    upward = normals(Mesh(mesh.vertices, mesh.faces[single // 3]))
    single, upward = single[upward.any(axis=1)], upward[upward.any(axis=1)]
    start, end = starts[single], ends[single]
    along = mesh.vertices[end].astype(np.float64) - mesh.vertices[start]
    tips = mesh.vertices[start] + FIN * np.linalg.norm(along, axis=1, keepdims=True) * upward
    return tips, np.stack([len(mesh.vertices) + np.arange(len(tips)), start, end], axis=1)


def _nearest_colors(mesh: Mesh, tree: RayMesh, vertices: np.ndarray) -> np.ndarray | None:
    """Return the colour of the nearest face's corner for each vertex [vertex 3]."""
    if mesh.colors is None:
        return None
    corners = mesh.faces[nearest_faces(tree, vertices)[0]]
    distance = np.linalg.norm(mesh.vertices[corners] - vertices[:, None], axis=2)
    return mesh.colors[corners[np.arange(len(corners)), distance.argmin(axis=1)]]
