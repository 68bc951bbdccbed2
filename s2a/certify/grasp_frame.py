"""Is the grasp frame of a sim.usd that of the scanned grasp region?"""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.certify.check import Check, check_bound
from s2a.scene.geometry.mesh_ops import centroids, normals, sample
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import PREPARE_AGAIN, Grasp

ROUND = 1.5
"""A region whose extents differ by less than this factor can be held any way round."""
INWARD = -0.5
"""Of `_facing`: 16 pockets in three virtual scans have -1.0 to -0.9, 36 handles before a front 0.07 to 1."""
SIDE = 0.5
"""Of a normal, across the approach, from which on its face is a side of the region."""
ON_SURFACE = 0.005
"""[m] A region lies no farther from its body's surface, of which it is a part."""


def grasp_frame(path: str, grasp: Grasp, surface: Mesh, max_distance: float, max_opening: float) -> list[Check]:
    """Return the checks of a grasp.

    Args:
        path: of the part's prim.
        grasp: of the part.
        surface: of its body, as scanned.
        max_distance: how far the grasp point may lie from the region [m]; a ring's middle is in the air.
        max_opening: of the gripper [m].
    """
    region = grasp.region
    tree = ray_mesh(region.vertices, region.faces)
    away = float(nearest_faces(tree, np.array([grasp.point]), 10.0)[1][0])
    gap = nearest_faces(ray_mesh(surface.vertices, surface.faces), region.vertices, 10.0)[1]
    apart = float(np.quantile(gap, 0.95, method="lower"))
    along = (sample(region, 5000, seed=0) - np.array(grasp.point)) @ Rotation.from_quat(grasp.orientation).as_matrix()
    low, high = np.quantile(along, [0.02, 0.98], axis=0)
    length, thickness, _ = high - low
    checks = []
    if grasp.internal:
        checks.append(
            check_bound(
                "grasp_internal",
                _facing(grasp),
                INWARD,
                "",
                prim=f"{path}/grasp",
                message="how far the region's sides face away from each other; a pocket's face each other",
                remedy="hold a handle that stands out from outside; " + PREPARE_AGAIN,
            )
        )
    wide = not grasp.internal and max(thickness, length) > max_opening
    ratio = float(thickness / max(length, 1e-6)) if wide else 0.0
    return [
        *checks,
        check_bound(
            "grasp_on_region", away, max_distance, "m", prim=f"{path}/grasp", message="from the grasp point to the region",
            remedy="annotate the side of the handle that is to be grasped: the middle of a ring is in the air",
        ),
        check_bound(
            "region_on_part", apart, ON_SURFACE, "m", prim=f"{path}/region", message="from the region to its part's surface",
            remedy=PREPARE_AGAIN,
        ),
        check_bound(
            "grasp_roll", ratio, ROUND, "", prim=f"{path}/grasp",
            message=f"thickness {1000 * thickness:.0f} mm by length {1000 * length:.0f} mm of the region",
            remedy="close the fingers across the thin side; " + PREPARE_AGAIN,
        ),
    ]  # fmt: skip


def _facing(grasp: Grasp) -> float:
    """Return whether a region's sides face away from its middle (1), as a bar's, or towards it (-1), as a pocket's."""
    across = Rotation.from_quat(grasp.orientation).as_matrix()[:, :2]
    middle, areas = centroids(grasp.region), grasp.region.face_areas
    away = (middle - np.average(middle, axis=0, weights=areas)) @ across
    sides = normals(grasp.region) @ across
    sides[np.linalg.norm(sides, axis=1) < SIDE] = 0.0  # floors and faces that look at the gripper
    moment = areas * np.einsum("ij,ij->i", sides, away)
    return float(moment.sum() / max(np.abs(moment).sum(), 1e-12))
