"""A format is one module: the one of docs/own_scan.md is registered as a user registers it, and read by the commands."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from s2a import scan
from s2a.commands import cli
from s2a.scan.folder import formats

DOCS = Path(__file__).parents[2] / "docs" / "own_scan.md"
BOXES = "cabinet 0 0 0 0 0.5 0.8 0.8\ndrawer 0.4 0.5 0 0.5 0.52 0.8 0.7\n"


@pytest.fixture
def boxes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder of the docs' format, and a package that registers its reader."""
    source = DOCS.read_text().partition("<!-- format: begin -->\n```python\n")[2].partition("```\n")[0]
    (tmp_path / "package").mkdir()
    (tmp_path / "package" / "boxes_format.py").write_text(source)
    monkeypatch.syspath_prepend(tmp_path / "package")
    info = tmp_path / "package" / "boxes-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: boxes\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[s2a.scan.formats]\nboxes = boxes_format\n")
    formats.cache_clear()
    folder = tmp_path / "room"
    folder.mkdir()
    (folder / "boxes.txt").write_text(BOXES)
    yield folder
    formats.cache_clear()
    sys.modules.pop("boxes_format", None)


def test_the_format_of_the_docs_is_read_and_exported(boxes: Path, tmp_path: Path) -> None:
    scene = scan.read(boxes)
    assert list(scene.parts) == ["cabinet_1", "drawer_2"] and scene.movable == ("drawer_2",)
    assert scene.parts["cabinet_1"].mesh.face_areas.sum() == pytest.approx(2 * (0.4 + 0.4 + 0.64))
    assert cli.main(["export", f"scan={boxes}", f"out={tmp_path / 'usd'}"]) == 0
    assert (tmp_path / "usd" / "geometric.usd").is_file()


def test_its_errors_are_one_line(boxes: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (boxes / "boxes.txt").write_text("cabinet 0 0 0\n")
    assert cli.main(["export", f"scan={boxes}", f"out={tmp_path / 'usd'}"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


def test_those_with_joints_are_asked_before_those_without() -> None:
    names = [reader.NAME for reader in formats("s2a.scan.formats")]
    assert ", ".join(names) == "Articulate3D, MultiScan, ScanNet, ScanNet++, bare mesh"


def test_every_ending_belongs_to_one_reader() -> None:
    endings = [ending for reader in formats("s2a.scan.meshes") for ending in reader.ENDINGS]
    assert len(endings) == len(set(endings)) and {".glb", ".obj", ".ply", ".usdz"} <= set(endings)
