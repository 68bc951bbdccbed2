"""A mesh as binary glTF 2.0, small enough to travel: fewer faces, positions in 16 bits."""

from dataclasses import replace
from typing import Any

import numpy as np

from s2a.core.color_space import to_linear
from s2a.scan.gltf_file import UNSIGNED_INT, UNSIGNED_SHORT, packed
from s2a.scene.geometry.mesh_ops import vertex_normals
from s2a.scene.scene import Mesh
from s2a.view.page.room import PagePart, PageRoom

MOVING = 0.5  # Fraction of the faces that jointed parts may have between them, before they lose any
# Bounds of the cells [m] and of their scale [m^0.5]: where the search for it begins and gives up
MIN_CELL, MAX_SCALE = 1e-4, 1e3
STEP = 1.05  # Factor by which cells grow from round to round at least


def thinned(room: PageRoom, max_faces: int) -> PageRoom:
    """Return a room whose surfaces have so many faces at most; those that move keep theirs as long as they can."""
    moving = {i: part for i, part in room.parts.items() if part.mover is not None}
    still = {i: part for i, part in room.parts.items() if part.mover is None}
    if _count(moving) + _count(still) <= max_faces:
        return room
    moving = _fewer(moving, max(int(MOVING * max_faces), max_faces - _count(still)))
    still = _fewer(still, max_faces - _count(moving))
    return replace(room, parts={i: moving.get(i) or still[i] for i in room.parts})


def clustered(mesh: Mesh, cell: float) -> Mesh:
    """Return a mesh whose vertices are the mean of those in each cell of a grid [m], with their mean colour."""
    if not len(mesh.vertices):
        return mesh
    index = np.floor((mesh.vertices - mesh.bounds[0]) / cell).astype(np.int64)
    width = index.max(axis=0) + 1
    keys = (index[:, 0] * width[1] + index[:, 1]) * width[2] + index[:, 2]
    _, owner, size = np.unique(keys, return_inverse=True, return_counts=True)
    faces = owner[mesh.faces]
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    colors = None if mesh.colors is None else np.rint(_means(mesh.colors, owner, size))
    return Mesh(_means(mesh.vertices, owner, size), faces, colors)


def _means(values: np.ndarray, owner: np.ndarray, size: np.ndarray) -> np.ndarray:
    return np.stack([np.bincount(owner, column, len(size)) for column in values.T], axis=1) / size[:, None]


def _fewer(parts: dict[str, PagePart], max_faces: int) -> dict[str, PagePart]:
    """Return parts with so many faces at most; a cell grows with the root of its part's size, so that small things last."""
    seen = {i: part.surface for i, part in parts.items() if len(part.surface.faces)}
    roots = {i: float(np.linalg.norm(np.ptp(mesh.bounds, axis=0))) ** 0.5 for i, mesh in seen.items()}
    count, coarse = _count(parts), parts
    scale = np.sqrt(
        sum(mesh.face_areas.sum() / max(roots[i], 1e-6) ** 2 for i, mesh in seen.items()) / max(max_faces, 1)
    )
    while count > max_faces:
        meshes = {i: clustered(mesh, max(scale * roots[i], MIN_CELL)) for i, mesh in seen.items()}
        coarse = {i: replace(part, surface=meshes.get(i, part.surface)) for i, part in parts.items()}
        count = _count(coarse)
        scale = max(scale, MIN_CELL) * max(np.sqrt(count / max(max_faces, 1)), STEP)
        if not count or scale > MAX_SCALE:
            break
    return coarse


def _count(parts: dict[str, PagePart]) -> int:
    return sum(len(part.surface.faces) for part in parts.values())


# Intensity of the light from everywhere: the scan's colours hold its light already, so that it is most of the light
AMBIENT = 2.2
# Name, intensity and place of the other lights, which are far away
LIGHTS = (("above", 1.3, (1.0, 2.0, 4.0)), ("aside", 0.6, (-3.0, -1.0, 1.0)))
BRIGHTEST = (AMBIENT + sum(intensity for _, intensity, _ in LIGHTS)) / np.pi  # What no surface exceeds


