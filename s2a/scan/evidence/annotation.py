"""All checks of an annotated scan: up axis and unit of the room, shared faces, then each moving part and its handle."""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np
from scipy.spatial import QhullError

from s2a.core.check import Check, Status, at_least, at_most
from s2a.scan.evidence import Bounds
from s2a.scan.evidence import joint as motion
from s2a.scan.evidence.front import Front, front, panel
from s2a.scan.evidence.surface import ScanSurface, Sweep, sphere, sweep
from s2a.scan.formats.articulate3d import Overlap
from s2a.scene.geometry.mesh_ops import centroids, merge, normals
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.geometry.planes import min_area_rectangle
from s2a.scene.scene import Mesh, Scene

# Faces within 10 degrees of a direction look along it: rough faces of level surfaces do
LEVEL = np.cos(np.radians(10.0))
BORDER = 0.15  # [m] Surfaces this near to the lowest or the highest ones are floor or ceiling
UNITS = "scan_units"
FLOOR = re.compile(r"^\s*floor\s*$", re.IGNORECASE)
REMEDY = "possible: z up; turn mesh and joints together (x, y, z) -> (x, -z, y) for a scan with y up"


def room_checks(surface: ScanSurface, fronts: Mapping[str, Front | None], bounds: Bounds) -> list[Check]:
    """Return what the surface says about the whole room; `fronts` are those of its moving parts by id."""
    planes = {part: front for part, front in fronts.items() if front is not None}
    return [*up_axis(surface, bounds), units(surface, planes, bounds)]


def up_axis(surface: ScanSurface, bounds: Bounds) -> list[Check]:
    """Judge which way is up, by the floor where one is labelled, by all surfaces where none is."""
    floors = [p.mesh for p in surface.scene.parts.values() if FLOOR.match(p.label) and p.mesh.face_areas.sum() > 0]
    if floors:
        return [_labelled(floors, surface, bounds)]
    points, facing = surface.samples
    if not len(points):
        return [Check("up_axis", "skipped", message="there is no surface")]
    return [_level(facing, bounds), _underside(points, surface.winding * facing, bounds)]


def level_fraction(facing: np.ndarray, direction: np.ndarray) -> float:
    """Return the fraction of normals [point 3] that lie along a direction [3], either way."""
    return float((np.abs(facing @ direction) > LEVEL).mean())


def underside(points: np.ndarray, facing: np.ndarray) -> float:
    """Return the excess of what looks up over what looks down between floor and ceiling, of their sum, -1 to 1.

    Nobody scans the undersides of tables, shelves and seats; NaN where less than 2 % of the surface is between.
    """
    low, high = np.quantile(points[:, 2], [0.005, 0.995])
    between = (points[:, 2] > low + BORDER) & (points[:, 2] < high - BORDER)
    up, down = (float((between & (sign * facing[:, 2] > LEVEL)).mean()) for sign in (1, -1))
    return (up - down) / (up + down) if up + down > 0.02 else float("nan")


def _labelled(floors: list[Mesh], surface: ScanSurface, bounds: Bounds) -> Check:
    """Judge the up axis by the parts labelled floor: level, and with the room above them."""
    weight = np.concatenate([mesh.face_areas for mesh in floors])
    middle = np.concatenate([centroids(mesh) for mesh in floors])
    facing = np.concatenate([normals(mesh) for mesh in floors])
    spread = (facing * weight[:, None]).T @ facing
    normal = np.linalg.eigh(spread)[1][:, -1]
    points = surface.samples[0]
    height = float(np.average((middle @ normal), weights=weight))
    normal = normal if float(np.median(points @ normal)) > height else -normal
    slope = float(np.degrees(np.arccos(np.clip(normal[2], -1.0, 1.0))))
    text = ", ".join(f"{x:.2f}" for x in normal)
    message = f"the room lies over its floor along ({text}), {slope:.0f} deg off z"
    return at_most("up_axis", slope, bounds.slope, "deg", message=message, remedy=REMEDY)


def _level(facing: np.ndarray, bounds: Bounds) -> Check:
    """Judge the up axis by area: in most rooms more surface is level than looks along any other direction."""
    directions = sphere(1500)
    fractions = (np.abs(facing @ directions.T) > LEVEL).mean(axis=0)
    best = directions[np.argmax(fractions)]
    own, most = level_fraction(facing, np.array([0.0, 0.0, 1.0])), float(fractions.max())
    ratio = own / most if most > 0 else 0.0
    text = ", ".join(f"{x:.2f}" for x in best)
    message = f"{own:.0%} of its surface is horizontal, but {most:.0%} is perpendicular to ({text}): is that up?"
    return at_least("up_axis", ratio, bounds.level, "of the most", otherwise="warn", message=message, remedy=REMEDY)


def _underside(points: np.ndarray, facing: np.ndarray, bounds: Bounds) -> Check:
    """Judge the up axis by what looks up and down between floor and ceiling."""
    excess = underside(points, facing)
    if np.isnan(excess):
        return Check("up_side", "skipped", message="no horizontal surface is between floor and ceiling")
    message = f"between floor and ceiling {(1 + excess) / 2:.0%} of the horizontal surface faces +z, as tabletops do"
    good = excess >= bounds.underside
    status: Status = "pass" if good else "fail" if excess < -bounds.underside else "warn"
    return Check("up_side", status, excess, bounds.underside, message=message, remedy="" if good else REMEDY)


