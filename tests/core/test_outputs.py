"""Outputs appear whole or not at all."""

from __future__ import annotations

import errno
import os
from pathlib import Path

import pytest

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write, replace_file


def write_folder(path: Path, **files: str) -> None:
    path.mkdir()
    for name, text in files.items():
        (path / name).write_text(text)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_a_file_appears_under_its_name_only_when_it_is_whole(tmp_path: Path):
    out = tmp_path / "new" / "x.usd"
    with atomic_write(out) as path:
        path.write_text("half")
        assert path.name == "x.usd" and not out.exists()
    assert out.read_text() == "half"
    assert names(tmp_path / "new") == ["x.usd"]


def test_a_failure_leaves_the_earlier_file_and_nothing_else(tmp_path: Path):
    out = tmp_path / "x.usd"
    out.write_text("earlier")
    with pytest.raises(ZeroDivisionError), atomic_write(out) as path:
        path.write_text("new")
        raise ZeroDivisionError
    assert out.read_text() == "earlier"
    assert names(tmp_path) == ["x.usd"]


def test_an_error_names_the_output_and_not_the_place_beside_it(tmp_path: Path):
    with pytest.raises(InputError) as error, atomic_write(tmp_path / "x.txt") as path:
        raise InputError(f"{path}: not an ending of USD")
    assert str(error.value) == f"{tmp_path / 'x.txt'}: not an ending of USD"


def test_a_failure_leaves_no_new_folders(tmp_path: Path):
    with pytest.raises(ZeroDivisionError), atomic_write(tmp_path / "a" / "b" / "x.usd"):
        raise ZeroDivisionError
    assert names(tmp_path) == []


def test_an_earlier_folder_is_replaced_whole(tmp_path: Path):
    out = tmp_path / "scan"
    write_folder(out, mark="", old="")
    with atomic_write(out, earlier="mark") as path:
        write_folder(path, mark="", new="")
    assert names(out) == ["mark", "new"]
    assert names(tmp_path) == ["scan"]


def test_an_earlier_folder_stays_when_the_new_one_fails_or_is_never_written(tmp_path: Path):
    out = tmp_path / "scan"
    write_folder(out, mark="", old="")
    with pytest.raises(ZeroDivisionError), atomic_write(out, earlier="mark") as path:
        write_folder(path, mark="")
        raise ZeroDivisionError
    with pytest.raises(FileNotFoundError), atomic_write(out, earlier="mark"):
        pass
    assert names(out) == ["mark", "old"]
    assert names(tmp_path) == ["scan"]


def test_a_folder_with_other_things_in_it_is_never_replaced(tmp_path: Path):
    write_folder(tmp_path / "home", letters="")
    with pytest.raises(InputError, match="not empty and has no mark"), atomic_write(tmp_path / "home", earlier="mark"):
        pass
    assert names(tmp_path / "home") == ["letters"]


def test_neither_a_file_nor_a_folder_is_replaced_by_the_other(tmp_path: Path):
    (tmp_path / "folder").mkdir()
    (tmp_path / "file").write_text("letter")
    with pytest.raises(InputError, match="'.*/folder' is a folder where a file"), atomic_write(tmp_path / "folder"):
        pytest.fail("nothing is begun")
    with (
        pytest.raises(InputError, match="'.*/file' is a file where a folder"),
        atomic_write(tmp_path / "file", earlier="mark"),
    ):
        pytest.fail("nothing is begun")
    assert names(tmp_path) == ["file", "folder"] and (tmp_path / "file").read_text() == "letter"


def test_an_output_below_a_file_is_refused(tmp_path: Path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="not a folder"), atomic_write(tmp_path / "file" / "x.usd"):
        pass


def test_one_of_many_files_is_there_whole_or_as_it_was(tmp_path: Path):
    file = tmp_path / "chunk/a.txt"
    replace_file(file, lambda part: part.write_text("first"))

    def fails(part: Path) -> None:
        part.write_text("sec")
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with pytest.raises(InputError, match=r"a\.txt: cannot be written: No space left on device; free some space"):
        replace_file(file, fails)
    assert [(path.name, path.read_text()) for path in file.parent.iterdir()] == [("a.txt", "first")]


@pytest.mark.parametrize("name", ["a" * 255, "é" * 127, "日" * 85, "x" * 251 + ".usd", "a" * 240])
def test_a_name_as_long_as_a_file_system_takes_is_written(tmp_path: Path, name: str):
    with atomic_write(tmp_path / name) as file:
        file.write_text("whole")
    assert [(each.name, each.read_text()) for each in tmp_path.iterdir()] == [(name, "whole")]
