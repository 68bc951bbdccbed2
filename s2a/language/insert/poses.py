"""Candidate poses of a plan, one after the other: choice by choice, region by region."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.bounds import Count, NotNegative
from s2a.core.errors import InputError
from s2a.language.insert.describe import RoomState, is_wall
from s2a.language.insert.fit import (
    COLLISION,
    NoRoom,
    Pose,
    SweptVolume,
    moved_into_contact,
    placement_conflict,
    reaching_into,
)
from s2a.language.insert.plan import Choice, Plan
from s2a.language.insert.search import (
    GridCandidate,
    Keep,
    SearchConfig,
    grid_candidates,
    occupancy_grid,
    preferences,
)
from s2a.language.insert.serves import Fault, PlaceServes
from s2a.language.insert.stable_pose import LEAN, leaned, slender
from s2a.language.insert.supports import (
    PaperConfig,
    SurfaceConfig,
    facing,
    flat_objects,
    floor_height,
    is_basin,
    is_floor,
    nearby,
    place_paper,
    target_plane,
    target_regions,
)
from s2a.language.insert.wish_check import any_allowed
from s2a.scan.rest import UNANNOTATED
from s2a.scene.geometry.planes import Plane
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Mesh, Scene

Relation = Literal["on", "in", "against", "hanging"]
SQUARELY, FACING, LARGE = 10.0, 45.0, 0.25
"""Largest turns from the front of a support of what is longer than `LARGE` [m] and of what is not [deg]."""
SLIDES = (1.0, 0.9, 0.8, 0.6, 0.4, 0.2)
"""Fractions of the way back that are tried."""
DROPPED = 0.006
"""From so much lower than before, what slid back is over the edge of its support [m]."""


@dataclass(frozen=True)
class PoseConfig:
    """Search for poses.

    Attributes:
        pose: "search" ranks all placements on a grid; "paper" shifts the object at random until nothing collides.
        search: the grid search.
        paper: the baseline.
        attempts: candidates that are tested exactly.
        alternatives: free poses on one region that are offered, in case that the object does not stay at the first
            ones. On one support, where the first ones do not stay.
        min_spacing: smallest distance of a candidate from those that failed, as a fraction of the object's radius.
        back_gap: gap between the object's back and what it is against [m].
        contact_gap: gap between the object and what it touches [m].
        slide: way that what stands against something may slide back to it [m].
        lowering_height: height above the region from which the object is lowered [m].
        swept_volume_tolerance: how far the object may reach into a swept volume, whose surface is noisy [m].
    """

    pose: Literal["search", "paper"]
    search: SearchConfig
    paper: PaperConfig = PaperConfig()
    attempts: Count = 40
    alternatives: Count = 8
    min_spacing: NotNegative = 0.25
    back_gap: NotNegative = 0.005
    contact_gap: NotNegative = 0.0003
    slide: NotNegative = 0.3
    lowering_height: NotNegative = 0.03
    swept_volume_tolerance: NotNegative = 0.008


@dataclass(frozen=True)
class ContactQuery:
    """Inputs of the exact tests, as `place` has them; `base` rotates from the object's frame to the region's."""

    scene: Scene
    object: Mesh
    region: Region
    relation: Relation
    config: PoseConfig
    base: np.ndarray
    volumes: list[SweptVolume]


def facing_first(object: Mesh, config: PoseConfig, anyhow: bool) -> tuple[PoseConfig, ...]:
    """Return settings with the turns at which an object faces as its support does, then with all.

    Large ones stand squarely, and turn their side or back to the room only `anyhow`.
    """
    large = np.ptp(object.bounds, axis=0)[:2].max() > LARGE
    most = SQUARELY if large else FACING
    turns = tuple(turn for turn in config.search.turns if abs(turn) <= most)
    if config.pose != "search" or not turns or len(turns) == len(config.search.turns):
        return (config,)
    facing = replace(config, search=replace(config.search, turns=turns))
    return (facing, config) if anyhow or not large else (facing,)


def refined(query: ContactQuery, candidate: GridCandidate, number: int) -> tuple[Pose, str | None]:
    """Return the exact pose of a candidate, and the conflict there or None; what would fall over leans if it may."""
    if query.relation == "against" and slender(query.object):
        pose, conflict = _touching(query, candidate, number, lean=True)
        if conflict is None:
            return pose, None
    return _touching(query, candidate, number, lean=False)


def _touching(query: ContactQuery, candidate: GridCandidate, number: int, lean: bool) -> tuple[Pose, str | None]:
    """Return the pose of a candidate lowered, or pushed, until it touches, and the conflict there or None."""
    scene, object, region, config = query.scene, query.object, query.region, query.config
    toward = -region.normal if region.kind == "vertical" else np.array([0.0, 0.0, -1.0])
    turn = _turn(region, query.base, candidate.turn)
    turn = leaned(turn) if lean else turn
    start = _start(query, candidate, turn, toward, number)
    if lean:
        # The search found room for it upright; its top is not to begin in the wall.
        forward = turn @ np.array([1.0, 0.0, 0.0]) * (1.0, 1.0, 0.0)
        away = float(np.ptp(object.bounds[:, 2])) * float(np.sin(LEAN)) * forward / np.linalg.norm(forward)
        start = start.shifted(away)
    against = query.relation == "against"
    reach = config.slide if against else 2 * config.lowering_height
    margin = np.array([[-1.0], [1.0]]) * (reach + 0.01)
    local = nearby(scene, *(start.moved(object).bounds + margin))
    pose = moved_into_contact(start, object, local, toward, 2 * config.lowering_height, config.contact_gap)
    if pose is None:
        return start, "carry nothing"
    if against:
        pose = _slid_back(query, pose, local, turn, config.back_gap)
        if pose is None:
            return start, "have nothing behind them"
    for _ in range(4):
        pose = pose.rounded()
        conflict = placement_conflict(scene, pose.moved(object), local, query.volumes, config.swept_volume_tolerance)
        if conflict != COLLISION:
            break
        # Between two edges the distance may be shorter than from any point that was queried.
        pose = pose.shifted(-config.contact_gap * toward)
    return pose, conflict


def _slid_back(query: ContactQuery, pose: Pose, local: Mesh, turn: np.ndarray, gap: float) -> Pose | None:
    """Return a standing pose moved back until it almost touches; None if there is nothing behind it.

    A wall behind a chest of drawers may be beyond the edge of that: what slides back stops before it drops.
    """
    # Off the floor, over whose bumps it would stumble.
    lifted = pose.shifted(np.array([0.0, 0.0, query.config.lowering_height]))
    back = turn @ np.array([-1.0, 0.0, 0.0]) * (1.0, 1.0, 0.0)
    behind = moved_into_contact(lifted, query.object, local, back / np.linalg.norm(back), query.config.slide, gap)
    if behind is None:
        return None
    down, reach = np.array([0.0, 0.0, -1.0]), 3 * query.config.lowering_height
    for fraction in SLIDES:
        between = (1 - fraction) * np.array(lifted.position) + fraction * np.array(behind.position)
        back_there = replace(behind, position=tuple(between.tolist()))
        low = moved_into_contact(back_there, query.object, local, down, reach, query.config.contact_gap)
        if low is not None and low.position[2] > pose.position[2] - DROPPED:
            return low
    return None


def _start(query: ContactQuery, candidate: GridCandidate, turn: np.ndarray, toward: np.ndarray, number: int) -> Pose:
    """Return the pose above a candidate from which the object is lowered."""
    lowest = float((query.object.vertices @ turn.T @ -toward).min())
    start = query.region.points(candidate.place[None])[0] + (lowest - query.config.lowering_height) * toward
    quaternion = tuple(Rotation.from_matrix(turn).as_quat().tolist())
    return Pose(tuple(start.tolist()), quaternion, candidate.room, number)


def _turn(region: Region, base: np.ndarray, turn: float) -> np.ndarray:
    """Return the rotation from the object's frame to the scene's, upright whatever the slope of the region, shape [3 3]."""
    front = region.axes @ base @ np.array([np.cos(turn), np.sin(turn), 0.0])
    yaw = np.arctan2(front[1], front[0])
    return Rotation.from_euler("z", yaw).as_matrix()


DENSE, MOST_SAMPLES = 6.0, 60000
"""Points a cell of a large object's surface in the second search, and their largest number."""
MOST_FAULTY = 16
"""Faulty poses after which none without fault is looked for any more."""


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
    for search, spacing, allowed in searches:
        candidates = grid_candidates(grid, region, object, base, wanted, search, allowed)
        if not (candidates or conflicts) and allowed is keep:
            raise NoRoom(_why(region, object))
        free = _free(query, _spread(candidates, max(2.0, spacing * radius / region.cell), config.attempts), conflicts)
        poses = _serving_first(free, object, serves)
        first = next(poses, None)
        if first is not None:
            yield first
            yield from itertools.islice(poses, config.alternatives - 1)
            return
    worst = max(conflicts, key=conflicts.count)
    raise NoRoom(f"none of {len(conflicts)} places on {target!r} at {region.height:.2f} m is free: most {worst}")


