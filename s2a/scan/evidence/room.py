"""The whole scan: which way is up, and in what unit it is."""

from __future__ import annotations

import re
from collections.abc import Mapping

import numpy as np

from s2a.scan.evidence import contact
from s2a.scan.evidence.finding import Bounds, Finding, Verdict, bounded_above, unknown
from s2a.scan.evidence.front import Front
from s2a.scan.evidence.surface import ScanSurface, sphere
from s2a.scene.geometry.mesh_ops import centroids, normals, sample_with_faces
from s2a.scene.scene import Mesh

LEVEL = np.cos(np.radians(10.0))
"""Faces within 10 degrees of a direction look along it: rough faces of level surfaces do."""
SAMPLES = 20_000
"""Points that stand for the surface."""
BORDER = 0.15
"""[m] Surfaces this near to the lowest or the highest ones are floor or ceiling."""
UNITS = "scan_units"
FLOOR = re.compile(r"^\s*floor\s*$", re.IGNORECASE)
REMEDY = "possible: z up; turn mesh and joints together (x, y, z) -> (x, -z, y) for a scan with y up"


def findings(surface: ScanSurface, fronts: Mapping[str, Front | None], bounds: Bounds) -> list[Finding]:
    """Return what the surface says about the whole room; `fronts` are those of its moving parts by id."""
    known = {part: front for part, front in fronts.items() if front is not None}
    return [*up_axis(surface, bounds), units(surface, known, bounds)]


def up_axis(surface: ScanSurface, bounds: Bounds) -> list[Finding]:
    """Judge which way is up, by the floor where one is labelled, by all surfaces where none is."""
    floors = [p.mesh for p in surface.scene.parts.values() if FLOOR.match(p.label) and p.mesh.face_areas.sum() > 0]
    if floors:
        return [_labelled(floors, surface, bounds)]
    points, facing = samples(surface.mesh)
    if not len(points):
        return [unknown("up_axis", "", "there is no surface")]
    return [_level(facing, bounds), _underside(points, surface.winding * facing, bounds)]


def samples(mesh: Mesh) -> tuple[np.ndarray, np.ndarray]:
    """Return points spread evenly over a surface [m], and the unit normals of their faces, shape [point 3] each."""
    points, faces = sample_with_faces(mesh, SAMPLES, 0)
    return points, normals(mesh)[faces]


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


def _labelled(floors: list[Mesh], surface: ScanSurface, bounds: Bounds) -> Finding:
    """Judge the up axis by the parts labelled floor: level, and with the room above them."""
    weight = np.concatenate([mesh.face_areas for mesh in floors])
    middle = np.concatenate([centroids(mesh) for mesh in floors])
    facing = np.concatenate([normals(mesh) for mesh in floors])
    spread = (facing * weight[:, None]).T @ facing
    normal = np.linalg.eigh(spread)[1][:, -1]
    points = samples(surface.mesh)[0]
    height = float(np.average((middle @ normal), weights=weight))
    normal = normal if float(np.median(points @ normal)) > height else -normal
    slope = float(np.degrees(np.arccos(np.clip(normal[2], -1.0, 1.0))))
    text = ", ".join(f"{x:.2f}" for x in normal)
    message = f"the room lies over its floor along ({text}), {slope:.0f} deg off z"
    return bounded_above("up_axis", "", slope, bounds.slope, "deg", message, REMEDY)


def _level(facing: np.ndarray, bounds: Bounds) -> Finding:
    """Judge the up axis by area: in most rooms more surface is level than looks along any other direction."""
    directions = sphere(1500)
    fractions = (np.abs(facing @ directions.T) > LEVEL).mean(axis=0)
    best = directions[np.argmax(fractions)]
    own, most = level_fraction(facing, np.array([0.0, 0.0, 1.0])), float(fractions.max())
    ratio = own / most if most > 0 else 0.0
    text = ", ".join(f"{x:.2f}" for x in best)
    message = f"{own:.0%} of its surface is level, but {most:.0%} lies across ({text}): is that up?"
    good = ratio >= bounds.level
    return Finding(
        "up_axis", "", "pass" if good else "warn", ratio, bounds.level, "of the most", message, "" if good else REMEDY
    )


