"""A plan to pick and place: its ends, its clearance, and the reason where there is none."""

from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from cabinet import box
from cube_room import APPROACH, GOAL, START, room_of

from s2a import robot
from s2a.motion import grasps, pick_plan
from s2a.motion.grasps import GraspCache, object_grasps
from s2a.motion.gripper import FIRM, SLOPING, Contact, gripper_depth
from s2a.motion.obstacles import Obstacles, surface_points
from s2a.motion.pick import Ends, firmest
from s2a.motion.pick_plan import LIFT, WIDE, PickPlan, PickTask, StraightPaths, plan_pick, shorter_first
from s2a.motion.search import Stand, Unreachable
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import matrix
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom

PANDA = robot.load("panda")
FEW = 20, 40
"""Points at which grasps are looked for, where any will do."""


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> PickPlan:
    """Of the cube, 0.3 m to the side."""
    return plan_pick(PickTask(room_of(tmp_path_factory.mktemp("plan")), "cube_9", START, GOAL, APPROACH), PANDA)


def test_the_path_is_whole_and_begins_at_home(plan: PickPlan) -> None:
    segments = [plan.reach, plan.approach, plan.lift, plan.carry, plan.lower, plan.retreat]
    np.testing.assert_allclose(plan.reach[0], PANDA.home, atol=1e-9)
    for one, following in zip(segments[:-1], segments[1:], strict=True):
        np.testing.assert_allclose(one[-1], following[0], atol=1e-9)


def test_the_tool_is_at_the_same_grasp_at_both_ends(plan: PickPlan) -> None:
    tool = matrix(plan.base) @ kinematics(PANDA).tool(np.stack([plan.approach[-1], plan.lower[-1]]))
    np.testing.assert_allclose(tool[0], matrix(START) @ plan.grasp, atol=1e-3)
    np.testing.assert_allclose(tool[1][:3, 3], (matrix(GOAL) @ plan.grasp)[:3, 3], atol=2e-3)  # 1 mm above


def test_the_object_is_lifted_and_put_down_straight(plan: PickPlan) -> None:
    kin = kinematics(PANDA)
    for path in (plan.lift, plan.lower):
        points = (matrix(plan.base) @ kin.tool(path))[:, :3, 3]
        assert np.ptp(points[:, :2], axis=0).max() < 1e-3
        assert np.ptp(points[:, 2]) == pytest.approx(0.08, abs=1e-3)


def test_what_is_too_wide_is_said_with_its_size(tmp_path: Path) -> None:
    with pytest.raises(Unreachable, match=r"grasp: no two opposite faces .* open 80 mm; .* is 100 mm; choose"):
        plan_pick(PickTask(room_of(tmp_path, side=0.1), "cube_9", START, GOAL, APPROACH), PANDA)


def test_a_place_out_of_reach_is_said(tmp_path: Path) -> None:
    far = np.array([0.2, -4.0, 0.828, 0, 0, 0, 1.0])
    with pytest.raises(Unreachable, match="base: .*; choose a place"):
        plan_pick(PickTask(room_of(tmp_path), "cube_9", START, far, APPROACH), PANDA)


def narrow(gap: float) -> list[Mesh]:
    """Return two walls, as high as the gripper, `gap` [m] from the cube's faces at its goal."""
    return [box((0.2, -0.2 + side * (0.025 + gap + 0.01), 0.867), (0.2, 0.01, 0.064)) for side in (-1, 1)]


@pytest.mark.slow
def test_a_narrow_place_takes_grasps_that_fit_into_it(tmp_path: Path) -> None:
    """Between walls 0.1 m apart the gripper body, 63 by 205 mm, fits only along them."""
    found = plan_pick(PickTask(room_of(tmp_path, beside=narrow(0.025)), "cube_9", START, GOAL, APPROACH), PANDA)
    closing = (matrix(GOAL) @ found.grasp)[:3, 1]
    assert abs(closing[0]) > 0.9


