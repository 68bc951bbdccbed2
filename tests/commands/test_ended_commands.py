"""Every command is ended in its middle, killed, run twice at once, on small, full and read-only disks, and by other users.

Earlier output stays, and what cannot be done is one line.
"""

from __future__ import annotations

import functools
import hashlib
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import box_room
import numpy as np
import pytest
import satellites
import tiny_scan
import warp as wp
from cabinet import write_cabinet

from s2a import robot
from s2a.commands import cli
from s2a.core.locks import LOCK
from s2a.motion.trajectory import Demonstration
from s2a.scene.usd import geometric
from s2a.tasks import pool

pytestmark = pytest.mark.slow

COMMANDS = {
    "sample": ["room=bathroom", "seed={n}", "out={out}/scan"],
    "zoo": ["seed={n}", "out={out}/zoo"],
    "export": ["scan={inputs}/scan", "out={out}"],
    "check": ["scan={inputs}/scan", "out={out}/check.json"],
    "insert": [
        "stage={inputs}/room.usd", "object={inputs}/zoo/objects/stapler.usda", "label=stapler", "llm=rules", "out={out}/insert",
        "image={out}/insert.png", "neighbours={n}",
    ],
    "prepare": ["stage={inputs}/room.usd", "targets=drawer_6", "out={out}/sim.usd"],
    "identify": ["stage={inputs}/sim.usda", "pulls=[{inputs}/pull.csv]", "noise.force=0.{n}5", "out={out}/identified.usda"],
    "optimize": ["stage={inputs}/sim.usda", "pull.rounds=3", "pull.time=0.{n}5", "out={out}/law.json"],
    "convert": ["stage={inputs}/sim.usda", "out={out}/mjcf"],
    "certify": ["stage={inputs}/sim.usda", "out={out}/validation", "stamp=false", "certify.motion.rest_time=2.{n}"],
    "evaluate": ["stage={inputs}/sim.usda", "num_envs=2", "seed={n}", "out={out}/planner.json", "images={out}"],
    "train": [
        "stage={inputs}/sim.usda", "num_envs=8", "ppo.num_steps_per_env=8", "ppo.iterations=4", "ppo.save_interval=1",
        "resume=true", "out={out}/ppo{n}",
    ],
    "view": ["path={inputs}/room.usd", "image={out}/view.png", "html={out}/view.html"],
    "import": ["mesh={inputs}/scan/mesh_aligned_0.05.ply", "out={out}/imported", "image={out}/import.png"],
    "annotate": ["scan={inputs}/scan", "edit=true", "page=false", "out={out}/annotated"],
    "collect": [
        "stage={inputs}/sim.usda", "episodes=1", "num_envs=2", "seed={n}", "every=20", "views.width=32", "views.height=32",
        "out={out}/set{n}",
    ],
    "bench": [
        "stage={inputs}/pool.json", "policy=random", "episodes=2", "steps=3", "num_envs=4", "seed={n}", "out={out}/bench.json",
    ],
    "perceive": [
        "stage={inputs}/pool.json", "network.capacity=64", "network.batch=4", "frames=4", "num_envs=2",
        "steps=6", "out={out}/perception{n}",
    ],
    "report": ["path={inputs}/bench.json", "out={out}/report.html"],
    "do": [
        "open drawer_2", "stage={inputs}/sim.usda", "llm=rules", "plan_only=true", "seed={n}", "out={out}/do.json",
    ],
    "register": ["closed={inputs}/scan", "open={inputs}/scan", "out={out}/registered"],
}  # fmt: skip
"""Keys of each command; {n} differs from run to run, so that certify does not keep the earlier report."""
TIMED = {"planner.json", "report.json", "report.html", "insert.json"}
"""Files that hold how long it took."""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("inputs")
    tiny_scan.write(folder / "scan")
    geometric.write(box_room.room(), folder / "room.usd")
    write_cabinet(folder / "sim.usda")
    rows = "\n".join(f"{i / 30},{0.01 * i},5" for i in range(20))
    (folder / "pull.csv").write_text(f"time,opening,force\n{rows}\n")
    if not satellites.missing("zoo"):
        assert cli.main(["zoo", f"out={folder / 'zoo'}"]) == 0
    write_pool(folder)
    table = f"out={folder / 'bench.json'}"
    assert cli.main(["bench", f"stage={folder / 'pool.json'}", "policy=random", "episodes=2", "steps=3", table]) == 0
    return folder


def write_pool(folder: Path) -> None:
    """Write a pool of two rooms, with a motion that stands still."""
    still = Demonstration(np.tile(np.array(robot.load("panda").start), (2, 1)), np.zeros((2, 10)), 1)
    entries = []
    for name in ("one", "two"):
        path = write_cabinet(folder / f"{name}.usda")
        pool.save_motion(still, folder / f"{name}.npz")
        entries.append(pool.PoolPart(path.name, "drawer_2", "prismatic", "bar", f"{name}.npz"))
    pool.write(folder / "pool.json", entries, {}, {"first": 0})


