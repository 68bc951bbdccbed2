"""Colliders that are fitted to what a noisy, coarse scan shows of a handle: neither larger nor smaller, square on their front."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from seen_handles import FRAME, PLANE, block, cup, knob, noisy, outside, pull, ring_behind, turned_knob

from s2a.scene.geometry.front_panel import facing_frame, fraction_inside, patch
from s2a.scene.geometry.knob import knob_hulls
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.sheet import straight_sheet


def test_noise_makes_no_knob_larger_and_a_coarse_mesh_makes_none_smaller() -> None:
    """Sides of a 12-gon inscribed in a circle of 15 mm are 7.8 mm long and lie 7.8^2 / (12 15) = 0.34 mm inside of it."""
    for region in (noisy(knob(), 0.0005), knob(sides=12)):
        pieces = knob_hulls(region, FRAME, 0.0)
        assert pieces is not None
        head = merge(pieces).vertices
        head = head[head[:, 0] > 0.016]
        # Polygons that stand for a circle have its area: their corners are 1.3 % farther out.
        assert np.linalg.norm(head[:, 1:], axis=1).max() == pytest.approx(0.015 * 1.013, abs=0.0004)
        assert head[:, 0].max() == pytest.approx(0.028, abs=0.0004)


def test_a_corner_that_the_scan_rounds_off_stays_the_heads_corner_and_a_ball_stays_a_ball() -> None:
    rounded = turned_knob([(0.007, 0.0), (0.007, 0.013), (0.015, 0.0131), (0.015, 0.0262), (0.0128, 0.028)])
    pieces = knob_hulls(rounded, FRAME, 0.0)
    assert pieces is not None
    rim = ring_behind(0.0140, 0.0146, 0.0275)
    assert fraction_inside(pieces, rim[rim[:, 0] > 0.0265]) > 0.95
    ball = turned_knob([(0.015 * np.cos(t), 0.015 + 0.015 * np.sin(t)) for t in np.linspace(-1.2, 1.5, 40)])
    pieces = knob_hulls(ball, FRAME, 0.0)
    assert pieces is not None
    beside = ring_behind(0.012, 0.015, 0.0295)
    assert fraction_inside(pieces, beside[beside[:, 0] > 0.027]) < 0.05


def test_a_straight_pull_is_a_lip_and_a_wall_through_the_middle_of_its_noise() -> None:
    opening = np.array([0.0, 0.0, -1.0])
    pieces = straight_sheet(noisy(pull(), 0.0006), FRAME, opening, 0.0, None)
    assert pieces is not None and len(pieces) == 2
    bounds = merge(pieces).bounds
    assert bounds[1] == pytest.approx([0.02, 0.15, 0.002], abs=0.0015)
    assert bounds[1, 0] == pytest.approx(0.02, abs=0.0008)  # the outermost of the noise is at 0.022
    assert bounds[0] == pytest.approx([0.0, -0.15, -0.014], abs=0.0015)
    inside = np.random.default_rng(0).uniform([0.002, -0.14, -0.013], [0.017, 0.14, -0.001], (2000, 3))
    assert fraction_inside(pieces, inside) == 0.0


def test_a_lip_ends_where_its_skirt_begins() -> None:
    pieces = straight_sheet(pull(skirt=True), FRAME, np.array([0.0, 0.0, -1.0]), 0.0, None)
    assert pieces is not None
    assert merge(pieces).bounds[0, 2] == pytest.approx(-0.014, abs=0.0025)


def test_a_bowed_sheet_and_a_cup_are_none_that_is_straight() -> None:
    opening = np.array([0.0, 0.0, -1.0])
    assert straight_sheet(pull(lift=0.02), FRAME, opening, 0.0, None) is None
    assert straight_sheet(outside(cup()), FRAME, opening, 0.0, None) is None


def test_a_piece_of_front_behind_a_handle_ends_with_it_where_the_front_does() -> None:
    front = block((-0.001, -0.3, -0.2), (0.0, 0.3, -0.014))
    region = pull()
    piece = patch(region, front, FRAME, PLANE, 0.02)
    assert piece.bounds[1, 2] == pytest.approx(0.002, abs=0.001)  # the front's upper border: nothing beyond
    assert piece.bounds[0, 2] < -0.0165 and piece.bounds[:, 0] == pytest.approx([-0.02, 0.0], abs=1e-6)


def test_hulls_of_a_handle_stand_square_on_its_front_though_it_moves_aslant() -> None:
    turn = trimesh.transformations.rotation_matrix(np.radians(8), [0, 0, 1])[:3, :3]
    upright = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    assert facing_frame(turn @ upright, PLANE[0]) == pytest.approx(upright, abs=1e-9)
