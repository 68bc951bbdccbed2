"""What stays where it is put, and what does not."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.certify.settle import SettleConfig, Settled, settle
from s2a.config import compose
from s2a.config import load as typed
from s2a.geometry.convex import box, column
from s2a.geometry.surfaces import merge
from s2a.scene import Mesh

CONFIG: SettleConfig = typed(SettleConfig, compose("edit/placement")["edit"]["settle"])


def rough_floor(size: float = 0.5, step: float = 0.015, noise: float = 0.0015) -> Mesh:
    """Return a rough square surface at z = 0 that looks up."""
    line = np.arange(-size / 2, size / 2 + step, step)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = np.random.default_rng(0).normal(scale=noise, size=x.shape)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (s.ravel() for s in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return Mesh(points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def dropped(piece: Mesh, support: Mesh, **changes: float) -> Settled:
    values = {**compose("edit/placement")["edit"]["settle"], **changes}
    return settle([piece], support, typed(SettleConfig, values))


def block(size: tuple[float, float, float], x: float = 0.0, z: float = 0.004) -> Mesh:
    return box(np.array([x, 0.0, z + size[2] / 2]), np.eye(3), np.array(size))


def test_a_box_stays_on_a_rough_floor() -> None:
    found = dropped(block((0.1, 0.12, 0.08)), rough_floor())
    assert found.stays, found.problem
    assert found.drift < 0.006
    assert found.penetration < 0.0005


def test_a_box_stays_on_two_large_triangles() -> None:
    floor = Mesh(np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    found = dropped(block((0.1, 0.12, 0.08), z=0.0003), floor)
    assert found.stays, found.problem
    assert found.drift < 0.0006


def test_a_box_over_an_edge_falls_once_its_middle_is_out() -> None:
    floor = rough_floor()
    edge = float(floor.vertices[:, 0].max())
    assert dropped(block((0.1, 0.1, 0.1), x=edge - 0.02), floor).stays
    assert not dropped(block((0.1, 0.1, 0.1), x=edge + 0.02), floor).stays


def test_a_slender_pole_on_its_tip_tilts() -> None:
    pole = column(np.array([0.0, 0.0, 0.004]), 0.002, 0.5)
    found = dropped(pole, rough_floor())
    assert not found.stays
    assert found.tilt > CONFIG.tilt


def test_what_floats_falls_and_what_is_inside_is_pushed_out() -> None:
    found = dropped(block((0.1, 0.1, 0.1), z=0.03), rough_floor(), reach=0.1)
    assert found.drift == pytest.approx(0.03, abs=0.006)
    assert "drifts by" in found.problem
    assert not dropped(block((0.1, 0.1, 0.1), z=-0.03), rough_floor()).stays


def test_without_a_floor_it_falls() -> None:
    away = rough_floor()
    far = Mesh(away.vertices + [5, 0, 0], away.faces)
    assert dropped(block((0.1, 0.1, 0.1)), far).problem == "it falls: nothing carries it"


def test_a_box_in_a_narrow_bowl_rests_on_its_ground_and_on_no_hull() -> None:
    # Four walls 0.2 m high around a ground of 0.3 m: the hull of all of it would lift the box by 0.2 m.
    ground = rough_floor(0.3)
    walls = [ground]
    for turn in range(4):
        c, s = np.cos(turn * np.pi / 2), np.sin(turn * np.pi / 2)
        wall = np.array([[0.16, -0.16, 0], [0.16, 0.16, 0], [0.16, 0.16, 0.2], [0.16, -0.16, 0.2]])
        turned = wall @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]])
        walls.append(Mesh(turned, np.array([[0, 2, 1], [0, 3, 2]])))
    found = dropped(block((0.25, 0.25, 0.1)), merge(walls))
    assert found.stays, found.problem


@pytest.mark.parametrize(("gap", "stays"), [(0.002, True), (0.02, False), (-0.004, False)])
def test_a_picture_hangs_at_its_wall(gap: float, stays: bool) -> None:
    wall = Mesh(np.array([[0, -1, 0], [0, 1, 0], [0, 1, 2], [0, -1, 2]]), np.array([[0, 1, 2], [0, 2, 3]]))
    picture = box(np.array([gap + 0.01, 0.0, 1.4]), np.eye(3), np.array([0.02, 0.5, 0.4]))
    assert settle([picture], wall, CONFIG, np.array([-1.0, 0.0, 0.0])).stays is stays
