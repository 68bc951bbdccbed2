"""Bounds that the types of settings carry."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import pytest
import satellites

from s2a.commands import cli
from s2a.core import bounds, config
from s2a.core.bounds import Above, AtLeast, Count, Fraction, NotEmpty, Numbers, Positive
from s2a.core.errors import InputError

IMPOSSIBLE = {
    "sample": [
        ("seed", "-1", "0 or more"),
        ("detail.poses", "3", "a number from 4 to 24"),
        ("detail.spacing", "-1.0", "a number above 0"),
        ("detail.fusion.voxel", "0.0", "a number above 0"),
        ("detail.thin.keep", "1.5", "a number above 0, up to 1"),
        ("annotator.border", "-0.1", "0 or more"),
    ],
    "prepare": [
        ("prepare.decimate.structure", "0.0", "a number above 0, up to 1"),
        ("prepare.decimate.other", "1.5", "a number above 0, up to 1"),
        ("prepare.decimate.max_error", "0.0", "a number above 0"),
        ("prepare.mass.families.drawer.value", "-3.0", "a number above 0"),
    ],
    "certify": [
        ("certify.physics.dt", "0.0", "a number above 0"),
        ("certify.motion.rest_time", "0.0", "a number above 0"),
    ],
    "train": [
        ("num_envs", "0", "1 or more"),
        ("demo_reset_fraction", "1.1", "a number from 0 to 1"),
        ("sim.dt", "-1.0", "a number above 0"),
        ("sim.substeps", "0", "1 or more"),
        ("task.episode_steps", "1", "2 or more"),
        ("ppo.iterations", "0", "1 or more"),
        ("ppo.hidden_dims", "[]", "a list of one or more"),
        ("ppo.gamma", "99.0", "a number from 0 to 1"),
    ],
    "evaluate": [
        ("seed", "-1", "0 or more"),
        ("planner.ik_seeds", "0", "1 or more"),
        ("camera.distance", "0.0", "a number above 0"),
    ],
    "view": [("camera.fov", "9.0", "a number above 0, up to 3"), ("camera.width", "0", "1 or more")],
    "insert": [
        ("plans", "0", "1 or more"),
        ("retries", "-1", "0 or more"),
        ("llm.timeout", "0.0", "a number above 0"),
        ("sandbox.seconds", "0.0", "a number above 0"),
    ],
    "zoo": [("seed", "-1", "0 or more")],
}


@pytest.mark.parametrize(
    ("command", "key", "value", "possible"),
    [(command, *case) for command, cases in IMPOSSIBLE.items() for case in cases],
)
def test_an_impossible_value_is_named_with_its_key_and_what_is_possible(
    command: str, key: str, value: str, possible: str
):
    satellites.need(command)
    required = [f"{k}=given" for k, given in config.leaves(config.compose(command)) if given == config.REQUIRED]
    with pytest.raises(InputError) as error:
        config.load(
            cli.settings_of(command),
            config.compose(command, [*required, f"{key}={value}"]),
        )
    assert str(error.value).startswith(f"key {key!r} is {value}; give {possible}")


@dataclass(frozen=True)
class Shelf:
    """Bounds at every depth."""

    boards: Count
    heights: Numbers
    labels: Annotated[tuple[Fraction, ...], NotEmpty()]
    corner: tuple[Positive, Positive]
    loads: dict[str, Positive]
    free: float


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"boards": 0}, "'boards' is 0; give 1 or more"),
        ({"heights": []}, "'heights' is [];"),
        ({"labels": [0.5, 1.5]}, "'labels.1' is 1.5; give a number from 0 to 1"),
        ({"corner": [1, 0]}, "'corner.1' is 0.0; give a number above 0"),
        ({"loads": {"left": math.nan}}, "'loads.left' is nan; give a number above 0"),
    ],
)
def test_what_lists_and_dictionaries_hold_has_bounds_too(changes: dict[str, object], named: str):
    shelf = {"boards": 1, "heights": [0], "labels": [0, 1], "corner": [1, 1], "loads": {"left": math.inf}, "free": -1}
    loaded = config.load(Shelf, shelf)
    assert loaded == Shelf(1, (0.0,), (0.0, 1.0), (1.0, 1.0), {"left": math.inf}, -1.0)
    with pytest.raises(InputError) as error:
        config.load(Shelf, shelf | changes)
    assert str(error.value).startswith(f"key {named}")


def test_an_end_belongs_to_the_range_or_not():
    assert [Above(0.0, 1.0).holds(value) for value in (0.0, 0.1, 1.0, 1.1)] == [False, True, True, False]
    assert [AtLeast(0.0, 1.0).holds(value) for value in (-0.1, 0.0, 1.0, 1.1)] == [False, True, True, False]
    bounds.check(Annotated[int, AtLeast(4)], 4, "corners")
    with pytest.raises(InputError, match="key 'corners' is 3; give 4 or more"):
        bounds.check(Annotated[int, AtLeast(4)], 3, "corners")
