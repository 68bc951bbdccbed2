"""Doors of a rectangle: pairs are told by the stiles of two frames, or by a width that no single cabinet door has."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from s2a.annotate.propose.fronts import CellBox, leaves, scanned
from s2a.annotate.propose.layers import FINE, Layer, layer_of
from s2a.annotate.surface import SplitSurface

LEFT, RIGHT, OUT = ("hinge", "left"), ("hinge", "right"), ("slide", "out")


def plane(height: np.ndarray) -> Layer:
    """Return the image of a grey plane that faces x, with cells of 1 cm, heights in m."""
    flat = np.zeros(height.shape)
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    return Layer(
        x, y, 0.0, np.zeros(2), 0.01, np.full((*height.shape, 3), 128.0), height, flat, flat, flat.astype(bool)
    )


def framed(width: int, doors: int) -> Layer:
    """Return doors 60 cm high beside each other, frames of 5 cm, panels 8 mm deep, smeared over 3 cm."""
    height = np.zeros((60, width))
    one = width // doors
    for start in range(0, one * doors, one):
        height[5:-5, start + 5 : start + one - 5] = -0.008
    return plane(gaussian_filter(height, 3.0, mode="nearest"))


@pytest.mark.parametrize("doors", [1, 2])
def test_two_frames_are_two_doors_that_open_away_from_their_seam(doors: int) -> None:
    one = [(CellBox(0, 0, 60, 60), None)]
    two = [(CellBox(0, 0, 30, 60), LEFT), (CellBox(30, 0, 60, 60), RIGHT)]
    assert leaves(framed(60, doors), CellBox(0, 0, 60, 60), RIGHT) == (one if doors == 1 else two)


def test_a_bulge_is_no_seam() -> None:
    across = np.linspace(-1, 1, 60)
    bulge = plane(np.tile(0.02 * (1 - across**2), (60, 1)))
    assert len(leaves(bulge, CellBox(0, 0, 60, 60), LEFT)) == 1


@pytest.mark.parametrize(("width", "height", "count"), [(60, 60, 1), (80, 60, 2), (80, 200, 1), (130, 100, 1)])
def test_flat_doors_are_two_where_their_width_is_a_module_of_two(width: int, height: int, count: int) -> None:
    flat = plane(np.zeros((height, width)))
    assert len(leaves(flat, CellBox(0, 0, width, height), LEFT)) == count
    assert len(leaves(flat, CellBox(0, 0, width, height), OUT)) == 1


@pytest.mark.parametrize(("left", "count"), [(6, 1), (36, 2), (66, 1)])
def test_a_door_with_its_handle_beside_the_middle_is_one(left: int, count: int) -> None:
    flat = plane(np.zeros((60, 75)))
    assert len(leaves(flat, CellBox(0, 0, 75, 60), LEFT, CellBox(left, 25, left + 4, 35))) == count


def test_a_front_ends_where_its_plane_does() -> None:
    height = np.full((80, 90), np.nan)
    height[10:70, 20:70] = 0.0
    assert scanned(plane(height), CellBox(12, 5, 78, 66)) == CellBox(20, 10, 70, 66)


def test_planes_of_coarse_meshes_are_thicker_by_what_their_edges_are_longer() -> None:
    triangle = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
    faces = np.array([[0, 1, 2]])
    surface = SplitSurface.of(FINE * triangle, faces, None)
    assert layer_of(surface, 0.015) == pytest.approx(0.015)
    coarse = replace(surface, vertices=(FINE + 0.02) * triangle)
    assert layer_of(coarse, 0.015) == pytest.approx(0.035)
