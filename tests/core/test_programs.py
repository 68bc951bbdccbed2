"""The programs beside the package: each starts, so that none keeps a name that the package has dropped."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = sorted(
    path
    for folder in ("tools", "experiments")
    for path in (ROOT / folder).glob("*.py")
    if "__main__" in path.read_text()
)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_imports_what_it_needs(program: Path) -> None:
    code = f"import runpy, sys; sys.path.insert(0, {str(program.parent)!r}); runpy.run_path({str(program)!r}, run_name='x')"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)
    assert done.returncode == 0, done.stderr
