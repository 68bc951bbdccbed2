"""The measure of a handle's colliders: hulls that add, lack or fill something score badly by figures derived by hand."""

from __future__ import annotations

import math

import numpy as np
import pytest
import trimesh
from handle_error import HandleError, TrueHandle, behind, filled_behind, symmetric_error

from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh

FRAME = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Grasp frame before a front at x = 0 that looks along +x: x along +y, y up, z into the furniture."""


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    solid = trimesh.creation.box(bounds=[low, high])
    return Mesh(solid.vertices, solid.faces)


FRONT = block((-0.02, -0.3, -0.2), (0.0, 0.3, 0.2))
BAR = block((0.02, -0.05, -0.01), (0.03, 0.05, 0.01))
"""100 mm long, 20 mm wide, 10 mm deep, 20 mm before the front; its posts are left out."""
FILLED = block((0.0, -0.05, -0.01), (0.03, 0.05, 0.01))


def error_of(own: list[Mesh], handle: Mesh = BAR, front: Mesh = FRONT, other: tuple[Mesh, ...] = ()) -> HandleError:
    return symmetric_error(own, [front, *other], TrueHandle(handle, front, merge([])))


def test_hulls_that_are_the_handle_have_no_error() -> None:
    halves = [block((0.02, -0.05, -0.01), (0.03, 0.0, 0.01)), block((0.02, 0.0, -0.01), (0.03, 0.05, 0.01))]
    for own in ([BAR], halves, [BAR, *halves]):
        assert error_of(own).symmetric_mm == pytest.approx(0.0, abs=0.02)


def test_a_hull_that_is_2_mm_too_large_all_around_has_an_error_of_2_mm() -> None:
    cube, larger = block((0, -0.02, -0.02), (0.03, 0.02, 0.02)), block((0, -0.022, -0.022), (0.032, 0.022, 0.022))
    error = error_of([larger], cube)
    assert error.true_mm == pytest.approx(2.0, abs=0.02)
    # Only the strips of 2 mm along its edges are farther away than 2 mm: up to 2.83 mm, 3.46 mm at corners.
    assert error.hull_mm == pytest.approx(2.03, abs=0.03)


def test_a_missing_half_counts_though_what_is_there_lies_on_the_handle() -> None:
    """A square bar, a = 20 mm, L = 200 mm, far from its front; the half at y > 0 is missing.

    Its sides there are L/4 away in the mean, its end L/2: (2aL L/4 + a^2 L/2) / (4aL + 2a^2) = 26.2 mm. Of the hull only the cut
    is off, by a/6 in the mean (of a square from its border): a^2 a/6 / (2aL + 2a^2) = 0.15 mm. One side alone would miss it.
    """
    far = block((-0.12, -0.3, -0.2), (-0.1, 0.3, 0.2))
    bar = block((0.02, -0.1, -0.01), (0.04, 0.1, 0.01))
    error = error_of([block((0.02, -0.1, -0.01), (0.04, 0.0, 0.01))], bar, far)
    assert error.true_mm == pytest.approx(26.2, rel=0.05)
    assert error.hull_mm == pytest.approx(0.15, abs=0.03)
    assert error.symmetric_mm == error.true_mm


def test_a_filled_gap_counts_from_both_sides() -> None:
    """The bar's back, 2000 of 6400 mm^2, is inside: 20/12 (3 - 20/100) = 4.67 mm from a rectangle's border; 1.46 mm in all.

    Of the hull, 0.95 x 7.5 = 7.1 mm next to the front cannot be touched. Its sides (perimeter 240 mm) from there to 20 mm are
    min(20 - x, x) from bar or front; integrated 74.6 mm^2, times 240 mm over 2000 + 240 x 22.9 mm^2 = 2.39 mm.
    """
    error = error_of([FILLED])
    assert error.true_mm == pytest.approx(1.46, abs=0.06)
    assert error.hull_mm == pytest.approx(2.39, abs=0.08)


def test_a_gap_that_the_fronts_hulls_fill_counts_as_far_as_it_is_nearer_to_the_handle() -> None:
    """Of the sides 10 to 20 mm before the front: 240 mm x 50 mm^2 over 2000 + 240 x 20 mm^2 = 1.76 mm."""
    assert error_of([BAR], other=(FILLED,)).hull_mm == pytest.approx(1.76, abs=0.08)


def test_without_a_hull_the_error_is_infinite() -> None:
    assert symmetric_error([], [], TrueHandle(BAR, FRONT, merge([]))).symmetric_mm == math.inf


def test_the_space_behind_a_head_is_what_is_neither_stalk_nor_open_to_the_room() -> None:
    """A head of 40 x 40 x 10 mm on a stalk of 20 x 20 x 20 mm: 3/4 of its box behind the head are free."""
    head, stalk = block((0.02, -0.02, -0.02), (0.03, 0.02, 0.02)), block((0.0, -0.01, -0.01), (0.02, 0.01, 0.01))
    points = behind(TrueHandle(merge([head, stalk]), FRONT, merge([])), FRAME, 0.0)
    assert len(points) == pytest.approx(6000 * (2 / 3) * 0.75, rel=0.05)
    assert filled_behind([head, stalk, FRONT], points) == pytest.approx(0.0, abs=0.1)
    wider = block((0.0, -0.01, -0.02), (0.02, 0.01, 0.02))  # 20 x 20 x 20 of 24 x 1000 mm^3 more
    assert filled_behind([head, stalk, wider], points) == pytest.approx(100 / 3, abs=2.0)
    assert filled_behind([head], points[:0]) is None
