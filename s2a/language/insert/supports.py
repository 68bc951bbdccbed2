"""Supports of a target: its regions in the scene, or the plane of the baseline."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from s2a.core.bounds import Count, CountFromZero, NotNegative
from s2a.core.errors import InputError
from s2a.language.grammar import BEDDING, is_kind_of
from s2a.language.insert.fit import NoRoom, Pose
from s2a.scene.geometry.mesh_ops import merge, within
from s2a.scene.geometry.mesh_query import crossing, kept_ray_mesh, visible_distance
from s2a.scene.geometry.planes import Plane, RansacConfig, ransac_plane
from s2a.scene.geometry.regions import KINDS, Kind, Region, RegionConfig, support_regions
from s2a.scene.scene import UNANNOTATED, Joint, Mesh, Scene

# Rim fraction from which a region is a basin, and its largest width [m]: a floor among furniture is none, a bathtub
# is
BASIN, WIDEST_BASIN = 0.5, 1.0
# What is lower than this and not as long as that lies flat on something; it blocks its place up to a height [m]
FLAT, LARGE, RAISED = 0.012, 0.5, 0.02
FAR = 2.0  # Length of the rays that test for a free view [m]
GROUND, UNDER = 0.05, 1.0
"""A level face of a part is the floor below it up to this above the floor [m], and with less than that free above [m]."""
SOFT = ("sofa", "armchair", "chair", "bed", "bench", "cushion", *BEDDING)
"""What has waves of some centimetres where one sits or lies."""
WAVES, SLOPE, SLANT = 0.03, 0.15, 0.5
"""Largest distance of these from their plane [m], slope of that, and tilt of a face [rad]."""
LOWEST, PART, BACK = 0.2, 0.3, 0.2
"""Least height of a seat [m], its least free area over the largest, and from which height above it a surface is a back [m]."""
WIDER, HIGHEST = 1.5, 0.95
"""Least free area of a soft region over that of the largest level one, and the quantile of its heights at which it carries."""


@dataclass(frozen=True)
class SurfaceConfig:
    """Detection of support surfaces.

    Attributes:
        surface: "regions" grows bounded regions; "ransac" takes the one plane with the most points.
        regions: growth of the regions.
        ransac: the baseline's plane.
    """

    surface: Literal["regions", "ransac"]
    regions: RegionConfig = RegionConfig()
    ransac: RansacConfig = RansacConfig()


def target_mesh(scene: Scene, target: str) -> Mesh:
    """Return the surface of a part and its descendants; InputError: no such part, or one without a surface."""
    scene.part(target)
    mesh = merge([scene.parts[i].mesh for i in (target, *scene.descendants(target))])
    if not len(mesh.faces):
        raise InputError(f"part {target!r} of scene {scene.name!r} has no surface; choose another target")
    return mesh


def standing_mesh(scene: Scene, target: str) -> Mesh:
    """Return the surface of a part and of what moves with it: the top edge of a cabinet's door carries nothing.

    Raises:
        InputError: no such part, or one without a surface.
    """
    ids = _standing(scene, target)
    mesh = merge([scene.parts[i].mesh for i in ids])
    return mesh if len(mesh.faces) else target_mesh(scene, target)


def _standing(scene: Scene, target: str) -> list[str]:
    """Return the ids of a part and of its descendants that are not on a drawer or door of it."""
    below = scene.descendants(target)
    moving = {i for j in below if isinstance(scene.parts[j].motion, Joint) for i in (j, *scene.descendants(j))}
    return [target, *(i for i in below if i not in moving)]


def is_floor(scene: Scene, target: str) -> bool:
    """Return True for the part that is the room's floor."""
    return scene.parts[target].label.lower() == "floor"


def floor_height(scene: Scene) -> float:
    """Return the height of the floor [m]: of the part of that name, else of the lowest point."""
    parts = [part for part in scene.parts.values() if len(part.mesh.vertices)]
    floors = [part.mesh for i, part in scene.parts.items() if is_floor(scene, i) and len(part.mesh.vertices)]
    if floors:
        return float(np.median(np.concatenate([mesh.vertices[:, 2] for mesh in floors])))
    return min((float(part.mesh.bounds[0, 2]) for part in parts), default=0.0)


