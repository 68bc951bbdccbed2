"""Hulls of the static room, cut free of what moves and of where a robot stands: little is lost."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from s2a.prepare.room_hulls import RoomConfig, cut_all, part_hulls
from s2a.scan.rest import UNANNOTATED
from s2a.scene.geometry.convex import box, column, contains, overlap, sweep, volume
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Part

FLOOR = box(np.array([0.0, 0.0, -0.01]), np.eye(3), np.array([4.0, 4.0, 0.02]))
COUNT = 12


def test_what_is_left_of_a_cut_piece_is_kept_unless_it_is_too_small() -> None:
    wall = box(np.array([0.048, 0.0, 0.0]), np.eye(3), np.full(3, 0.1))  # 2 mm of it lies at x below 0
    space = box(np.array([0.5, 0.0, 0.0]), np.eye(3), np.ones(3))
    (left,) = cut_all(wall, [space])
    assert volume(left) < 0.1 * 0.1 * 0.0021
    assert not cut_all(wall, [space], min_volume=2.5e-5)
    assert cut_all(
        box(np.zeros(3), np.eye(3), np.full(3, 0.01)), [box(np.full(3, 1.0), np.eye(3), np.ones(3))], min_volume=1.0
    )


def test_what_is_many_small_components_keeps_its_hulls() -> None:
    # a plant: 80 leaves of 8 by 4 cm, each a component smaller than what is left out, in a ball of 0.5 m
    random = np.random.default_rng(0)
    turned = Rotation.random(80, random_state=0).as_matrix()
    leaf = np.array([[-0.04, -0.02, 0.0], [0.04, -0.02, 0.0], [0.04, 0.02, 0.0], [-0.04, 0.02, 0.0]])
    places = random.normal(size=(80, 1, 3))
    places *= 0.25 * random.random((80, 1, 1)) ** (1 / 3) / np.linalg.norm(places, axis=2, keepdims=True)
    points = (leaf @ turned + places).reshape(-1, 3)
    faces = (4 * np.arange(80)[:, None, None] + [[0, 1, 2], [0, 2, 3]]).reshape(-1, 3)
    hulls = part_hulls(Part("plant", Mesh(points, faces)), RoomConfig(resolution=10000))
    on = np.any([contains(each.mesh, places[:, 0], 0.03) for each in hulls], axis=0)
    # nine of ten leaves, and little of the air between them
    assert on.mean() > 0.9 and sum(volume(each.mesh) for each in hulls) < 0.5 * 4 / 3 * np.pi * 0.25**3


def area_of_floor(pieces: list[Mesh], surface: float) -> float:
    """Return the area [m^2] over which pieces reach up to a height [m], by points 2 cm apart."""
    grid = np.stack([g.ravel() for g in np.meshgrid(*2 * [np.arange(-1.99, 2.0, 0.02)], [surface])], axis=1)
    return float(np.any([contains(piece, grid, 1e-5) for piece in pieces], axis=0).sum()) * 0.02**2


def test_a_floor_keeps_what_no_robot_stands_on() -> None:
    stands = [column(np.array([*place, -0.5]), 0.1, 1.0) for place in ((0.3, 0.2), (-1.0, 1.2), (1.4, -1.5))]
    for count in (1, 2, 3):
        left = cut_all(FLOOR, stands[:count], COUNT, 8.0e-6, 1.0e-4)
        assert len(left) <= COUNT and max(overlap(a, b) for a in left for b in stands[:count]) == 0.0
        assert max(overlap(a, b) for a, b in itertools.combinations(left, 2)) < 1e-6
        # A column takes 0.032 m^2, its bounding square 0.04.
        assert area_of_floor(left, -0.005) > 16.0 * 0.95
    assert area_of_floor(cut_all(FLOOR, stands[:1]), -0.005) < 16.0 * 0.6


def test_a_floor_that_a_door_grazes_is_not_lost() -> None:
    leaf = box(np.array([0.4, 0.02, 0.99]), np.eye(3), np.array([0.8, 0.04, 2.0]))  # 10 mm deep in the floor
    swept = sweep(leaf, Joint("revolute", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, 1.5)), 0.003)
    left = cut_all(FLOOR, swept, COUNT, 8.0e-6, 1.0e-4)
    assert len(left) <= COUNT and max(overlap(a, b) for a in left for b in swept) == 0.0
    # It sweeps a quarter of a circle, 0.5 m^2, where the lowest 7 mm of the floor are left, and of these everything.
    assert area_of_floor(left, -0.0135) == pytest.approx(16.0)
    assert area_of_floor(left, -0.001) > 16.0 - 1.5 * 0.5
    # What reaches through it makes a hole nevertheless.
    stand = column(np.array([-1.0, -1.0, -0.5]), 0.1, 1.0)
    left = cut_all(FLOOR, [*swept, stand], COUNT, 8.0e-6, 1.0e-4)
    assert len(left) <= COUNT and max(overlap(a, b) for a in left for b in [*swept, stand]) == 0.0
    assert area_of_floor(left, -0.0135) > 16.0 * 0.95


def test_no_hull_of_what_nobody_annotated_spans_two_things() -> None:
    things = [box(np.array([x, 0.0, 0.3]), np.eye(3), np.array([0.4, 0.4, 0.6])) for x in (0.0, 3.0)]
    hulls = part_hulls(Part(UNANNOTATED, merge(things)), RoomConfig(resolution=10_000))
    assert sum(volume(one.mesh) for one in hulls) == pytest.approx(2 * 0.4 * 0.4 * 0.6, rel=0.1)
    assert all(np.ptp(one.mesh.bounds[:, 0]) < 0.5 for one in hulls)


def test_hulls_of_a_room_that_nobody_annotated_fill_no_air() -> None:
    """A floor, a wall along its side, and a table top at that wall: one surface."""

    def sheet(corner: tuple[float, ...], along: tuple[float, ...], across: tuple[float, ...]) -> Mesh:
        one, two = (np.linspace(0.0, 1.0, 13)[:, None] * np.array(side) for side in (along, across))
        points = np.array(corner) + one[:, None] + two[None]
        k = np.arange(12 * 13).reshape(12, 13)[:, :-1].ravel()
        faces = np.concatenate([np.stack([k, k + 13, k + 14], 1), np.stack([k, k + 14, k + 1], 1)])
        return Mesh(points.reshape(-1, 3), faces)

    floor, wall = sheet((0, 0, 0), (3, 0, 0), (0, 3, 0)), sheet((0, 0, 0), (0, 3, 0), (0, 0, 3))
    room = merge([floor, wall, sheet((0, 0, 0.75), (0.75, 0, 0), (0, 3, 0))])
    hulls = [one.mesh for one in part_hulls(Part(UNANNOTATED, room), RoomConfig(resolution=10_000))]
    carried = np.array([[2.0, 1.0, -0.001], *([x, y, 0.749] for x in (0.2, 0.6) for y in (0.3, 1.5, 2.7))])
    assert all(any(contains(one, point[None])[0] for one in hulls) for point in carried)
    air = np.array([[x, 1.5, z] for x in (0.3, 1.0, 2.0) for z in (0.3, 0.6, 1.2, 2.0)])
    assert not any(contains(one, air, 0.02).any() for one in hulls)
