"""The inside of a drawer, and places for objects in it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from cabinet import box
from drawer_room import DEPTH, FLOOR, HALF_WIDTH, WALL_TOP, drawer_room

from s2a.core.errors import InputError
from s2a.motion.obstacles import moved_room
from s2a.motion.places import BESIDE, at_zero, inside_of, inside_placements


def test_the_inside_ends_at_the_walls_and_at_the_lowest_wall_s_top(tmp_path: Path) -> None:
    room = drawer_room(tmp_path / "sim.usda")
    inside = inside_of(room, "drawer_2", 0.3, np.array([0.4, 0.05, FLOOR]))  # 0.1 m from the middle of the box at zero
    assert inside is not None
    np.testing.assert_allclose(inside.half, [(DEPTH[1] - DEPTH[0]) / 2, HALF_WIDTH, (WALL_TOP - FLOOR) / 2], atol=1e-4)
    np.testing.assert_allclose(inside.frame[:3, 3], [np.mean(DEPTH), 0.0, (FLOOR + WALL_TOP) / 2], atol=1e-4)


def test_places_are_on_the_floor_within_the_walls_and_open_above(tmp_path: Path) -> None:
    found = inside_placements(drawer_room(tmp_path / "sim.usda"), "cube_9", "drawer_2", 0.3)
    at = np.array([pose for pose, _ in found])
    np.testing.assert_allclose(at[:, 2], FLOOR + 0.02 + 0.001, atol=1e-4)
    assert np.abs(at[:, 1]).max() <= HALF_WIDTH - 0.02 - BESIDE + 1e-3
    assert at[:, 0].max() <= DEPTH[1] + 0.3 - 0.02 - BESIDE + 1e-3
    assert at[:, 0].min() >= 0.305 + 0.02  # what the cabinet's top covers cannot be reached


def test_what_is_higher_than_the_gap_does_not_go_in(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"of 0.125 m height .* meets what is above as that is shut, by \d+ mm"):
        inside_placements(drawer_room(tmp_path / "sim.usda", side=0.125), "cube_9", "drawer_2", 0.3)


def test_what_is_below_the_floor_does_not_count(tmp_path: Path) -> None:
    below = [box((0.1, 0.0, FLOOR - 0.01), (0.2, 0.3, 0.01))]  # as the drawer below may be: as high as this one's floor
    room = drawer_room(tmp_path / "sim.usda", beside=below)
    assert inside_placements(room, "cube_9", "drawer_2", 0.3)


def test_a_drawer_without_a_floor_takes_nothing(tmp_path: Path) -> None:
    room = drawer_room(tmp_path / "sim.usda", floor=False)
    with pytest.raises(InputError, match=r"no level floor .* prepare.interior=true"):
        inside_placements(room, "cube_9", "drawer_2", 0.3)


def test_what_is_in_the_part_moves_with_it(tmp_path: Path) -> None:
    room = drawer_room(tmp_path / "sim.usda")
    moved = moved_room(room, "drawer_2", 0.25, {"cube_9": np.array([0.5, 0, 0.7, 0, 0, 0, 1.0])})
    assert moved.bodies["drawer_2"].position == pytest.approx((0.25, 0.0, 0.0))
    assert moved.bodies["cabinet_1"] is room.bodies["cabinet_1"]
    back = at_zero(room, "drawer_2", np.array([*moved.free["cube_9"].position, 0, 0, 0, 1.0]), 0.25)
    np.testing.assert_allclose(back[:3], [0.25, 0.0, 0.7])
