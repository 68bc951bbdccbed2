"""What a run's folder remembers of its settings, its beginnings and its stage."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from s2a.core.errors import InputError
from s2a.core.provenance import starts
from s2a.learn.rl import run_folder
from s2a.scene.usd.stamp import write_stamp

VALUES: dict[str, Any] = {
    "num_envs": 4,
    "resume": False,
    "ppo": {"gamma": 0.99, "iterations": 3, "hidden_dims": (16, 8)},
    "reward": {"distance": 1.5},
    "metrics": {"success_opening": 0.2},
}


def changed(group: str, **values: object) -> dict[str, Any]:
    """Return the settings with some values of a group changed or added; None removes one."""
    group_now = {key: value for key, value in (VALUES[group] | values).items() if value is not None}
    return VALUES | {group: group_now}


@pytest.fixture
def out(tmp_path: Path) -> Path:
    """A folder in which a run was begun."""
    run_folder.keep_settings(VALUES, tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "values",
    [
        changed("ppo", iterations=9) | {"resume": True},
        changed("reward", closing=0.0),
        changed("metrics", wide_opening=0.3),
        changed("metrics", success_opening=0.1),
        changed("metrics", success_opening=None),
        VALUES | {"demo_moved_fraction": 0.0},
    ],
    ids=["longer", "a term that weighs nothing", "a threshold more", "another threshold", "a threshold less", "unused"],
)
def test_what_changes_nothing_that_is_learned_may_change(out: Path, values: dict[str, Any]) -> None:
    run_folder.keep_settings(values, out)
    run_folder.keep_settings(VALUES, out)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        (changed("ppo", gamma=0.9), "'ppo.gamma' is 0.9, but .* was begun with 0.99"),
        (
            changed("reward", closing=20.0),
            "'reward.closing' is 20.0, but .* was begun without it; .*0 for a reward term",
        ),
        (changed("reward", distance=0.0), "'reward.distance' is 0.0, but .* was begun with 1.5"),
        (changed("reward", distance=None), "'reward.distance' is None, but .* was begun with 1.5"),
    ],
)
def test_what_would_learn_something_else_is_refused_by_name(out: Path, values: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message):
        run_folder.keep_settings(values, out)


def with_sim(drives: object, spring: object) -> dict[str, Any]:
    """Return settings with a simulation."""
    limits, joint = {"velocity": 0.2, "drives": drives}, {"stiffness": 10.0, "spring": spring}
    return VALUES | {"sim": {"limits": limits, "joint": joint}}


def test_what_has_no_effect_may_change(tmp_path: Path) -> None:
    run_folder.keep_settings(with_sim(False, "joint"), tmp_path)
    run_folder.keep_settings(with_sim(False, "grasp"), tmp_path, lambda: ("sim.joint.spring",))


@pytest.mark.parametrize("text", ["{", "[]", ""])
def test_a_damaged_folder_is_one_line(out: Path, text: str) -> None:
    stage = out / "sim.usd"
    stage.write_text("a room")
    for file, use in (
        (run_folder.SETTINGS, lambda: run_folder.keep_settings(VALUES, out)),
        (run_folder.STARTS, lambda: run_folder.keep_start(out, 3, stage, {})),
    ):
        (out / file).write_text(text)
        with pytest.raises(InputError, match=f"{file}: not what ") as refused:
            use()
        assert "\n" not in str(refused.value)


def test_a_run_tells_with_what_it_began_and_went_on_and_keeps_to_its_stage(tmp_path: Path) -> None:
    stage, out = tmp_path / "sim.usda", tmp_path / "run"
    out.mkdir()
    stage.write_text("#usda 1.0\n")
    assert starts(out) == []
    run_folder.keep_start(out, 0, stage, {"commit": "abc"})
    write_stamp(stage, {"drawer_2": True})  # a validation report in between changes nothing
    both = run_folder.keep_start(out, 20, stage, {"commit": "def"})
    assert starts(out) == both
    assert [(start["iteration"], start["commit"]) for start in both] == [(0, "abc"), (20, "def")]
    stage.write_text('#usda 1.0\ndef Xform "other" {}\n')
    with pytest.raises(InputError, match="sim.usda has changed since .*run was begun; resume with what it was"):
        run_folder.keep_start(out, 40, stage, {})
    assert starts(out) == both
