"""From a phone's GLB to a robot that opens three parts, annotated with clicks in Chromium as somebody would who sees the room."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import satellites

browser = pytest.importorskip("browser", reason="selenium is not installed", exc_type=ImportError)
pytest.importorskip("viser", reason="viser is not installed")

import clicking  # noqa: E402

from s2a import scan  # noqa: E402
from s2a.commands import cli  # noqa: E402

pytestmark = [
    pytest.mark.slow,
    pytest.mark.browser,
    pytest.mark.skipif(not (browser.CHROMIUM and browser.DRIVER), reason="Chromium and its driver are not installed"),
]
ROOM, SEED = "kitchen", 110
"""Not among the rooms by which anything here was developed."""
PARTS = {"drawer_27": "handle_31", "drawer_25": "handle_29", "dishwasher_door_20": "handle_22"}
"""What is annotated, and where one sees its handle."""
AZIMUTH = -1.82
"""[rad] From here the camera sees the kitchen's front."""


def test_three_parts_of_an_unseen_phone_scan_are_annotated_in_a_minute_each_and_opened(tmp_path: Path) -> None:
    sample = [f"room={ROOM}", f"seed={SEED}", "detail=phone", f"out={tmp_path / 'sample'}"]
    satellites.need("sample")
    assert cli.main(["sample", *sample]) == 0
    glb, imported = tmp_path / "sample" / "scan.glb", tmp_path / "scan"
    assert cli.main(["import", f"mesh={glb}", f"out={imported}", "texel=0.02"]) == 0
    truth = json.loads((tmp_path / "sample" / "truth" / "truth.json").read_text())["parts"]
    shift = json.loads((imported / "import.json").read_text())["matrix"][2][3]
    figures = clicking.annotate(imported, truth, PARTS, AZIMUTH, shift, tmp_path / "out")
    assert np.median([clicking.PACE * row["actions"] for row in figures]) <= 60.0
    scene = scan.read(tmp_path / "out")
    assert len(scene.movable) == 3
    assert cli.main(["check", f"scan={tmp_path / 'out'}"]) == 0
    assert cli.main(["export", f"scan={tmp_path / 'out'}", f"out={tmp_path}"]) == 0
    stage = tmp_path / "room.usd"
    assert cli.main(["prepare", f"stage={tmp_path / 'geometric.usd'}", "targets=all", f"out={stage}"]) == 0
    for part in scene.movable:
        report = tmp_path / f"{part}.json"
        assert cli.main(["evaluate", f"stage={stage}", f"part={part}", "num_envs=2", f"out={report}"]) == 0
        assert json.loads(report.read_text())["opening"]["mean"] > 0.2
