"""The package without its satellites: what is left imports, lists its commands and exports a scan."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import tiny_scan

ROOT = Path(__file__).parents[2]
SATELLITES = ("homes", "language", "joints")
IMPORT_ALL = """
import importlib, pkgutil, s2a
for module in pkgutil.walk_packages(s2a.__path__, "s2a."):
    if not module.name.endswith("__main__"):
        importlib.import_module(module.name)
print(s2a.__file__)
"""


@pytest.fixture(scope="module")
def core(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A copy of the package without the satellites."""
    folder = tmp_path_factory.mktemp("core")
    skipped = shutil.ignore_patterns(*SATELLITES, "__pycache__")
    shutil.copytree(ROOT / "s2a", folder / "s2a", ignore=skipped)
    shutil.copytree(ROOT / "conf", folder / "conf")
    return folder


def run(core: Path, *arguments: str) -> str:
    environment = {**os.environ, "PYTHONPATH": str(core)}
    command = [sys.executable, *arguments]
    return subprocess.run(command, cwd=core, env=environment, check=True, capture_output=True, text=True).stdout


def test_every_module_imports(core: Path) -> None:
    assert run(core, "-c", IMPORT_ALL).strip().splitlines()[-1] == str(core / "s2a" / "__init__.py")


def test_the_command_line_lists_what_is_there_and_exports_a_scan(core: Path, tmp_path: Path) -> None:
    listed = run(core, "-m", "s2a")
    assert "  prepare " in listed
    assert not any(f"  {name} " in listed for name in ("sample", "zoo", "pool", "insert", "do", "register", "identify"))
    scan = tiny_scan.write(tmp_path / "scan")
    run(core, "-m", "s2a", "export", f"scan={scan}", f"out={tmp_path / 'usd'}")
    assert (tmp_path / "usd" / "geometric.usd").is_file()