def _underside(points: np.ndarray, facing: np.ndarray, bounds: Bounds) -> Finding:
    """Judge the up axis by what looks up and down between floor and ceiling."""
    excess = underside(points, facing)
    if np.isnan(excess):
        return unknown("up_side", "", "nothing level stands between floor and ceiling")
    message = f"between floor and ceiling {(1 + excess) / 2:.0%} of what is level looks along +z, as tabletops do"
    good = excess >= bounds.underside
    verdict: Verdict = "pass" if good else "fail" if excess < -bounds.underside else "warn"
    return Finding("up_side", "", verdict, excess, bounds.underside, "", message, "" if good else REMEDY)


def units(surface: ScanSurface, fronts: dict[str, Front], bounds: Bounds) -> Finding:
    """Judge the unit by three sizes that no room's style changes much.

    The height of the room, of the surfaces that objects stand on, and the thickness of handles, as far as there are any. One
    of them may be odd (a hall, a gallery, a wheel as a handle), two are not by chance.

    Args:
        surface: the room.
        fronts: fronts of its moving parts by id.
        bounds: `heights`, `surfaces` and `handles`.
    """
    height, handles = _height(surface), _handle_sizes(surface, fronts)
    sizes = [
        (height, bounds.heights, f"the room is {height:.3g} m high"),
        (raised := _raised(surface), bounds.surfaces, f"objects stand {raised:.3g} m over its floor"),
        (thick := _median(handles), bounds.handles, f"its handles are {1000 * thick:.3g} mm thick"),
    ]
    known = [(low <= size <= high, text) for size, (low, high), text in sizes if not np.isnan(size)]
    odd = sum(not fits for fits, _ in known)
    message = ", ".join(text for _, text in known)
    if not odd:
        return Finding(UNITS, "", "pass", height, bounds.heights[1], "m", message)
    remedy = (
        f"possible: {bounds.heights[0]:g} to {bounds.heights[1]:g} m, {bounds.surfaces[0]:g} to {bounds.surfaces[1]:g} m, "
        f"{1000 * bounds.handles[0]:g} to {1000 * bounds.handles[1]:g} mm; scale mesh and joints to metres (feet x 0.3048, "
        "inches x 0.0254, cm x 0.01)"
    )
    verdict: Verdict = "fail" if odd >= min(2, len(known)) else "warn"
    return Finding(UNITS, "", verdict, height, bounds.heights[1], "m", message, remedy)


def _height(surface: ScanSurface) -> float:
    """Return the height of a room [m], without stray points."""
    points = surface.mesh.vertices
    return float(np.subtract(*np.quantile(points[:, 2], [0.995, 0.005]))) if len(points) else 0.0


def _raised(surface: ScanSurface) -> float:
    """Return the median height over the floor of the surfaces between floor and ceiling that look up [m]; NaN without any."""
    points, facing = samples(surface.mesh)
    if not len(points):
        return float("nan")
    low, high = np.quantile(points[:, 2], [0.005, 0.995])
    height = points[surface.winding * facing[:, 2] > LEVEL, 2] - low
    height = height[(height > BORDER) & (height < high - low - BORDER)]
    return float(np.median(height)) if len(height) > 0.01 * len(points) else float("nan")


def _handle_sizes(surface: ScanSurface, fronts: dict[str, Front]) -> list[float]:
    """Return the thickness of each handle across its length in its front's plane [m]."""
    scene = surface.scene
    held = {part: front for part, front in fronts.items() if contact.has_handle(scene, part)}
    return [float(np.sort(contact.size(contact.region(scene, part), front))[1]) for part, front in held.items()]


def _median(values: list[float]) -> float:
    return float(np.median(values)) if values else float("nan")
