"""The rules: which way is up, which side is the front, and what a phrase names."""

from __future__ import annotations

import json
from typing import Any

import pytest

from s2a.language.ask import Request
from s2a.language.insert.rules import _flat, _up, known, rules
from s2a.language.insert.stable_pose import AXES


def facts(sides: list[float], slices: dict[str, list[float]] | None = None, **more: Any) -> dict[str, Any]:
    """The facts of an object that stands equally well on every side."""
    alike = {axis: [0.8] * 5 for axis in "xyz"}
    said = {"sides": sides, "slices": alike | (slices or {}), "hollow": {}, "up": None}
    return said | {"feet": dict.fromkeys(AXES, 0.3)} | more


def test_a_table_is_used_where_a_hand_reaches() -> None:
    levels = [
        {"kind": "horizontal", "height": h, "free": f, "circle": 0.25, "room": 2.0} for h, f in ((1.5, 0.2), (0.5, 0.1))
    ]
    room = [{"id": "table_1", "label": "table", "size": [1.0, 0.7, 1.6], "supports": levels}]
    asked = facts([6.0, 2.0, 1.5], label="eraser", wish="", room=room)
    choices = json.loads(rules(Request("plan", "", (), None, asked)).text)["choices"]
    assert [choice["height"] for choice in choices] == [0.5, 1.5]


def test_a_vase_has_its_longest_side_up() -> None:
    assert _up(facts([30.0, 12.0, 12.0]), known("vase")) == "+x"


def test_of_two_proportions_that_fit_the_ends_decide() -> None:
    # An alarm clock is as wide as it is high; left and right are alike, the bells and the feet are not.
    ends = {"y": [0.4, 0.7, 0.7, 0.8, 0.9]}
    assert _up(facts([15.0, 15.0, 6.0], ends), known("alarm clock"))[1] == "y"


def test_what_did_not_stay_is_not_put_down_the_same_way_again() -> None:
    clock = facts([15.0, 15.0, 6.0], {"y": [0.4, 0.7, 0.7, 0.8, 0.9]})
    first = _up(clock, known("alarm clock"))
    assert _up(clock | {"unstable": True, "tried_up": first}, known("alarm clock")) != first


def test_a_lamp_has_its_shade_up_unless_the_file_states_the_end() -> None:
    ends = [0.75, 0.6, 0.45, 0.3, 0.25]  # a lava lamp, or a desk lamp upside down
    lamp = facts([15.0, 15.0, 40.0], {"z": ends})
    assert _up(lamp, known("desk lamp")) == "-z"
    assert _up(lamp | {"up": "+x"}, known("desk lamp")) == "-z"
    for label in ("lava lamp", "night light", "desk lamp"):
        assert _up(lamp | {"up": "+z"}, known(label)) == "+z"


@pytest.mark.parametrize("colourful", ["+x", "-x"])
def test_a_painting_faces_the_room_with_its_colours(colourful: str) -> None:
    varied = dict.fromkeys(AXES, 20.0) | {colourful: 60.0}
    up, front = _flat(facts([3.0, 45.0, 60.0], varied=varied), known("painting"))
    # 45 x 60: of pictures more are wider than high.
    assert (up, front) == ("+y", colourful)


@pytest.mark.parametrize("back", ["+y", "-y"])
def test_what_has_no_colours_hangs_with_its_flat_side_to_the_wall(back: str) -> None:
    # It stands firmly with its front up, that is on its back.
    front = "-y" if back == "+y" else "+y"
    feet = dict.fromkeys(AXES, 0.05) | {front: 0.7, back: 0.1}
    assert _flat(facts([45.0, 8.0, 9.0], feet=feet), known("towel hooks"))[1] == front


@pytest.mark.parametrize(
    ("label", "noun"),
    [
        ("glass of red wine", "wine glass"),
        ("bar of soap in a dish", "soap dish"),
        ("bar of soap", "bar of soap"),
        ("bottle of wine", "wine bottle"),
        ("bowl of oranges", "bowl"),
    ],
)
def test_a_phrase_means_its_compound(label: str, noun: str) -> None:
    kind = known(label)
    assert kind is not None
    assert noun in kind.noun
