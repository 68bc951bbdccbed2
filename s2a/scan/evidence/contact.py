"""Annotated faces against the surface: parts that touch nothing, faces that two unrelated parts list, grasp regions."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import QhullError

from s2a.core.check import Check, at_least, at_most
from s2a.scan.evidence import Bounds
from s2a.scan.evidence.front import Front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scan.formats.articulate3d import Overlap
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.geometry.planes import min_area_rectangle
from s2a.scene.scene import Mesh, Scene


def floating(surface: ScanSurface, bounds: Bounds) -> list[Check]:
    """Judge every part that shares no vertex with another by its distance from the rest of the scan; only failures are kept."""
    scene = surface.scene
    alone = [part for part in isolated(surface) if len(scene.parts[part].mesh.faces)]
    checks = []
    for part in alone:
        gap = gap_to_rest(surface, part)
        if bounds.contact < gap < np.inf:  # a scan of one part has nothing that could carry it
            message = f"it floats: the nearest other surface is {1000 * gap:.0f} mm off"
            remedy = f"possible: up to {1000 * bounds.contact:.0f} mm; annotate what carries it, or scan that"
            checks.append(Check("floats", "warn", gap, bounds.contact, "m", part=part, message=message, remedy=remedy))
    return checks


def shared_faces(overlaps: Sequence[Overlap], bounds: Bounds) -> list[Check]:
    """Judge the faces that two unrelated parts list; one of both is wrong, and the deeper part gets them."""
    remedy = f"possible: up to {bounds.overlap:.0%}; remove them from the part to which they do not belong"
    row = Check("shared_faces", "warn", bound=bounds.overlap, unit="of the faces", remedy=remedy)
    checks = []
    for overlap in (each for each in overlaps if each.fraction > bounds.overlap):
        first, second = overlap.parts
        message = f"{overlap.faces} of its faces, {overlap.fraction:.0%}, are listed by {second} too"
        checks.append(replace(row, value=overlap.fraction, part=first, message=message))
    return checks


def isolated(surface: ScanSurface) -> list[str]:
    """Return the ids of the parts that share no vertex with another, bit for bit: those not cut out of one surface."""
    # The bits of x and y as one integer are sorted fast, and few vertices have both in common; adding 0 makes -0 the same as 0.
    bits = (surface.mesh.vertices + np.float32(0.0)).view(np.uint32)
    plane = bits[:, 0].astype(np.uint64) << np.uint64(32) | bits[:, 1]
    order = np.argsort(plane)
    same = np.flatnonzero(plane[order[1:]] == plane[order[:-1]])
    few = np.unique(order[np.concatenate([same, same + 1])])
    counts = [len(surface.scene.parts[i].mesh.vertices) for i in surface.ids]
    part = np.repeat(np.arange(len(counts), dtype=np.int32), counts)[few]
    rows = np.lexsort((part, bits[few, 2], plane[few]))
    few, part = few[rows], part[rows]
    touching = (plane[few[1:]] == plane[few[:-1]]) & (bits[few[1:], 2] == bits[few[:-1], 2]) & (part[1:] != part[:-1])
    shared = np.zeros(len(counts), bool)
    shared[part[1:][touching]] = shared[part[:-1][touching]] = True
    return [name for name, touches in zip(surface.ids, shared, strict=True) if not touches]


def gap_to_rest(surface: ScanSurface, part: str) -> float:
    """Return the distance of a part from every other surface [m]; infinity where there is none."""
    faces = surface.mesh.faces[surface.owner != surface.ids.index(part)]
    if not len(faces):
        return float("inf")
    points = surface.scene.parts[part].mesh.vertices
    return float(nearest_faces(ray_mesh(surface.mesh.vertices, faces), points)[1].min())


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


def grasp_on_region(part: str, scene: Scene, bounds: Bounds) -> Check:
    """Judge a grasp point by its distance from the scanned surface: that of a ring lies in its empty middle."""
    gap, regions = grasp_gap(scene, part), scene.handle_parts(part)
    where = f"between {' and '.join(regions)}" if len(regions) > 1 else "in the air: has it a hole, or is it a ring?"
    message = f"its grasp point lies {1000 * gap:.0f} mm off the surface of its region, {where}"
    remedy = f"possible: up to {1000 * bounds.grasp_gap:.0f} mm; annotate only the faces to grasp, of one handle"
    return at_most(
        "grasp_on_region", gap, bounds.grasp_gap, "m", part=part, message=message, remedy=remedy, otherwise="warn"
    )


def handle_relief(part: str, scene: Scene, front: Front, bounds: Bounds) -> Check:
    """Judge whether a handle stands out: one in the colours alone cannot be held."""
    height = relief(region(scene, part), front)
    message = f"its handle stands out by {1000 * height:.0f} mm: it is in the colours only, and cannot be held"
    remedy = f"possible: from {1000 * bounds.relief:.0f} mm; scan it closer, or model it into the mesh"
    return at_least(
        "handle_relief", height, bounds.relief, "m", part=part, message=message, remedy=remedy, otherwise="warn"
    )


def handle_on_part(part: str, scene: Scene, bounds: Bounds) -> Check:
    """Judge whether a handle sits on the part that it is annotated to move."""
    gap = handle_gap(scene, part)
    if not gap >= 0:
        return Check("handle_on_part", "skipped", part=part, message="it has no surface besides its handle")
    message = f"its handle lies {1000 * gap:.0f} mm off its surface"
    remedy = (
        f"possible: up to {1000 * bounds.handle_gap:.0f} mm; is it another part's? check the index paths of the labels"
    )
    return at_most("handle_on_part", gap, bounds.handle_gap, "m", part=part, message=message, remedy=remedy)
