"""The demo: its commands are understood, and the time that it says is left."""

from __future__ import annotations

import shlex
import subprocess
import sys
from pathlib import Path

import pytest
import run_demo
import satellites

from s2a.commands import cli
from s2a.core import config


@pytest.mark.parametrize("robot", ["panda", "baxter"])
def test_every_step_is_understood_and_reads_what_one_before_it_wrote(robot: str) -> None:
    written = {"demo/scan/truth/truth.usda", "demo/zoo/objects/stapler.usda", "demo/geometric.usd"}  # within folders
    for step in run_demo.steps("demo", robot):
        program, command, *rest = shlex.split(step.command)
        if program != "s2a":
            assert set(rest) <= written
            continue
        if not satellites.missing(command):
            config.load(cli.settings_of(command), cli.compose(command, rest))
        given = dict(argument.partition("=")[::2] for argument in rest)
        assert {given[key] for key in ("scan", "stage", "object", "path") if key in given} <= written
        written |= {given[key] for key in ("out", "html") if key in given}
    assert ("policy=pretrained" in str(run_demo.steps("demo", robot))) == (robot == "panda")


def test_the_time_left_is_stretched_by_how_slow_the_steps_before_were() -> None:
    a, b, c = (run_demo.Step(name, seconds, name) for name, seconds in (("a", 10.0), ("b", 20.0), ("c", 5.0)))
    assert run_demo.left([a, b, c], [], 0.0, 0.0) == 35.0
    assert run_demo.left([b, c], [a], 30.0, 0.0) == 75.0
    assert run_demo.left([b, c], [a], 30.0, 15.0) == 60.0
    assert run_demo.left([b, c], [a], 30.0, 100.0) == 15.0, "a step that takes longer than expected has nothing left"


def test_a_step_that_fails_ends_the_demo_with_what_it_said(tmp_path: Path) -> None:
    code = "import run_demo; s = run_demo.Step('x', 1.0, 's2a view path=nowhere.usd'); run_demo._run(s, [s], [], 0.0)"
    ended = subprocess.run(
        [sys.executable, "-c", code], cwd=Path(run_demo.__file__).parent, capture_output=True, text=True, timeout=300
    )
    assert ended.returncode == 1
    assert "nowhere.usd: does not exist" in ended.stdout and "[1/1] ended with exit code 2" in ended.stderr
