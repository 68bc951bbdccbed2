"""Doubles: a second television is not put beside the first."""

from __future__ import annotations

import pytest

from s2a.language.insert.fit import NoRoom
from s2a.language.insert.plan import Choice, Plan, apart_from_likes, like_on

LINES = [
    {"id": "tv_1", "label": "tv", "on": "stand_2"},
    {"id": "mug_3", "label": "mug", "on": "stand_2"},
    {"id": "stand_2", "label": "tv stand", "on": "floor_9"},
    {"id": "sideboard_4", "label": "sideboard", "on": "floor_9"},
]


def plan(*targets: str) -> Plan:
    choices = tuple(Choice(target, "horizontal", "on", 0.5, "so") for target in targets)
    return Plan("+z", "-y", None, choices)


@pytest.mark.parametrize(
    ("label", "target", "like"),
    [
        ("television", "stand_2", "tv_1"),
        ("flat screen", "stand_2", "tv_1"),
        ("television", "sideboard_4", None),
        ("mug", "stand_2", None),  # people have several
        ("tv stand", "floor_9", None),
    ],
)
def test_a_like_is_one_of_a_kind_of_which_people_keep_one(label: str, target: str, like: str | None) -> None:
    assert like_on(target, label, LINES) == like


def test_a_support_with_a_like_is_passed_over_and_comes_last_in_the_last_plan() -> None:
    both = plan("stand_2", "sideboard_4")
    assert [one.target for one in apart_from_likes(both, "television", LINES, last=False).choices] == ["sideboard_4"]
    last = apart_from_likes(both, "television", LINES, last=True)
    assert [one.target for one in last.choices] == ["sideboard_4", "stand_2"]
    assert apart_from_likes(both, "mug", LINES, last=False) == both


def test_a_plan_of_nothing_else_goes_back_once() -> None:
    with pytest.raises(NoRoom, match="on stand_2: tv_1 is there already"):
        apart_from_likes(plan("stand_2"), "television", LINES, last=False)
    assert apart_from_likes(plan("stand_2"), "television", LINES, last=True) == plan("stand_2")
