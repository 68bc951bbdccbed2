"""What stays where it is put, and what does not."""

from __future__ import annotations

from typing import Any

import mujoco
import numpy as np
import pytest

from s2a.language.insert import drop_test as settling
from s2a.language.insert.drop_test import DropTestConfig, DropTestResult, drop_test
from s2a.scene.geometry.convex import box, column
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh

CONFIG = DropTestConfig()


def rough_floor(size: float = 0.5, step: float = 0.015, noise: float = 0.0015) -> Mesh:
    """Return a rough square surface at z = 0 that looks up."""
    line = np.arange(-size / 2, size / 2 + step, step)
    x, y = np.meshgrid(line, line, indexing="ij")
    z = np.random.default_rng(0).normal(scale=noise, size=x.shape)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (s.ravel() for s in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    points = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return Mesh(points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]))


def dropped(hull: Mesh, support: Mesh, **changes: Any) -> DropTestResult:
    return drop_test([hull], support, DropTestConfig(**changes))


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


def test_a_wide_flat_object_touches_thousands_of_triangles_and_no_contact_is_dropped() -> None:
    """With MuJoCo's own guess of memory 1,800 triangles end in an error, and 3,200 in a step without some contacts."""
    floor = rough_floor(size=1.0, step=0.033, noise=0.0)
    built = settling.model([block((0.98, 0.98, 0.002), z=-0.0005)], floor.vertices[floor.faces], np.zeros(3), CONFIG)
    data = mujoco.MjData(built)
    mujoco.mj_step(built, data)
    assert data.ncon > len(floor.faces) > 1800 and not any(warning.number for warning in data.warning)


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
    found = dropped(block((0.1, 0.1, 0.1), z=0.03), rough_floor(), search_radius=0.1)
    assert found.drift == pytest.approx(0.03, abs=0.006)
    assert "drifts by" in found.problem
    assert not dropped(block((0.1, 0.1, 0.1), z=-0.03), rough_floor()).stays


def test_without_a_floor_it_falls() -> None:
    away = rough_floor()
    far = Mesh(away.vertices + [5, 0, 0], away.faces)
    assert dropped(block((0.1, 0.1, 0.1)), far).problem == "it falls: nothing supports it"


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
    assert drop_test([picture], wall, CONFIG, np.array([-1.0, 0.0, 0.0])).stays is stays


def flat(edge: float) -> Mesh:
    """Return a level square that ends at x = edge."""
    corners = np.array([[edge - 2, -1, 0], [edge, -1, 0], [edge, 1, 0], [edge - 2, 1, 0]])
    return Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))


def steps(patches: pytest.MonkeyPatch, hull: Mesh, support: Mesh, **changes: Any) -> tuple[DropTestResult, int]:
    """Drop something; return what came of it, and in how many steps."""
    taken, step = [0], mujoco.mj_step

    def counted(*arguments: object) -> None:
        taken[0] += 1
        step(*arguments)

    with patches.context() as patch:
        patch.setattr(mujoco, "mj_step", counted)
        return dropped(hull, support, **changes), taken[0]


def test_what_rests_is_not_watched_to_the_end_and_nothing_else_comes_of_it(monkeypatch: pytest.MonkeyPatch) -> None:
    hull = block((0.1, 0.12, 0.08))
    for support in (flat(1.0), rough_floor()):
        short, few = steps(monkeypatch, hull, support)
        long, all_ = steps(monkeypatch, hull, support, creep=-1.0)
        assert all_ == round(CONFIG.seconds / CONFIG.step)
        assert few < 0.5 * all_
        assert short.problem == long.problem == ""
        assert short.drift == pytest.approx(long.drift, abs=2e-6)
        assert short.tilt == pytest.approx(long.tilt, abs=2e-5)
        assert short.penetration == pytest.approx(long.penetration, abs=2e-6)


def on_edge(over: float, **changes: Any) -> DropTestResult:
    """Watch a pole whose middle is beyond the edge of what it stands on by so much [m]."""
    return dropped(block((0.04, 0.04, 0.3), z=0.0), flat(-over), drop=0.0, **changes)


def test_what_tips_slowly_is_never_taken_for_resting() -> None:
    stands, falls = -0.001, 0.0
    for _ in range(10):  # where it still stands after two seconds, and just not
        middle = 0.5 * (stands + falls)
        if on_edge(middle, creep=-1.0).stays:
            stands = middle
        else:
            falls = middle
    for over in (stands, falls, falls + 1e-4):
        whole = on_edge(over, creep=-1.0)
        assert on_edge(over).problem == whole.problem
        assert on_edge(over).tilt == pytest.approx(whole.tilt, abs=1e-5)
    # A limit to the speed alone would take it for resting.
    assert on_edge(falls, creep=0.005, steady=1e9).stays


def test_rest_is_judged_by_a_speed_that_does_not_change() -> None:
    time = np.arange(-50, 0)[:, None] * CONFIG.step

    def rests(speed: np.ndarray) -> bool:
        speeds = np.concatenate([np.zeros((50, 5)), speed], axis=1)
        return settling.rests(speeds, speeds[-1], 1.8, CONFIG)

    assert rests(1e-5 + 0.0 * time)
    assert not rests(1e-3 + 0.0 * time)  # 1.8 mm in the time that is left
    assert not rests(1e-5 * np.exp(0.5 * time))  # a pole of 60 m falls as slowly
    assert not rests(1e-5 * np.exp(5.0 * time))
    assert not rests(1e-5 * np.exp(-5.0 * time))  # what comes to rest may hide what begins to fall
    assert not rests(1e-5 * np.sin(30.0 * time))
    assert not rests(np.where(np.arange(50)[:, None] > 1, 1e-5, np.inf))  # not watched for long enough


def test_what_is_left_out_while_an_object_hardly_moves_makes_no_difference(monkeypatch: pytest.MonkeyPatch) -> None:
    turned = np.array([[0.8, -0.6, 0.0], [0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    floor, wall = flat(0.02), block((0.01, 0.4, 0.3), x=0.11)
    for z, x in ((0.004, -0.2), (0.004, 0.05), (0.03, -0.2)):  # it stays, leans against the wall, falls deep
        hull = box(np.array([x, 0.0, z + 0.1]), turned, np.array([0.12, 0.08, 0.2]))
        values = {"search_radius": 0.05}
        found = dropped(hull, merge([floor, wall]), **values)
        with monkeypatch.context() as patch:
            patch.setattr(settling, "close", lambda triangles, _: np.ones(len(triangles), bool))
            assert dropped(hull, merge([floor, wall]), **values) == found
