"""Where an object stays: the next best place, or the pose in which it comes to rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from rough_furniture import block, table
from scipy.spatial.transform import Rotation

from s2a.core.config import compose, load
from s2a.language.insert.describe import RoomState
from s2a.language.insert.fit import Pose
from s2a.language.insert.plan import Choice
from s2a.language.insert.poses import CandidatePose, PoseConfig
from s2a.language.insert.settings import InsertSettings
from s2a.language.insert.stability import drop_check, stable_pose
from s2a.language.insert.supports import SurfaceConfig, nearby
from s2a.scene.geometry.mesh_query import crossing
from s2a.scene.scene import Mesh

VALUES = compose("insert/placement")["insert"]
POSE: PoseConfig = load(PoseConfig, VALUES["pose"])
ROOM = RoomState(table(), "", SurfaceConfig("regions"))
SETTINGS: InsertSettings = load(InsertSettings, compose("insert", ["stage=none", "out=none"]))
ON = Choice("table_2", "horizontal", "on", 0.74, "")
CUP = block(0.08, 0.08, 0.1)


def candidate(x: float, height: float, tilt: float = 0.0) -> CandidatePose:
    """A cup somewhere over the table, tilted [deg] about x."""
    turn = tuple(Rotation.from_euler("x", tilt, degrees=True).as_quat().tolist())
    return CandidatePose(ON, np.array([0.0, 0.0, 1.0]), Pose((x, 0.3, height), turn, 0.1, 1), {"height": 0.74})


def found(*candidates: CandidatePose, thing: Mesh = CUP, accept: Any = lambda one: "") -> tuple[Any, list[str]]:
    check, reasons = drop_check(SETTINGS.hulls, SETTINGS.placement.drop_test), []
    stays = stable_pose(ROOM, thing, candidates, lambda one: check(thing, one, ROOM.scene), accept, POSE, reasons)
    return stays, reasons


def test_the_next_place_is_taken_where_the_first_one_fails() -> None:
    falls, stands = candidate(3.0, 0.742), candidate(0.7, 0.742)
    assert found(falls, stands)[0] is stands
    nothing, reasons = found(falls, candidate(3.5, 0.742))
    assert nothing is None
    assert reasons == ["on table_2: it falls: nothing supports it at all 2 places"]


def test_what_falls_over_is_refused_with_the_side_on_which_it_rests() -> None:
    board = block(0.03, 0.2, 0.3)  # on its long edge, front along x
    leaning = candidate(0.7, 0.76, tilt=0.0)
    for angle, side in ((40.0, "on its front"), (-40.0, "on its back")):
        turn = tuple(Rotation.from_euler("y", angle, degrees=True).as_quat().tolist())
        _, reasons = found(replace(leaning, pose=replace(leaning.pose, quaternion=turn)), thing=board)
        assert f"comes to rest {side}" in reasons[0]


def test_the_pose_in_which_an_object_rests_is_taken_and_touches_nothing() -> None:
    tilted = candidate(0.7, 0.76, tilt=9.0)
    rests, _ = found(tilted)
    up = Rotation.from_quat(rests.pose.quaternion).apply([0.0, 0.0, 1.0])
    assert np.degrees(np.arccos(min(1.0, up[2]))) < 2.0
    moved = rests.pose.moved(CUP)
    assert moved.bounds[0, 2] == pytest.approx(0.742, abs=0.004)
    assert crossing(moved, nearby(ROOM.scene, *moved.bounds)) is None


def test_what_falls_over_is_not_taken_as_it_lies() -> None:
    stick = block(0.03, 0.03, 0.4)
    assert found(candidate(0.7, 0.76, tilt=14.0), thing=stick)[0] is None


def test_a_place_that_stays_goes_before_one_that_rests() -> None:
    stands = candidate(0.8, 0.742)
    assert found(candidate(0.7, 0.76, tilt=9.0), stands)[0] is stands


def test_an_objection_passes_a_place_over() -> None:
    left, right = candidate(0.6, 0.742), candidate(0.9, 0.742)
    stays, _ = found(left, right, accept=lambda one: "not there" if one.pose.position[0] < 0.7 else "")
    assert stays is right
    assert found(left, accept=lambda one: "not there")[1] == ["on table_2: not there"]


def test_of_reasons_that_are_equally_frequent_the_first_is_named_in_every_run() -> None:
    falls, left = candidate(3.0, 0.742), candidate(0.6, 0.742)
    for first, second, reason in ((falls, left, "it falls: nothing supports it"), (left, falls, "not there")):
        assert found(first, second, accept=lambda one: "not there")[1] == [f"on table_2: {reason} at all 2 places"]
