"""Placements of an object on supports."""

from __future__ import annotations

import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import box
from cube_room import START, room_of
from scipy.spatial.transform import Rotation

from s2a import robot
from s2a.core.errors import InputError
from s2a.motion import grasps
from s2a.motion.grasps import Ungraspable
from s2a.motion.places import APART, CANDIDATES, FAR, MARGINS, NEAR, OF_ONE, first_planned, free_placements, place_poses
from s2a.motion.search import Unreachable
from s2a.robot.tool_path import matrix
from s2a.scene.geometry import convex
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import Collider

PANDA = robot.load("panda")
FEW = 20, 40
"""Points at which grasps are looked for, where any will do."""


def test_a_free_placement_is_level_apart_and_on_the_support(tmp_path: Path) -> None:
    pose = next(free_placements(room_of(tmp_path), "cube_9", "cabinet_1", START))
    assert np.linalg.norm(pose[:2] - START[:2]) >= APART
    assert pose[2] == pytest.approx(0.802 + 0.025 + 0.001, abs=1e-3)
    assert abs(pose[0]) < 0.305 - 0.025
    assert abs(pose[1]) < 0.381 - 0.025


def test_only_what_an_object_stands_on_has_to_be_on_the_support(tmp_path: Path) -> None:
    room = room_of(tmp_path)
    body = room.free["cube_9"]
    arms = replace(body.colliders[0], mesh=box((0.0, 0.0, 0.3), (0.01, 0.5, 0.01)))
    room = replace(room, free={"cube_9": replace(body, colliders=(*body.colliders, arms))})
    pose = next(free_placements(room, "cube_9", "cabinet_1", START))
    assert pose[2] == pytest.approx(0.802 + 0.025 + 0.001, abs=1e-3)


def test_free_placements_are_apart_and_those_with_room_for_the_hand_come_first(tmp_path: Path) -> None:
    """A block of 4 cm stands in the middle."""
    room = room_of(tmp_path, beside=[box((0, 0, 0.85), (0.02, 0.02, 0.048))])
    poses = np.array(list(free_placements(room, "cube_9", "cabinet_1", START)))
    apart = np.linalg.norm(poses[:, None, :2] - poses[None, :, :2], axis=2) + 9.0 * np.eye(len(poses))
    assert len(poses) > 3 and apart.min() >= APART
    beside = np.linalg.norm(np.maximum(np.abs(poses[:, :2]) - 0.02 - 0.025, 0.0), axis=1)
    first = int((beside < MARGINS[0]).argmax())
    assert 0 < first and (beside[:first] >= MARGINS[0]).all() and beside.min() >= MARGINS[-1]


