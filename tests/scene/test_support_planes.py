"""Flat pieces on which things stand: normals that are smoothed where a surface looks one way."""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.regions import UP, smoothed_normals
from s2a.scene.scene import Mesh


def test_a_surface_that_looks_down_has_no_smoothed_normals() -> None:
    mesh = Mesh(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 2, 1]]))
    assert np.array_equal(smoothed_normals(mesh, UP, rounds=2), [[0, 0, 0]])


def test_a_flat_surface_keeps_its_normal_and_the_side_of_a_step_has_none() -> None:
    points = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, -1], [1, 0, -1]])
    mesh = Mesh(points, np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5], [0, 5, 1]]))
    assert np.allclose(smoothed_normals(mesh, UP, rounds=3), [[0, 0, 1], [0, 0, 1], [0, 0, 0], [0, 0, 0]])
