"""The search for a base: reach, clearance, and a reason for each base."""

from __future__ import annotations

import itertools
import re
from pathlib import Path

import numpy as np
import pytest
from cabinet import box
from cube_room import GOAL, START, room_of, with_hulls

from s2a import robot
from s2a.motion.grasps import object_grasps
from s2a.motion.gripper import gripper_boxes
from s2a.motion.obstacles import Obstacles
from s2a.motion.search import Follow, Misses, Search, Stand, around, reached
from s2a.motion.workcell import Workcell
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import follow, matrix
from s2a.scene.geometry import convex
from s2a.scene.scene import Mesh

PANDA = robot.load("panda")
FEW = 20, 40
"""Points at which grasps are looked for, where any will do."""


@pytest.mark.parametrize("far", ["place", "grasp"])
def test_the_nearest_miss_is_of_one_base_and_grasp_at_both_ends(far: str, tmp_path: Path) -> None:
    """One end is 1.2 m from every base, the other 0.5 m: the miss is that of the far one, whichever comes first."""
    room = room_of(tmp_path)
    cell, base = Workcell(PANDA, Obstacles.of_room(room, {"cube_9"}, START[:3])), np.eye(4)
    base[:3, 3] = [0.7, 0.1, 0.4]
    ends = {name: matrix(START) for name in ("grasp", "place")}
    ends[far] = matrix(START - [0.7, 0, 0, 0, 0, 0, 0])
    base[:3, :3] = np.diag([-1.0, -1.0, 1.0])
    grasps = object_grasps([c.mesh for c in room.free["cube_9"].colliders], np.zeros(3), PANDA.gripper).tool
    down = grasps[grasps[:, 2, 2] < -0.99][:8]
    misses = Misses()
    assert not list(reached(cell, ends, [Stand(base, 0.4)], down, 0, misses))
    found = re.match(rf"{far}: the arm's nearest miss is (\d+) mm and (\d+) degrees", misses.nearest.text)
    assert found, misses.nearest.text
    assert 200 < int(found[1]) < 700


def test_the_arm_s_gripper_is_that_of_the_grasps(tmp_path: Path) -> None:
    """Beside a wall 4 mm from the gripper's box nothing is reached into; 10 mm nearer, 6 mm. Links stand out of it by 20 mm."""
    shape, at = robot_shape(PANDA), np.array([PANDA.home])
    base = np.eye(4)
    base[:3, 3] = [3.0, 3.0, 0.0]  # away from the cabinet
    tool = base @ shape.kin.tool(at)[0]
    _, _, (low, high) = gripper_boxes(PANDA.gripper)
    for gap in (0.004, -0.006):
        wall = box((high[0] + gap + 0.02, 0.0, high[2] - 0.02), (0.02, 0.03, 0.01))
        wall = Mesh(wall.vertices @ tool[:3, :3].T + tool[:3, 3], wall.faces)
        near = with_hulls(Obstacles.of_room(room_of(tmp_path), {"cube_9"}, tool[:3, 3]), wall)
        depth = Workcell(PANDA, near).arm_depth(at, base, fingers=False)[0]
        assert depth == pytest.approx(max(0.0, -gap), abs=1e-3)


def test_many_paths_of_their_own_are_followed_as_one_by_one(tmp_path: Path) -> None:
    kin = kinematics(PANDA)
    first = kin.tool(np.array([PANDA.home]))[0]
    up = np.stack([first + np.array([[0, 0, 0, 0]] * 2 + [[0, 0, 0, z], [0] * 4]) for z in (0.0, 0.02, 0.04)])
    turned = up.copy()
    turned[:, 1, 3] += 0.1
    bases = np.stack([np.eye(4)] * 2)
    together = follow(kin, np.stack([up, turned]), bases, 4, 0)
    for poses, found in zip((up, turned), together, strict=True):
        (alone,) = follow(kin, poses, bases[:1], 4, 0)
        assert len(found)
        np.testing.assert_allclose(found, alone, atol=1e-4)