def _to_all_walls(turns: tuple[float, ...]) -> tuple[float, ...]:
    """Return turns [degree] from each of the four sides of a floor: furniture faces the room from a wall on any."""
    yaws = {(turn + side + 180.0) % 360.0 - 180.0 for turn in turns for side in (0.0, 90.0, 180.0, 270.0)}
    return tuple(sorted(yaws, key=abs))


def _denser(object: Mesh, region: Region, config: PoseConfig) -> SearchConfig:
    """Return settings with which the search misses no cell that an object covers; slower."""
    cells = float(object.face_areas.sum()) / region.cell**2
    return replace(config.search, samples=int(min(DENSE * cells + config.search.samples, MOST_SAMPLES)))


def _free(query: ContactQuery, candidates: Iterable[GridCandidate], conflicts: list[str]) -> Iterator[Pose]:
    """Yield the free poses among candidates; append the conflicts of the others."""
    for number, candidate in enumerate(candidates, start=1):
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


def _spread(candidates: list[GridCandidate], apart: float, count: int) -> Iterator[GridCandidate]:
    """Yield candidates best first, some cells apart from all earlier ones: what failed there fails next to it, too."""
    left, places = candidates, np.array([one.place for one in candidates])
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
AHEAD, HUNG = 0.6, 1.1
"""Least depth before what hangs, and height over the floor of a wall that serves to hang things on [m]."""
MEANT = 0.04
"""Largest difference between the height in a plan and that of the region it refers to [m]."""


