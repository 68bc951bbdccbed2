"""The soft bear at rest: one piece, its volume, its boxes, the surface that follows it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from pxr import Usd
from scipy.spatial.transform import Rotation
from soft_cube import cube_asset

from s2a.core.errors import InputError
from s2a.sim.soft_body import BEAR, KUHN, SoftBody, SoftShape, read_asset, soft_body, volumes

SHAPE = SoftShape(length=0.14, cells=15, fill=0.4)


@pytest.fixture(scope="module")
def bear() -> SoftBody:
    """Of the shape that conf has."""
    return soft_body(SHAPE)


def test_a_cube_is_cut_into_six_tetrahedra_of_a_sixth_each() -> None:
    corners = KUHN.reshape(-1, 3).astype(float)
    np.testing.assert_allclose(volumes(corners, np.arange(24).reshape(6, 4)), 1.0 / 6.0)


def test_its_volume_is_that_of_its_cells_and_near_the_asset_s(bear: SoftBody) -> None:
    points, tets, _ = read_asset(BEAR)
    asset = volumes(points, tets).sum() * (0.14 / np.ptp(points[:, 0])) ** 3
    assert volumes(bear.vertices, bear.tets).min() > 0.0
    assert volumes(bear.vertices, bear.tets).sum() == pytest.approx(bear.volume)
    assert bear.volume == pytest.approx(asset, rel=0.1)


def test_its_frame_is_at_the_centre_of_mass(bear: SoftBody) -> None:
    assert bear.vertex_volumes.sum() == pytest.approx(bear.volume)
    np.testing.assert_allclose(bear.vertex_volumes @ bear.vertices, 0.0, atol=1e-12)


def test_its_boxes_are_its_cells(bear: SoftBody) -> None:
    sizes = [np.ptp(box.vertices, axis=0).prod() for box in bear.boxes]
    assert sum(sizes) == pytest.approx(bear.volume, rel=1e-5)
    assert (np.diff(sizes) < 1e-9).all()  # the largest first
    assert len(bear.boxes) < 40


def test_the_moments_of_a_cube_are_those_of_its_vertices(tmp_path: Path) -> None:
    """One cell, 0.2 m wide: Kuhn's cut lets its vertices stand for unequal volumes, which add up to all of it."""
    body = soft_body(SoftShape(0.2, 1, 0.5), cube_asset(tmp_path))
    assert len(body.boxes) == 1
    assert body.volume == pytest.approx(0.008)
    # All vertices are 0.1 m from the middle along every axis: each moment is m (0.1^2 + 0.1^2).
    assert body.inertia(100.0) == pytest.approx([0.8 * 0.02] * 3)


def test_the_surface_follows_every_affine_motion(bear: SoftBody) -> None:
    np.testing.assert_allclose(bear.shown(bear.vertices).vertices, bear.surface.vertices, atol=1e-6)
    turn = Rotation.from_rotvec([0.3, -0.2, 0.9]).as_matrix() @ np.diag([1.0, 0.7, 1.1])
    moved = bear.shown(bear.vertices @ turn.T + [1.0, 2.0, 3.0]).vertices
    np.testing.assert_allclose(moved, bear.surface.vertices @ turn.T + [1.0, 2.0, 3.0], atol=1e-5)


def test_the_surface_keeps_near_what_is_simulated(bear: SoftBody) -> None:
    cell = SHAPE.length / SHAPE.cells
    low, high = bear.vertices.min(axis=0) - cell, bear.vertices.max(axis=0) + cell
    assert ((bear.surface.vertices >= low) & (bear.surface.vertices <= high)).all()


def test_cells_so_large_that_the_legs_fall_off_are_an_error() -> None:
    with pytest.raises(InputError, match=r"cells=10: the body falls into \d parts; give more cells"):
        soft_body(SoftShape(0.14, 10, 0.5))


def test_a_file_without_tetrahedra_is_an_error(tmp_path: Path) -> None:
    path = tmp_path / "none.usda"
    Usd.Stage.CreateNew(str(path)).Save()
    with pytest.raises(InputError, match="no mesh has tetraIndices"):
        read_asset(path)
