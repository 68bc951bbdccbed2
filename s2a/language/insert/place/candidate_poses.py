"""Candidate poses of a plan, one after the other: choice by choice, region by region."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.language.insert.describe import RoomState
from s2a.language.insert.place.contact import ContactQuery, PoseConfig, Relation, refined
from s2a.language.insert.place.fit import NoRoom, Pose, SweptVolume, reaching_into
from s2a.language.insert.place.preferences import preferences
from s2a.language.insert.place.search import GridCandidate, Keep, SearchConfig, grid_candidates, occupancy_grid
from s2a.language.insert.place.serves import Fault, PlaceServes
from s2a.language.insert.place.supports import (
    SurfaceConfig,
    facing,
    flat_objects,
    is_basin,
    is_floor,
    place_paper,
    target_plane,
    target_regions,
)
from s2a.language.insert.plan import Choice, Plan
from s2a.scene.geometry.planes import Plane
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Mesh, Scene

DENSE, MOST_SAMPLES = 6.0, 60000
"""Points a cell of a large object's surface in the second search, and their largest number."""
MOST_FAULTY = 16
"""Faulty poses after which none without fault is looked for any more."""


def place(
    scene: Scene,
    object: Mesh,
    region: Region,
    relation: Relation,
    config: PoseConfig,
    target: str,
    volumes: list[SweptVolume],
    near: str | None = None,
) -> Pose:
    """Return the best pose of an object on a region: the first of `places`."""
    return next(places(scene, object, region, relation, config, target, volumes, near))


def places(
    scene: Scene,
    object: Mesh,
    region: Region,
    relation: Relation,
    config: PoseConfig,
    target: str,
    volumes: list[SweptVolume],
    near: str | None = None,
    keep: Keep | None = None,
) -> Iterator[Pose]:
    """Yield free poses of an object on a region, the best first, one at least.

    Args:
        scene: the room.
        object: upright, standing on z = 0, front towards +x, in metres.
        region: a support region of the target.
        relation: "on" or "in" stands, "against" stands with its back to something, "hanging" hangs on a vertical region.
        config: settings of the search.
        target: id of the part that the region belongs to.
        volumes: swept volumes of the room's drawers and doors, kept free.
        near: id of the preferred neighbour, or None.
        keep: of places [m], shape [place 3], those that a wish allows, shape [place]; None for all.

    Raises:
        NoRoom: no pose is free.
        InputError: a relation that the region does not support.
    """
    if (relation == "hanging") != (region.kind == "vertical"):
        raise InputError(f"relation {relation!r} on a region of kind {region.kind!r}; only hanging goes with vertical")
    base, radius, height = _frame(scene, object, region, target)
    low, high = _box(region, radius, height)
    volumes = reaching_into(volumes, low, high, scene, target)
    obstacles = [*(part.mesh for part in scene.parts.values()), *flat_objects(scene, target)]
    grid = occupancy_grid(region, radius, height, obstacles, volumes, config.search)
    tall = float(np.ptp(object.bounds[:, 2]))
    against = relation == "against"
    if against and is_floor(scene, target):
        config = replace(config, search=replace(config.search, turns=_to_all_walls(config.search.turns)))
    wanted = preferences(scene, region, target, against, near, tall, config.search.habits)
    query = ContactQuery(scene, object, region, relation, config, base, volumes)
    serves = None if region.kind == "vertical" else PlaceServes(scene, region, target)
    conflicts: list[str] = []
    searches = [(config.search, config.min_spacing, keep), (_denser(object, region, config), 0.0, keep)]
    if serves and serves.fixtures:
        searches.insert(0, (config.search, config.min_spacing, serves.clear_of_fixtures(object, keep)))
    for search, spacing, kept in searches:
        found = grid_candidates(grid, region, object, base, wanted, search, kept)
        if not (found or conflicts) and kept is keep:
            raise NoRoom(_why(region, object))
        free = _free(query, _spread(found, max(2.0, spacing * radius / region.cell), config.attempts), conflicts)
        poses = _serving_first(free, object, serves)
        first = next(poses, None)
        if first is not None:
            yield first
            yield from itertools.islice(poses, config.alternatives - 1)
            return
    worst = max(set(conflicts), key=conflicts.count)
    raise NoRoom(f"none of {len(conflicts)} places on {target!r} at {region.height:.2f} m is free: most {worst}")


