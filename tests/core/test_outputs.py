"""Outputs appear whole or not at all."""

from __future__ import annotations

import errno
import fcntl
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import pytest

from s2a.commands import cli
from s2a.core import locks
from s2a.core.errors import InputError
from s2a.core.outputs import Written, atomic_write, keys, locked, replace_file, require_writable


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


HOLDER = (
    "import sys, time; from pathlib import Path; from s2a.core.outputs import locked\n"
    "with locked({'out': Path(sys.argv[1])}, 's2a collect'):\n    print('held', flush=True); time.sleep(60)\n"
)


@contextmanager
def held(path: Path) -> Iterator[subprocess.Popen]:
    """Let another process hold an output; it is killed at the end."""
    holder = subprocess.Popen([sys.executable, "-c", HOLDER, str(path)], stdout=subprocess.PIPE, text=True)
    try:
        assert holder.stdout is not None and holder.stdout.readline() == "held\n"
        yield holder
    finally:
        holder.kill()
        holder.communicate()


@pytest.mark.parametrize("name", ["set", "é" * 127, "new/folder/a.json"])
def test_an_output_that_is_held_is_refused_until_its_holder_is_killed(tmp_path: Path, name: str):
    out = tmp_path / name
    with held(out) as holder:
        before = sorted(tmp_path.rglob("*"))
        with pytest.raises(InputError) as error, locked({"out": out}, "s2a train"):
            pass
        words = f"out {str(out)!r} is being written by s2a collect, process {holder.pid} on "
        assert str(error.value).startswith(words) and "since 20" in str(error.value)
        assert sorted(tmp_path.rglob("*")) == before
        holder.send_signal(signal.SIGKILL)
        holder.wait()
        with locked({"out": out}, "s2a train"):
            assert not out.exists()
    assert not list(tmp_path.rglob(f"*{locks.LOCK}"))


def test_a_lock_holds_by_whatever_link_its_output_is_named(tmp_path: Path):
    (tmp_path / "real").mkdir()
    (tmp_path / "link").symlink_to("real")
    with held(tmp_path / "link/set"), pytest.raises(InputError, match="is being written by s2a collect"):
        with locked({"out": tmp_path / "real/set"}, "s2a collect"):
            pass


def test_other_outputs_of_the_same_folder_are_free_and_two_keys_may_name_one(tmp_path: Path):
    with held(tmp_path / "a"), locked({"images": tmp_path / "b", "recordings": tmp_path / "b"}, "s2a evaluate"):
        assert names(tmp_path) == [".a.s2a-lock", ".b.s2a-lock"]
    with locked({"out": tmp_path / ("x" * 250 + "1")}, ""), locked({"out": tmp_path / ("x" * 250 + "2")}, ""):
        pass  # long names that begin alike


def test_a_folder_with_an_output_that_is_held_is_not_replaced(tmp_path: Path):
    out = tmp_path / "out"
    write_folder(out, mark="earlier")
    with held(out / "set"):
        with (
            pytest.raises(InputError, match="has an output in it that s2a collect, process"),
            atomic_write(out, "mark"),
        ):
            pass
    with locked({"image": out / "a.png"}, "s2a insert"), atomic_write(out, "mark") as new:  # its own is no other's
        write_folder(new, mark="new")
    assert (out / "mark").read_text() == "new"


def test_a_lock_is_no_content_of_a_folder(tmp_path: Path):
    out = tmp_path / "out"
    with locked({"image": out / "a.png"}, "s2a insert"), atomic_write(out, "mark") as new:
        write_folder(new, mark="")
    (out / f".killed{locks.LOCK}").touch()
    assert [path.name for path in locks.contents(out)] == ["mark"]


def as_nobody(code: str, *arguments: object) -> str:
    """Run code as another user; return what it prints."""
    if os.getuid():
        pytest.skip("is not root")
    words = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups", sys.executable, "-c", code]
    ran = subprocess.run([*words, *map(str, arguments)], capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


def opened(path: Path) -> None:
    """Let all users into the folders above a path."""
    for folder in path.parents:
        if folder.stat().st_uid == os.getuid():
            folder.chmod(folder.stat().st_mode | 0o055)


def test_a_folder_of_which_only_the_inside_may_be_written_is_locked_inside(tmp_path: Path):
    out = tmp_path / "volume"
    out.mkdir()
    opened(out)
    out.chmod(0o777)
    code = (
        "import os, sys; from pathlib import Path; from s2a.core.outputs import locked\n"
        "with locked({'out': Path(sys.argv[1])}, 's2a train'): print(os.listdir(sys.argv[1]))"
    )
    assert as_nobody(code, out) == "['.s2a-lock']\n" and names(out) == []


def test_what_cannot_be_written_is_named_with_the_remedy_and_not_a_temporary_name(tmp_path: Path):
    out = tmp_path / "room.usd"
    out.touch()
    opened(out)
    code = (
        "import sys; from pathlib import Path; from s2a.core.outputs import require_writable\n"
        "try: require_writable(Path(sys.argv[1]), 'give stamp=false')\nexcept Exception as error: print(error)"
    )
    assert as_nobody(code, out) == f"{out}: cannot be written: Permission denied; give stamp=false\n"
    require_writable(out, "")
    assert names(tmp_path) == ["room.usd"]


def test_where_there_are_no_locks_a_living_holder_is_seen_and_the_rest_is_warned_of(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
):
    def flock(*_: object) -> None:
        raise OSError(errno.ENOLCK, os.strerror(errno.ENOLCK))

    monkeypatch.setattr(fcntl, "flock", flock)
    out = tmp_path / "out"
    with locked({"out": out}, "s2a collect"):
        assert "the file system has no locks" in caplog.text
        with pytest.raises(InputError, match=f"process {os.getpid()} on "), locked({"out": out}, "s2a collect"):
            pass
    (tmp_path / ".out.s2a-lock").write_text('{"process": 4194305, "host": "elsewhere"}')
    with locked({"out": out}, "s2a collect"):
        pass


def test_outputs_are_known_by_their_type():
    @dataclass(frozen=True)
    class Settings:
        stage: Annotated[Path, "a note"]
        images: tuple[Path, ...]
        out: Annotated[Path, Written()]
        record: Annotated[Path, Written()] | None

    assert keys(Settings) == ["out", "record"]
    for command in cli.commands():
        written = keys(cli.settings_of(command))
        assert written or command in ("replay", "doctor", "demo")


@pytest.mark.parametrize("error", [RuntimeError("PytorchStreamWriter failed"), OSError("Unable to write, errno = 28")])
def test_a_disk_that_is_full_is_seen_behind_what_a_library_raises(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, error: Exception
):
    state = os.statvfs(tmp_path)
    full: Any = type("State", (), {"f_bavail": 3, "f_frsize": state.f_frsize, "f_files": 9, "f_favail": 9})
    with pytest.raises(type(error)), atomic_write(tmp_path / "a.pt"):
        raise error
    monkeypatch.setattr(os, "statvfs", lambda _: full)
    with pytest.raises(InputError, match=r"a\.pt: cannot be written: No space left on device"):
        with atomic_write(tmp_path / "a.pt"):
            raise error


def test_a_device_is_not_replaced():
    with pytest.raises(InputError, match="is a device"), atomic_write(Path("/dev/null")):
        pass
