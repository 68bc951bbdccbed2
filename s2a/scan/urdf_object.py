"""The URDF of one object, as a network predicts it from images, as predicted parts of the scan around it.

The object is fitted into its box in the scan, and each face of the scan in the box goes to the link whose surface is nearest.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from scipy.spatial import cKDTree

from s2a.core.errors import InputError
from s2a.scan import urdf_links
from s2a.scan.ply import ScanMesh
from s2a.scan.predictions import USUAL_LABEL, USUAL_RANGE, Prediction
from s2a.scan.urdf_links import KINDS, UrdfJoint

SUFFIX = ".urdf"
HANDLE = ("handle", "knob")
"""A link that is fixed to a moving one and has such a word in its name is its handle."""
MARGIN = 0.03
"""[m] Beyond its box a face of the scan still belongs to the object, and so far from a link's surface at most."""
SAMPLES = 2000
"""Points on the surface of each link."""


@dataclass(frozen=True)
class ObjectBox:
    """Where an object stands in a scan.

    Attributes:
        center: [m], scan file's coordinates, shape [3].
        size: full extents along its own axes [m], shape [3].
        yaw: of its x axis about z [rad].
    """

    center: np.ndarray
    size: np.ndarray
    yaw: float

    @property
    def axes(self) -> np.ndarray:
        """Its axes as columns, shape [3 3]."""
        cos, sin = math.cos(self.yaw), math.sin(self.yaw)
        return np.array([[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]])

    def __str__(self) -> str:
        return "[" + ",".join(f"{value:.3f}" for value in (*self.center, *self.size, self.yaw)) + "]"


def best(path: Path, surface: ScanMesh, boxes: Sequence[ObjectBox]) -> ObjectBox:
    """Return the box in which the scan's faces lie nearest to the object's surface, on average by their areas.

    Raises:
        InputError: as of `read`.
    """
    middle = surface.vertices[surface.faces].mean(axis=1) + surface.origin
    a, b, c = np.moveaxis(surface.vertices[surface.faces].astype(np.float64), 1, 0)
    areas = np.linalg.norm(np.cross(b - a, c - a), axis=1)
    inside = _inside(middle, boxes[0])

    def misfit(box: ObjectBox) -> float:
        _, triangles, _, _ = _placed(path, box)
        tree = cKDTree(np.concatenate([_sampled(each) for each in triangles.values()]))
        return float(np.average(tree.query(middle[inside])[0], weights=areas[inside] + 1e-12)) if inside.any() else 0.0

    return min(boxes, key=misfit)


def read(path: Path, surface: ScanMesh, box: ObjectBox) -> list[Prediction]:
    """Return the moving links of a URDF at its zero pose as predicted parts of a scan; those without a face are left out.

    Args:
        path: the URDF, z up; meshes lie in its folder or below.
        surface: the scan's mesh.
        box: that the object fills; its extents are stretched to those of the box.

    Raises:
        InputError: as of `urdf_links.read`, or an object without volume.
    """
    found, triangles, linear, offset = _placed(path, box)
    near = _nearest(triangles, surface, box)
    movers = {name: _mover(name, found.joints) for name in found.poses}
    moving = [joint for joint in found.joints if joint.kind in KINDS]
    return [p for joint in moving for p in _predicted(joint, found.poses, linear, offset, near, movers)]


def _placed(path: Path, box: ObjectBox) -> tuple[urdf_links.UrdfObject, dict[str, np.ndarray], np.ndarray, np.ndarray]:
    """Return the links of a URDF, their triangles [face 3 3] in its box, and how they came there: linear map and offset."""
    found = urdf_links.read(path)
    points = np.concatenate([each.reshape(-1, 3) for each in found.triangles.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    if (high - low).min() < 1e-6:
        raise InputError(f"{path}: its surfaces lie in a plane; give a URDF of a solid object")
    linear = box.axes * (box.size / (high - low))
    offset = box.center - linear @ ((low + high) / 2)
    return found, {name: each @ linear.T + offset for name, each in found.triangles.items()}, linear, offset


def _inside(points: np.ndarray, box: ObjectBox) -> np.ndarray:
    return np.asarray((np.abs((points - box.center) @ box.axes) <= box.size / 2 + MARGIN).all(axis=1))


def _nearest(triangles: Mapping[str, np.ndarray], surface: ScanMesh, box: ObjectBox) -> dict[str, np.ndarray]:
    """Return the faces of the scan in a box by the link that is nearest, at most MARGIN away."""
    middle = surface.vertices[surface.faces].mean(axis=1) + surface.origin
    chosen = np.flatnonzero(_inside(middle, box))
    points = np.concatenate([_sampled(each) for each in triangles.values()])
    away, k = cKDTree(points).query(middle[chosen])
    return {name: chosen[(k // SAMPLES == i) & (away <= MARGIN)] for i, name in enumerate(triangles)}


def _sampled(triangles: np.ndarray) -> np.ndarray:
    """Return points on triangles [face 3 3], evenly by area, shape [SAMPLES 3]."""
    solid = trimesh.Trimesh(**trimesh.triangles.to_kwargs(triangles), process=False)
    return np.asarray(trimesh.sample.sample_surface(solid, SAMPLES, seed=0)[0])


def _mover(link: str, joints: list[UrdfJoint]) -> str | None:
    """Return the moving link that a link is or is fixed to, or None."""
    by_child = {joint.child: joint for joint in joints}
    while link in by_child:
        if by_child[link].kind in KINDS:
            return link
        link = by_child[link].parent
    return None


def _predicted(
    joint: UrdfJoint,
    poses: Mapping[str, np.ndarray],
    linear: np.ndarray,
    offset: np.ndarray,
    near: Mapping[str, np.ndarray],
    movers: Mapping[str, str | None],
) -> list[Prediction]:
    """Return the prediction of a moving joint, or none where no face of the scan belongs to it."""
    links = [link for link, mover in movers.items() if mover == joint.child and link in near]
    held = [link for link in links if link != joint.child and any(word in link.lower() for word in HANDLE)]
    faces = np.unique(np.concatenate([np.zeros(0, np.int64), *(near[link] for link in links)]))
    handle = np.unique(np.concatenate([np.zeros(0, np.int64), *(near[link] for link in held)]))
    if not len(faces):
        return []
    pose, kind = poses[joint.child], KINDS[joint.kind]
    axis = linear @ pose[:3, :3] @ joint.axis
    stretch = float(np.linalg.norm(axis))
    limits = joint.limits or (0.0, USUAL_RANGE[kind])
    if joint.limits and kind == "translation":
        limits = (limits[0] * stretch, limits[1] * stretch)
    origin = linear @ pose[:3, 3] + offset
    return [
        Prediction(USUAL_LABEL[kind], kind, axis / stretch, origin, limits, 1.0, faces, handle, joint.limits is None)
    ]
