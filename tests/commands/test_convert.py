"""s2a convert: what it writes, and that bad input is one line and leaves an earlier output as it was."""

from __future__ import annotations

from pathlib import Path

import mujoco
import pytest
from converted import CABINET, LID, PART, write_room

import s2a
from s2a.commands import cli
from s2a.core.errors import InputError


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_room(tmp_path_factory.mktemp("room") / "room.usd", lid=True)


def _contents(folder: Path) -> dict[str, bytes]:
    return {str(path.relative_to(folder)): path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def test_a_room_is_replaced_by_a_later_one_and_nothing_is_left_beside_it(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "new" / "mjcf"
    assert cli.main(["convert", f"stage={stage}", f"out={out}"]) == 0
    assert "2 articulated parts and 0 free objects move" in capsys.readouterr().out
    assert cli.main(["convert", f"stage={stage}", f"out={out}", f"parts={LID}"]) == 0
    assert mujoco.MjModel.from_xml_path(str(out / "room.xml")).nv == 1
    assert [path.name for path in out.parent.iterdir()] == ["mjcf"]


def test_the_spring_that_urdf_cannot_hold_is_reported(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    arguments = ["convert", f"stage={stage}", "to=urdf", "sim.joint.stiffness=7"]
    assert cli.main([*arguments, f"out={tmp_path / 'a'}"]) == 0
    assert "without the spring of 7 N/m" in capsys.readouterr().out
    assert cli.main([*arguments, f"out={tmp_path / 'b'}", "sim.joint.stiffness=0"]) == 0
    assert "without the spring" not in capsys.readouterr().out


def test_the_python_api_returns_the_file_to_load(stage: Path, tmp_path: Path) -> None:
    assert s2a.convert(stage, tmp_path / "urdf", to="urdf", parts=[PART]) == tmp_path / "urdf" / "room.urdf"
    assert (tmp_path / "urdf" / "room.urdf").is_file()
    with pytest.raises(InputError, match="'to' is 'sdf'; expected one of: mjcf, urdf"):
        s2a.convert(stage, tmp_path / "sdf", to="sdf")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["stage=nowhere.usd"], "nowhere.usd: no such file"),
        (
            [f"parts=[{PART},cup_9]"],
            f"'cup_9' neither moves on a joint nor lies free in room 'test'; possible: {PART}, {LID}",
        ),
        ([f"parts={CABINET}"], f"'{CABINET}' neither moves"),
        (["parts=[]"], "nothing of room 'test' is to move; give parts=all"),
        (["to=urdf"], "has no room.urdf as an earlier output would"),
    ],
)
def test_bad_input_is_one_line_and_leaves_an_earlier_room(
    arguments: list[str], message: str, stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    out.mkdir()
    (out / "room.xml").write_text("earlier")
    given = [f"out={out}", *arguments, *([] if arguments[0].startswith("stage=") else [f"stage={stage}"])]
    assert cli.main(["convert", *given]) == 2
    [line] = [line for line in capsys.readouterr().err.splitlines() if not line.startswith("Warp")]
    assert message in line
    assert _contents(tmp_path) == {"out/room.xml": b"earlier"}


def test_a_file_and_the_folder_of_the_stage_are_not_replaced(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "file"
    file.write_text("mine")
    assert cli.main(["convert", f"stage={stage}", f"out={file}"]) == 2
    assert "is a file where a folder should be written" in capsys.readouterr().err
    assert file.read_text() == "mine"
    (tmp_path / "scene").mkdir()
    (tmp_path / "scene" / "room.xml").write_text("earlier")
    inside = write_room(tmp_path / "scene" / "room.usd")
    assert cli.main(["convert", f"stage={inside}", f"out={inside.parent}"]) == 2
    assert "would be replaced" in capsys.readouterr().err
    assert inside.is_file()


def test_what_fails_midway_leaves_an_earlier_room(stage: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    out = tmp_path / "out"
    s2a.convert(stage, out)
    before = _contents(tmp_path)

    def refuse(path: str) -> None:
        raise ValueError("MuJoCo cannot read it")

    monkeypatch.setattr(mujoco.MjModel, "from_xml_path", refuse)
    with pytest.raises(ValueError, match="cannot read"):
        s2a.convert(stage, out, parts=LID)
    assert _contents(tmp_path) == before
