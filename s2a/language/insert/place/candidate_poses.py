"""Candidate poses of a plan, one after the other: choice by choice, region by region."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.language.insert.place.contact import PoseConfig
from s2a.language.insert.place.fit import NoRoom, Pose
from s2a.language.insert.place.pose import places
from s2a.language.insert.place.search import Keep
from s2a.language.insert.place.supports import SurfaceConfig, is_basin, place_paper, target_plane, target_regions
from s2a.language.insert.plan import Choice, Plan
from s2a.language.insert.room_state import RoomState
from s2a.scene.geometry.planes import Plane
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Mesh, Scene

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
        keep: what a wish allows of places, see `s2a.language.insert.place.pose.places`.

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
