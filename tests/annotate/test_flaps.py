"""Flaps that look like drawers: what tells them is how far behind their front the wall is."""

from __future__ import annotations

import numpy as np
import pytest

from s2a.annotate.propose.fronts import depth_behind, is_flap
from s2a.annotate.propose.layers import Points
from s2a.annotate.region import FrontRegion

DENSITY = 4000.0
X = np.array([1.0, 0.0, 0.0])


def front(wide: float, high: float) -> FrontRegion:
    """Return a front that faces x, its middle 0.4 m above the floor."""
    axes = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    return FrontRegion(X, np.array([0.0, 0.0, 0.4]), axes, np.array([wide, high]), np.empty(0, int))


def wall(behind: float, normal: np.ndarray = X, wide: float = 3.0) -> Points:
    """Return points of a wall of 1 m above 1 m, `wide` metres of it about the front."""
    count = round(DENSITY * wide)
    random = np.random.default_rng(0)
    at = random.uniform((-behind - 0.002, -wide / 2, 1.0), (-behind + 0.002, wide / 2, 2.0), (count, 3))
    return Points(at, np.tile(normal, (count, 1)), np.zeros((count, 3)))


@pytest.mark.parametrize(
    ("wide", "high", "behind", "expected"),
    [
        (0.6, 0.36, 0.35, True),  # a shoe cabinet
        (0.6, 0.36, 0.55, False),  # a chest of drawers: too deep to tip
        (0.6, 0.15, 0.35, False),  # a low drawer of a shallow cabinet
        (0.36, 0.36, 0.35, False),  # a box in a shelf
    ],
)
def test_what_is_about_as_high_as_its_furniture_is_deep_tips(
    wide: float, high: float, behind: float, expected: bool
) -> None:
    assert is_flap(front(wide, high), wall(behind), DENSITY) == expected


def test_the_wall_is_where_it_is() -> None:
    assert depth_behind(front(0.6, 0.36), wall(0.35), DENSITY) == pytest.approx(0.35, abs=0.003)


def test_without_a_wall_that_faces_as_the_front_does_nothing_is_known() -> None:
    beside, few = wall(0.35), wall(0.35)[np.arange(300)]  # of which sixty lie behind the front; a strip of it has 240
    beside.place[:, 1] += 2.0
    for points in (wall(0.35, -X), wall(1.5), beside, few):
        assert depth_behind(front(0.6, 0.36), points, DENSITY) is None
        assert not is_flap(front(0.6, 0.36), points, DENSITY)


def test_the_farthest_wall_counts() -> None:
    """A picture, or the back of an open shelf above, hangs before it."""
    near, far = wall(0.3), wall(0.6)
    both = Points(*(np.concatenate(each) for each in zip(vars(near).values(), vars(far).values(), strict=True)))
    assert depth_behind(front(0.6, 0.36), both, DENSITY) == pytest.approx(0.6, abs=0.003)