def units(surface: ScanSurface, fronts: dict[str, Front], bounds: Bounds) -> Check:
    """Judge the unit by three sizes that no room's style changes much.

    The height of the room, of the surfaces that objects stand on, and the thickness of handles, as far as there are any. One
    of them may be odd (a hall, a gallery, a wheel as a handle), two are not by chance.

    `fronts`: fronts of its moving parts by id; `bounds`: `heights`, `surfaces` and `handles`.
    """
    scene, heights = surface.scene, surface.samples[0][:, 2]  # not of vertices, which crowd where a texture was fine
    height = float(np.subtract(*np.quantile(heights, [0.995, 0.005]))) if len(heights) else 0.0
    handles = [(region(scene, part), one) for part, one in fronts.items() if has_handle(scene, part)]
    thickness = [np.sort(size(mesh, one))[1] for mesh, one in handles]
    thick = float(np.median(thickness)) if handles else float("nan")
    sizes = [
        (height, bounds.heights, f"the room is {height:.3g} m high"),
        (raised := _raised(surface), bounds.surfaces, f"objects stand {raised:.3g} m over its floor"),
        (thick, bounds.handles, f"its handles are {1000 * thick:.3g} mm thick"),
    ]
    measured = [(low <= size <= high, text) for size, (low, high), text in sizes if not np.isnan(size)]
    odd = sum(not fits for fits, _ in measured)
    message = ", ".join(text for _, text in measured)
    if not odd:
        return Check(UNITS, "pass", height, bounds.heights[1], "m", message=message)
    remedy = (
        f"possible: rooms {bounds.heights[0]:g} to {bounds.heights[1]:g} m high, surfaces at {bounds.surfaces[0]:g} to "
        f"{bounds.surfaces[1]:g} m, handles of {1000 * bounds.handles[0]:g} to {1000 * bounds.handles[1]:g} mm; scale mesh and "
        "joints to metres (feet x 0.3048, inches x 0.0254, cm x 0.01)"
    )
    status: Status = "fail" if odd >= min(2, len(measured)) else "warn"
    return Check(UNITS, status, height, bounds.heights[1], "m", message=message, remedy=remedy)


def _raised(surface: ScanSurface) -> float:
    """Return the median height over the floor of the surfaces between floor and ceiling that look up [m]; NaN without any."""
    points, facing = surface.samples
    if not len(points):
        return float("nan")
    low, high = np.quantile(points[:, 2], [0.005, 0.995])
    height = points[surface.winding * facing[:, 2] > LEVEL, 2] - low
    height = height[(height > BORDER) & (height < high - low - BORDER)]
    return float(np.median(height)) if len(height) > 0.01 * len(points) else float("nan")


def check(scene: Scene, bounds: Bounds, overlaps: Sequence[Overlap] = ()) -> list[Check]:
    """Return what the scanned surface says about an annotation: of the room first, then of each moving part.

    Args:
        scene: as read from a scan or a geometric stage: no surface trimmed.
        bounds: thresholds.
        overlaps: faces that two unrelated parts of the scan list, which a scene cannot tell (`read_overlaps`).

    Returns:
        Every answer, also those that pass; of parts that float and of shared faces the failures alone.
    """
    surface = ScanSurface(scene)
    fronts = {part: front(surface, part) for part in scene.movable}
    checks = [*room_checks(surface, fronts, bounds), *floating(surface, bounds)]
    checks += shared_faces(overlaps, bounds)
    for part, own in fronts.items():
        checks += moving_part(surface, part, own, bounds)
    return checks


def moving_part(surface: ScanSurface, part: str, front: Front | None, bounds: Bounds) -> Iterator[Check]:
    """Yield what the surface says about one moving part."""
    scene, joint = surface.scene, surface.scene.joint(part)
    if front is None:
        yield Check(
            "front", "skipped", part=part, message="it has no flat surface, so that its joint cannot be checked"
        )
        return
    points = panel(scene, part).vertices.astype(float)
    handle = has_handle(scene, part)
    yield motion.opens_outward(part, joint, front, bounds)
    yield motion.kind(part, scene.parts[part].label, joint, front, bounds)
    if joint.kind == "prismatic":
        yield motion.slide_axis(part, joint, front, bounds)
        yield motion.slide_level(part, scene.parts[part].label, joint, bounds)
        yield motion.slide_travel(part, joint, front, surface, bounds)
        if handle:
            yield motion.slide_handle(part, joint, front, scene.grasp_point(part), bounds)
    else:
        yield motion.hinge_edge(part, joint, front, points, bounds)
        yield motion.hinge_parallel(part, joint, front, bounds)
        yield motion.hinge_range(part, joint, bounds)
        if handle:
            yield motion.hinge_handle(part, joint, front, points, scene.grasp_point(part), bounds)
    if handle:
        yield handle_on_part(part, scene, bounds)
        yield handle_relief(part, scene, front, bounds)
    if region(scene, part).face_areas.any():
        yield grasp_on_region(part, scene, bounds)
    yield path(part, sweep(surface, part, bounds.blocked), joint.kind, bounds)


def path(part: str, swept: Sweep, kind: str, bounds: Bounds) -> Check:
    """Judge the swept path of a part against the untrimmed rest of the scan."""
    unit = "m" if kind == "prismatic" else "rad"
    names = " and ".join(name for name, _ in swept.obstacles[:2])
    message = f"{swept.blocked:.0%} of it runs into {names or 'nothing'}; free up to {swept.free:.2f} of {swept.full:.2f} {unit}"
    remedy = f"possible: up to {bounds.blocked:.0%}; correct the joint, or is something in its way?"
    return at_most(
        "swept_path",
        swept.blocked,
        bounds.blocked,
        "of the surface",
        part=part,
        message=message,
        remedy=remedy,
        otherwise="warn",
    )


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
