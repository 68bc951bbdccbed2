"""Parts that touch nothing, and faces that two unrelated parts list."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding
from s2a.scan.evidence.surface import ScanSurface
from s2a.scan.overlaps import Overlap
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh


def floating(surface: ScanSurface, bounds: Bounds) -> list[Finding]:
    """Judge every part that shares no vertex with another by its distance from the rest of the scan; only failures are kept."""
    scene = surface.scene
    alone = [part for part in isolated(surface) if len(scene.parts[part].mesh.faces)]
    found = []
    for part in alone:
        gap = gap_to_rest(surface, part)
        if gap > bounds.contact:
            message = f"it floats: the nearest other surface is {1000 * gap:.0f} mm off"
            remedy = f"possible: up to {1000 * bounds.contact:.0f} mm; annotate what carries it, or scan that"
            found.append(Finding("floats", part, "warn", gap, bounds.contact, "m", message, remedy))
    return found


def shared_faces(overlaps: Sequence[Overlap], bounds: Bounds) -> list[Finding]:
    """Judge the faces that two unrelated parts list; one of both is wrong, and the deeper part gets them."""
    found = []
    for overlap in overlaps:
        if overlap.fraction > bounds.overlap:
            first, second = overlap.parts
            message = f"{overlap.faces} of its faces, {overlap.fraction:.0%}, are listed by {second} too"
            remedy = f"possible: up to {bounds.overlap:.0%}; remove them from the part to which they do not belong"
            found.append(
                Finding(
                    "shared_faces", first, "warn", overlap.fraction, bounds.overlap, "of the faces", message, remedy
                )
            )
    return found


def isolated(surface: ScanSurface) -> list[str]:
    """Return the ids of the parts that share no vertex with another, bit for bit: those not cut out of one surface."""
    vertices = surface.mesh.vertices + np.float32(0.0)
    keys = np.ascontiguousarray(vertices).view([("", np.float32)] * 3).ravel()
    counts = [len(surface.scene.parts[i].mesh.vertices) for i in surface.ids]
    part = np.repeat(np.arange(len(counts)), counts)
    _, place = np.unique(keys, return_inverse=True)
    first = np.full(place.max(initial=0) + 1, len(counts))
    last = np.full(len(first), -1)
    np.minimum.at(first, place, part)
    np.maximum.at(last, place, part)
    shared = np.zeros(len(counts), bool)
    shared[part[(first != last)[place]]] = True
    return [name for name, touches in zip(surface.ids, shared, strict=True) if not touches]


def gap_to_rest(surface: ScanSurface, part: str) -> float:
    """Return the distance of a part from every other surface [m]; infinity where there is none."""
    faces = surface.mesh.faces[surface.owner != surface.ids.index(part)]
    if not len(faces):
        return float("inf")
    points = surface.scene.parts[part].mesh.vertices
    return float(nearest_faces(ray_mesh(surface.mesh.vertices, faces), points)[1].min())
