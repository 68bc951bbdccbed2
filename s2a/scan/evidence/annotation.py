"""All checks of an annotated scan: up axis and unit of the room, then each moving part."""

import re
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from s2a.core.check import Check, Status, at_least, at_most
from s2a.scan.evidence import Bounds, contact
from s2a.scan.evidence import joint as motion
from s2a.scan.evidence.front import Front, front, panel
from s2a.scan.evidence.surface import ScanSurface, Sweep, sphere, sweep
from s2a.scan.formats.articulate3d import Overlap
from s2a.scene.geometry.mesh_ops import centroids, normals
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
    message = f"{own:.0%} of its surface is level, but {most:.0%} lies across ({text}): is that up?"
    return at_least("up_axis", ratio, bounds.level, "of the most", otherwise="warn", message=message, remedy=REMEDY)


def _underside(points: np.ndarray, facing: np.ndarray, bounds: Bounds) -> Check:
    """Judge the up axis by what looks up and down between floor and ceiling."""
    excess = underside(points, facing)
    if np.isnan(excess):
        return Check("up_side", "skipped", message="nothing level stands between floor and ceiling")
    message = f"between floor and ceiling {(1 + excess) / 2:.0%} of what is level looks along +z, as tabletops do"
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
    handles = [(contact.region(scene, part), one) for part, one in fronts.items() if contact.has_handle(scene, part)]
    thickness = [np.sort(contact.size(mesh, one))[1] for mesh, one in handles]
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
        f"possible: {bounds.heights[0]:g} to {bounds.heights[1]:g} m, {bounds.surfaces[0]:g} to {bounds.surfaces[1]:g} m, "
        f"{1000 * bounds.handles[0]:g} to {1000 * bounds.handles[1]:g} mm; scale mesh and joints to metres (feet x 0.3048, "
        "inches x 0.0254, cm x 0.01)"
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
    checks = [*room_checks(surface, fronts, bounds), *contact.floating(surface, bounds)]
    checks += contact.shared_faces(overlaps, bounds)
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
    handle = contact.has_handle(scene, part)
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
        yield contact.handle_on_part(part, scene, bounds)
        yield contact.handle_relief(part, scene, front, bounds)
    if contact.region(scene, part).face_areas.any():
        yield contact.grasp_on_region(part, scene, bounds)
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
