"""`s2a check`: exit codes, the JSON file, and a sampled room from end to end."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from box_room import changed, room

from s2a.commands import cli
from s2a.scene.scene import Scene
from s2a.scene.usd import geometric


def stage(scene: Scene, path: Path) -> Path:
    geometric.write(scene, path)
    return path


def test_a_right_annotation_leaves_zero_and_a_contradiction_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["check", f"scan={stage(room(), tmp_path / 'right.usd')}"]) == 0
    assert "pass" in capsys.readouterr().out
    wrong = stage(changed(room(), "drawer_6", axis=(-1, 0, 0)), tmp_path / "wrong.usd")
    assert cli.main(["check", f"scan={wrong}", f"out={tmp_path / 'check.json'}"]) == 1
    [line] = [line for line in capsys.readouterr().out.splitlines() if "fail opens_outward" in line]
    assert "drawer_6" in line and "cosine -1.00" in line and "possible: 0.3 to 1; negate the axis" in line
    written = json.loads((tmp_path / "check.json").read_text())
    assert written["passed"] is False and written["bounds"]["outward"] == 0.3
    [found] = [f for f in written["checks"] if f["name"] == "opens_outward" and f["part"] == "drawer_6"]
    assert found["value"] == pytest.approx(-1.0) and found["status"] == "fail"


def test_a_warning_alone_leaves_zero(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = stage(changed(room(), "drawer_6", limits=(0.0, 0.8)), tmp_path / "long.usd")
    assert cli.main(["check", f"scan={path}"]) == 0
    assert "warn slide_travel: drawer_6: it slides by 0.80 m" in capsys.readouterr().out


def test_what_is_no_scan_is_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["check", f"scan={tmp_path / 'nowhere'}"]) == 2
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.slow
def test_a_sampled_room_passes_and_its_changed_joints_are_named(
    office_scan: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["check", f"scan={office_scan}"]) == 0
    assert "warn" not in capsys.readouterr().out
    wrong = tmp_path / "scan"
    shutil.copytree(office_scan, wrong, ignore=shutil.ignore_patterns("truth"))
    [path] = wrong.glob("*_artic.json")
    content = json.loads(path.read_text())
    records = {record["pid"]: record for record in content["data"]["articulations"]}
    records[15]["axis"] = [-x for x in records[15]["axis"]]  # a drawer
    records[21]["origin"][0] += 3.0  # a cabinet's door
    path.write_text(json.dumps(content))
    assert cli.main(["export", f"scan={wrong}", f"out={tmp_path / 'usd'}"]) == 0
    said = [line for line in capsys.readouterr().err.splitlines() if "warning:" in line]
    assert {line.split(": ")[3] for line in said} == {"drawer_15", "door_21"}
    assert any("opens_outward: drawer_15" in line for line in said) and any(
        "hinge_edge: door_21" in line for line in said
    )