def is_basin(region: Region) -> bool:
    """Return True for a level region that is surrounded by a rim: a sink, a tub, a tray."""
    return region.kind == "horizontal" and region.rim_fraction > BASIN and min(region.size) < WIDEST_BASIN


def flat_objects(scene: Scene, target: str) -> list[Mesh]:
    """Return what lies flat in a scene, raised: lower than the noise of a scan, it would be taken for its support."""
    own = {target, *scene.descendants(target)}
    meshes = []
    for part_id, part in scene.parts.items():
        if part_id in own or part.parent is not None or not len(part.mesh.faces):
            continue
        sides = np.ptp(part.mesh.bounds, axis=0)
        if sides[2] < FLAT and sides.max() < LARGE:
            meshes.append(Mesh(part.mesh.vertices + np.array([0.0, 0.0, RAISED], np.float32), part.mesh.faces))
    return meshes


def target_regions(scene: Scene, target: str, config: RegionConfig, kinds: tuple[Kind, ...] = KINDS) -> list[Region]:
    """Return the support regions of a part, with what all other parts leave free."""
    scene.part(target)
    upright = kinds == ("vertical",)
    own = {target, *scene.descendants(target)} if upright else set(_standing(scene, target))
    others = [part.mesh for part_id, part in scene.parts.items() if part_id not in own] + flat_objects(scene, target)
    mesh = target_mesh(scene, target) if upright else standing_mesh(scene, target)
    regions = support_regions(mesh, config, others, kinds)
    if _may_spill(scene, target):  # as a table does whose label is a box down to the floor
        ground = floor_height(scene) + GROUND
        regions = [r for r in regions if r.kind != "horizontal" or r.height > ground or r.clearance > UNDER]
    if upright or not any(is_kind_of(scene.parts[target].label, one) for one in SOFT):
        return regions
    level = max((region.free_area for region in regions if region.kind == "horizontal"), default=0.0)
    soft = [region for region in _soft_regions(mesh, config, others) if region.free_area >= WIDER * level]
    # Between its arms and back it is no basin, and what is on it is on its seat.
    regions = [replace(region, rim_fraction=0.0) for region in [*soft, *regions]]
    lowest = floor_height(scene) + LOWEST  # not of the scene: rooms have pits and wells of stairs
    above = [region for region in regions if region.kind == "horizontal" and region.height > lowest]
    large = PART * max((region.free_area for region in above), default=0.0)
    seat = min((region.height for region in above if region.free_area >= large), default=np.inf)
    return [region for region in regions if region.kind != "horizontal" or region.height <= seat + BACK]


def _may_spill(scene: Scene, target: str) -> bool:
    """Return True for a named part beside a floor that is a part of its own."""
    floors = [i for i in scene.parts if is_floor(scene, i)]
    return bool(floors) and target not in floors and scene.parts[target].label != UNANNOTATED


def _soft_regions(mesh: Mesh, config: RegionConfig, others: list[Mesh]) -> list[Region]:
    """Return the level regions of a surface with waves, each as high as most of it."""
    plane = replace(config.plane, tolerance=WAVES, max_slope=SLOPE, max_tilt=SLANT, bin_height=WAVES / 3)
    regions = support_regions(mesh, replace(config, plane=plane, noise_height=WAVES), others, ("horizontal",))
    return [_on_its_waves(region, mesh) for region in regions]


def _on_its_waves(region: Region, mesh: Mesh) -> Region:
    """Return a region raised from the middle of its waves to their tops."""
    cells = region.places(mesh.vertices.astype(float))
    row, column = np.clip(np.floor(cells[:, :2]).astype(int), 0, np.array(region.support.shape) - 1).T
    own = cells[region.support[row, column] & (np.abs(cells[:, 2]) <= WAVES), 2]
    rise = max(float(np.quantile(own, HIGHEST)), 0.0) if len(own) else 0.0
    return replace(
        region, origin=region.origin + rise * region.normal, clearances=np.maximum(region.clearances - rise, 0.0)
    )


def target_plane(scene: Scene, target: str, upright: bool, config: RansacConfig) -> tuple[Plane, np.ndarray]:
    """Return the baseline's plane of a part and its inliers [m], shape [point 3].

    Raises:
        InputError: no plane of that direction.
    """
    points = target_mesh(scene, target).vertices
    plane = ransac_plane(points, upright, config)
    if plane is None:
        raise InputError(
            f"part {target!r} has no {'vertical' if upright else 'horizontal'} plane; choose another surface kind"
        )
    return plane, points[plane.faces]


