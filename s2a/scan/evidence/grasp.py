"""Grasp regions: is the grasp point on the surface, does the region stand out, does it belong to its part."""

from __future__ import annotations

import numpy as np
from scipy.spatial import QhullError

from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding, bounded_above, bounded_below, unknown
from s2a.scan.evidence.front import Front
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.geometry.planes import min_area_rectangle
from s2a.scene.scene import Mesh, Scene


def region(scene: Scene, part: str) -> Mesh:
    """Return the surface of a moving part's handle; of the part itself where it has none."""
    meshes = [scene.parts[i].mesh for i in scene.handle_parts(part)]
    return merge([Mesh(mesh.vertices, mesh.faces) for mesh in meshes])


def has_handle(scene: Scene, part: str) -> bool:
    """Return True for a moving part with a grasp region apart from itself that has a surface."""
    return part not in scene.grasp_parts(part) and bool(region(scene, part).face_areas.sum() > 0)


def size(mesh: Mesh, front: Front) -> np.ndarray:
    """Return the extents of a grasp region in its front's plane, length and width, and along its normal [m], shape [3]."""
    points = mesh.vertices.astype(np.float64)
    flat = points @ front.axes
    try:
        in_plane = np.ptp(flat @ min_area_rectangle(flat), axis=0)
    except QhullError:  # points on one line
        in_plane = np.ptp(flat, axis=0)
    return np.array([*np.sort(in_plane)[::-1], np.ptp(points @ front.normal)])


def grasp_gap(scene: Scene, part: str) -> float:
    """Return the distance of a part's grasp point, the mean of its region, from the region's surface [m]."""
    mesh = region(scene, part)
    point = scene.grasp_point(part)[None]
    return float(nearest_faces(ray_mesh(mesh.vertices, mesh.faces), point)[1][0])


def relief(mesh: Mesh, front: Front) -> float:
    """Return how far a region stands out over its front or lies under it, or beyond its outline [m]: the 95th percentile.

    Recessed pulls lie under the front, grip ledges beyond its edge.
    """
    points = mesh.vertices.astype(np.float64)
    height = np.abs(points @ front.normal - front.offset)
    flat = points @ front.axes
    beyond = np.maximum(front.low - flat, flat - front.high).max(axis=1)
    return float(np.quantile(np.maximum(height, beyond), 0.95))


def handle_gap(scene: Scene, part: str) -> float:
    """Return the distance between the surfaces of a part and of its grasp region [m]."""
    held = set(scene.grasp_parts(part))
    rest = [scene.parts[i].mesh for i in scene.members(part) if i not in held]
    own = merge([Mesh(mesh.vertices, mesh.faces) for mesh in rest])
    if not len(own.faces):
        return float("nan")
    return float(nearest_faces(ray_mesh(own.vertices, own.faces), region(scene, part).vertices)[1].min())


def grasp_on_region(part: str, scene: Scene, bounds: Bounds) -> Finding:
    """Judge a grasp point by its distance from the scanned surface: that of a ring lies in its empty middle."""
    gap, regions = grasp_gap(scene, part), scene.handle_parts(part)
    where = f"between {' and '.join(regions)}" if len(regions) > 1 else "in the air: has it a hole, or is it a ring?"
    message = f"its grasp point lies {1000 * gap:.0f} mm off the surface of its region, {where}"
    remedy = f"possible: up to {1000 * bounds.grasp_gap:.0f} mm; annotate only the faces to grasp, of one handle"
    return bounded_above("grasp_on_region", part, gap, bounds.grasp_gap, "m", message, remedy, "warn")


def handle_relief(part: str, scene: Scene, front: Front, bounds: Bounds) -> Finding:
    """Judge whether a handle stands out: one in the colours alone cannot be held."""
    height = relief(region(scene, part), front)
    message = f"its handle stands out by {1000 * height:.0f} mm: it is in the colours only, and cannot be held"
    remedy = f"possible: from {1000 * bounds.relief:.0f} mm; scan it closer, or model it into the mesh"
    return bounded_below("handle_relief", part, height, bounds.relief, "m", message, remedy, "warn")


def handle_on_part(part: str, scene: Scene, bounds: Bounds) -> Finding:
    """Judge whether a handle sits on the part that it is annotated to move."""
    gap = handle_gap(scene, part)
    if not gap >= 0:
        return unknown("handle_on_part", part, "it has no surface besides its handle")
    message = f"its handle lies {1000 * gap:.0f} mm off its surface"
    remedy = (
        f"possible: up to {1000 * bounds.handle_gap:.0f} mm; is it another part's? check the index paths of the labels"
    )
    return bounded_above("handle_on_part", part, gap, bounds.handle_gap, "m", message, remedy)
