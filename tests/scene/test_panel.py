"""The front panel behind a handle."""

from __future__ import annotations

import numpy as np
import pytest
from cabinet import box

from s2a.scene.geometry.front_panel import slab
from s2a.scene.geometry.mesh_ops import keep, normals
from s2a.scene.scene import Mesh

AHEAD = np.array([1.0, 0.0, 0.0])


def seen(mesh: Mesh, directions: list[list[float]]) -> Mesh:
    """Return the faces of a box that look along one of some directions."""
    facing = (normals(mesh) @ np.array(directions, float).T > 0.9).any(axis=1)
    return keep(mesh, np.flatnonzero(facing))


def test_a_front_with_its_edges_becomes_a_slab_behind_its_plane() -> None:
    front = seen(box((-0.01, 0.0, 0.5), (0.01, 0.3, 0.1)), [[1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1]])
    piece = slab(front, AHEAD, 0.02)
    assert piece is not None
    assert np.allclose(piece.bounds, [[-0.02, -0.3, 0.4], [0.0, 0.3, 0.6]], atol=3e-3)


@pytest.mark.parametrize("depth", [0.3, 0.45])
def test_a_lid_whose_edge_faces_the_gripper_is_no_slab(depth: float) -> None:
    lid = seen(box((-depth / 2, 0.0, 0.5), (depth / 2, 0.3, 0.02)), [[1, 0, 0], [0, 0, 1]])
    assert slab(lid, AHEAD, 0.02) is None
