"""The front of a part that moves: its largest plane, and on which side of it the room is."""

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from s2a.scan.evidence.surface import ScanSurface
from s2a.scene.geometry.mesh_ops import centroids, keep, merge, sample
from s2a.scene.geometry.planes import across, find_planes, min_area_rectangle
from s2a.scene.scene import Mesh, Scene

FLAT = 0.006  # [m] Faces this near belong to a plane: three times the noise of a laser scan
POINTS = 120  # Points of a front whose lines of sight are tried
SIDED = 0.3  # Excess of one side over the other, of their sum, from which the lines of sight tell a side
RELIEF = 0.004  # [m] A region whose middle stands out by less may be noise


@dataclass(frozen=True)
class Front:
    """The largest plane of a part."""

    normal: np.ndarray  # unit, outwards: to the side where the room is, shape [3]
    offset: float  # normal.x on the plane [m]
    # directions of the sides of the smallest rectangle around the part in the plane, as columns, shape [3 2]
    axes: np.ndarray
    low: np.ndarray  # smallest coordinates of the part along `axes` [m], shape [2]
    high: np.ndarray  # largest ones
    thickness: float  # extent of the part behind its plane [m]
    fill: float  # fraction of the rectangle that the part's outline fills: about 1 for a rectangle, 0.79 for a disc
    # excess of the lines of sight from the outward side over those from the other, of their sum, -1 to 1; NaN
    # where none is free
    seen: float
    facing: float  # the same of the area of faces that look outwards, -1 to 1
    relief: float  # how far the middle of the grasp region stands out of the plane [m]; NaN for a part without a region

    @property
    def center(self) -> np.ndarray:
        """Middle of the rectangle [m], shape [3]."""
        return self.axes @ (self.low + self.high) / 2 + self.normal * self.offset

    @property
    def size(self) -> np.ndarray:
        """Sides of the rectangle [m], shape [2]."""
        return self.high - self.low

    @property
    def votes(self) -> dict[str, float]:
        """The evidence for the outward side that tells anything: its name, positive where it agrees."""
        evidence = {"seen": (self.seen, SIDED), "facing": (self.facing, SIDED), "relief": (self.relief, RELIEF)}
        return {name: value for name, (value, least) in evidence.items() if abs(value) >= least}


def panel(scene: Scene, part: str) -> Mesh:
    """Return the surface of a moving part without its grasp region; with it where there is no other."""
    region = set(scene.grasp_parts(part))
    own = scene.parts[part].mesh
    if part in region or own.face_areas.sum() > 0:
        return own
    return merge([scene.parts[i].mesh for i in scene.members(part) if i not in region])


def region(scene: Scene, part: str) -> Mesh | None:
    """Return the surface of a moving part's grasp region, or None if the part itself is grasped."""
    parts = scene.grasp_parts(part)
    return None if part in parts else merge([scene.parts[i].mesh for i in parts])


def front(surface: ScanSurface, part: str) -> Front | None:
    """Return the front of a moving part, or None where it has no plane of a square centimetre.

    The outward side is the one that most of three witnesses name: the lines of sight from the room's free interior, the
    sides to which the scanned faces look, and the side on which the grasp region stands out.
    """
    mesh = panel(surface.scene, part)
    planes = find_planes(Mesh(mesh.vertices, mesh.faces), FLAT, 1e-4, 1)
    if not planes:
        return None
    normal, offset, flat = planes[0].normal, planes[0].offset, keep(mesh, planes[0].faces)
    points = sample(flat, POINTS, 0)
    ahead, behind = surface.seen(points, normal)
    seen = (ahead - behind) / (ahead + behind) if ahead + behind > 0 else np.nan
    facing = surface.winding * _facing(mesh, normal)
    relief = _relief(surface.scene, part, normal, offset)
    axes, low, high, fill = _rectangle(mesh, normal)
    one = Front(normal, offset, axes, low, high, 0.0, fill, seen, facing, relief)
    sign = -1.0 if sum(np.sign(vote) for vote in one.votes.values()) < 0 else 1.0
    thickness = float(max(0.0, -np.quantile(sign * (mesh.vertices @ normal - offset), 0.02)))
    outwards = {name: sign * getattr(one, name) for name in ("normal", "offset", "seen", "facing", "relief")}
    return replace(one, thickness=thickness, **outwards)


def _facing(mesh: Mesh, normal: np.ndarray) -> float:
    """Return the area of faces along a normal minus that of faces against it, of their sum."""
    a, b, c = np.moveaxis(mesh.vertices[mesh.faces].astype(np.float64), 1, 0)
    along = 0.5 * np.cross(b - a, c - a) @ normal
    return float(along.sum() / max(np.abs(along).sum(), 1e-12))


def _relief(scene: Scene, part: str, normal: np.ndarray, offset: float) -> float:
    """Return how far the middle of a part's grasp region lies before a plane [m]; NaN without a region."""
    held = region(scene, part)
    if held is None or not held.face_areas.sum() > 0:
        return float("nan")
    return float(np.average(centroids(held) @ normal - offset, weights=held.face_areas))


def _rectangle(mesh: Mesh, normal: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, float]:
    """Return the smallest rectangle around a mesh across a normal: directions [3 2], low and high [2], and its fill."""
    basis = np.stack(across(normal), axis=1)
    flat = mesh.vertices.astype(np.float64) @ basis
    axes = basis @ min_area_rectangle(flat)
    along = mesh.vertices.astype(np.float64) @ axes
    low, high = along.min(axis=0), along.max(axis=0)
    return axes, low, high, float(ConvexHull(flat).volume) / max(float(np.prod(high - low)), 1e-12)
