"""The table of artefacts: what a row does, and what is said of files that no row takes."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import tiny_scan
from cabinet import write_cabinet
from pxr import UsdUtils

from s2a.commands import cli, view
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
    assert view.Config  # whose import registers all rows, before the table is replaced
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


OTHERS = {
    "scan/mesh_aligned_0.05.ply": r"is a mesh alone; give the folder of its scan, or s2a import mesh=\S+ply out=FOLDER",
    "room.obj": r"s2a import mesh=room.obj out=FOLDER",
    "a.json": r"is a JSON file of s2a evaluate, which is not shown; give s2a report path=\S+a.json",
    "run": r"is a run of s2a train, which is not shown; give s2a report path=\S+run",
    "train.log": r"cannot be shown; give .*a scan's folder|cannot be shown; give .*a geometric stage",
    "model_1.pt": r"cannot be shown; give .*a geometric stage",
    "states.npz": r"is played in its room; give stage=",
    "sim_visuals.usda": r"holds the visuals of a room; give \S+sim.usda$",
    "damaged.usd": r"not a USD file, or a damaged one",
    "foreign.usda": r"expected a stage that s2a wrote: s2a import mesh= reads other ones",
}
"""Paths that view does not show, and what it says of each."""


@pytest.fixture(scope="module")
def others(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("others")
    tiny_scan.write(folder / "scan")
    (folder / "room.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    (folder / "a.json").write_text(json.dumps({"episodes": 2}))
    (folder / "run").mkdir()
    (folder / "run" / "settings.json").write_text("{}")
    for name in ("train.log", "model_1.pt", "states.npz", "damaged.usd"):
        (folder / name).write_bytes(b"1")
    write_cabinet(folder / "sim.usda")
    (folder / "foreign.usda").write_text('#usda 1.0\n(\n defaultPrim = "R"\n)\ndef Xform "R"\n{\n}\n')
    return folder


@pytest.mark.parametrize("keys", ["text=true", "image={}/i.png", "html={}/i.html"])
@pytest.mark.parametrize("name", OTHERS)
def test_view_says_of_any_other_file_what_it_is_and_what_to_do(
    name: str, keys: str, others: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["view", f"path={others / name}", keys.format(tmp_path)]) == 2
    line = capsys.readouterr().err.strip()
    assert re.search(OTHERS[name], line) and "\n" not in line and name in line


@pytest.mark.parametrize("name", ["sim", "geometric", "descriptive"])
def test_a_package_is_shown_as_its_stage_is(
    name: str, others: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["export", f"scan={others / 'scan'}", f"out={tmp_path}"]) == 0
    stage = others / "sim.usda" if name == "sim" else next(tmp_path.glob(f"{name}.*"))
    assert UsdUtils.CreateNewUsdzPackage(str(stage), str(tmp_path / "room.usdz"))
    capsys.readouterr()
    shown = []
    for path in (stage, tmp_path / "room.usdz"):
        assert cli.main(["view", f"path={path}"]) == 0
        shown.append(capsys.readouterr().out)
    assert shown[0] == shown[1] and len(shown[0].splitlines()) > 3


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
