"""`s2a import frames=...`: a recording becomes a levelled, coloured surface where the room is."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import recordings
import trimesh

from s2a.commands import cli
from s2a.scan import ply


@pytest.mark.slow
def test_a_recording_is_fused_where_the_room_is(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    world = trimesh.transformations.rotation_matrix(2.0, (0.3, -0.8, 0.5), (1, 2, 3))
    walk = recordings.seven_scenes(tmp_path / "walk", 36, world)
    up = world[:3, 2].round(4).tolist()
    out = tmp_path / "scan"
    assert cli.main(["import", f"frames={walk}", "voxel=0.03", "far=9", f"up={up}", "level=true", f"out={out}"]) == 0
    assert "7-Scenes recording: 36 frames fused" in capsys.readouterr().out
    scan = ply.read(out / "mesh_aligned_0.05.ply")
    matrix = np.array(json.loads((out / "import.json").read_text())["matrix"]) @ world
    assert matrix[:3, 2] == pytest.approx([0, 0, 1], abs=0.01)
    points = (scan.vertices - matrix[:3, 3]) @ matrix[:3, :3]
    off = np.minimum(np.abs(points), np.abs(points - recordings.SIZE)).min(axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.01 and len(points) > 5000
    assert scan.colors is not None
    inner = (points[:, :2] > 0.2).all(axis=1) & (points[:, :2] < recordings.SIZE[:2] - 0.2).all(axis=1)
    floor, ceiling = inner & (points[:, 2] < 0.05), inner & (points[:, 2] > 2.4)
    assert scan.colors[floor].mean(axis=0) == pytest.approx(recordings.RED, abs=6)
    assert scan.colors[ceiling].mean(axis=0) == pytest.approx(recordings.GREY, abs=6)
    keyframes = json.loads((out / "keyframes" / "keyframes.json").read_text())
    assert 8 <= len(keyframes["frames"]) <= 36
