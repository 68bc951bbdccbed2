"""What validation reports and insertions say on the page of their room."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
import tiny_scan

from s2a import api
from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.scene.usd.stamp import content_hash
from s2a.view.page import cards
from s2a.view.page.room import read

CHECK = {"name": "grasp_hold", "status": "fail", "value": 0.0031, "bound": 0.002, "unit": "m", "prim": "/x"}
CHECK |= {"message": "it <slips>", "remedy": "grip harder"}


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return api.export(tiny_scan.write(tmp_path / "scan"), out=tmp_path / "usd").geometric


def report(folder: Path, stage: Path, **changes: Any) -> Path:
    each = {"target": "door_3", "stage": str(stage), "sha256": content_hash(stage), "checks": [CHECK]} | changes
    folder.mkdir()
    (folder / "report.json").write_text(json.dumps({"reports": [each]}))
    return folder


def test_a_validation_report_shows_its_stage_with_what_failed_on_the_parts_card(stage: Path, tmp_path: Path) -> None:
    shown, noted = cards.of_path(report(tmp_path / "validation", stage))
    assert shown == stage
    card = cards.card(replace(read(shown), notes=noted), "door_3")
    assert "failed, 1 checks<" in card and "0.0031 m, bound 0.002: it &lt;slips&gt;; grip harder" in card
    other = cards.card(replace(read(shown), notes=noted), next(i for i in read(shown).parts if i != "door_3"))
    assert "validation" not in other
    assert cards.noted(replace(read(shown), notes=noted)).count("<b>door_3</b>") == 1


def test_a_report_of_what_the_file_was_before_says_so(stage: Path, tmp_path: Path) -> None:
    _, noted = cards.of_path(report(tmp_path / "validation", stage, sha256="0" * 64, checks=[]))
    assert dict(noted["door_3"])["validation"] == "passed, 0 checks, before the file was changed"


def test_an_insertion_tells_its_steps_in_their_order(stage: Path, tmp_path: Path) -> None:
    record = {
        "id": "mug_9",
        "problem": "",
        "hint": "at the back",
        "plan": {"near": "pc_1", "choices": [{"target": "desk_5"}]},
    }
    record |= {"scale": {"size": [0.1, 0.08, 0.12], "method": "unit mm", "reason": "table"}}
    record |= {"pose": {"position": [1.0, 2.0, 0.74]}, "verify": {"drift": 0.0008, "tilt": 0.0175}}
    failed = {"id": "", "problem": "no place"}
    stage.with_name("insert.usda").write_bytes(stage.read_bytes())
    stage.with_name("insert.json").write_text(json.dumps({"objects": [record, failed]}))
    shown, noted = cards.of_path(stage.parent)
    assert shown.name == "insert.usda" and list(noted) == ["mug_9"]
    assert [name for name, _ in noted["mug_9"]] == ["placement hint", "plan", "size", "place", "at rest"]
    assert dict(noted["mug_9"])["at rest"] == "moved 0.8 mm, tilted 1.0 degrees"
    assert dict(noted["mug_9"])["size"] == "0.1 x 0.08 x 0.12 m, unit mm: table"


def test_other_paths_are_shown_as_they_are(stage: Path) -> None:
    assert cards.of_path(stage) == (stage, {}) and cards.of_path(stage.parent) == (stage.parent, {})


@pytest.mark.parametrize("values", ["{", "[]", '{"reports": []}', '{"reports": [{"stage": 3}]}'])
def test_a_damaged_report_is_one_line(values: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "report.json").write_text(values)
    assert cli.main(["view", f"path={tmp_path}"]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and "report.json" in error and "bug" not in error


def test_a_report_without_its_stage_names_it(stage: Path, tmp_path: Path) -> None:
    folder = report(tmp_path / "validation", stage)
    stage.unlink()
    with pytest.raises(InputError, match=r"geometric.usd, which does not exist here; give path= the stage"):
        cards.of_path(folder)


def test_the_tree_of_a_reports_stage_is_printed(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["view", f"path={report(tmp_path / 'validation', stage)}"]) == 0
    assert "door_3" in capsys.readouterr().out
