"""Labels of a scan forbid proposals on what has no front and expect them on furniture that opens; fronts get handles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import plain_room
import pytest

from s2a.annotate import handle
from s2a.annotate.annotation import Item
from s2a.annotate.propose.furniture import LabelledFaces, opens, refrigerator_doors, turns_right
from s2a.annotate.region import FrontRegion, GrowConfig, hinge_at, inside, slide
from s2a.annotate.surface import SplitSurface

UP, RIGHT, OUT = np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])


def front(height: float, faces: tuple[int, ...] = ()) -> FrontRegion:
    """Return a front of 0.4 x 0.6 m that faces x, its middle at a height."""
    axes = np.stack([RIGHT, UP], axis=1)
    return FrontRegion(OUT, np.array([0.0, 0.0, height]), axes, np.array([0.4, 0.6]), np.array(faces, int))


@pytest.mark.parametrize(
    ("label", "expected"),
    [
        ("kitchen cabinets", True),
        ("Refrigerator", True),
        ("bedside table", True),
        ("toilet cabinet", True),
        ("bed", False),
        ("sofa chair", False),
        ("curtains", False),
        ("toilet", False),
        ("wall", False),
        ("embedded thing", None),
        ("table", None),
        ("COUCH", False),
        ("object", None),
    ],
)
def test_words_of_a_label_say_whether_it_opens(label: str, expected: bool | None) -> None:
    assert opens(label) is expected


def test_a_front_on_a_couch_is_forbidden_and_on_a_cabinet_expected() -> None:
    labels = LabelledFaces.of(np.ones(10), ["couch", "cabinet", "table"], np.array([0, 0, 0, 1, 1, 1, 2, 2, -1, -1]))
    assert labels.min_score(front(0.4, (0, 1, 2)), 0.5) == np.inf
    assert labels.min_score(front(0.4, (3, 4, 5)), 0.5) == 0.25
    assert labels.min_score(front(0.4, (6, 7, 8)), 0.5) == 0.5
    names = LabelledFaces.of(np.ones(3), ["door", "cabinet door", "windows"], np.arange(3))
    assert [names.one_leaf(front(0.4, (face,))) for face in range(3)] == [True, False, True]
    # A third of the front on a couch forbids it, a quarter, which may be a border that is off, does not.
    assert labels.min_score(front(0.4, (0, 6, 7)), 0.5) == np.inf
    assert labels.min_score(front(0.4, (0, 3, 4, 5)), 0.5) == 0.25


@pytest.mark.parametrize(
    ("side", "height", "expected"),
    [
        (0, 0.4, (-0.15, 0.18)),  # hinged at its right: at the left, near the upper end of a floor cabinet
        (1, 0.4, (0.15, 0.18)),
        (0, 1.7, (-0.15, -0.18)),  # a wall cabinet: near the lower end
        (0, 0.95, (-0.15, 0.05)),  # a hand's height lies within
        (2, 1.7, (0.0, -0.25)),  # a flap hinged above is held below
        (3, 0.4, (0.0, 0.25)),
    ],
)
def test_a_door_is_held_at_the_side_that_moves_most(side: int, height: float, expected: tuple[float, float]) -> None:
    region = front(height)
    place = region.local(handle.usual_place(region, hinge_at(region, side))[None])[0]
    assert place == pytest.approx((*expected, 0.0), abs=1e-9)


def test_a_drawer_is_held_in_its_middle_and_a_sliding_door_at_the_side_that_it_leaves() -> None:
    region = front(0.4)
    assert handle.usual_place(region, slide(region, "out")) == pytest.approx(region.center)
    away = slide(region, "right")
    place = region.local(handle.usual_place(region, away)[None])[0]
    assert place[0] == pytest.approx(-0.15 * np.sign(region.axes[:, 0] @ np.array(away.axis)))


SPLIT = ((0.4, 0.7), (1.4, 0.7))
"""Height of the middle and of pieces at the left, one over the other [m]."""


@pytest.mark.parametrize(
    ("wide", "right", "doors"),
    [(0.9, ((0.9, 1.7),), 2), (0.7, ((0.9, 1.7),), 3), (0.9, SPLIT, 4)],  # the last: doors over doors
)
def test_pieces_on_a_refrigerator_are_two_doors_where_it_is_wide_enough(
    wide: float, right: tuple[tuple[float, float], ...], doors: int
) -> None:
    """Two pieces at the left, and one at the right half: a narrower refrigerator and one of four doors keep them."""
    sheet = plain_room.grid(np.zeros(3), RIGHT, UP, (wide, 1.8), (200, 200, 200))
    surface = SplitSurface.of(sheet.vertices, sheet.faces, sheet.colors)
    labels = LabelledFaces.of(surface.areas, ["Refrigerator"], np.zeros(len(surface.faces), int))
    items = []
    for side, middle, height, high in [*((1, 0.25, *each) for each in SPLIT), *((0, 0.75, *each) for each in right)]:
        region = replace(front(height), size=np.array([wide / 2, high]))
        region = replace(region, center=np.array([0.0, middle * wide, height]))
        region = replace(region, faces=inside(surface, region, 0.02))
        items.append(Item(region, joint=hinge_at(region, side)))
    result = refrigerator_doors(surface, tuple(items), labels, GrowConfig())
    assert len(result) == doors
    if doors == 2:
        assert [turns_right(item) for item in result] == [False, True]
        assert np.array([item.region.size for item in result]) == pytest.approx(np.array([[0.45, 1.7]] * 2), abs=0.05)