def _to_all_walls(turns: tuple[float, ...]) -> tuple[float, ...]:
    """Return turns [degree] from each of the four sides of a floor: furniture faces the room from a wall on any."""
    found = {(turn + side + 180.0) % 360.0 - 180.0 for turn in turns for side in (0.0, 90.0, 180.0, 270.0)}
    return tuple(sorted(found, key=abs))


def _denser(object: Mesh, region: Region, config: PoseConfig) -> SearchConfig:
    """Return settings with which the search misses no cell that an object covers; slower."""
    cells = float(object.face_areas.sum()) / region.cell**2
    return replace(config.search, samples=int(min(DENSE * cells + config.search.samples, MOST_SAMPLES)))


def _free(query: ContactQuery, found: Iterable[GridCandidate], conflicts: list[str]) -> Iterator[Pose]:
    """Yield the free poses among candidates; append the conflicts of the others."""
    for number, candidate in enumerate(found, start=1):
        pose, conflict = refined(query, candidate, number)
        if conflict is None:
            yield pose
        else:
            conflicts.append(conflict)


def _serving_first(poses: Iterable[Pose], object: Mesh, serves: PlaceServes | None) -> Iterator[Pose]:
    """Yield poses in their order, but those with a fault after the others, as far as these are looked for."""
    faulty: list[tuple[Fault, Pose]] = []
    for pose in poses:
        fault = Fault.NONE if serves is None else serves.fault(pose.moved(object))
        if fault is Fault.NONE:
            yield pose
            continue
        faulty.append((fault, pose))
        if len(faulty) == MOST_FAULTY:
            break
    yield from (pose for _, pose in sorted(faulty, key=lambda one: one[0]))


def _frame(scene: Scene, object: Mesh, region: Region, target: str) -> tuple[np.ndarray, float, float]:
    """Return the rotation from the object's frame to the region's, and the object's radius and height there [m]."""
    if region.kind == "vertical":
        base = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    else:
        front = facing(scene, target, region) @ region.axes[:, :2]
        x, y = front / np.linalg.norm(front)
        base = np.array([[x, -y, 0.0], [y, x, 0.0], [0.0, 0.0, 1.0]])
    local = object.vertices @ base.T
    return base, float(np.linalg.norm(local[:, :2], axis=1).max()), float(np.ptp(local[:, 2]))


