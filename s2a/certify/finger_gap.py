"""Finger gap: the space on both sides of the grasp that is free in the scan, and its fill ratio by colliders."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import UsdGeom
from scipy.spatial.transform import Rotation

from s2a.certify.contents import Contents
from s2a.core.bounds import Fraction
from s2a.robot.spec import GripperSpec
from s2a.scan.visuals import visible
from s2a.scene.geometry.front_panel import fraction_inside
from s2a.scene.geometry.mesh_ops import keep, merge, sample
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd.stage import read_attribute, read_mesh

MARGIN = 0.002
"""[m] Accuracy of a scan: points nearer to its surface count as occupied."""
APPROACH = 0.2
"""[m] Length of the gripper body's swept volume before the grasp: its own depth and its straight approach."""
BLOCKED = 0.005
"""[m] Penetration depth of the gripper body that is more than the scan's roughness."""
POINTS = 1500
"""Samples on either side."""


@dataclass(frozen=True)
class GapConfig:
    """Bounds on the finger gap.

    Attributes:
        min_free_fraction: free fraction of each finger's space in the scan from which a part is graspable.
        max_fill_ratio: gap fill ratio from which colliders block the fingers.
    """

    min_free_fraction: Fraction = 0.9
    max_fill_ratio: Fraction = 0.01


@dataclass(frozen=True)
class Gap:
    """The finger gap at the grasp.

    Attributes:
        free_fraction: of each finger's space, free as scanned; the minimum of both, 0 to 1.
        fill_ratio: fraction of the free space that colliders fill, 0 to 1; NaN where nothing is free.
        thickness: of the region between the fingers, or of closed fingers within it [m].
        max_opening: of the gripper [m].
        body_penetration: max depth of scanned surfaces in the path of the gripper body [m], and the name of the deepest.
    """

    free_fraction: float
    fill_ratio: float
    thickness: float
    max_opening: float
    body_penetration: tuple[float, str] = (0.0, "")

    def graspable(self, config: GapConfig) -> bool:
        """The fingers of a parallel gripper fit, by the scan alone."""
        return self.free_fraction >= config.min_free_fraction and self.thickness < self.max_opening

    def reasons(self, config: GapConfig) -> list[str]:
        """Return in words why no parallel gripper could hold the region, as scanned; empty where one could."""
        found = [self.blocked] if self.blocked else []
        if not self.thickness < self.max_opening:
            found.append(
                f"the region is {1000 * self.thickness:.0f} mm thick, the gripper opens {1000 * self.max_opening:.0f}"
            )
        elif not self.free_fraction >= config.min_free_fraction:
            found.append(f"the scan leaves {self.free_fraction:.0%} of the fingers' space beside the region free")
        return found

    @property
    def blocked(self) -> str:
        """Message about a scanned obstacle in the path of the gripper body; empty if there is none."""
        depth, name = self.body_penetration
        return (
            f"{name} is {1000 * depth:.0f} mm deep in the path of the gripper body, as scanned"
            if depth > BLOCKED
            else ""
        )


def gap(path: Path, held: Contents, gripper: GripperSpec) -> Gap:
    """Measure the finger gap beside the grasp region of a valid sim.usd.

    Of a recessed pull it is the space of closed fingers within it. A point there is free as scanned if a straight line along
    the gripper's approach reaches it without meeting the scan.
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
    colliders = [mesh for _, mesh in scene.colliders if _near(mesh, origin)]
    whole = merge(list(scene.surfaces.values()))
    surface = ray_mesh(whole.vertices, whole.faces)
    thick, deep, starts = float(high - low), min(face, 0.0), ((low - MARGIN, -1.0), (high + MARGIN, 1.0))
    if read_attribute(site, "internal", bool, False):  # closed, in the middle; as thick as they are
        thick, deep, starts = 2 * gripper.finger_box[1], 0.0, ((0.0, -1.0), (0.0, 1.0))
    sides = [_fill(start, (deep, gripper.tip_ahead), gripper) for start in starts]
    free = [_reached(points, surface, origin, frame) for points in sides]
    open_points = np.concatenate([points[mask] for points, mask in zip(sides, free, strict=True)])
    filled = fraction_inside(colliders, origin + open_points @ frame.T) if len(open_points) else float("nan")
    found = max((_body_penetration(mesh, origin, frame, gripper), name) for name, mesh in scene.surfaces.items())
    return Gap(float(min(mask.mean() for mask in free)), filled, thick, gripper.max_opening, found)


def _body_penetration(mesh: Mesh, origin: np.ndarray, frame: np.ndarray, gripper: GripperSpec) -> float:
    """Return how deep a surface is in the box that the gripper body sweeps on its approach [m]."""
    corners = mesh.vertices[mesh.faces]
    width, height, end = gripper.body_box[0] / 2, gripper.body_box[1] / 2, -gripper.body_behind
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
    distance = first_hits(surface, starts, directions)
    return distance > away + MARGIN


def _near(mesh: Mesh, origin: np.ndarray, reach: float = 0.15) -> bool:
    low, high = mesh.bounds
    return bool(((low < origin + reach) & (high > origin - reach)).all())
