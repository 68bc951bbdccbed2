"""`s2a prepare refine_joints=true`: the refined joint is the file's, and the annotation is kept beside it."""

from pathlib import Path

import numpy as np
import pytest
from flat_cabinet import DRAWER, cabinet, tilted

from s2a import api
from s2a.core import config
from s2a.scene.usd import geometric, sim_stage

WRONG = tilted(DRAWER, 2.0, (0.0, 0.6, 0.8))
FAST = ["prepare.base.search=false", "prepare.colliders.method=one_hull", "prepare.decimate.mode=none"]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("refined")
    geometric.write(cabinet({"drawer_2": WRONG}), folder / "geometric.usd")
    return api.prepare(folder / "geometric.usd", "drawer_2", folder / "room.usd", [*FAST, "refine_joints=true"])


def test_the_refined_joint_is_the_files(prepared) -> None:
    found = sim_stage.read(prepared).articulations["drawer_2"]
    assert np.degrees(np.arccos(np.dot(found.joint.axis, DRAWER.axis))) < 0.3
    assert found.refinement.annotated == WRONG
    assert np.degrees(found.refinement.angle) == pytest.approx(2.0, abs=0.3)
    assert 0.0 < np.degrees(found.refinement.angle_sigma) < 0.5
    assert any("joint of drawer_2 refined" in note for note in found.notes)


def test_it_happens_only_if_asked_for() -> None:
    assert config.compose("prepare")["refine_joints"] is False


def test_a_rewritten_file_keeps_the_refinement(prepared, tmp_path) -> None:
    room = sim_stage.read(prepared)
    sim_stage.write(room, tmp_path / "again.usd")
    again = sim_stage.read(tmp_path / "again.usd").articulations["drawer_2"]
    assert again.refinement == room.articulations["drawer_2"].refinement
