"""What is said to those whose mesh has another name or format fits the files that they have."""

from __future__ import annotations

from pathlib import Path

import pytest
import tiny_scan

from s2a import scan
from s2a.commands import cli
from s2a.core.errors import InputError


def message(folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        scan.read(folder)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_mesh_under_its_own_name_is_to_be_renamed(tmp_path: Path) -> None:
    folder = tiny_scan.write(tmp_path / "scan")
    (folder / tiny_scan.PLY).rename(folder / "my_kitchen.ply")
    assert "found my_kitchen.ply: rename the mesh" in message(folder) and tiny_scan.PLY in message(folder)
    assert "release" not in message(folder)


@pytest.mark.parametrize(("name", "says"), [("room.obj", "trimesh.load('room.obj'"), ("room.glb", "glTF has y up")])
def test_a_mesh_of_another_format_is_to_be_converted(name: str, says: str, tmp_path: Path) -> None:
    folder = tiny_scan.write(tmp_path / "scan")
    (folder / tiny_scan.PLY).rename(folder / name)
    assert says in message(folder) and "process=False" in message(folder)
    bare = tmp_path / "bare"
    bare.mkdir()
    (bare / name).write_text("")
    assert says in message(bare)


def test_the_conversion_that_is_named_keeps_faces_and_their_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import trimesh

    folder = tiny_scan.write(tmp_path / "scan")
    given = trimesh.load(folder / tiny_scan.PLY, process=False)
    given.export(folder / "room.obj")
    (folder / tiny_scan.PLY).unlink()
    call = message(folder).partition("order of its faces: ")[2]
    monkeypatch.chdir(folder)
    exec(f"import trimesh; {call}")  # what a user would type
    assert (tiny_scan.triangles(scan.read(folder).part("door_3")) == tiny_scan.corners(2, 3)).all()


@pytest.mark.parametrize("command", ["export", "view"])
def test_a_mesh_file_in_place_of_a_folder_is_to_be_converted(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "room.glb").write_text("")
    key = {"export": "scan", "view": "path"}[command]
    out = [f"out={tmp_path / 'usd'}"] if command == "export" else []
    assert cli.main([command, f"{key}={tmp_path / 'room.glb'}", *out]) == 2
    assert "s2a import mesh=room.glb" in capsys.readouterr().err
