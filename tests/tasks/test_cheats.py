"""Eight scripted robots open the drawer; only one of them grasps its handle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import cheats
import pytest
from cabinet import write_cabinet
from part_worlds import make_env


def play(tmp_path: Path, scripts: Mapping, **cabinet) -> dict[str, dict[str, float]]:  # noqa: ANN003
    """Return each script's results by column."""
    stage = write_cabinet(tmp_path / "sim.usda", **cabinet)
    env = make_env(
        stage,
        len(scripts),
        sim="sim/planner",
        graph=True,
        start_noise=0.0,
        termination_opening=1e9,
        tcp_offset=(0, 0, 0),
    )
    found = cheats.play(env, [script(env.sim) for script in scripts.values()])
    return {name: {c: round(float(v[i]), 3) for c, v in found.items()} for i, name in enumerate(scripts)}


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, float]]:
    """What all scripts came to."""
    handle, push = (tmp_path_factory.mktemp(name) for name in ("handle", "push"))
    return play(handle, cheats.SCRIPTS) | play(push, cheats.PUSHES, attached=[cheats.PLATE])


@pytest.mark.parametrize("name", [*cheats.SCRIPTS, *cheats.PUSHES])
def test_every_script_opens_the_drawer(results: dict[str, dict[str, float]], name: str) -> None:
    assert results[name]["success"] == 1.0, results[name]


@pytest.mark.parametrize("name", [*cheats.SCRIPTS, *cheats.PUSHES])
def test_a_grasp_alone_counts_as_one(results: dict[str, dict[str, float]], name: str) -> None:
    assert results[name]["grasp_success"] == float(name == "grasp"), results[name]


@pytest.mark.parametrize(
    ("name", "column"),
    [
        ("grasp", "handle_success"),
        ("one_finger", "single_finger_success"),
        ("two_fingers", "handle_success"),
        ("press", "handle_success"),
        ("palm", "body_success"),
        ("elbow", "body_success"),
    ],
)
def test_the_other_columns_tell_how_it_was_opened(results: dict[str, dict[str, float]], name: str, column: str) -> None:
    assert results[name][column] == 1.0, results[name]
