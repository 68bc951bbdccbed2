"""Room for fingers: what the scan leaves free on both sides of the grasp, and what the colliders fill of it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import UsdGeom
from scipy.spatial.transform import Rotation

from s2a.certify.contents import Contents
from s2a.geometry.handles.finger_gap import share_inside
from s2a.geometry.mesh_ops import keep, merge, sample
from s2a.geometry.mesh_query import RayMesh, first_hits, ray_mesh
from s2a.ranges import Fraction
from s2a.robot.spec import GripperSpec
from s2a.scene import Mesh
from s2a.usd.stage import read_mesh
from s2a.usd.visuals import visible

MARGIN = 0.002
"""[m] What a scan is sure of: points nearer to its surface count as taken."""
APPROACH = 0.2
"""[m] Length of the way that the hand's body takes up before the grasp: its own depth, and what it comes straight."""
BLOCKED = 0.005
"""[m] What the scan has so deep in the way of the hand's body is no roughness of the scan."""
POINTS = 1500
"""On either side."""


@dataclass(frozen=True)
class GapConfig:
    """Bounds on the room for fingers.

    Attributes:
        free: share of a finger's room that the scan has to leave free for a part to be called graspable.
        filled: largest share of the room free in the scan that colliders may fill.
    """

    free: Fraction
    filled: Fraction


@dataclass(frozen=True)
class Gap:
    """Room for fingers at the grasp.

    Attributes:
        free: share of either finger's room that is free as scanned, the smaller one, 0 to 1.
        filled: share of what is free as scanned that colliders fill, 0 to 1; nan where nothing is free.
        thickness: of the region between the fingers [m].
        max_opening: of the gripper [m].
        palm: how deep anything scanned is in the way of the hand's body behind the fingers [m], and what.
    """

    free: float
    filled: float
    thickness: float
    max_opening: float
    palm: tuple[float, str] = (0.0, "")

    def graspable(self, config: GapConfig) -> bool:
        """Whether the scan alone says that the fingers of a parallel gripper fit."""
        return self.free >= config.free and self.thickness < self.max_opening

    @property
    def blocked(self) -> str:
        """What was scanned in the way of the hand's body, in words; empty where there is room for it."""
        depth, name = self.palm
        return f"{name} was scanned {1000 * depth:.0f} mm deep in the way of the hand's body" if depth > BLOCKED else ""


def gap(path: Path, held: Contents, gripper: GripperSpec) -> Gap:
    """Ask a sound sim.usd for the room of the fingers beside the grasp region.

    A point there is free as scanned if a straight line along the hand's approach reaches it without meeting the scan.
    """
    assert held.target is not None
    site = held.target.GetChild("grasp")
    pose = UsdGeom.Xformable(site).ComputeLocalToWorldTransform(0.0)
    quat = pose.ExtractRotationQuat()
    frame = Rotation.from_quat([*quat.GetImaginary(), quat.GetReal()]).as_matrix()
    origin = np.array(pose.ExtractTranslation())
    region = (sample(read_mesh(held.target.GetChild("region")), 20000, seed=0) - origin) @ frame
    here = region[np.abs(region[:, 0]) < gripper.finger_box[0] / 2]
    if len(here) < 50:
        return Gap(0.0, float("nan"), float("nan"), gripper.max_opening)
    (low, face), (high, _) = np.quantile(here[:, 1:], [0.02, 0.98], axis=0)
    scene = visible(path)
    pieces = [mesh for _, mesh in scene.colliders if _near(mesh, origin)]
    whole = merge(list(scene.surfaces.values()))
    surface = ray_mesh(whole.vertices, whole.faces)
    sides = [
        _fill(y, (min(face, 0.0), gripper.tip_ahead), gripper) for y in ((low - MARGIN, -1.0), (high + MARGIN, 1.0))
    ]
    free = [_reached(points, surface, origin, frame) for points in sides]
    open_points = np.concatenate([points[mask] for points, mask in zip(sides, free, strict=True)])
    filled = share_inside(pieces, origin + open_points @ frame.T) if len(open_points) else float("nan")
    found = max((_in_palm(mesh, origin, frame, gripper), name) for name, mesh in scene.surfaces.items())
    return Gap(float(min(mask.mean() for mask in free)), filled, float(high - low), gripper.max_opening, found)


def _in_palm(mesh: Mesh, origin: np.ndarray, frame: np.ndarray, gripper: GripperSpec) -> float:
    """Return how deep a surface is in the box that the hand's body passes through on its way to the grasp [m]."""
    corners = mesh.vertices[mesh.faces]
    width, height, end = gripper.palm_box[0] / 2, gripper.palm_box[1] / 2, -gripper.palm_behind
    reach = APPROACH + height
    near = ((corners.min(axis=1) < origin + reach) & (corners.max(axis=1) > origin - reach)).all(axis=1)
    if not mesh.face_areas[near].any():
        return 0.0
    places = (sample(keep(mesh, near), 50000, seed=0) - origin) @ frame
    room = np.stack([width - np.abs(places[:, 0]), height - np.abs(places[:, 1]), end - places[:, 2]], axis=1)
    within = places[:, 2] > end - APPROACH
    return float(max(0.0, room.min(axis=1)[within].max(initial=0.0)))


def _fill(start: tuple[float, float], depth: tuple[float, float], gripper: GripperSpec) -> np.ndarray:
    """Return points of a fingertip beside the region, in the grasp frame [m], shape [point 3]."""
    y, side = start
    unit = np.random.default_rng(0).uniform(size=(POINTS, 3))
    x = (unit[:, 0] - 0.5) * gripper.finger_box[0]
    return np.stack(
        [x, y + side * unit[:, 1] * gripper.finger_box[1], depth[0] + unit[:, 2] * (depth[1] - depth[0])], axis=1
    )


def _reached(points: np.ndarray, surface: RayMesh, origin: np.ndarray, frame: np.ndarray) -> np.ndarray:
    """Return which points of the grasp frame a line along the approach reaches with a margin, shape [point], bool."""
    away = 0.15
    starts = origin + (points - [0.0, 0.0, away]) @ frame.T
    directions = np.tile(frame[:, 2], (len(points), 1))
    way = first_hits(surface, starts, directions)
    return way > away + MARGIN


def _near(mesh: Mesh, origin: np.ndarray, reach: float = 0.15) -> bool:
    low, high = mesh.bounds
    return bool(((low < origin + reach) & (high > origin - reach)).all())
