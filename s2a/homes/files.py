"""The files of a scan: ScanNet++'s mesh and segments, Articulate3D's parts and articulations."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from s2a.homes.catalog import Entry
from s2a.scan.ply_writer import write_ply as write_ply
from s2a.scene.scene import Joint, Mesh

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
"""Articulate3D's semantic group of a part by its name; everything else is "others"."""


def write_json(path: Path, content: Any) -> None:
    """Write compact JSON; Python's floats keep every digit."""
    path.write_text(json.dumps(content, separators=(",", ":")), encoding="utf-8")


def parts_record(name: str, mesh: Mesh, numbers: np.ndarray, entries: list[Entry]) -> dict[str, Any]:
    """Return Articulate3D's segmentation: the faces and vertices of each part of articulated objects.

    Args:
        name: the scan's name.
        mesh: the scan.
        numbers: the part of each face, shape [face].
        entries: all parts of the room.
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
    """Return the record of one part, whose surface is the given faces."""
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
    """Return Articulate3D's articulations: radians and metres, relative to the scanned pose.

    Args:
        name: the scan's name.
        entries: all parts of the room.
        joints: the annotated joints by part number.
    """
    annotated = [entry for entry in entries if entry.articulated]
    parts = [
        {"pid": entry.number, "label": entry.label, "group": GROUPS.get(entry.piece.name, "others")}
        for entry in annotated
    ]
    articulations = [_articulation(entry, joints[entry.number]) for entry in annotated if entry.number in joints]
    return {"modelId": f"virtual.{name}", "data": {"parts": parts, "articulations": articulations}}


def _articulation(entry: Entry, joint: Joint) -> dict[str, Any]:
    """Return the record of one joint."""
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
