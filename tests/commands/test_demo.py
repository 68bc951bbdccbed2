"""The demo: its commands are understood, and the time that it says is left."""

from __future__ import annotations

import io
import shlex
from pathlib import Path

import pytest
import satellites
from rich.console import Console

from s2a.commands import cli
from s2a.core import config
from s2a.core.errors import InputError

demo = pytest.importorskip("s2a.homes.commands.demo", reason="needs s2a.homes")


@pytest.mark.parametrize("robot", ["panda", "baxter"])
def test_every_step_is_understood_and_reads_what_one_before_it_wrote(robot: str) -> None:
    written = {"demo/scan/truth/truth.usda", "demo/zoo/objects/stapler.usda", "demo/geometric.usd"}  # within folders
    for step in demo.steps("demo", robot):
        program, command, *rest = shlex.split(step.command)
        assert program == "s2a"
        if not satellites.missing(command):
            config.load(cli.settings_of(command), cli.compose(command, rest))
        given = dict(argument.partition("=")[::2] for argument in rest)
        assert {given[key] for key in ("scan", "stage", "object", "path") if key in given} <= written
        written |= {given[key] for key in ("out", "html") if key in given}
    assert ("policy=pretrained" in str(demo.steps("demo", robot))) == (robot == "panda")


def test_the_time_left_is_stretched_by_how_slow_the_steps_before_were() -> None:
    a, b, c = (demo.DemoStep(name, seconds, name) for name, seconds in (("a", 10.0), ("b", 20.0), ("c", 5.0)))
    assert demo.left([a, b, c], [], 0.0, 0.0) == 35.0
    assert demo.left([b, c], [a], 30.0, 0.0) == 75.0
    assert demo.left([b, c], [a], 30.0, 15.0) == 60.0
    assert demo.left([b, c], [a], 30.0, 100.0) == 15.0, "a step that takes longer than expected has nothing left"


def test_a_step_that_fails_ends_the_demo_with_what_it_said() -> None:
    step, output = demo.DemoStep("x", 1.0, "s2a view path=nowhere.usd"), io.StringIO()
    with pytest.raises(InputError, match=r"step \[1/1\], s2a view path=nowhere.usd, ended with exit code 2"):
        demo.perform(step, [step], [], 0.0, Console(file=output, width=120))
    assert "nowhere.usd: does not exist" in output.getvalue()


def test_a_folder_of_the_user_is_left_alone(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "ppo").mkdir()
    assert cli.main(["demo", f"folder={tmp_path}"]) == 2
    assert "holds other files than those of a demo" in capsys.readouterr().err and (tmp_path / "ppo").is_dir()


def test_a_folder_with_a_space_is_one_argument() -> None:
    for step in demo.steps("my demo", "panda"):
        assert all("=" in argument for argument in shlex.split(step.command)[2:]), step.command
