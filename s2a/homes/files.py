"""Files of a scan: ScanNet++'s mesh and segments, Articulate3D's parts and articulations, a phone's textured GLB.

The GLB (glTF 2.0, Khronos Group) has y up and an image in which two triangles share a square, a texel apart.
"""

import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.spatial import ConvexHull, QhullError

from s2a.homes.room import Entry
from s2a.scan.gltf_file import FLOAT, UNSIGNED_INT, packed
from s2a.scene.scene import Joint, Mesh

# Articulate3D's semantic group of a part by its name; everything else is "others"
GROUPS = {
    "drawer": "drawers",
    "door": "doors/windows",
    "window": "doors/windows",
    "sliding door": "doors/windows",
    "lid": "lids",
    "handle": "handles movable",
    "handle base": "handles movable",
    "knob": "handles movable",
}


def write_json(path: Path, content: Any) -> None:
    """Write compact JSON; Python's floats keep every digit."""
    path.write_text(json.dumps(content, separators=(",", ":")), encoding="utf-8")


def parts_record(name: str, mesh: Mesh, numbers: np.ndarray, entries: list[Entry]) -> dict[str, Any]:
    """Return Articulate3D's segmentation: the faces and vertices of each part of articulated objects.

    `numbers`: the part of each face, shape [face].
    """
    annotated = [entry for entry in entries if entry.articulated]
    area = mesh.face_areas
    mine = np.isin(numbers, [entry.number for entry in annotated])
    stats = {
        "annotatedFaces": int(mine.sum()),
        "unannotatedFaces": int((~mine).sum()),
        "totalFaces": len(mesh.faces),
        "annotatedFaceArea": float(area[mine].sum()),
        "unannotatedFaceArea": float(area[~mine].sum()),
        "totalFaceArea": float(area.sum()),
        "percentComplete": 100.0 * float(mine.mean()),
        "totalVertices": len(mesh.vertices),
    }
    annotations = [_annotation(entry, mesh, np.flatnonzero(numbers == entry.number)) for entry in annotated]
    labels = [entry.label for entry in annotated]
    return {"modelId": f"virtual.{name}", "labels": labels, "data": {"stats": stats, "annotations": annotations}}


def _annotation(entry: Entry, mesh: Mesh, faces: np.ndarray) -> dict[str, Any]:
    vertices = np.unique(mesh.faces[faces])
    return {
        "partId": entry.number,
        "objectId": entry.number,
        "label": entry.label,
        "obb": box_record(mesh.vertices[vertices]),
        "dominantNormal": dominant_normal(mesh, faces),
        "triIndices": faces.tolist(),
        "vertIndices": vertices.tolist(),
    }


def dominant_normal(mesh: Mesh, faces: np.ndarray) -> list[float]:
    """Return the area-weighted mean normal of some faces, a unit vector; z where there is none."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces[faces]].astype(np.float64), 1, 0)
    total = np.cross(b - a, c - a).sum(axis=0)
    length = np.linalg.norm(total)
    return (total / length).tolist() if length > 0 else [0.0, 0.0, 1.0]


def box_record(points: np.ndarray) -> dict[str, Any]:
    """Return the smallest upright box around points [m], shape [point 3], with its axes column by column."""
    points = points.astype(np.float64) if len(points) else np.zeros((1, 3))
    axes = np.array([[*_footprint(points[:, :2]), 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    axes[1] = np.cross(axes[2], axes[0])
    along = points @ axes.T
    low, high = along.min(axis=0), along.max(axis=0)
    return {
        "centroid": ((low + high) / 2 @ axes).tolist(),
        "axesLengths": (high - low).tolist(),
        "normalizedAxes": axes.ravel().tolist(),
        "min": points.min(axis=0).tolist(),
        "max": points.max(axis=0).tolist(),
    }


def _footprint(points: np.ndarray) -> np.ndarray:
    """Return the direction of the smallest rectangle around points in the plane, shape [2]."""
    try:
        hull = points[ConvexHull(points).vertices]
    except (QhullError, ValueError):
        return np.array([1.0, 0.0])
    edges = np.roll(hull, -1, axis=0) - hull
    edges /= np.linalg.norm(edges, axis=1)[:, None]
    along = hull @ edges.T
    across = hull @ np.stack([-edges[:, 1], edges[:, 0]])
    return edges[np.argmin(np.ptp(along, axis=0) * np.ptp(across, axis=0))]


def artic_record(name: str, entries: list[Entry], joints: dict[int, Joint]) -> dict[str, Any]:
    """Return Articulate3D's articulations: radians and metres, relative to the scanned pose."""
    annotated = [entry for entry in entries if entry.articulated]
    parts = [
        {"pid": entry.number, "label": entry.label, "group": GROUPS.get(entry.piece.name, "others")}
        for entry in annotated
    ]
    articulations = [_articulation(entry, joints[entry.number]) for entry in annotated if entry.number in joints]
    return {"modelId": f"virtual.{name}", "data": {"parts": parts, "articulations": articulations}}


