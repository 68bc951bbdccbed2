"""The programs beside the package: each starts, so that none keeps a name that the package has dropped."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from pathlib import Path

import pytest
import satellites

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = [str(ROOT / folder) for folder in ("tools", "experiments")]
PROGRAMS = sorted(path for folder in FOLDERS for path in Path(folder).glob("*.py") if "__main__" in path.read_text())
START = """
import gc, json, runpy, sys, traceback
gc.disable()  # it would go through the objects of torch and Newton again and again
sys.path[:0] = json.loads(sys.argv[1])
failures = {}
for program in sys.argv[2:]:
    try:
        runpy.run_path(program, run_name="x")
    except BaseException:
        failures[program] = traceback.format_exc()
print(json.dumps(failures))
gc.freeze()
"""


@pytest.fixture(scope="module")
def failures() -> dict[str, str]:
    """Start all programs one after another in a process of their own, which imports torch and newton once."""
    command = [sys.executable, "-c", START, json.dumps(FOLDERS), *map(str, PROGRAMS)]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_imports_what_it_needs(program: Path, failures: dict[str, str]) -> None:
    failure = failures.get(str(program), "")
    if absent := [room for room in satellites.MISSING if f"No module named 's2a.{room}" in failure]:
        pytest.skip(f"needs s2a.{absent[0]}")
    assert not failure, failure


def test_tests_of_the_package_import_nothing_of_the_experiments() -> None:
    names = {path.stem for path in (ROOT / "experiments").glob("*.py")}
    files = [file for file in (ROOT / "tests").rglob("*.py") if file.parent.name != "experiments"]
    imports = [(file.name, node) for file in files for node in ast.walk(ast.parse(file.read_text()))]
    wrong = {
        file: name
        for file, node in imports
        for name in (
            [alias.name for alias in node.names] if isinstance(node, ast.Import) else [getattr(node, "module", None)]
        )
        if isinstance(node, (ast.Import, ast.ImportFrom)) and name in names
    }
    assert wrong == {}
