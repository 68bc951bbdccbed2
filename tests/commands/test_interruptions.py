"""Commands that are ended, run out of disk, or are told odd places: earlier output stays, and nothing is left beside it."""

from __future__ import annotations

import errno
import os
import signal
import subprocess
import sys
import time
from importlib.abc import MetaPathFinder
from pathlib import Path

import numpy as np
import pytest
import satellites
import tiny_scan

from s2a import __main__ as entry
from s2a.commands import cli, view
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.scan.visuals import tree
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import descriptive, geometric

WRITER = """
import signal, sys, time
signal.signal(signal.SIGHUP, signal.SIG_DFL)  # a shell may have told the tests to ignore these two
signal.signal(signal.SIGINT, signal.default_int_handler)
from pathlib import Path
from s2a.commands import cli
from s2a.core.outputs import atomic_write

def work(config):
    with atomic_write(Path(sys.argv[1]), earlier="mark") as out:
        out.mkdir()
        (out / "mark").write_text("new")
        Path(sys.argv[1] + ".begun").touch()
        time.sleep(60)

cli._dispatch = work
sys.exit(cli.main([]))
"""


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def begun(out: Path) -> subprocess.Popen:
    """Start a command that replaces a folder, and wait until it is at it."""
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(out)], stderr=subprocess.PIPE, text=True)
    mark = Path(f"{out}.begun")
    while not mark.exists():
        assert process.poll() is None, process.communicate()
        time.sleep(0.02)
    mark.unlink()
    return process


def earlier(tmp_path: Path) -> Path:
    out = tmp_path / "out"
    out.mkdir()
    (out / "mark").write_text("old")
    return out


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGINT])
def test_a_command_that_is_ended_leaves_nothing_and_the_earlier_output_stays(tmp_path: Path, number: int) -> None:
    out = earlier(tmp_path)
    process = begun(out)
    process.send_signal(number)
    said = process.communicate(timeout=30)[1]
    assert process.returncode == (130 if number == signal.SIGINT else 143)
    assert said.strip() in ("s2a: terminated", "s2a: interrupted")
    assert names(tmp_path) == ["out"] and (out / "mark").read_text() == "old"


def test_what_a_killed_command_left_is_removed_by_the_next_and_nothing_else_is(tmp_path: Path) -> None:
    out = earlier(tmp_path)
    for name in (".out.settings", ".out.s2a-x", ".other.s2a-12345678"):
        (tmp_path / name).mkdir()
    killed = begun(out)
    killed.kill()
    killed.wait()
    assert len(names(tmp_path)) == 5 and (out / "mark").read_text() == "old"
    alive = begun(out)
    try:
        left = [name for name in names(tmp_path) if name.startswith(".out.s2a-") and len(name) > 12]
        assert len(left) == 1, "that of the living one"
        with atomic_write(out, earlier="mark") as new:
            new.mkdir()
            (new / "mark").write_text("newer")
        assert left[0] in names(tmp_path) and (out / "mark").read_text() == "newer"
    finally:
        alive.terminate()
        alive.communicate()
    assert names(tmp_path) == [".other.s2a-12345678", ".out.s2a-x", ".out.settings", "out"]


def test_temporary_files_of_a_killed_process_are_deleted_by_the_next(tmp_path: Path) -> None:
    script = (
        "import time; from pathlib import Path; from s2a.core.outputs import temporary_folder\n"
        "with temporary_folder() as folder:\n"
        "    (folder / 'file').touch(); print('begun', flush=True); time.sleep(60)\n"
    )
    command, settings = [sys.executable, "-c", script], {**os.environ, "TMPDIR": str(tmp_path)}
    killed = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=settings)
    assert killed.stdout is not None and killed.stdout.readline() == "begun\n"
    killed.kill()
    killed.communicate()
    assert len(names(tmp_path)) == 1
    other = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=settings)
    assert other.stdout is not None and other.stdout.readline() == "begun\n"
    assert len(names(tmp_path)) == 1, "that of the living one"
    other.terminate()
    other.communicate()


@pytest.mark.parametrize("error", [errno.ENOSPC, errno.EDQUOT, errno.EFBIG])
def test_a_full_disk_names_the_output(tmp_path: Path, error: int) -> None:
    with pytest.raises(InputError, match="out.txt: cannot be written: .*free some space"):
        with atomic_write(tmp_path / "out.txt"):
            raise OSError(error, os.strerror(error))
    with pytest.raises(InputError, match="out.npy: cannot be written"):
        with atomic_write(tmp_path / "out.npy"):
            raise OSError("109319 requested and 13637 written")
    assert names(tmp_path) == []


def test_several_that_write_one_folder_at_once_all_succeed(tmp_path: Path) -> None:
    script = (
        "import sys; from pathlib import Path; from s2a.core.outputs import atomic_write\n"
        "for k in range(100):\n"
        "    with atomic_write(Path(sys.argv[1]), earlier='mark') as out:\n"
        "        out.mkdir(); (out / 'a').write_text(sys.argv[2]); (out / 'mark').write_text(sys.argv[2])\n"
    )
    out = tmp_path / "out"
    writers = [
        subprocess.Popen([sys.executable, "-c", script, str(out), str(k)], stderr=subprocess.PIPE, text=True)
        for k in range(3)
    ]
    assert [(w.communicate()[1], w.returncode) for w in writers] == [("", 0)] * 3
    assert (out / "a").read_text() == (out / "mark").read_text()
    assert names(tmp_path) == ["out"]


