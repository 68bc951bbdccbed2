"""The tree without its satellites: what is left imports, keeps its contracts, is packed, and passes its tests."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tomllib
import zipfile
from collections.abc import Iterator
from pathlib import Path

import pytest
import satellites
import tiny_scan

ROOT = Path(__file__).parents[2]
TREE = ("s2a", "conf", "tests", "docs", "experiments", "tools")
FILES = ("pyproject.toml", "README.md", "CHANGELOG.md", "LICENSE", "Makefile", "mkdocs.yml", "requirements.lock")
IMPORT_ALL = """
import gc, importlib, pkgutil, s2a
gc.disable()  # it would go through the objects of torch and Newton again and again
for module in pkgutil.walk_packages(s2a.__path__, "s2a."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
print(s2a.__file__)
gc.freeze()
"""
LINT = "from importlinter.cli import lint_imports_command; lint_imports_command(['--no-logo', '--no-cache'])"


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the tree without the satellites and their tests."""
    folder = tmp_path_factory.mktemp("core")
    for name in TREE:
        skipped = ("__pycache__", *(satellites.COMMANDS if name in ("s2a", "tests") else ()))
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns(*skipped))
    for name in FILES:
        shutil.copy(ROOT / name, folder / name)
    return folder


def run(core: Path, *arguments: str) -> str:
    """Return what Python prints in the copy of the tree."""
    environment = {**os.environ, "PYTHONPATH": str(core)}
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=core, env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{done.stdout[-4000:]}\n{done.stderr[-4000:]}"
    return done.stdout


@pytest.mark.slow
def test_every_module_imports(core: Path) -> None:
    assert run(core, "-c", IMPORT_ALL).strip().splitlines()[-1] == str(core / "s2a" / "__init__.py")


def test_the_command_line_lists_what_is_there_and_exports_a_scan(core: Path, tmp_path: Path) -> None:
    listed = run(core, "-m", "s2a")
    assert "  prepare " in listed
    assert not any(f"  {name} " in listed for names in satellites.COMMANDS.values() for name in names)
    scan = tiny_scan.write(tmp_path / "scan")
    run(core, "-m", "s2a", "export", f"scan={scan}", f"out={tmp_path / 'usd'}")
    assert (tmp_path / "usd" / "geometric.usd").is_file()


def test_the_contracts_between_its_modules_and_the_style_hold(core: Path) -> None:
    assert " 0 broken" in run(core, "-c", LINT)
    run(core, "-m", "ruff", "check", "--no-cache")
    run(core, "-m", "ruff", "format", "--check", "--no-cache")


def test_it_is_packed(core: Path, tmp_path: Path) -> None:
    run(core, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", str(tmp_path), ".")
    (wheel,) = tmp_path.glob("*.whl")
    rooms = {name.split("/")[1] for name in zipfile.ZipFile(wheel).namelist() if name.startswith("s2a/")}
    assert {"core", "api.py", "conf"} <= rooms and not rooms & set(satellites.COMMANDS)


@pytest.mark.slow
def test_its_tests_import_nothing_of_a_satellite(core: Path) -> None:
    run(core, "-m", "pytest", "-q", "--collect-only", "-p", "no:cacheprovider")


@pytest.mark.slow
def test_its_types_hold(core: Path) -> None:
    run(core, "-m", "mypy")


@pytest.mark.slow
def test_its_tests_pass(core: Path) -> None:
    run(core, "-m", "pytest", "-q", "-m", "not slow and not gpu", "--ignore", __file__, "-p", "no:cacheprovider")


def _starred() -> Iterator[str]:
    """Yield the module names with a star among the contracts."""
    for contract in tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]:
        for key in ("source_modules", "forbidden_modules", "allowed_importers", "protected_modules"):
            yield from (name for name in contract.get(key, ()) if "*" in name)


@pytest.mark.parametrize("name", sorted(set(_starred())))
@pytest.mark.skipif(bool(satellites.MISSING), reason="needs all satellites")
def test_a_name_with_a_star_in_a_contract_is_a_module(name: str) -> None:
    pattern = name.removesuffix(".**").replace(".", "/")
    assert [*ROOT.glob(f"{pattern}.py"), *ROOT.glob(f"{pattern}/__init__.py")]