@dataclass(frozen=True)
class CandidatePose:
    """A candidate pose of an object.

    Attributes:
        choice: the plan's choice.
        normal: normal of the surface, unit, shape [3].
        pose: pose of the object.
        surface: description of the surface for the record.
    """

    choice: Choice
    normal: np.ndarray
    pose: Pose
    surface: dict[str, Any]

    @property
    def target(self) -> str:
        """Id of the carrying part."""
        return self.choice.target


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
        keep: what a wish allows of places, see `s2a.language.insert.poses.places`.

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
    candidates = target_regions(scene, target, surface.regions, ("vertical",)) if upright else room.levels(target)
    floor, bare = floor_height(scene), scene.parts[target].label == UNANNOTATED
    if choice.height is not None and bare and not upright:  # all the room: the floor is no other choice
        candidates = [region for region in candidates if abs(region.height - choice.height) < MEANT]
    if not candidates:
        raise NoRoom(f"it has no {choice.surface} surface")
    if upright and choice.height is None and (bare or is_wall(scene.parts[target].label)):
        candidates = [region for region in candidates if _seen_cells(region, floor)]
        if not candidates:
            raise NoRoom(f"it has no {choice.surface} surface with {AHEAD:g} m before it, {HUNG:g} m above the floor")
    regions = _ordered(candidates, choice, floor)
    if keep is not None and not upright:
        regions = [region for region in regions if any_allowed(keep, region.points(np.argwhere(region.free) + 0.5))]
        if not regions:
            raise NoRoom("no free place on it meets the request")
    for region in regions[:TRIED]:
        try:
            if pose.pose == "paper":
                points = region.points(np.argwhere(region.support) + 0.5)
                plane = Plane(region.normal, float(region.normal @ region.center), np.arange(len(points)))
                yield _on_plane(scene, object, plane, points, choice, pose, "regions")
                continue
            line = _model_line(region, choice)
            for where in places(scene, object, region, choice.relation, pose, target, room.volumes, plan.near, keep):
                yield CandidatePose(choice, region.normal, where, line)
        except NoRoom as error:
            reasons.append(f"{choice.relation} {target}: {error}")


def _on_plane(
    scene: Scene, object: Mesh, plane: Plane, points: np.ndarray, choice: Choice, pose: PoseConfig, method: str
) -> CandidatePose:
    """Return the baseline's candidate pose on a plane with its points [point 3]."""
    where = place_paper(scene, object, plane, points, pose.paper)
    described = {
        "method": method,
        "target": choice.target,
        "height": round(float(points[:, 2].mean()), 4),
        "points": len(points),
    }
    return CandidatePose(choice, plane.normal, where, described)


def _seen_cells(region: Region, floor: float) -> int:
    """Return how many cells of an upright region are high enough over the floor, and have depth before them."""
    high = region.points(np.argwhere(region.support) + 0.5)[:, 2] >= floor + HUNG
    return int((high & (region.clearances[region.support] >= AHEAD)).sum())


def _ordered(regions: list[Region], choice: Choice, floor: float) -> list[Region]:
    """Return regions in the order in which they match a choice: by height, kind and free area; `floor`: its height [m].

    What is to be on something does not go into its basin, nor what is to be in it onto its rim, where it has both. What hangs,
    hangs where it is seen best.
    """

    def within(region: Region) -> bool:
        return region.kind == "inside" or is_basin(region)

    def merit(region: Region) -> tuple[bool, bool, float]:
        meant = choice.height is not None and abs(region.height - choice.height) < MEANT
        if region.kind == "vertical":
            return meant, True, float(seen[id(region)])
        return meant, region.kind == choice.surface, region.free_area

    seen = {id(region): _seen_cells(region, floor) for region in regions if region.kind == "vertical"}
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
