"""Many captures: their names, rows of what failed, and the data sets of a sweep's jobs joined to one."""

from __future__ import annotations

import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import furnished_room
import pytest

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.core.locks import LOCK, MARK
from s2a.learn import rooms
from s2a.tasks import pool
from s2a.view import report

PART = {"room": "a.usd", "part": "drawer_1", "kind": "prismatic", "handle": "scanned", "motion": "a_drawer_1.npz"}


def row(name: str, **more: Any) -> dict[str, Any]:
    """Return the row of a room in which nothing was made."""
    empty = {"name": name, "source": name, "failed": "", "seconds": {}, "parts": [], "left_out": {}, "verdicts": {}}
    return empty | {"image": ""} | more


def test_patterns_name_captures(tmp_path: Path) -> None:
    (tmp_path / "flat").mkdir()
    for name in ("hall.ply", "attic.obj"):
        (tmp_path / name).touch()
    names = list(rooms.captures_of(f"{tmp_path}/*").values())
    assert names == ["attic", "flat", "hall"]
    assert list(rooms.captures_of((f"{tmp_path}/hall.ply", f"{tmp_path}/*"))) == [
        tmp_path / "hall.ply",
        tmp_path / "attic.obj",
        tmp_path / "flat",
    ]


def test_two_captures_of_one_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "hall.ply").touch()
    (tmp_path / "hall.obj").touch()
    assert cli.main(["dataset", f"scans={tmp_path}/*", f"out={tmp_path}/rooms"]) == 2
    assert "both named 'hall'" in capsys.readouterr().err and not (tmp_path / "rooms").exists()


def test_no_capture_is_refused(tmp_path: Path) -> None:
    for given, words in (
        (f"{tmp_path}/no", "no file or folder"),
        ((), "empty"),
    ):
        with pytest.raises(InputError, match=words):
            rooms.captures_of(given)


def test_the_data_sets_of_jobs_become_one_index(tmp_path: Path) -> None:
    for job in ("0", "1", "10"):
        (tmp_path / job / ".hydra").mkdir(parents=True)
        (tmp_path / job / ".hydra/overrides.yaml").write_text("- scans=/captures/hall\n- out=rooms\n")
    for job, one in (("0", row("a", parts=[PART], image="a.jpg")), ("10", row("b", left_out={"door_2": "no base"}))):
        (tmp_path / job / "rooms").mkdir()
        pool.write(tmp_path / job / "rooms/pool.json", [], {}, {"verdicts": [one]})
    text = rooms.overview(tmp_path)
    assert (
        "1 parts of 3 rooms, 1 of them slide; 1 parts left out, 1 rooms failed" in text
        and "job 1 failed: the job wrote no index" in text
    )
    (entry,) = pool.read(tmp_path / "pool.json")
    assert (entry.room, entry.motion) == ("0/rooms/a.usd", "0/rooms/a_drawer_1.npz")
    index = json.loads((tmp_path / "pool.json").read_text())
    assert [one["name"] for one in index["verdicts"]] == ["a", "job 1", "b"]
    assert index["left_out"] == {"b/door_2": "no base"} and index["verdicts"][0]["image"] == "0/rooms/a.jpg"


def test_the_page_shows_a_verdict_a_room_and_reasons(tmp_path: Path) -> None:
    verdicts = {"drawer_1": {"success": 1.0, "grasp_success": 1.0, "certified": True, "failed_checks": ""}}
    rows = [
        row("a", parts=[PART], verdicts=verdicts, seconds={"import": 60.0, "prepare": 30.0}),
        row("b", failed="import: no up axis"),
    ]
    pool.write(tmp_path / "pool.json", [pool.PoolPart(**PART)], {"a/door_2": "no base"}, {"verdicts": rows})
    page = report.read(tmp_path / "pool.json").html()
    assert "1 parts of 2 rooms" in page and "1 rooms failed; 1.5 minutes" in page
    assert all(words in page for words in ("import: no up axis", "no base", "1 of 1", "a/door_2"))
    assert "<h2>Images" not in page, "no room has an image"


