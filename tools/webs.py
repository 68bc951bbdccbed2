"""What a scan shows of the gaps behind handles: free space for fingers, or surface that is not there (webs).

Fusion and Poisson reconstruction draw surface on into the shadow behind a bar. What of it stands in the middle half of the gap,
away from all true surface, is a web.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.scene.geometry.mesh_ops import keep, merge, sample
from s2a.scene.geometry.mesh_query import RayMesh, first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Mesh, Scene

DEPTHS = (0.008, 0.12)
"""[m] Depth of a gap behind a handle into which fingers go."""
FINGER = 0.015
"""[m] How far beside the handle a web stops fingers: the thickness of a Franka fingertip."""
SLICE, STEP = 0.005, 0.0015
"""[m] Length of the slices of a handle's gap, and between the rays that look for it."""
OFF = 0.004
"""[m] What is closer to the truth is noise, not a web; in slim gaps a quarter of their depth, if that is less."""
DENSITY = 1e6
"""Points per square metre of scan by which webs are found."""


@dataclass(frozen=True)
class Gap:
    """Where fingers go behind a handle, in columns along x of its frame, which points away from the front.

    Attributes:
        pose: of that frame, shape [4 4].
        places: y and z of each column [m], shape [column 2].
        front: x of the front there [m], shape [column].
        back: x of the handle's back there [m], shape [column].
    """

    pose: np.ndarray
    places: np.ndarray
    front: np.ndarray
    back: np.ndarray

    @property
    def along(self) -> int:
        """The axis along which the handle is long: 0 for y, 1 for z."""
        return int(np.argmax(np.ptp(self.places, axis=0)))

    @property
    def length(self) -> float:
        """How long it is [m]; 0 if there is none."""
        return float(np.ptp(self.places, axis=0).max()) if len(self.places) else 0.0


def webs(mesh: Mesh, truth: Scene, poses: dict[str, np.ndarray]) -> dict[str, float]:
    """Return the fraction of each handle's gap, along the handle, that a scan closes; handles without a gap are left out.

    Args:
        mesh: the scan.
        truth: what was scanned.
        poses: of the handles, x pointing away from the front, by part id, shape [4 4] each.
    """
    clean = merge([part.mesh for part in truth.parts.values()])
    true = ray_mesh(clean.vertices, clean.faces)
    gaps = {i: find_gap(truth, i, pose) for i, pose in poses.items()}
    return {i: closed_fraction(mesh, true, gap) for i, gap in gaps.items() if gap.length > 4 * SLICE}


def find_gap(truth: Scene, part_id: str, pose: np.ndarray) -> Gap:
    """Find the gap behind a handle by rays towards its back and from there to what is true behind it."""
    handle = truth.parts[part_id].mesh
    behind = merge([part.mesh for i, part in truth.parts.items() if i != part_id])
    local = (handle.vertices - pose[:3, 3]) @ pose[:3, :3]
    low, high = local.min(axis=0), local.max(axis=0)
    grid = np.meshgrid(*(np.arange(low[i] + STEP / 2, high[i], STEP) for i in (1, 2)), indexing="ij")
    places = np.stack(grid, axis=-1).reshape(-1, 2)
    before = low[0] - 0.05
    starts = np.insert(places, 0, before, axis=1) @ pose[:3, :3].T + pose[:3, 3]
    outwards = np.tile(pose[:3, 0], (len(starts), 1))
    flown = first_hits(ray_mesh(handle.vertices, handle.faces), starts, outwards)
    hit = np.isfinite(flown)
    # A hair within the handle: a post's back lies on the front, and a ray must not start behind that.
    on_back = starts[hit] + (flown[hit, None] + 1e-4) * outwards[hit]
    depth = first_hits(ray_mesh(behind.vertices, behind.faces), on_back, -outwards[hit])
    free = (depth > DEPTHS[0]) & (depth < DEPTHS[1])
    back = (before + flown[hit])[free]
    return Gap(pose, places[hit][free], back - depth[free], back)


def closed_fraction(mesh: Mesh, true: RayMesh, gap: Gap) -> float:
    """Return the fraction of a gap's slices across the handle that are closed in the middle half of their depth.

    A slice is closed if it holds at least half the area of a flat web from the front to the handle. The outermost slices are
    left out: webs there are too close to posts to be distinguished from them.
    """
    along, across = 1 + gap.along, 2 - gap.along
    low, high = gap.places[:, across - 1].min() - FINGER, gap.places[:, across - 1].max() + FINGER
    points = _phantoms(mesh, true, gap)
    points = points[(points[:, across] > low) & (points[:, across] < high)]
    column = np.floor(gap.places[:, along - 1] / SLICE)
    closed = []
    for k in np.unique(column)[1:-1]:
        front, back = (np.median(x[column == k]) for x in (gap.front, gap.back))
        quarter = (back - front) / 4
        here = (points[:, 0] > front + quarter) & (points[:, 0] < back - quarter) & (points[:, along] // SLICE == k)
        closed.append(here.sum() / DENSITY >= 0.5 * 2 * quarter * SLICE)
    return float(np.mean(closed))


def _phantoms(mesh: Mesh, true: RayMesh, gap: Gap) -> np.ndarray:
    """Return scanned points about a gap, in the handle's frame [m], that lie on no true surface, shape [point 3]."""
    local = (mesh.vertices - gap.pose[:3, 3]) @ gap.pose[:3, :3]
    columns = np.column_stack([gap.front, gap.places])
    low, high = columns.min(axis=0) - 0.03, np.column_stack([gap.back, gap.places]).max(axis=0) + 0.03
    region = keep(mesh, ((local > low) & (local < high)).all(axis=1)[mesh.faces].any(axis=1))
    points = sample(region, int(DENSITY * region.face_areas.sum()), seed=0)
    off = min(OFF, float(np.median(gap.back - gap.front)) / 4)
    points = points[nearest_faces(true, points)[1] > off]
    return (points - gap.pose[:3, 3]) @ gap.pose[:3, :3]
