"""The table of artefacts: what a row does, and what is said of files that no row takes."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.scene import artefacts
from s2a.scene.artefacts import Artefact
from s2a.scene.scene import Mesh, Part, Scene

TRIANGLE = Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])


def read_boards(path: Path) -> Scene:
    return Scene(path.stem, {f"{name}_{i}": Part(name, TRIANGLE) for i, name in enumerate(path.read_text().split(), 1)})


@pytest.fixture
def boards(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A file of a kind of its own, and the one row that makes it known."""
    monkeypatch.setattr(artefacts, "TABLE", list(artefacts.TABLE))
    artefacts.register(Artefact("a list of boards", lambda path: path.suffix == ".boards", room=read_boards))
    path = tmp_path / "shop.boards"
    path.write_text("shelf door")
    return path


def test_one_row_makes_view_show_a_kind_as_a_tree_an_image_and_a_page(
    boards: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("viser")
    assert cli.main(["view", f"path={boards}"]) == 0
    assert "shelf_1  'shelf'  1 triangles" in capsys.readouterr().out
    image, page = boards.with_suffix(".png"), boards.with_suffix(".html")
    size = ["camera.width=60", "camera.height=40"]
    assert cli.main(["view", f"path={boards}", f"image={image}", f"html={page}", *size]) == 0
    assert image.stat().st_size > 0 and "shop" in page.read_text(encoding="utf-8")


def test_a_row_names_its_kind_in_the_error_for_other_files(boards: Path) -> None:
    other = boards.with_suffix(".csv")
    other.write_text("a,b")
    with pytest.raises(InputError, match=r"shop.csv: cannot be shown; give .*a list of boards"):
        artefacts.find(other, "room")
    with pytest.raises(InputError, match=r"nowhere: does not exist; give .*a list of boards"):
        artefacts.find(boards.with_name("nowhere"), "room")


def test_rooms_share_a_kind_and_the_fallback_comes_last(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(artefacts, "TABLE", [])
    artefacts.register(Artefact("anything", Path.exists, room=str, fallback=True))
    artefacts.register(Artefact("a note", Path.is_dir, notes=lambda path: (path, {})))
    artefacts.register(Artefact("a note", Path.is_dir, report=str))
    assert [row.name for row in artefacts.TABLE] == ["a note", "anything"]
    assert artefacts.find(tmp_path, "notes") is artefacts.find(tmp_path, "report")
    assert artefacts.find(tmp_path, "room").name == "anything"


def test_a_changed_json_file_is_read_again(tmp_path: Path) -> None:
    path = tmp_path / "x.json"
    for number in (1, 22):
        path.write_text(json.dumps({"n": number}))
        assert artefacts.values(path) == {"n": number}
    for text in ("[1]", "{", "[" * 100_000):
        path.write_text(text)
        assert artefacts.values(path) == {}
