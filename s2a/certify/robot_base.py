"""Can a robot stand where a sim.usd says, by what was scanned there?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.check import Check, check_bound, decide
from s2a.geometry.mesh_query import RayMesh, first_hits
from s2a.ranges import Fraction, Positive
from s2a.robot.spec import RobotSpec
from s2a.usd.sim_scene import PREPARE_AGAIN, Base

HEAD = 0.3
"""[m] From here above the base the floor is looked for."""
RING = 8
"""Places around the base's middle where the floor is looked for, besides the middle."""


@dataclass(frozen=True)
class BaseCheckConfig:
    """Bounds on where a robot stands.

    Attributes:
        floor: how far the scanned floor may be from the base's foot [m].
        min_floor_fraction: fraction of the base's footprint with floor below.
        max_turn: how far the base may look past the grasp point [rad].
        height: of the column above the base that must be free [m].
    """

    floor: Positive
    min_floor_fraction: Fraction
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
    floor = floor_fraction(place, base, surface, config)
    hit = obstacle(place, base, surface, config)
    if np.isfinite(hit):
        problems.append(
            (path, f"a scanned surface lies {hit:.2f} m from the base's axis, within its radius of {base.radius:g} m")
        )
    return [
        decide("base_pose", problems, "let prepare search another place, or correct the joint", prim=path),
        check_bound(
            "base_on_floor", 1.0 - floor, 1.0 - config.min_floor_fraction, "", prim=path,
            message="of the footprint has no scanned floor below", remedy="stand where the floor was scanned; " + PREPARE_AGAIN,
        ),
    ]  # fmt: skip


def floor_fraction(place: np.ndarray, base: Base, surface: RayMesh, config: BaseCheckConfig) -> float:
    """Return the fraction of a base's footprint below which a surface is at the height of its foot, 0 to 1."""
    angle = np.arange(RING) * 2.0 * np.pi / RING
    ring = base.radius * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    starts = place + np.concatenate([np.zeros((1, 3)), ring]) + [0.0, 0.0, HEAD]
    down = np.tile([0.0, 0.0, -1.0], (len(starts), 1))
    foot = starts[:, 2] - first_hits(surface, starts, down)
    return float((np.abs(foot - (place[2] - base.pedestal)) < config.floor).mean())


def obstacle(place: np.ndarray, base: Base, surface: RayMesh, config: BaseCheckConfig) -> float:
    """Return the distance of the nearest scanned surface from the axis of the base's column [m]; inf where it is free."""
    angle = np.arange(4 * RING) * 2.0 * np.pi / (4 * RING)
    level = np.linspace(0.1, config.height, 6)
    ways = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    starts = np.repeat(place + level[:, None] * [0.0, 0.0, 1.0], len(ways), axis=0)
    found = float(first_hits(surface, starts, np.tile(ways, (len(level), 1))).min())
    return found if found < base.radius else np.inf
