"""The notebook: nothing but its source is kept, and it runs."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")

FILE = Path(__file__).parents[2] / "docs/tutorials/first_drawer.ipynb"
MINUTES = 10.0
"""On a CPU machine with nothing else to do. A busy one gets the factor below before the test gives up."""
BUSY = 3.0


def test_the_notebook_is_valid_and_holds_no_outputs() -> None:
    notebook = nbformat.read(FILE, as_version=4)
    nbformat.validate(notebook)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert len(cells) > 5
    assert [(cell.outputs, cell.execution_count) for cell in cells] == [([], None)] * len(cells)


@pytest.mark.slow
def test_the_notebook_runs(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from nbclient import NotebookClient

    monkeypatch.setenv("PATH", str(Path(sys.executable).parent), prepend=os.pathsep)
    notebook = nbformat.read(FILE, as_version=4)
    start = time.monotonic()
    NotebookClient(notebook, timeout=60 * MINUTES * BUSY, resources={"metadata": {"path": str(tmp_path)}}).execute()
    minutes = (time.monotonic() - start) / 60.0
    print(f"{minutes:.1f} minutes, load {os.getloadavg()[0]:.1f}")
    assert minutes < MINUTES * max(1.0, os.getloadavg()[1] / (os.cpu_count() or 1))
    assert (tmp_path / "demo/room.html").is_file() and (tmp_path / "demo/planner.html").is_file()
    text = str([cell.get("outputs") for cell in notebook.cells])
    assert "image/png" in text and "error:" not in text and "100.0%" in text
