"""What works without the optional dependencies, and what is said where they are missing."""

from __future__ import annotations

import subprocess
import sys
import tomllib
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
import satellites
import tiny_scan
from few import few

from s2a.commands import cli
from s2a.core import errors
from s2a.core.errors import InputError

ROOT = Path(__file__).parents[2]
BLOCK = """
import sys
from importlib.machinery import PathFinder
find = PathFinder.find_spec
PathFinder.find_spec = lambda name, *rest: None if name.partition(".")[0] in {blocked!r} else find(name, *rest)
"""
RUN = """
from s2a.commands.cli import main
sys.exit(main(sys.argv[1:]))
"""
UNCOLLECTED = "import gc\ngc.disable()\n"
"""Keep Python's collector from the objects of torch and Newton, through which it would go again and again."""
EVERYTHING = sorted(name for modules in errors.MODULES.values() for name in modules)


def s2a(blocked: list[str], *arguments: str) -> subprocess.CompletedProcess[str]:
    code = BLOCK.format(blocked=blocked) + RUN
    return subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, cwd=ROOT)


def test_every_module_belongs_to_the_extra_that_installs_it() -> None:
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    distributions = packages_distributions()
    for extra, modules in errors.MODULES.items():
        listed = "\n".join(declared[extra]).lower().replace("_", "-")
        for module in set(modules) & set(distributions):
            assert any(name.lower().replace("_", "-") in listed for name in distributions[module]), module


@pytest.mark.slow
def test_export_and_the_text_of_view_need_no_extra(tmp_path: Path) -> None:
    scan = tiny_scan.write(tmp_path / "scan")
    exported = s2a(EVERYTHING, "export", f"scan={scan}", f"out={tmp_path / 'usd'}")
    assert exported.returncode == 0, exported.stderr
    assert "not checked against the surface" in exported.stderr and "pip install 's2a[sim]'" in exported.stderr
    for path in (scan, tmp_path / "usd" / "geometric.usd", tmp_path / "usd" / "descriptive.usda"):
        shown = s2a(EVERYTHING, "view", f"path={path}")
        assert shown.returncode == 0, shown.stderr
        assert "door" in shown.stdout


FREE = {"demo", "doctor", "export", "import", "report", "view"}
"""Commands that begin without an extra; the first step of the demo names it."""


@pytest.mark.parametrize("command", few(sorted(set(cli.commands()) - FREE), 6))
def test_a_command_without_its_extra_names_the_pip_command(command: str) -> None:
    failed = s2a(EVERYTHING, command, "--help")
    assert failed.returncode == 2
    assert failed.stderr.count("\n") == 1
    assert "is not installed; give: pip install 's2a[" in failed.stderr


@pytest.mark.slow
def test_the_doctor_tells_of_each_extra_what_is_missing() -> None:
    healthy, bare = s2a([], "doctor"), s2a(EVERYTHING, "doctor")
    assert healthy.returncode == bare.returncode == 0, bare.stderr
    for extra in errors.MODULES:
        assert bare.stdout.count(f"pip install 's2a[{extra}]'") == 1 and f"\nextra {extra}: " in healthy.stdout
    assert "missing" not in healthy.stdout and "usd-core" in bare.stdout and "not known without" in bare.stdout


def test_an_image_without_the_simulation_extra_names_the_pip_command(tmp_path: Path) -> None:
    scan = tiny_scan.write(tmp_path / "scan")
    failed = s2a(EVERYTHING, "view", f"path={scan}", f"image={tmp_path / 'image.png'}")
    assert failed.returncode == 2
    assert "pip install 's2a[sim]'" in failed.stderr
    assert not (tmp_path / "image.png").exists()


def test_training_without_torch_names_the_learning_extra() -> None:
    failed = s2a(list(errors.MODULES["learn"]), "train", "stage=a.usd", "out=b")
    assert failed.returncode == 2
    assert "pip install 's2a[learn]'" in failed.stderr


@pytest.mark.slow
def test_the_simulation_extra_alone_serves_the_scene_commands() -> None:
    blocked = [*errors.MODULES["learn"], *errors.MODULES["llm"]]
    names = ("sample", "check", "zoo", "insert", "prepare", "certify", "view")
    imports = "".join(f"import {cli.commands()[name]}\n" for name in names if not satellites.missing(name))
    subprocess.run([sys.executable, "-c", BLOCK.format(blocked=blocked) + UNCOLLECTED + imports], check=True, cwd=ROOT)


def test_modules_that_belong_to_no_extra_stay_a_bug() -> None:
    with pytest.raises(ModuleNotFoundError), errors.required():
        raise ModuleNotFoundError("No module named 'typo'", name="typo")
    with pytest.raises(InputError, match="llm"), errors.required():
        raise ModuleNotFoundError("No module named 'openai'", name="openai")
