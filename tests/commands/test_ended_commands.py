"""Every command is ended in its middle, killed, and run on a disk that is full or read-only: earlier output stays."""

from __future__ import annotations

import hashlib
import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import box_room
import pytest
import satellites
import tiny_scan
from cabinet import write_cabinet

from s2a.commands import cli
from s2a.scene.usd import geometric

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
    "certify": ["stage={inputs}/sim.usda", "out={out}/validation", "stamp=false", "certify.motion.poses=4{n}"],
    "evaluate": ["stage={inputs}/sim.usda", "num_envs=2", "seed={n}", "out={out}/planner.json", "images={out}"],
    "train": [
        "stage={inputs}/sim.usda", "num_envs=8", "ppo.num_steps_per_env=8", "ppo.iterations=4", "ppo.save_interval=1",
        "resume=true", "out={out}/ppo{n}",
    ],
    "view": ["path={inputs}/room.usd", "image={out}/view.png"],
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
    return folder


def begun(command: str, inputs: Path, out: Path, n: int) -> subprocess.Popen:
    keys = [key.format(inputs=inputs, out=out, n=n) for key in COMMANDS[command]]
    return subprocess.Popen(
        [sys.executable, "-m", "s2a", command, *keys], stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )


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
        assert process.returncode in (0, 1, 130, 143, -number) or b"has done its" in said, said
        assert b"bug" not in said, said
        states.append(content(out) if number != signal.SIGKILL else ours(content(out)))
    again = begun(command, inputs, out, 1)
    said = again.communicate()[1]
    assert again.returncode in (0, 1) or b"has done its" in said, said
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