def test_the_page_counts_the_parts_of_the_index(tmp_path: Path) -> None:
    kept_out = PART | {"part": "door_3", "handle": "edge", "motion": "a_door_3.npz"}
    (tmp_path / "a.jpg").write_bytes(b"\xff\xd8\xff")
    rows = [
        row("a", parts=[PART, kept_out], left_out={"door_2": "no base"}, image="a.jpg"),
        row("b", parts=[kept_out | {"room": "b.usd"}]),
    ]
    pool.write(tmp_path / "pool.json", [pool.PoolPart(**PART)], {"a/door_2": "no base"}, {"verdicts": rows})
    page = report.read(tmp_path / "pool.json").html()
    cells = {name: re.findall(r"<td class='n'>(\d+)", page.split(f"<td class=''>{name}<")[1])[:2] for name in "ab"}
    assert cells == {"a": ["3", "1"], "b": ["1", "0"]}, "parts that move, and those in the index"
    assert "a: 1 parts; 1 left out" in page and "<h2>Images" in page


@pytest.mark.slow
def test_captures_that_fail_are_rows_and_are_tried_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for name in ("hall.ply", "attic.txt"):
        (tmp_path / name).write_text("nothing")
    keys = ["dataset", f"scans=[{tmp_path}/hall.ply,{tmp_path}/attic.txt]", f"out={tmp_path}/rooms", "jobs=2"]
    assert cli.main(keys) == 2
    rows = json.loads((tmp_path / "rooms/pool.json").read_text())["verdicts"]
    assert [one["name"] for one in rows] == ["hall", "attic"]
    assert all(one["failed"].startswith("import: ") and one["parts"] == [] for one in rows)
    message = capsys.readouterr().err
    assert "2 rooms failed" in message and "hall: import: " in message
    assert cli.main([*keys, "episodes=3"]) == 2
    assert "made with other settings" in capsys.readouterr().err


def until(process: subprocess.Popen[bytes], reached: Callable[[], bool]) -> None:
    """Wait until a command has reached a point, and kill it there."""
    while not reached():
        assert process.poll() is None, "the command ended before it was killed"
        time.sleep(0.05)
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.mark.slow
def test_a_killed_run_goes_on_and_keeps_what_is_done(tmp_path: Path) -> None:
    captures, out = tmp_path / "captures", tmp_path / "rooms"
    captures.mkdir()
    furnished_room.room().export(captures / "a.ply")
    assert cli.main(["sample", "room=hallway", "seed=0", "detail=demo", f"out={captures / 'b'}"]) == 0
    shutil.copytree(captures / "b", captures / "c")
    command = [sys.executable, "-m", "s2a", "dataset", f"scans={captures}/*", f"out={out}", "stages=[]"]

    def stored() -> dict[str, Any]:
        return {file.stem: json.loads(file.read_text()) for file in out.glob("?.json")}

    # Killed in the proposals of the first, whose import is done; then in the third, with the second done.
    until(subprocess.Popen(command), lambda: "import" in stored().get("a", {}).get("seconds", {}))
    imported = (out / "a/scan/import.json").stat().st_mtime_ns
    until(subprocess.Popen(command), lambda: "prepare" in stored().get("c", {}).get("seconds", {}))
    assert stored()["b"]["failed"] == "" and stored()["c"]["failed"] == rooms.CUT_OFF
    done = {file.name: file.stat().st_mtime_ns for file in out.glob("b*")}
    subprocess.run(command, check=True, env=os.environ)
    assert (out / "a/scan/import.json").stat().st_mtime_ns == imported
    assert {file.name: file.stat().st_mtime_ns for file in out.glob("b*")} == done
    index = json.loads((out / "pool.json").read_text())
    parts = {name: [part["part"] for part in index["parts"] if part["room"] == f"{name}.usd"] for name in "bc"}
    assert parts["b"] and parts["b"] == parts["c"], "the same scan gives the same parts, cut off or not"
    assert [one["name"] for one in index["verdicts"]] == ["a", "b", "c"]
    assert not any(one["failed"] for one in index["verdicts"][1:])
    assert all((out / part["motion"]).is_file() for part in index["parts"])
    rests = [file for file in out.rglob("*") if MARK in file.name and not file.name.endswith(LOCK)]
    assert not rests, "nothing of a killed run stays"