def _box(region: Region, radius: float, height: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the box in the scene that an object on a region may reach [m]."""
    rows, columns = region.support.shape
    corners = region.points(np.array([(0, 0), (rows, 0), (0, columns), (rows, columns)]))
    corners = np.concatenate([corners, corners + height * region.normal])
    return corners.min(axis=0) - radius - 0.05, corners.max(axis=0) + radius + 0.05


def _spread(found: list[GridCandidate], apart: float, count: int) -> Iterator[GridCandidate]:
    """Yield candidates best first, some cells apart from all earlier ones: what failed there fails next to it, too."""
    left, places = found, np.array([one.place for one in found])
    for _ in range(count):
        if not left:
            return
        first = left[0]
        yield first
        far = np.linalg.norm(places - first.place, axis=1) >= apart
        left, places = [one for one, stays in zip(left, far, strict=True) if stays], places[far]


def _why(region: Region, object: Mesh) -> str:
    """Return the message for a region without any candidate."""
    size = " x ".join(f"{extent:.2f}" for extent in np.ptp(object.bounds, axis=0))
    room = " x ".join(f"{extent:.2f}" for extent in region.size)
    return (
        f"an object of {size} m finds no place on a {region.kind} region of {room} m at {region.height:.2f} m with"
        f" {region.free_area:.3f} m^2 free and {region.clearance:.2f} m of room; choose another region or a smaller object"
    )


TRIED = 4
"""Regions tested per target."""
MEANT = 0.04
"""Largest difference between the height in a plan and that of the region it refers to [m]."""


@dataclass(frozen=True)
class CandidatePose:
    """A candidate pose of an object.

    Attributes:
        target: id of the carrying part.
        choice: the plan's choice.
        normal: normal of the surface, unit, shape [3].
        pose: pose of the object.
        surface: description of the surface for the record.
    """

    target: str
    choice: Choice
    normal: np.ndarray
    pose: Pose
    surface: dict[str, Any]


def candidate_poses(
    room: RoomState,
    object: Mesh,
    plan: Plan,
    surface: SurfaceConfig,
    pose: PoseConfig,
    reasons: list[str],
    keep: Keep | None = None,
) -> Iterator[CandidatePose]:
    """Yield the candidate poses of a plan, the best first.

    Args:
        room: the room.
        object: upright, standing on z = 0, front towards +x, in metres.
        plan: the plan.
        surface: detection of surfaces.
        pose: search for poses.
        reasons: receives the reason for each rejected region.
        keep: what a wish allows of places, see `s2a.language.insert.place.candidate_poses.places`.

    Raises:
        InputError: methods that do not go together.
    """
    if surface.surface == "ransac" and pose.pose != "paper":
        raise InputError(
            "surface=ransac finds a plane without borders, which pose=search cannot search; give pose=paper"
        )
    for choice in plan.choices:
        try:
            if surface.surface == "ransac":
                plane, points = target_plane(room.scene, choice.target, choice.surface == "vertical", surface.ransac)
                yield _on_plane(room.scene, object, plane, points, choice, pose, "ransac")
            else:
                yield from _on_regions(room, object, plan, choice, surface, pose, reasons, keep)
        except InputError as error:
            reasons.append(f"{choice.relation} {choice.target}: {error}")


def _on_regions(
    room: RoomState,
    object: Mesh,
    plan: Plan,
    choice: Choice,
    surface: SurfaceConfig,
    pose: PoseConfig,
    reasons: list[str],
    keep: Keep | None,
) -> Iterator[CandidatePose]:
    """Yield the candidate poses on the regions of a choice; a table below a lamp may count as "inside", too."""
    scene, target = room.scene, choice.target
    upright = choice.surface == "vertical"
    found = target_regions(scene, target, surface.regions, ("vertical",)) if upright else room.levels(target)
    regions = _ordered(found, choice)
    if not regions:
        raise NoRoom(f"it has no {choice.surface} surface")
    for region in regions[:TRIED]:
        try:
            if pose.pose == "paper":
                points = region.points(np.argwhere(region.support) + 0.5)
                plane = Plane(region.normal, float(region.normal @ region.center), np.arange(len(points)))
                yield _on_plane(scene, object, plane, points, choice, pose, "regions")
                continue
            said = _model_line(region, choice)
            for where in places(scene, object, region, choice.relation, pose, target, room.volumes, plan.near, keep):
                yield CandidatePose(target, choice, region.normal, where, said)
        except NoRoom as error:
            reasons.append(f"{choice.relation} {target}: {error}")


def _on_plane(
    scene: Scene, object: Mesh, plane: Plane, points: np.ndarray, choice: Choice, pose: PoseConfig, method: str
) -> CandidatePose:
    """Return the baseline's candidate pose on a plane with its points [point 3]."""
    found = place_paper(scene, object, plane, points, pose.paper)
    described = {
        "method": method,
        "target": choice.target,
        "height": round(float(points[:, 2].mean()), 4),
        "points": len(points),
    }
    return CandidatePose(choice.target, choice, plane.normal, found, described)


def _ordered(regions: list[Region], choice: Choice) -> list[Region]:
    """Return regions in the order in which they match a choice: by height, kind and free area.

    What is to be on something does not go into its basin, nor what is to be in it onto its rim, where it has both.
    """

    def within(region: Region) -> bool:
        return region.kind == "inside" or is_basin(region)

    def merit(region: Region) -> tuple[bool, bool, float]:
        meant = choice.height is not None and abs(region.height - choice.height) < MEANT
        return meant, region.kind == choice.surface, region.free_area

    fitting = [
        region for region in regions if within(region) == (choice.relation == "in" or choice.surface == "inside")
    ]
    return sorted(fitting or regions, key=merit, reverse=True)


def _model_line(region: Region, choice: Choice) -> dict[str, Any]:
    """Return the description of a region for the record."""
    numbers = {
        "height": region.height,
        "area": region.area,
        "free_area": region.free_area,
        "clearance": region.clearance,
    }
    rounded = {name: round(value, 4) for name, value in numbers.items()}
    return {
        "method": "regions",
        "target": choice.target,
        "kind": region.kind,
        **rounded,
        "walled": round(region.rim_fraction, 2),
    }