def brightness(mesh: Mesh) -> np.ndarray:
    """Return the fraction of its own linear colour with which each vertex reflects the page's light, shape [vertex].

    A diffuse surface (Lambert) reflects light of intensity 1 with its colour over pi, as three.js reckons.
    """
    normals = vertex_normals(mesh.vertices, mesh.faces)
    total = np.full(len(normals), AMBIENT)
    for _, intensity, place in LIGHTS:
        total += intensity * np.maximum(normals @ (np.array(place) / np.linalg.norm(place)), 0.0)
    return total / np.pi


MAX_SHORT = 65535
MIN_EXTENT = 1e-6  # [m] A flat mesh's extent across itself is taken for this: a scale of zero has no inverse
UNLIT = "KHR_materials_unlit"
# Linear RGB: what leaves the colours of vertices as they are, and the colour of surfaces without one
WHITE, PLAIN = (1.0, 1.0, 1.0), (0.5, 0.5, 0.5)

Color = tuple[float, float, float]


def encode(
    mesh: Mesh, color: Color | None = None, opacity: float = 1.0, both_sides: bool = False, baked: bool = False
) -> bytes:
    """Return a mesh as the bytes of a .glb file.

    Args:
        mesh: with a face at least, in any frame [m].
        color: linear RGB of the whole mesh, 0 to 1; None: its vertices' colours, or else PLAIN.
        opacity: 1 for opaque.
        both_sides: Show faces from behind, too.
        baked: Hold the page's light in the colours of the vertices, so that pixels are not shaded; without `color`.
    """
    low, extent = mesh.bounds[0], np.maximum(np.ptp(mesh.bounds, axis=0), MIN_EXTENT)
    points = np.zeros((len(mesh.vertices), 4), np.uint16)  # the fourth aligns them
    points[:, :3] = np.rint((mesh.vertices - low) / extent * MAX_SHORT)
    short = len(mesh.vertices) <= MAX_SHORT
    indices = mesh.faces.astype(np.uint16 if short else np.uint32).ravel()
    vectors = {"componentType": UNSIGNED_SHORT, "type": "VEC3", "normalized": True}
    arrays: list[tuple[np.ndarray, dict[str, Any] | None]] = [
        (indices, {"componentType": UNSIGNED_SHORT if short else UNSIGNED_INT, "type": "SCALAR"}),
        (points, vectors | {"min": points[:, :3].min(axis=0).tolist(), "max": points[:, :3].max(axis=0).tolist()}),
    ]
    attributes = {"POSITION": 1}
    if baked or (color is None and mesh.colors is not None):
        arrays.append((_linear(mesh, brightness(mesh) / BRIGHTEST if baked else 1.0), vectors))
        attributes["COLOR_0"] = 2
    plain = WHITE if "COLOR_0" in attributes else PLAIN
    material = _material(color or plain, opacity, both_sides)
    if baked:
        material["pbrMetallicRoughness"]["baseColorFactor"] = [*3 * (BRIGHTEST,), opacity]
        material["extensions"] = {UNLIT: {}}
    document = {
        "extensionsUsed": ["KHR_mesh_quantization", *[UNLIT] * baked],
        "extensionsRequired": ["KHR_mesh_quantization"],
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "translation": low.tolist(), "scale": extent.tolist()}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 0, "material": 0}]}],
        "materials": [material],
    }
    return packed(document, arrays)


def _material(color: Color, opacity: float, both_sides: bool) -> dict[str, Any]:
    surface = {"baseColorFactor": [*color, opacity], "metallicFactor": 0.0, "roughnessFactor": 1.0}
    mode = "BLEND" if opacity < 1.0 else "OPAQUE"
    return {"pbrMetallicRoughness": surface, "alphaMode": mode, "doubleSided": both_sides}


def _linear(mesh: Mesh, level: np.ndarray | float) -> np.ndarray:
    """Return the sRGB colours of vertices as glTF wants them: linear, 16 bits, shape [vertex 4], the fourth being opacity.

    `level`: fraction of its colour that each vertex has, shape [vertex].
    """
    table = to_linear(np.arange(256, dtype=np.uint8)).astype(np.float64)
    colors = np.tile(PLAIN, (len(mesh.vertices), 1)) if mesh.colors is None else table[mesh.colors]
    # The 256 steps of sRGB again: the eye sees no more, and a file of them packs smaller.
    colors = table[np.searchsorted((table[1:] + table[:-1]) / 2, colors * np.reshape(level, (-1, 1)))]
    linear = np.full((len(colors), 4), MAX_SHORT, np.uint16)
    linear[:, :3] = np.rint(MAX_SHORT * colors)
    return linear