@pytest.mark.parametrize("out", [".", "..", "/", "", "sub/.."])
@pytest.mark.parametrize("command", ["zoo", "export", "sample"])
def test_no_command_replaces_the_current_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, command: str, out: str
) -> None:
    satellites.need(command)
    (tmp_path / "sub").mkdir()
    monkeypatch.chdir(tmp_path)
    tiny_scan.write(tmp_path / "scan")
    before = names(tmp_path)
    values = {"zoo": [], "export": [f"scan={tmp_path / 'scan'}"], "sample": ["detail=demo", "room=office"]}[command]
    if command == "export" and out:
        pytest.skip("export puts two files into a folder that may hold others")
    start = time.monotonic()
    assert cli.main([command, *values, f"out={out}"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1 and ("current folder" in said[0] or "is ''" in said[0] or "unknown" in said[0]), said
    assert time.monotonic() - start < 20.0 and names(tmp_path) == before


def test_an_empty_input_is_not_the_current_folder(capsys: pytest.CaptureFixture) -> None:
    assert cli.main(["view", "path="]) == 2
    assert "key 'path' is ''; expected a path" in capsys.readouterr().err


def test_two_sweeps_of_one_second_have_folders_of_their_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(time, "strftime", lambda _: "multirun/2026-01-01/00-00-00")
    assert len({cli._sweep_folder([])[0] for _ in range(4)}) == 4
    assert cli._sweep_folder(["hydra.sweep.dir=mine"]) == (Path("mine"), False)


class Interrupt(MetaPathFinder):
    """Interrupts an import."""

    def find_spec(self, name: str, *_: object) -> None:
        if name == "s2a.commands.cli":
            raise KeyboardInterrupt


def test_an_interrupt_while_the_program_is_imported_is_one_line(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture
) -> None:
    from s2a import commands

    monkeypatch.delitem(sys.modules, "s2a.commands.cli")
    monkeypatch.delattr(commands, "cli")
    monkeypatch.setattr(sys, "meta_path", [Interrupt(), *sys.meta_path])
    assert entry.main() == 130
    assert capsys.readouterr().err == "s2a: interrupted\n"


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_a_terminal_that_knows_fewer_letters_shows_the_rest_by_number(tmp_path: Path, encoding: str) -> None:
    square = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]]), np.array([[0, 1, 2]]))
    path = tmp_path / "room.usda"
    geometric.write(Scene("書\x1b", {"書_1": Part("書架\x1b[2J", square)}), path)
    result = subprocess.run(
        [sys.executable, "-m", "s2a", "view", f"path={path}"],
        env={**os.environ, "PYTHONIOENCODING": encoding},
        capture_output=True,
    )
    assert result.returncode == 0 and b"Error" not in result.stderr
    assert b"\\u66f8" in result.stdout and b"\x1b" not in result.stdout


def test_a_path_that_is_not_utf8_is_written_and_named(tmp_path: Path) -> None:
    tiny_scan.write(tmp_path / "scan")
    out = os.fsencode(tmp_path) + b"/out\xe9"
    command = [sys.executable, "-m", "s2a", "export", b"scan=" + os.fsencode(tmp_path / "scan"), b"out=" + out]
    result = subprocess.run(command, capture_output=True)
    assert result.returncode in (0, 2) and b"bug" not in result.stderr, result
    assert len(result.stderr.splitlines()) == 1


def chain(length: int) -> Scene:
    """Return parts that each belong to the one before; the last but one moves."""
    square = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0.0]]), np.array([[0, 1, 2]]))
    slide = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.4))
    parts = {
        f"part_{k}": Part("part", square, f"part_{k - 1}" if k else None, slide if k == length - 2 else "fixed")
        for k in range(length)
    }
    return Scene("chain", parts)


def test_a_chain_of_more_parts_than_a_stack_has_frames_is_written_and_read(tmp_path: Path) -> None:
    scene, last = chain(1050), "part_1049"
    assert scene.depth(last) == 1049 and scene.root(last) == "part_0"
    assert scene.descendants("part_0") == tuple(f"part_{k}" for k in range(1, 1050))
    assert (scene.body("part_3"), scene.body(last)) == ("part_0", "part_1048")
    geometric.write(scene, tmp_path / "geometric.usd")
    assert geometric.read(tmp_path / "geometric.usd") == scene


@pytest.mark.slow
def test_a_chain_of_more_parts_than_a_stack_has_frames_is_described_and_shown(tmp_path: Path) -> None:
    descriptive.write(chain(1050), tmp_path / "descriptive.usda")
    assert "part_1049" in tree(tmp_path / "descriptive.usda")


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES, errno.ENOSPC])
def test_a_cache_that_cannot_be_written_is_named_with_the_remedy(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture, number: int
) -> None:
    def fail(_: object) -> None:
        raise OSError(number, os.strerror(number), "/home/somebody/.cache/warp/1.19.0")

    monkeypatch.setattr(view, "run", fail)
    assert cli.main(["view", "path=room.usd"]) == 2
    assert "set WARP_CACHE_PATH to a folder that can be written" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("streams", "code", "words"),
    [
        ("> /dev/full", 2, "s2a: stdout cannot be written: No space left on device; choose another file for it\n"),
        (">&-", 0, ""),
        ("| true", 0, ""),
    ],
)
def test_a_stream_that_takes_nothing_is_no_traceback(streams: str, code: int, words: str) -> None:
    script = f"set -o pipefail; {sys.executable} -m s2a --version {streams}"
    ran = subprocess.run(["bash", "-c", script], capture_output=True, text=True)
    assert (ran.returncode, ran.stderr) == (code, words)