def _articulation(entry: Entry, joint: Joint) -> dict[str, Any]:
    record: dict[str, Any] = {
        "pid": entry.number,
        "type": "rotation" if joint.kind == "revolute" else "translation",
        "origin": list(joint.origin),
        "axis": list(joint.axis),
        "base": [entry.parent] if entry.parent is not None else [],
        "rangeMin": joint.limits[0],
        "rangeMax": joint.limits[1],
        "motionStates": {"closed": {"percent": 0.0, "value": 0.0}},
    }
    if joint.kind == "revolute":
        sideways = np.cross(joint.axis, (1.0, 0.0, 0.0) if abs(joint.axis[0]) < 0.9 else (0.0, 1.0, 0.0))
        record["ref"] = (sideways / np.linalg.norm(sideways)).tolist()
    return record


def segment_groups(name: str, mesh: Mesh, numbers: np.ndarray, entries: list[Entry]) -> dict[str, Any]:
    """Return ScanNet++'s objects: those without moving parts under their own number, then the articulated ones as wholes.

    Args:
        name: the scan's name.
        mesh: the scan; each vertex is its own segment.
        numbers: the part of each face, shape [face].
        entries: all parts of the room.
    """
    plain = [(entry.number, entry, [entry.number]) for entry in entries if not entry.articulated]
    roots = [entry for entry in entries if entry.articulated and entry.parent is None]
    wholes = [(len(entries) + i, root, _family(root, entries)) for i, root in enumerate(roots, start=1)]
    groups = []
    for number, entry, members in plain + wholes:
        faces = np.flatnonzero(np.isin(numbers, members))
        vertices = np.unique(mesh.faces[faces])
        groups.append(
            {
                "id": number,
                "objectId": number,
                "label": entry.piece.name,
                "segments": vertices.tolist(),
                "obb": box_record(mesh.vertices[vertices]),
                "dominantNormal": dominant_normal(mesh, faces),
            }
        )
    return {"sceneId": name, "segGroups": groups}


def _family(root: Entry, entries: list[Entry]) -> list[int]:
    """Return the numbers of an object and all its parts; parents come before children in the list of entries."""
    family = {root.number}
    for entry in entries:
        if entry.parent in family:
            family.add(entry.number)
    return sorted(family)


TEXELS = 6  # Along each side of the square of two triangles
# Rotation from z up to y up: (x, y, z) becomes (x, z, -y)
Y_UP = np.array(((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0)))
# Returns the colours [point 3] of points [point 3] with normals [point 3]
Paint = Callable[[np.ndarray, np.ndarray], np.ndarray]


