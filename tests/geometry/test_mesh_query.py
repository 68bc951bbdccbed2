"""Rays and closest points on meshes."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.geometry.mesh_query import first_hits, nearest_faces, ray_mesh


def test_the_nearest_face_and_the_first_hit_of_a_triangle() -> None:
    surface = ray_mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]]))
    face, gap = nearest_faces(surface, np.array([[0.2, 0.2, 0.3], [0.2, 0.2, 5.0]]), 1.0)
    assert face.tolist() == [0, -1] and gap.tolist() == [pytest.approx(0.3, abs=1e-6), np.inf]
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    assert first_hits(surface, np.array([[0.2, 0.2, 1.0], [0.9, 0.9, 1.0]]), down).tolist() == [1.0, np.inf]


def test_a_mesh_without_faces_is_met_by_nothing() -> None:
    nothing = ray_mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    face, _ = nearest_faces(nothing, np.zeros((3, 3)))
    assert face.tolist() == [-1, -1, -1]
    assert np.isinf(first_hits(nothing, np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0], (3, 1)))).all()
