"""The programs beside the package: each starts, so that none keeps a name that the package has dropped."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import pytest

from s2a import cores

ROOT = Path(__file__).resolve().parents[2]
PROGRAMS = sorted(
    path
    for folder in ("tools", "experiments")
    for path in (ROOT / folder).glob("*.py")
    if "__main__" in path.read_text()
)


@pytest.fixture(scope="module")
def started() -> Iterator[dict[Path, Future[subprocess.CompletedProcess[str]]]]:
    """Start all programs, as many at once as there are cores: imports take most of the time."""
    with ThreadPoolExecutor(cores.count()) as pool:
        yield {program: pool.submit(_import, program) for program in PROGRAMS}


def _import(program: Path) -> subprocess.CompletedProcess[str]:
    code = f"import runpy, sys; sys.path.insert(0, {str(program.parent)!r}); runpy.run_path({str(program)!r}, run_name='x')"
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=ROOT, check=False)


@pytest.mark.parametrize("program", PROGRAMS, ids=lambda path: path.stem)
def test_a_program_imports_what_it_needs(
    program: Path, started: dict[Path, Future[subprocess.CompletedProcess[str]]]
) -> None:
    done = started[program].result()
    assert done.returncode == 0, done.stderr
