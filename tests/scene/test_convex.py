"""Convex pieces: hulls, cuts, overlaps."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from s2a.scene.geometry import convex
from s2a.scene.scene import Mesh

CUBE = convex.box(np.zeros(3), np.eye(3), np.ones(3))


def moved(piece: Mesh, by: tuple[float, float, float]) -> Mesh:
    return Mesh(piece.vertices + np.array(by), piece.faces)


def test_a_hull_is_closed_and_looks_outwards() -> None:
    piece = convex.hull(np.random.default_rng(0).normal(size=(200, 3)))
    assert piece is not None
    solid = trimesh.Trimesh(piece.vertices, piece.faces, process=False)
    assert solid.is_watertight and solid.volume > 0


@pytest.mark.parametrize("flat", [(1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1e-5, 1.0, 1.0)])
def test_flat_and_thin_sets_get_a_thickness(flat: tuple[float, float, float]) -> None:
    piece = convex.hull(np.random.default_rng(0).random((50, 3)) * flat)
    assert piece is not None
    assert (np.ptp(piece.vertices, axis=0) > 0.9e-3).all()
    assert convex.volume(piece) > 0


def test_two_points_have_no_hull() -> None:
    assert convex.hull(np.array([[0, 0, 0], [1, 0, 0], [1, 0, 0]])) is None


def test_a_sphere_of_32_vertices_keeps_nine_tenths_of_the_sphere() -> None:
    directions = np.random.default_rng(0).normal(size=(2000, 3))
    sphere = directions / np.linalg.norm(directions, axis=1, keepdims=True)
    piece = convex.hull(sphere, max_vertices=32)
    assert piece is not None
    assert len(piece.vertices) <= 32
    assert convex.volume(piece) > 0.75 * 4 / 3 * np.pi
    assert np.abs(np.linalg.norm(piece.vertices, axis=1) - 1).max() < 1e-5


def test_overlap_is_the_radius_of_the_ball_that_fits_into_both() -> None:
    assert convex.overlap(CUBE, moved(CUBE, (0.8, 0, 0))) == pytest.approx(0.1, abs=1e-6)
    assert convex.overlap(CUBE, CUBE) == pytest.approx(0.5, abs=1e-6)
    assert convex.overlap(CUBE, moved(CUBE, (1.1, 0, 0))) == 0.0
    # Boxes around them overlap, they do not.
    turned = trimesh.transformations.rotation_matrix(np.pi / 4, [0, 0, 1])[:3, :3]
    assert convex.overlap(CUBE, convex.box(np.array([1.0, 1.0, 0]), turned, np.ones(3))) == 0.0


def test_contains_is_exact_at_the_faces() -> None:
    points = np.array([[0.499, 0, 0], [0.501, 0, 0], [0.51, 0, 0]])
    assert convex.contains(CUBE, points).tolist() == [True, False, False]
    assert convex.contains(CUBE, points, margin=0.005).tolist() == [True, True, False]


def test_what_is_clipped_and_what_is_left_make_up_the_piece() -> None:
    normal = np.array([1.0, 2.0, 3.0]) / np.sqrt(14.0)
    one, other = convex.clip(CUBE, normal, 0.1), convex.clip(CUBE, -normal, -0.1)
    assert one is not None and other is not None
    assert convex.volume(one) + convex.volume(other) == pytest.approx(1.0, abs=1e-5)
    assert (one.vertices @ normal).max() == pytest.approx(0.1, abs=1e-5)


def test_clipping_all_or_nothing() -> None:
    assert convex.clip(CUBE, np.array([1.0, 0, 0]), 0.6) is CUBE
    assert convex.clip(CUBE, np.array([1.0, 0, 0]), -0.6) is None


def test_cutting_free_takes_the_plane_that_costs_least() -> None:
    (free,) = convex.cut_free(CUBE, moved(CUBE, (0.8, 0.1, 0)))
    assert convex.volume(free) == pytest.approx(0.8, abs=1e-3)
    assert convex.cut_free(CUBE, moved(CUBE, (2, 0, 0)), count=4)[0] is CUBE
    assert not convex.cut_free(CUBE, convex.box(np.zeros(3), np.eye(3), 2 * np.ones(3)), count=4)


def test_more_parts_keep_more_and_none_that_is_too_small() -> None:
    corner = moved(CUBE, (0.8, 0.7, 0.6))  # 0.2 x 0.3 x 0.4 are in both
    kept = [sum(map(convex.volume, convex.cut_free(CUBE, corner, count=k))) for k in (1, 2, 3, 4)]
    assert kept == pytest.approx([0.8, 0.8 + 0.2 * 0.7, 1 - 0.2 * 0.3 * 0.4, 1 - 0.2 * 0.3 * 0.4], abs=1e-3)
    assert len(convex.cut_free(CUBE, corner, count=4, min_volume=0.1)) == 2


def test_a_thin_edge_is_cut_free_though_no_ball_fits_into_what_it_shares() -> None:
    sheet = convex.hull(
        np.array([(0, y, z) for y in (0, 1) for z in (0, 1)] + [(-1, y, z) for y in (0, 1) for z in (-0.001, 1.001)])
    )
    wall = convex.box(np.array([0.5, 0.5, -0.0003]), np.eye(3), np.array([1.006, 0.5, 0.0008]))
    assert sheet is not None and 0.0 < convex.overlap(sheet, wall) < 1e-4
    (free,) = convex.cut_free(sheet, wall)
    assert convex.overlap(free, wall) == 0.0


def test_subtracting_a_notch_keeps_the_rest() -> None:
    notch = convex.box(np.array([0, 0, 0.5]), np.eye(3), np.array([0.2, 2.0, 0.4]))
    rest = convex.subtract(CUBE, notch)
    assert sum(map(convex.volume, rest)) == pytest.approx(1 - 0.2 * 0.2, abs=1e-3)
    points = np.random.default_rng(0).uniform(-0.09, 0.09, (100, 3)) + [0, 0, 0.4]
    assert not any(convex.contains(piece, points).any() for piece in rest)


def test_a_column_holds_its_circle() -> None:
    angles = np.linspace(0, 2 * np.pi, 50)
    ring = np.stack([1 + 0.25 * np.cos(angles), 2 + 0.25 * np.sin(angles), 0 * angles + 0.6], axis=1)
    assert convex.contains(convex.column(np.array([1.0, 2.0, 0.0]), 0.25, 1.2), ring, margin=1e-6).all()
