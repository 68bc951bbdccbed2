"""The Python API: its scene half, and that it costs nothing before it is used."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import satellites
import tiny_scan

from s2a import api
from s2a.commands import cli
from s2a.core.errors import InputError

ROOT = Path(__file__).parents[2]


def test_importing_the_package_loads_nothing() -> None:
    heavy = ["numpy", "pxr", "hydra", "warp", "torch"]
    code = f"import sys, s2a; print([name for name in {heavy} if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_the_api_loads_no_simulator_before_it_is_used() -> None:
    heavy = ["warp", "newton", "torch", "mujoco", "openai"]
    code = f"import sys; from s2a import api; print([name for name in {heavy} if name in sys.modules])"
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "[]"


def test_a_scene_is_the_same_from_its_scan_and_from_its_stage(tmp_path: Path) -> None:
    folder = tiny_scan.write(tmp_path / "scan")
    written = api.export(folder, out=tmp_path / "usd")
    assert written.descriptive.is_file()
    scene, again = api.load_scene(folder), api.load_scene(str(written.geometric))
    assert list(scene.parts) == list(again.parts) == list(written.scene.parts)
    assert scene.movable == again.movable == ("door_3",)
    for part_id, part in scene.parts.items():
        assert np.array_equal(part.mesh.vertices, again.parts[part_id].mesh.vertices)


def test_bad_input_is_an_input_error(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="nowhere"):
        api.load_scene(tmp_path / "nowhere.usd")
    with pytest.raises(InputError, match="nowhere"):
        api.prepare(tmp_path / "nowhere.usd", "drawer_15", out=tmp_path / "sim.usd")
    satellites.need("insert")
    with pytest.raises(InputError, match="did you mean: retries"):
        api.insert(tmp_path / "x.usd", "a.obj", "mug", out=tmp_path / "out", overrides=["retrie=3"])


@pytest.fixture
def in_the_demo(office_scan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder in which the snippets of the documentation find what they read."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "demo").mkdir()
    (tmp_path / "demo" / "scan").symlink_to(office_scan)
    return tmp_path


def snippets(page: str) -> list[str]:
    return re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), re.DOTALL)


@pytest.mark.slow
def test_the_snippet_of_the_readme_runs(in_the_demo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (snippet,) = snippets("README.md")
    names: dict[str, Any] = {}
    exec(snippet, names)
    assert "True" in capsys.readouterr().out.splitlines()  # among what libraries print
    assert names["observation"].shape == (16, 23) and not names["terminated"].any()


@pytest.mark.slow
def test_the_snippets_of_the_python_page_run(in_the_demo: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scene, task = snippets("docs/python.md")
    assert cli.main(["zoo", "out=demo/zoo"]) == 0
    short = [line for line in scene.splitlines() if "prepare(" not in line and "certify(" not in line]
    exec("\n".join(short), {})  # the others are the README's
    assert any("'drawer_15'" in line for line in capsys.readouterr().out.splitlines())
    assert (in_the_demo / "demo" / "insert" / "insert.usda").is_file()
    assert task.split("env = ")[1] == snippets("README.md")[0].split("env = ")[1], "it runs above"