def test_the_next_spot_is_planned_for_where_the_first_one_has_no_plan(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(grasps, "SAMPLES", FEW)

    def plan(spot: int) -> str:
        if spot < 3:
            raise Unreachable(f"not from {spot}")
        return f"from {spot}"

    room = room_of(tmp_path)
    assert first_planned(room, "cube_9", PANDA, [1, 2, 3, 4], plan) == (3, "from 3")
    with pytest.raises(Unreachable, match="not from 1"):
        first_planned(room, "cube_9", PANDA, [1, 2], plan)


@pytest.mark.parametrize("spots", [[], [1]])
def test_where_no_spot_serves_the_gripper_that_does_not_fit_is_said_first(
    spots: list[int], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A cube of 100 mm, and a gripper that opens 80."""
    monkeypatch.setattr(grasps, "SAMPLES", FEW)

    def ends() -> Iterator[int]:
        yield from spots
        raise InputError("no level spot is free")

    def plan(spot: int) -> str:
        raise Unreachable(f"not from {spot}")

    with pytest.raises(Ungraspable, match="open 80 mm; .* is 100 mm; choose"):
        first_planned(room_of(tmp_path, side=0.1), "cube_9", PANDA, ends(), plan)
    with pytest.raises(InputError, match="no level spot"):
        first_planned(room_of(tmp_path), "cube_9", PANDA, ends(), plan)

    def graspable(spot: int) -> str:
        error = Unreachable(f"no way from {spot}")
        error.graspable = True
        raise error

    with pytest.raises(Unreachable, match="no way from 1"):  # it was held; the gripper is not asked again
        first_planned(room_of(tmp_path, side=0.1), "cube_9", PANDA, [1], graspable)


def blocks() -> list[Mesh]:
    """Return blocks of 3 cm that stand 7.5 cm apart all over the cabinet: no object is put between two of them."""
    places = [(x, y) for x in np.arange(-0.27, 0.28, 0.075) for y in np.arange(-0.36, 0.37, 0.075)]
    return [box((x, y, 0.817), (0.01, 0.01, 0.015)) for x, y in places]


@pytest.mark.slow
def test_nearby_spots_are_on_what_carries_the_object_first_and_else_on_what_is_near(tmp_path: Path) -> None:
    poses = np.array(list(place_poses(room_of(tmp_path), "cube_9", NEAR, START)))
    assert len(poses) == CANDIDATES
    assert poses[:OF_ONE, 2] == pytest.approx(0.802 + 0.025 + 0.001, abs=1e-3)
    assert poses[OF_ONE:, 2] == pytest.approx(0.025 + 0.001, abs=1e-3)  # the floor
    assert (np.linalg.norm(poses[:, :2] - START[:2], axis=1) <= FAR).all()
    full = np.array(list(place_poses(room_of(tmp_path, beside=blocks()), "cube_9", NEAR, START)))
    assert full[:, 2] == pytest.approx(0.025 + 0.001, abs=1e-3)


def test_an_object_leans_on_a_slope_at_the_other_ends_height_before_it_stands_lower_and_only_where_it_may(
    tmp_path: Path,
) -> None:
    """A support with a slope of 4 degrees, and a level top 0.3 m lower beside it; the cube is turned by 30 degrees."""
    tilt, yaw = Rotation.from_euler("y", -4.0, degrees=True), Rotation.from_euler("z", 30.0, degrees=True)
    slope = convex.box(np.array([1.5, 0.0, 0.5]), tilt.as_matrix(), np.array([0.6, 0.6, 0.1]))
    hulls = [Collider("slope_5", mesh) for mesh in (slope, box((1.5, 0.55, 0.2), (0.3, 0.2, 0.05)))]
    room = room_of(tmp_path)
    cube = replace(room.free["cube_9"], orientation=tuple(yaw.as_quat()))
    room = replace(room, static_colliders=(*room.static_colliders, *hulls), free={"cube_9": cube})
    middle = np.array([1.5, 0.0, 0.55, 0.0, 0.0, 0.0, 1.0])
    poses = np.array(list(free_placements(room, "cube_9", "slope_5", middle)))
    is_level = poses[:, 2] < 0.3
    count = int(is_level.sum())
    assert 0 < count < len(poses) and is_level[-count:].all()
    np.testing.assert_array_equal(
        list(free_placements(room, "cube_9", "slope_5", middle, leaning=False)), poses[-count:]
    )
    np.testing.assert_allclose(poses[-count:, 3:], np.tile(yaw.as_quat(), (count, 1)))
    leaning = Rotation.from_quat(poses[:-count, 3:])
    assert ((tilt * yaw).inv() * leaning).magnitude().max() < np.radians(0.1)
    above = (poses[:-count, :3] - [1.5, 0.0, 0.5]) @ tilt.as_matrix()[:, 2]
    assert above == pytest.approx(np.full(len(above), 0.05 + 0.025 + 0.001), abs=1e-3)


def test_what_is_low_keeps_clear_of_what_stands_beside_it_too(tmp_path: Path) -> None:
    room = room_of(tmp_path, side=0.03, beside=blocks())
    with pytest.raises(InputError, match="no level spot that is free"):
        next(free_placements(room, "cube_9", "cabinet_1", np.array([0.0, -1.0, 0.8, 0, 0, 0, 1.0])))


def test_spots_that_are_too_far_are_told_from_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=f"free for 'cube_9', but none within {FAR:.2f} m"):
        next(free_placements(room_of(tmp_path), "cube_9", "cabinet_1", np.array([0.0, -1.8, 0.8, 0, 0, 0, 1.0])))


def test_a_record_of_another_object_is_refused(tmp_path: Path) -> None:
    room, record = room_of(tmp_path), tmp_path / "insert.json"
    record.write_text(json.dumps({"objects": [{"id": "mug_3"}]}))
    with pytest.raises(InputError, match="did not insert 'cube_9'; it inserted: mug_3"):
        next(place_poses(room, "cube_9", str(record), START))


def test_a_pose_may_be_turned(tmp_path: Path) -> None:
    (pose,) = place_poses(room_of(tmp_path), "cube_9", "0.1 0.2 0.9 90", START)
    np.testing.assert_allclose(matrix(pose)[:3, 0], [0.0, 1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(pose[:3], [0.1, 0.2, 0.9])