def begun(
    command: str, inputs: Path, out: Path, n: int, before: Sequence[str] = (), environment: dict[str, str] | None = None
) -> subprocess.Popen:
    """Start a command, behind the words of another that runs it."""
    keys = [key.format(inputs=inputs, out=out, n=n) for key in COMMANDS[command]]
    words = [*before, sys.executable, "-m", "s2a", command, *keys]
    return subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, env=environment)


def content(folder: Path) -> dict[str, str]:
    """Return a hash of every file below a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    return {str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


def ours(found: dict[str, str]) -> dict[str, str]:
    """Return the files that are not in a folder which a killed command leaves and the next one deletes."""
    return {name: mark for name, mark in found.items() if ".s2a-" not in name}


@pytest.mark.parametrize("command", COMMANDS)
def test_an_ended_command_keeps_the_earlier_output_and_can_be_run_again(
    command: str, inputs: Path, tmp_path: Path
) -> None:
    satellites.need(command)
    out = tmp_path / "out"
    out.mkdir()
    start = time.monotonic()
    first = begun(command, inputs, out, 0)
    said = first.communicate()[1]
    assert first.returncode in (0, 1), said
    whole, before = time.monotonic() - start, content(out)
    assert before
    states = []
    for number, fraction in (
        (signal.SIGTERM, 0.5),
        (signal.SIGINT, 0.75),
        (signal.SIGKILL, 0.5),
        (signal.SIGKILL, 0.9),
    ):
        process = begun(command, inputs, out, 1)
        time.sleep(fraction * whole)
        process.send_signal(number)
        said = process.communicate()[1]
        assert process.returncode in (0, 1, 130, 143, -number) or b"has completed its" in said, said
        assert b"bug" not in said, said
        states.append(content(out) if number != signal.SIGKILL else ours(content(out)))
    again = begun(command, inputs, out, 1)
    said = again.communicate()[1]
    assert again.returncode in (0, 1) or b"has completed its" in said, said
    after = content(out)
    assert after == ours(after)
    for state in states if command != "train" else ():  # whose checkpoints are there to go on from
        assert state.keys() in (before.keys(), after.keys())
        changed = {name for name in state if state[name] not in (before.get(name), after.get(name))}
        assert changed <= {name for name in state if Path(name).name in TIMED}


@pytest.fixture
def disk(tmp_path: Path) -> Iterator[Path]:
    """A small file system."""
    folder = tmp_path / "disk"
    folder.mkdir()
    if subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64m", "none", folder], capture_output=True).returncode:
        pytest.skip("may not mount a file system")
    yield folder
    subprocess.run(["umount", folder], check=True)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("state", ["full", "read-only"])
def test_a_disk_that_takes_nothing_is_one_line(command: str, state: str, inputs: Path, disk: Path) -> None:
    satellites.need(command)
    assert begun(command, inputs, disk, 0).wait() in (0, 1)
    before = content(disk)
    if state == "full":
        with open(disk / "filler", "wb") as filler:
            os.posix_fallocate(filler.fileno(), 0, os.statvfs(disk).f_bavail * os.statvfs(disk).f_frsize)
        before = content(disk)
    else:
        subprocess.run(["mount", "-o", "remount,ro", disk], check=True)
    process = begun(command, inputs, disk, 1)
    said = process.communicate()[1].decode()
    lines = [line for line in said.splitlines() if line.startswith("s2a")]
    assert process.returncode == 2 and "bug" not in said and str(disk) in lines[-1], said
    assert ours(content(disk)) == before


def refused(process: subprocess.Popen) -> str:
    """Return the one line with which a command is refused."""
    said = process.communicate()[1].decode()
    lines = [line for line in said.splitlines() if line.startswith("s2a: ") and "warning: " not in line]
    assert process.returncode == 2 and len(lines) == 1, said
    assert "Traceback" not in said and "bug" not in said, said
    return lines[0]


def locks(folder: Path) -> list[Path]:
    """Return the locks in a folder that name their holders."""
    return [path for path in folder.rglob(f"*{LOCK}") if path.stat().st_size]


@pytest.mark.parametrize("command", COMMANDS)
def test_a_second_command_is_refused_and_goes_on_where_the_first_was_killed(
    command: str, inputs: Path, tmp_path: Path
) -> None:
    satellites.need(command)
    out = tmp_path / "out"
    out.mkdir()
    first = begun(command, inputs, out, 0)
    while not locks(tmp_path):
        assert first.poll() is None, first.communicate()[1]
        time.sleep(0.005)
    first.send_signal(signal.SIGSTOP)
    try:
        before = content(out)
        line = refused(begun(command, inputs, out, 0))
        assert f"is being written by s2a {command}, process {first.pid} on " in line
        assert content(out) == before
    finally:
        first.kill()
        first.communicate()
    third = begun(command, inputs, out, 0)
    said = third.communicate()[1]
    assert third.returncode in (0, 1), said
    assert content(out) and content(out) == ours(content(out)) and not list(tmp_path.rglob(f"*{LOCK}"))


@pytest.mark.parametrize("command", COMMANDS)
def test_of_two_commands_at_once_no_output_is_mixed(command: str, inputs: Path, tmp_path: Path) -> None:
    satellites.need(command)
    out = tmp_path / "out"
    out.mkdir()
    pair = [begun(command, inputs, out, 0) for _ in range(2)]
    said = [process.communicate()[1].decode() for process in pair]
    print(command, [process.returncode for process in pair])
    assert min(process.returncode for process in pair) in (0, 1), said
    for process, words in zip(pair, said, strict=True):
        held = "is being written by" in words or "holds files" in words or "has completed its" in words
        assert process.returncode in (0, 1) or (process.returncode == 2 and held), words
        assert "bug" not in words
    assert content(out) == ours(content(out)) and not list(tmp_path.rglob(f"*{LOCK}"))


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("size", ["40k", "300k", "3m", "30m"])
def test_a_small_disk_takes_whole_files_or_nothing(
    command: str, size: str, inputs: Path, disk: Path, whole: Callable[[str], dict[str, str]]
) -> None:
    satellites.need(command)
    subprocess.run(["mount", "-o", f"remount,size={size}", disk], check=True)
    (disk / "earlier").write_text("here before")
    before = content(disk)
    process = begun(command, inputs, disk, 0)
    if process.wait() in (0, 1):
        print(command, size, "fits")
        present, expected = repeatable(content(disk)), before | whole(command)
        if command == "train":  # whose files hold how long it took, the log's name when
            present, expected = ({name for name in files if "tfevents" not in name} for files in (present, expected))
        assert present == expected
        return
    line = refused(process)
    print(command, size, line)
    assert str(disk) in line and "free some space" in line
    if command in ("train", "collect"):  # which keep what is whole, to go on from
        assert content(disk)["earlier"] == before["earlier"]
    else:  # view writes two files
        assert before.items() <= repeatable(content(disk)).items() <= (before | whole(command)).items()


@pytest.fixture(scope="module")
def whole(inputs: Path, tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], dict[str, str]]:
    """What a command writes where there is space."""

    @functools.cache
    def files(command: str) -> dict[str, str]:
        out = tmp_path_factory.mktemp("whole")
        assert begun(command, inputs, out, 0).wait() in (0, 1)
        return repeatable(content(out))

    return files


def repeatable(found: dict[str, str]) -> dict[str, str]:
    """Return the files that neither hold times nor where they are."""
    return {
        name: mark for name, mark in found.items() if Path(name).name not in {*TIMED, "identified.usda", "insert.usda"}
    }


def without_git(folder: Path) -> dict[str, str]:
    """Return an environment whose programs are those of a bare container."""
    folder.mkdir()
    for name in ("sh", "env", "uname", "ldconfig", "gcc", "cc", "as", "ld"):
        if path := shutil.which(name):
            (folder / name).symlink_to(path)
    return os.environ | {"PATH": str(folder)}


CACHES = ("HOME", "S2A_CACHE", "WARP_CACHE_PATH", "XDG_CACHE_HOME")
UNKNOWN = ["unshare", "--user", "--map-user=12345", "--map-group=12345"]
"""Runs a command as a user whom the system does not list."""


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("lack", ["git", "home"])
def test_a_command_needs_neither_git_nor_a_home(command: str, lack: str, inputs: Path, tmp_path: Path) -> None:
    satellites.need(command)
    if lack == "home" and subprocess.run([*UNKNOWN, "true"], capture_output=True).returncode:
        pytest.skip("may not make users")
    out = tmp_path / "out"
    out.mkdir()
    bare = {name: value for name, value in os.environ.items() if name not in CACHES} | {"TMPDIR": str(tmp_path)}
    bare |= {"WARP_CACHE_PATH": str(wp.config.kernel_cache_dir)}  # to compile kernels takes a minute each time
    environment = without_git(tmp_path / "bin") if lack == "git" else bare
    process = begun(command, inputs, out, 0, UNKNOWN if lack == "home" else (), environment)
    said = process.communicate()[1].decode()
    assert process.returncode in (0, 1) and "Traceback" not in said and content(out), said
    assert not Path("~").exists() and not (out / "~").exists()


@pytest.mark.parametrize("command", COMMANDS)
def test_a_place_of_another_user_is_refused_at_once(command: str, inputs: Path) -> None:
    satellites.need(command)
    if os.getuid():
        pytest.skip("is not root")
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(inputs, Path(folder, "inputs"))
        Path(folder, "inputs").chmod(0o755)  # pytest's folders are its user's alone
        out = Path(folder, "out")
        out.mkdir()
        Path(folder).chmod(0o755)
        nobody = ["setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"]
        if subprocess.run([*nobody, "test", "-x", os.path.realpath(sys.executable)]).returncode:
            pytest.skip("another user may not run this Python")
        bare = {name: value for name, value in os.environ.items() if name not in CACHES} | {"HOME": "/nonexistent"}
        line = refused(begun(command, Path(folder, "inputs"), out, 0, nobody, bare))
        assert str(out) in line and "cannot be written: Permission denied; choose another path" in line