def nearby(scene: Scene, low: np.ndarray, high: np.ndarray, parts: Iterable[str] | None = None) -> Mesh:
    """Return the triangles of a scene, or of some of its parts, whose boxes meet a box [m]."""
    meshes = []
    for part_id in scene.parts if parts is None else parts:
        mesh = scene.parts[part_id].mesh
        whole = len(mesh.faces) and (mesh.bounds[0] >= low).all() and (mesh.bounds[1] <= high).all()
        meshes.append(mesh if whole else within(mesh, low, high))
    return merge([Mesh(mesh.vertices, mesh.faces) for mesh in meshes if len(mesh.faces)])


def facing(scene: Scene, target: str, region: Region) -> np.ndarray:
    """Return the horizontal direction that objects on a region should face, unit, shape [3].

    Of the region's own four directions it is one in which the target leaves the view open (a shelf's front), and of those
    the one nearest to the middle of the room. An upright region faces along its normal.
    """
    if region.kind == "vertical":
        return region.normal
    level = region.axes[:, :2].T * (1.0, 1.0, 0.0)
    directions = np.concatenate([level, -level])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    start = region.center + min(0.1, 0.5 * region.clearance) * region.normal
    # The rays are horizontal: they can hit only triangles that cross their height.
    reach = np.array([FAR, FAR, 0.001])
    mesh = nearby(scene, start - reach, start + reach, (target, *scene.descendants(target)))
    sees = np.full(4, FAR)
    if len(mesh.faces):
        sees, _ = visible_distance(kept_ray_mesh(mesh), np.tile(start, (4, 1)), directions, FAR)
    inward = bounds_of(scene).mean(axis=0) - region.center
    inward /= max(float(np.linalg.norm(inward[:2])), 1e-9)
    return directions[np.argmax(2.0 * (sees >= sees.max() - 0.05) + directions @ (inward * (1.0, 1.0, 0.0)))]


def bounds_of(scene: Scene) -> np.ndarray:
    """Return the lowest and highest corner of the box around a scene [m], shape [2 3]."""
    bounds = np.array([part.mesh.bounds for part in scene.parts.values() if len(part.mesh.vertices)])
    return np.stack([bounds[:, 0].min(axis=0), bounds[:, 1].max(axis=0)])


def over(region: Region, point: np.ndarray) -> bool:
    """Return True if a point [3] is over the grid of a region, or below it."""
    row, column, _ = region.places(point[None])[0]
    rows, columns = region.support.shape
    return bool(0 <= row < rows and 0 <= column < columns)


@dataclass(frozen=True)
class PaperConfig:
    """The baseline's random offsets.

    Attributes:
        attempts: number of random offsets.
        spread: standard deviation of the first offset [m]; it grows linearly with the attempts, up to ten times this.
        seed: of the offsets.
    """

    attempts: Count = 1000
    spread: NotNegative = 0.01
    seed: CountFromZero = 0


def place_paper(scene: Scene, object: Mesh, plane: Plane, inliers: np.ndarray, config: PaperConfig) -> Pose:
    """Return the baseline's pose: the mean of the plane's points plus half the object, shifted until nothing collides.

    Half the object is half its extent along the normal. Offsets are random, until no triangle of the object cuts anything;
    it is not turned, and nothing asks what carries it.

    Args:
        scene: the room.
        object: upright, standing on z = 0, in metres.
        plane: from `s2a.scene.geometry.planes`.
        inliers: the plane's points [m], shape [point 3].
        config: number and spread of the offsets.

    Raises:
        NoRoom: every offset collides.
    """
    middle = object.bounds.mean(axis=0)
    half = float(np.ptp(object.vertices @ plane.normal) / 2)
    start = inliers.mean(axis=0) + half * plane.normal - middle
    random = np.random.default_rng(config.seed)
    for number in range(config.attempts):
        spread = config.spread * min(10.0, number / 10)
        pose = Pose(tuple(start + random.normal(size=3) * spread), (0.0, 0.0, 0.0, 1.0), 0.0, number + 1)
        moved = pose.moved(object)
        if crossing(moved, nearby(scene, *moved.bounds)) is None:
            return pose.rounded()
    raise NoRoom(f"all of {config.attempts} random offsets collide; give surface=regions pose=search")
