"""Can a robot stand where a sim.usd says, by what was scanned there?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.check import Check, check_bound, decide
from s2a.core.ranges import Positive
from s2a.robot.spec import RobotSpec
from s2a.scan.evidence.floor import FloorConfig, floor_fraction
from s2a.scene.geometry.mesh_query import RayMesh, first_hits
from s2a.scene.usd.sim_scene import PREPARE_AGAIN, Base

RAYS = 32
"""Directions around the base's axis in which what stands there is looked for."""


@dataclass(frozen=True)
class BaseCheckConfig:
    """Bounds on where a robot stands.

    Attributes:
        floor: when it stands on scanned floor.
        max_turn: how far the base may look past the grasp point [rad].
        height: of the column above the base that must be free [m].
    """

    floor: FloorConfig
    max_turn: Positive
    height: Positive


def robot_base(
    path: str, base: Base, point: np.ndarray, surface: RayMesh, robot: RobotSpec, config: BaseCheckConfig
) -> list[Check]:
    """Return the checks of a base pose.

    Args:
        path: of its prim.
        base: the pose.
        point: grasp point [m], scene coordinates, shape [3].
        surface: everything that was scanned.
        robot: of the robot that stands there.
        config: bounds.
    """
    problems = []
    if not base.free:
        problems.append((path, f"prepare found no pose without a collision; {base.reason}"))
    place = np.array(base.position)
    ahead = Rotation.from_quat(base.orientation).apply([1.0, 0.0, 0.0])[:2]
    to = (point - place)[:2]
    turn = float(np.arccos(np.clip(ahead @ to / max(np.linalg.norm(ahead) * np.linalg.norm(to), 1e-9), -1.0, 1.0)))
    if turn > config.max_turn:
        problems.append((path, f"it looks {np.degrees(turn):.0f} degrees past the grasp point"))
    away = float(np.linalg.norm(point - place - [0.0, 0.0, robot.base.shoulder_height]))
    reach = robot.base.reach + robot.tool_offset[2]
    if away > reach:
        problems.append((path, f"the grasp point is {away:.2f} m from the shoulder, the arm reaches {reach:.2f} m"))
    floor = floor_fraction(place, base.pedestal, base.radius, surface, config.floor.tolerance)
    hit = obstacle(place, base, surface, config)
    if np.isfinite(hit):
        problems.append(
            (path, f"a scanned surface lies {hit:.2f} m from the base's axis, within its radius of {base.radius:g} m")
        )
    return [
        decide("base_pose", problems, "let prepare search another place, or correct the joint", prim=path),
        check_bound(
            "base_on_floor", 1.0 - floor, 1.0 - config.floor.min_fraction, "", prim=path,
            message="of the footprint has no scanned floor below", remedy="stand where the floor was scanned; " + PREPARE_AGAIN,
        ),
    ]  # fmt: skip


def obstacle(place: np.ndarray, base: Base, surface: RayMesh, config: BaseCheckConfig) -> float:
    """Return the distance of the nearest scanned surface from the axis of the base's column [m]; inf where it is free."""
    angle = np.arange(RAYS) * 2.0 * np.pi / RAYS
    level = np.linspace(0.1, config.height, 6)
    ways = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    starts = np.repeat(place + level[:, None] * [0.0, 0.0, 1.0], len(ways), axis=0)
    found = float(first_hits(surface, starts, np.tile(ways, (len(level), 1))).min())
    return found if found < base.radius else np.inf