@pytest.mark.slow
def test_a_place_in_something_is_said_with_the_nearest_miss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of every grasp the worst of all places on its way at both ends, and of these the least."""
    monkeypatch.setattr(pick_plan, "SAMPLES", FEW)
    walls = [box((0.2, -0.2 + y, 0.9), (0.06, 0.01, 0.098)) for y in (-0.045, 0.045)]
    walls += [box((0.2 + x, -0.2, 0.9), (0.01, 0.06, 0.098)) for x in (-0.045, 0.045)]
    room, gripper = room_of(tmp_path, beside=walls), PANDA.gripper
    with pytest.raises(Unreachable, match=r"at a clearance of 2 mm the gripper reaches about \d+ mm into") as error:
        plan_pick(PickTask(room, "cube_9", START, GOAL, APPROACH), PANDA)
    near, known = (
        Obstacles.of_room(room, {"cube_9"}, (START[:3] + GOAL[:3]) / 2),
        GraspCache(room.free["cube_9"], gripper),
    )
    least = []
    for samples in FEW:
        found = known(samples, FIRM, np.array([0.0, 0.0, 1.0]))
        ends = [
            gripper_depth(near, gripper, matrix(at) @ found.tool, found.opened, APPROACH, LIFT, math.inf)
            for at in (START, GOAL)
        ]
        least.append(np.maximum(*ends).min())
    said = float(re.search(r"reaches about (\d+) mm", str(error.value))[1])
    assert said == pytest.approx(1000 * min(least), abs=0.51) and said > 1.0


def test_a_search_that_ends_before_a_base_was_looked_at_blames_no_base(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pick_plan, "SAMPLES", FEW)
    monkeypatch.setattr(grasps, "WORK", 0)
    with pytest.raises(
        Unreachable, match=r"^'cube_9': the search ended after 0 million collision checks; give another"
    ):
        plan_pick(PickTask(room_of(tmp_path), "cube_9", START, GOAL, APPROACH), PANDA)


def test_what_is_deeper_than_a_limit_somewhere_is_known_to_be_so(tmp_path: Path) -> None:
    room, gripper = room_of(tmp_path, beside=narrow(0.025)), PANDA.gripper
    near = Obstacles.of_room(room, {"cube_9"}, GOAL[:3])
    found = GraspCache(room.free["cube_9"], gripper)(FEW[1], FIRM, np.array([0.0, 0.0, 1.0]))
    whole, first, some = (
        gripper_depth(near, gripper, matrix(GOAL) @ found.tool, found.opened, APPROACH, LIFT, limit)
        for limit in (math.inf, 0.0, 0.01)
    )
    assert (whole > 0.0).any() and (whole == 0.0).any()
    np.testing.assert_array_equal(whole > 0.0, first > 0.0)
    np.testing.assert_array_equal(whole[whole <= 0.01], some[whole <= 0.01])
    assert (some[whole > 0.01] > 0.01).all() and (whole >= first).all()


def test_grasps_of_an_object_are_found_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    body, up = room_of(tmp_path).free["cube_9"], np.array([0.0, 0.0, 1.0])
    known = GraspCache(body, PANDA.gripper)
    first = known(50, FIRM, up)
    alone = object_grasps([c.mesh for c in body.colliders], np.zeros(3), PANDA.gripper, 0, 50, FIRM, up)
    np.testing.assert_array_equal(first.tool, alone.tool)
    monkeypatch.setattr(grasps, "object_grasps", lambda *args: alone[:1])
    assert known(50, FIRM, up + 1e-9) is first
    assert all(len(known(*other).tool) == 1 for other in ((51, FIRM, up), (50, SLOPING, up), (50, FIRM, -up)))


@pytest.mark.parametrize("last", [FIRM, SLOPING, None])
def test_sloping_faces_are_held_where_no_start_has_a_firm_plan(
    last: Contact | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two starts the second has a plan, with a firm grasp, with a sloping one, or with none."""
    tried: list[tuple[float, Contact]] = []

    def plan(ends: Ends, contact: Contact) -> str:
        tried.append((ends[0][0], contact))
        if ends[0][0] != 2.0 or contact != last:
            raise Unreachable(f"no plan from {ends[0][0]}")
        return "a plan"

    ends = [(np.full(7, start), GOAL) for start in (1.0, 2.0)]
    monkeypatch.setattr(grasps, "SAMPLES", FEW)
    room = room_of(tmp_path)
    if last is None:
        with pytest.raises(Unreachable, match="no plan from 1.0"):
            firmest(room, "cube_9", PANDA, lambda: ends, plan)
    else:
        found = firmest(room, "cube_9", PANDA, lambda: ends, plan)
        assert found[0] is ends[1] and found[1] == "a plan"
    firm, sloping = [(1.0, FIRM), (2.0, FIRM)], [(1.0, SLOPING), (2.0, SLOPING)]
    assert tried == (firm if last is FIRM else firm + sloping)


def test_a_plan_passes_home_and_both_ends(plan: PickPlan) -> None:
    swept = plan.swept(PANDA, np.zeros((1, 3)))
    for end in (START, GOAL):
        assert np.linalg.norm(swept - end[:3], axis=1).min() < 0.005
    home = matrix(plan.base) @ kinematics(PANDA).tool(np.array([PANDA.home]))[0]
    assert np.linalg.norm(swept - home[:3, 3], axis=1).min() < 0.1


def held_points(room: SimRoom, found: PickPlan) -> np.ndarray:
    """Return points on the cube's surface as a plan carries it, shape [pose point 3]."""
    surface = surface_points([collider.mesh for collider in room.free["cube_9"].colliders])
    body = matrix(found.base) @ robot_shape(PANDA).kin.tool(found.carry) @ np.linalg.inv(found.grasp)
    return surface @ body[:, :3, :3].transpose(0, 2, 1) + body[:, None, :3, 3]


@pytest.mark.slow
def test_what_is_held_is_carried_well_clear_of_what_its_nearest_way_grazes(plan: PickPlan, tmp_path: Path) -> None:
    """A bottle that had slipped by 3 mm met the front of a drawer that its path was to pass by 5 mm."""
    passed = held_points(room_of(tmp_path), plan)
    middle = (START + GOAL)[1] / 2
    top = passed[np.abs(passed[..., 1] - middle) < 0.03][:, 2].min() - 0.008
    fence = box((0.2, middle, (top + 0.802) / 2), (0.1, 0.005, (top - 0.802) / 2))
    room = room_of(tmp_path, beside=[fence])
    near = Obstacles.of_room(room, {"cube_9"}, START[:3])
    assert near.depth(passed, np.full(passed.shape[1], 0.005)).max() == 0.0
    points = held_points(room, plan_pick(PickTask(room, "cube_9", START, GOAL, APPROACH), PANDA))
    assert near.depth(points, np.full(points.shape[1], WIDE[0])).max() <= 1e-3


def test_straight_paths_between_which_the_arm_turns_far_come_last() -> None:
    """A held bear was carried 2.5 m around the robot for a way of 25 cm, and lost: its place was reached on another branch."""
    still, eye = np.zeros((2, 7)), np.eye(4)

    def path(name: float, turn: float) -> StraightPaths:
        return StraightPaths(Stand(eye), still, eye, name, still + turn)

    blocks = [[path(1.0, 3.0)], [path(2.0, 1.0)], [], [path(3.0, 3.0), path(4.0, 0.2)]]
    assert [each.opened for each in shorter_first(map(iter, blocks))] == [2.0, 1.0, 4.0, 3.0]