def shelf_view(tmp_path: Path, *extra: Mesh) -> list[tuple[Stand, int, bool]]:
    """Return the bases and grasps that reach the cube at both ends, with a further hull in the room."""
    room = room_of(tmp_path)
    bare = Obstacles.of_room(room, {"cube_9"}, START[:3])
    near = with_hulls(bare, *extra)
    grasps = object_grasps([c.mesh for c in room.free["cube_9"].colliders], np.zeros(3), PANDA.gripper).tool
    down = grasps[grasps[:, 2, 2] < -0.99]
    down = down[:: max(1, len(down) // 8)]
    some = list(itertools.islice(around(Workcell(PANDA, bare), matrix(START), matrix(GOAL)), 48))
    ends = {"grasp": matrix(START), "place": matrix(GOAL)}
    return list(reached(Workcell(PANDA, near), ends, some, down, 0, Misses()))


def test_bases_and_grasps_are_tried_in_turn(tmp_path: Path) -> None:
    """Neither one base nor one grasp takes all of the first ten pairs."""
    found = shelf_view(tmp_path)
    pairs = [(stand.base[:3, 3].tobytes(), k) for stand, k, _ in found]
    once = {base: sorted(k for b, k in pairs if b == base) for base, _ in pairs}
    nth = [once[base].index(k) for base, k in pairs]
    assert len(set(pairs)) == len(pairs)
    bases_of_first, grasps_of_first = ({pair[i] for pair in pairs[:10]} for i in (0, 1))
    assert len(bases_of_first) >= 3
    assert len(grasps_of_first) >= 3
    assert nth[0] == 0
    assert any(clear for *_, clear in found)


def test_an_arm_within_the_room_is_said(tmp_path: Path) -> None:
    around = box((0.2, -0.05, 1.2), (0.6, 0.6, 0.25))  # what comes from above passes it
    found = shelf_view(tmp_path, around)
    assert found
    assert not any(clear for *_, clear in found)


def test_no_base_has_anything_where_its_shoulder_turns(tmp_path: Path) -> None:
    """The motor at the side of the first link reaches 0.149 m out, 0.332 m up; the column above the base has 0.12 m."""
    bare, ends = Obstacles.of_room(room_of(tmp_path), {"cube_9"}, START[:3]), (matrix(START), matrix(GOAL))
    base = next(around(Workcell(PANDA, bare), *ends, (0.0,))).base
    towards = base[:3, :3] @ [0.0, 1.0, 0.0]
    post = convex.box(base[:3, 3] + 0.155 * towards + [0.0, 0.0, 0.332], base[:3, :3], np.array([0.02, 0.03, 0.02]))
    near = with_hulls(bare, post)
    found = around(Workcell(PANDA, near), *ends, (0.0,))
    assert not any(np.allclose(stand.base, base) for stand in found)
    column = base[:3, 3] + np.linspace(0.17, 0.33, 5)[:, None] * [0.0, 0.0, 1.0]
    assert near.depth(column[None], np.full(5, PANDA.base.radius))[0] == 0.0


def test_the_branch_on_which_the_arm_comes_is_among_those_it_can_go_on_with() -> None:
    kin = kinematics(robot.load("panda"))
    joints = kin.lower + 0.3 * (kin.upper - kin.lower)
    poses = np.tile(kin.tool(joints[None])[0], (3, 1, 1))
    poses[:, 2, 3] += [0.0, 0.01, 0.02]
    (paths,) = follow(kin, poses, np.eye(4)[None], 1, near=joints[None])
    assert np.abs(paths[:, 0] - joints).max(axis=1).min() < 1e-3


def test_a_base_from_which_nothing_is_followed_has_its_own_reason() -> None:
    """Of three bases the first meets something, the second is too far away, and from the third the arm follows the path."""
    kin = kinematics(PANDA)
    poses = np.tile(kin.tool(np.array([PANDA.home]))[0], (3, 1, 1))
    poses[:, 2, 3] += [0.0, 0.01, 0.02]
    away = np.eye(4)
    away[0, 3] = 3.0
    near, far, good = (
        Stand(base, words=name) for base, name in ((np.eye(4), "near"), (away, "far"), (np.eye(4), "good"))
    )

    def meets(stand: Stand, path: np.ndarray) -> tuple[float, str]:
        return (0.03, "a wall") if stand is near else (0.0, "")

    search = Search(PANDA, kin)
    handle = Follow("handle", 1, poses, meets, 2, clear=1)
    assert [k for k, _ in search.followed([near, far, good], handle)] == [2]
    reasons = {stand.words: miss for stand, miss in search.misses.of.items()}
    assert set(reasons) == {"near", "far"}
    assert "handle: the arm reaches 30 mm into a wall" in str(reasons["near"])
    assert "handle: the arm cannot reach" in str(reasons["far"])
    assert str(search.unreachable("the drawer")) == "the drawer: handle: the arm reaches 30 mm into a wall (base near)"


def test_a_base_that_is_turned_has_the_paths_of_the_one_that_is_not() -> None:
    kin = kinematics(PANDA)
    poses = np.tile(kin.tool(np.array([PANDA.home]))[0], (2, 1, 1))
    poses[:, 2, 3] += [0.0, 0.01]
    turn, base = 0.4, np.eye(4)
    base[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    stands = [Stand(np.eye(4)), Stand(base, turn=turn, facing=np.eye(4))]
    for stand, paths in zip(
        stands, Search(PANDA, kin).paths(stands, Follow("", 0, poses, lambda *_: (0.0, ""), 2)), strict=True
    ):
        assert len(paths)
        for path in paths:
            turned = np.linalg.inv(poses) @ stand.base @ kin.tool(path)
            assert np.linalg.norm(turned[:, :3, 3], axis=1).max() < 1e-3