def write(path: Path, vertices: np.ndarray, faces: np.ndarray, paint: Paint) -> None:
    """Write a mesh with a texture.

    Args:
        path: of the file.
        vertices: z up [m], shape [vertex 3].
        faces: vertex indices, shape [face 3].
        paint: colours of points on it.
    """
    across = int(np.ceil(np.sqrt(np.ceil(len(faces) / 2))))
    image = _texture(vertices[faces].astype(np.float64), across, paint)
    corners = (vertices[faces].reshape(-1, 3) @ Y_UP.T).astype("<f4")
    coordinates = _coordinates(len(faces), across).astype("<f4")
    indices = np.arange(len(corners), dtype="<u4")
    file = io.BytesIO()
    Image.fromarray(image).save(file, format="PNG")
    material = {"baseColorTexture": {"index": 0}, "metallicFactor": 0.0, "roughnessFactor": 1.0}
    attributes = {"POSITION": 0, "TEXCOORD_0": 1}
    document = {
        "asset": {"version": "2.0", "generator": "s2a sample"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "scan"}],
        "meshes": [{"primitives": [{"attributes": attributes, "indices": 2, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": material, "doubleSided": True}],  # as dull as paint, from both sides
        "textures": [{"source": 0}],
        "images": [{"bufferView": 3, "mimeType": "image/png"}],
    }
    low, high = corners.min(axis=0).tolist(), corners.max(axis=0).tolist()
    arrays: list[tuple[np.ndarray, dict[str, Any] | None]] = [
        (corners, {"componentType": FLOAT, "type": "VEC3", "min": low, "max": high}),
        (coordinates, {"componentType": FLOAT, "type": "VEC2"}),
        (indices, {"componentType": UNSIGNED_INT, "type": "SCALAR"}),
        (np.frombuffer(file.getvalue(), np.uint8), None),
    ]
    path.write_bytes(packed(document, arrays))


def _squares(count: int, across: int) -> np.ndarray:
    """Return column and row of each triangle's square, shape [face 2]."""
    square = np.arange(count) // 2
    return np.stack([square % across, square // across], axis=1)


def _coordinates(count: int, across: int) -> np.ndarray:
    """Return texture coordinates of all triangles' corners, in the middle of texels, shape [3 face 2]."""
    low, high = 0.5 / TEXELS, 1.0 - 0.5 / TEXELS
    gap = 1.0 / TEXELS
    first = np.array([(low, low), (high - gap, low), (low, high - gap)])
    second = np.array([(high, high), (low + gap, high), (high, low + gap)])
    corners = np.where((np.arange(count) % 2 == 0)[:, None, None], first, second)
    return ((_squares(count, across)[:, None] + corners) / across).reshape(-1, 2)


def _texture(triangles: np.ndarray, across: int, paint: Paint) -> np.ndarray:
    """Return the image, shape [row column 3], uint8."""
    count = len(triangles)
    size = across * TEXELS
    column, row = np.meshgrid(np.arange(TEXELS), np.arange(TEXELS))
    upper = (column + row > TEXELS - 1).ravel()
    span = TEXELS - 2
    u, v = column.ravel() / span, row.ravel() / span
    lower_uv = np.stack([u, v], axis=1)
    upper_uv = np.stack([(TEXELS - 1 - column.ravel()) / span, (TEXELS - 1 - row.ravel()) / span], axis=1)
    image = np.zeros((size, size, 3), np.uint8)
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-12)
    squares = _squares(count, across) * TEXELS
    for parity, mine, weights in ((0, ~upper, lower_uv), (1, upper, upper_uv)):
        some = np.arange(parity, count, 2)
        uv = weights[mine]
        a, b, c = np.moveaxis(triangles[some], 1, 0)
        points = a[:, None] + uv[None, :, :1] * (b - a)[:, None] + uv[None, :, 1:] * (c - a)[:, None]
        colors = paint(points.reshape(-1, 3), np.repeat(normals[some], len(uv), axis=0))
        x = squares[some, 0][:, None] + column.ravel()[mine]
        y = squares[some, 1][:, None] + row.ravel()[mine]
        image[y.ravel(), x.ravel()] = colors
    return image
