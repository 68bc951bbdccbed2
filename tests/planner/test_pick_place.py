"""A plan to pick and place: its ends, its clearance, and what is said where there is none."""

from __future__ import annotations

import gc
import itertools
import json
import math
import re
import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import box, free_cube, write_cabinet

from s2a import robot
from s2a.core.errors import InputError
from s2a.planner import grasp_cache, graspable, pick_place
from s2a.planner.contact import FIRM, SLOPING, Contact
from s2a.planner.free_motion import free_motion
from s2a.planner.grasp_cache import GraspCache
from s2a.planner.graspable import Ungraspable
from s2a.planner.gripper_depth import gripper_depth
from s2a.planner.gripper_shape import gripper_boxes
from s2a.planner.misses import Misses, Unreachable
from s2a.planner.object_grasps import matrix, object_grasps
from s2a.planner.obstacles import RoomHulls, surface_points
from s2a.planner.pick_base import arm_depth, bases, reached
from s2a.planner.pick_place import WIDE, plan_pick
from s2a.planner.pick_plan import PickPlan, StraightPaths
from s2a.planner.places import (
    APART,
    CANDIDATES,
    FAR,
    MARGINS,
    NEAR,
    OF_ONE,
    first_planned,
    free_placements,
    place_poses,
)
from s2a.robot.collision import robot_shape
from s2a.robot.kinematics import kinematics
from s2a.robot.tool_path import follow
from s2a.scene.geometry import convex
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom
from s2a.tasks import skills_pick_place as skill

PANDA = robot.load("panda")
FEW = 20, 40
"""Points at which grasps are looked for, where any will do."""
START, GOAL = np.array([0.2, 0.1, 0.828, 0, 0, 0, 1.0]), np.array([0.2, -0.2, 0.828, 0, 0, 0, 1.0])


def room_of(tmp_path: Path, side: float = 0.05, **more) -> SimRoom:  # noqa: ANN003
    """Return a cabinet of 0.802 m with a cube on it."""
    cube = free_cube("cube_9", tuple(START[:3]), side, 0.2)
    return sim_stage.read(write_cabinet(tmp_path / "sim.usda", free=[cube], **more), visuals=False)


@pytest.fixture(scope="module")
def plan(tmp_path_factory: pytest.TempPathFactory) -> PickPlan:
    """Of the cube, 0.3 m to the side."""
    return plan_pick(room_of(tmp_path_factory.mktemp("plan")), "cube_9", START, GOAL, PANDA)


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


def test_what_is_within_a_hull_is_in_it(tmp_path: Path) -> None:
    block = box((3.0, 0.0, 1.0), (0.2, 0.2, 0.2))
    hulls = RoomHulls(room_of(tmp_path), {"cube_9"}, np.array([3.0, 0.0, 1.0]), block)
    points = np.array([[[3.0, 0.0, 1.0]], [[3.15, 0.0, 1.0]], [[3.203, 0.0, 1.0]], [[3.21, 0.21, 1.0]]])
    in_plane = np.array([[[x, 0.2, 1.2]] for x in np.linspace(3.2 + 1e-4, 3.4, 500)])  # nearest to an edge
    assert hulls.depth(in_plane, np.array([0.005])).max() <= 0.005
    # 0.2 m to the surface from its middle, 0.05 from near it; 3 mm and 14 mm (past an edge) before it.
    assert hulls.depth(points, np.array([0.005])) == pytest.approx([0.205, 0.055, 0.002, 0.0], abs=1e-5)


def test_what_is_too_wide_is_said_with_its_size(tmp_path: Path) -> None:
    with pytest.raises(Unreachable, match=r"grasp: no two opposite faces .* open 80 mm; .* is 100 mm; choose"):
        plan_pick(room_of(tmp_path, side=0.1), "cube_9", START, GOAL, PANDA)


def test_a_place_out_of_reach_is_said(tmp_path: Path) -> None:
    far = np.array([0.2, -4.0, 0.828, 0, 0, 0, 1.0])
    with pytest.raises(Unreachable, match="base: .*; choose a place"):
        plan_pick(room_of(tmp_path), "cube_9", START, far, PANDA)


@pytest.mark.parametrize("far", ["place", "grasp"])
def test_the_nearest_miss_is_of_one_base_and_grasp_at_both_ends(far: str, tmp_path: Path) -> None:
    """One end is 1.2 m from every base, the other 0.5 m: the miss is that of the far one, whichever comes first."""
    room, shape = room_of(tmp_path), robot_shape(PANDA)
    base = np.eye(4)
    base[:3, 3] = [0.7, 0.1, 0.4]
    ends = {name: matrix(START) for name in ("grasp", "place")}
    ends[far] = matrix(START - [0.7, 0, 0, 0, 0, 0, 0])
    base[:3, :3] = np.diag([-1.0, -1.0, 1.0])
    grasps = object_grasps([c.mesh for c in room.free["cube_9"].colliders], np.zeros(3), PANDA.gripper).tool
    down = grasps[grasps[:, 2, 2] < -0.99][:8]
    misses = Misses()
    assert not list(reached(shape, RoomHulls(room, {"cube_9"}, START[:3]), ends, [(base, 0.4)], down, 0, misses))
    found = re.match(rf"{far}: the arm's nearest miss is (\d+) mm and (\d+) degrees", misses.text)
    assert found, misses.text
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
        near = RoomHulls(room_of(tmp_path), {"cube_9"}, tool[:3, 3], wall)
        depth = arm_depth(shape, near, at, base, fingers=False)[0]
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


def narrow(gap: float) -> list[Mesh]:
    """Return two walls, as high as the gripper, `gap` [m] from the cube's faces at its goal."""
    return [box((0.2, -0.2 + side * (0.025 + gap + 0.01), 0.867), (0.2, 0.01, 0.064)) for side in (-1, 1)]


def test_a_narrow_place_takes_grasps_that_fit_into_it(tmp_path: Path) -> None:
    """Between walls 0.1 m apart the gripper body, 63 by 205 mm, fits only along them."""
    found = plan_pick(room_of(tmp_path, beside=narrow(0.025)), "cube_9", START, GOAL, PANDA)
    closing = (matrix(GOAL) @ found.grasp)[:3, 1]
    assert abs(closing[0]) > 0.9


def test_a_place_in_something_is_said_with_the_nearest_miss(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of every grasp the worst of all places on its way at both ends, and of these the least."""
    monkeypatch.setattr(pick_place, "SAMPLES", FEW)
    walls = [box((0.2, -0.2 + y, 0.9), (0.06, 0.01, 0.098)) for y in (-0.045, 0.045)]
    walls += [box((0.2 + x, -0.2, 0.9), (0.01, 0.06, 0.098)) for x in (-0.045, 0.045)]
    room, gripper = room_of(tmp_path, beside=walls), PANDA.gripper
    with pytest.raises(Unreachable, match=r"with 2 mm around it the gripper reaches at least [\d.]+ mm into") as error:
        plan_pick(room, "cube_9", START, GOAL, PANDA)
    near, known = RoomHulls(room, {"cube_9"}, (START[:3] + GOAL[:3]) / 2), GraspCache(room.free["cube_9"], gripper)
    least = []
    for samples in FEW:
        found = known(samples, FIRM, np.array([0.0, 0.0, 1.0]))
        ends = [gripper_depth(near, gripper, matrix(at) @ found.tool, found.opened, math.inf) for at in (START, GOAL)]
        least.append(np.maximum(*ends).min())
    said = float(re.search(r"at least ([\d.]+) mm", str(error.value))[1])
    assert said == pytest.approx(1000 * min(least), abs=0.06) and said > 1.0


def test_what_is_deeper_than_a_limit_somewhere_is_known_to_be_so(tmp_path: Path) -> None:
    room, gripper = room_of(tmp_path, beside=narrow(0.025)), PANDA.gripper
    near = RoomHulls(room, {"cube_9"}, GOAL[:3])
    found = GraspCache(room.free["cube_9"], gripper)(FEW[1], FIRM, np.array([0.0, 0.0, 1.0]))
    whole, first, some = (
        gripper_depth(near, gripper, matrix(GOAL) @ found.tool, found.opened, limit) for limit in (math.inf, 0.0, 0.01)
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
    monkeypatch.setattr(grasp_cache, "object_grasps", lambda *args: alone[:1])
    assert known(50, FIRM, up + 1e-9) is first
    assert all(len(known(*other).tool) == 1 for other in ((51, FIRM, up), (50, SLOPING, up), (50, FIRM, -up)))


@pytest.mark.parametrize("last", [FIRM, SLOPING, None])
def test_sloping_faces_are_held_where_no_start_has_a_firm_plan(
    last: Contact | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of two starts the second has a plan, with a firm grasp, with a sloping one, or with none."""
    tried: list[tuple[float, Contact]] = []

    def plan(room, target, start, goal, spec, contacts, known):  # noqa: ANN001, ANN202
        tried.append((start[0], *contacts))
        if start[0] != 2.0 or contacts != (last,):
            raise Unreachable(f"no plan from {start[0]}")
        return "a plan"

    ends = [(np.full(7, start), GOAL) for start in (1.0, 2.0)]
    monkeypatch.setattr(graspable, "SAMPLES", FEW)
    monkeypatch.setattr(skill, "plan_pick", plan)
    monkeypatch.setattr(skill, "_ends", lambda *args: iter(ends))
    room = room_of(tmp_path)
    if last is None:
        with pytest.raises(Unreachable, match="no plan from 1.0"):
            skill._planned(room, "cube_9", PANDA, None)
    else:
        found = skill._planned(room, "cube_9", PANDA, None)
        assert found[0] is ends[1] and found[1] == "a plan"
    firm, sloping = [(1.0, FIRM), (2.0, FIRM)], [(1.0, SLOPING), (2.0, SLOPING)]
    assert tried == (firm if last is FIRM else firm + sloping)


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
    monkeypatch.setattr(graspable, "SAMPLES", FEW)

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
    monkeypatch.setattr(graspable, "SAMPLES", FEW)

    def ends() -> Iterator[int]:
        yield from spots
        raise InputError("no level spot is free")

    def plan(spot: int) -> str:
        raise Unreachable(f"not from {spot}")

    with pytest.raises(Ungraspable, match="open 80 mm; .* is 100 mm; choose"):
        first_planned(room_of(tmp_path, side=0.1), "cube_9", PANDA, ends(), plan)
    with pytest.raises(InputError, match="no level spot"):
        first_planned(room_of(tmp_path), "cube_9", PANDA, ends(), plan)


def blocks() -> list[Mesh]:
    """Return blocks of 3 cm that stand 7.5 cm apart all over the cabinet: no object is put between two of them."""
    places = [(x, y) for x in np.arange(-0.27, 0.28, 0.075) for y in np.arange(-0.36, 0.37, 0.075)]
    return [box((x, y, 0.817), (0.01, 0.01, 0.015)) for x, y in places]


def test_nearby_spots_are_on_what_carries_the_object_first_and_else_on_what_is_near(tmp_path: Path) -> None:
    poses = np.array(list(place_poses(room_of(tmp_path), "cube_9", NEAR, START)))
    assert len(poses) == CANDIDATES
    assert poses[:OF_ONE, 2] == pytest.approx(0.802 + 0.025 + 0.001, abs=1e-3)
    assert poses[OF_ONE:, 2] == pytest.approx(0.025 + 0.001, abs=1e-3)  # the floor
    assert (np.linalg.norm(poses[:, :2] - START[:2], axis=1) <= FAR).all()
    full = np.array(list(place_poses(room_of(tmp_path, beside=blocks()), "cube_9", NEAR, START)))
    assert full[:, 2] == pytest.approx(0.025 + 0.001, abs=1e-3)


def test_what_is_low_keeps_clear_of_what_stands_beside_it_too(tmp_path: Path) -> None:
    room = room_of(tmp_path, side=0.03, beside=blocks())
    with pytest.raises(InputError, match="no level spot that is free"):
        next(free_placements(room, "cube_9", "cabinet_1", np.array([0.0, -1.0, 0.8, 0, 0, 0, 1.0])))


def test_a_record_of_another_object_is_refused(tmp_path: Path) -> None:
    room, record = room_of(tmp_path), tmp_path / "insert.json"
    record.write_text(json.dumps({"objects": [{"id": "mug_3"}]}))
    with pytest.raises(InputError, match="did not insert 'cube_9'; it inserted: mug_3"):
        next(place_poses(room, "cube_9", str(record), START))


def test_a_pose_may_be_turned(tmp_path: Path) -> None:
    (pose,) = place_poses(room_of(tmp_path), "cube_9", "0.1 0.2 0.9 90", START)
    np.testing.assert_allclose(matrix(pose)[:3, 0], [0.0, 1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(pose[:3], [0.1, 0.2, 0.9])


def test_a_motion_goes_around_what_is_in_its_way() -> None:
    def free(q: np.ndarray) -> np.ndarray:
        return ~((np.abs(q[:, 0]) < 0.3) & (q[:, 1] < 0.5))

    start, goal = np.array([-1.0, -1.0]), np.array([1.0, -1.0])
    path = free_motion(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, 0)
    assert path is not None
    assert free(path).all()
    np.testing.assert_allclose(path[[0, -1]], [start, goal])
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.1
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert steps.sum() < 6.0  # straight over the corners: 4.3


def test_a_motion_is_the_same_whatever_was_searched_before() -> None:
    def free(q: np.ndarray) -> np.ndarray:
        return ~((np.abs(q[:, 0]) < 0.3) & (q[:, 1] < 0.5))

    start, goal = np.array([-1.0, -1.0]), np.array([1.0, -1.0])
    first, other, again = (
        free_motion(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, seed) for seed in (0, 1, 0)
    )
    assert first is not None and other is not None and again is not None
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or not np.allclose(first, other)


def test_a_search_holds_nothing_when_it_is_done() -> None:
    """A room's hulls are read for each; held until the garbage is collected, twenty searches took 240 MB."""

    def free(q: np.ndarray) -> np.ndarray:
        return ~((np.abs(q[:, 0]) < 0.3) & (q[:, 1] < 0.5))

    gc.collect()
    gc.disable()
    held = weakref.ref(free)
    free_motion(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), np.full(2, -2.0), np.full(2, 2.0), free, 0)
    del free
    gone = held() is None
    gc.enable()
    assert gone


def test_no_motion_through_a_wall() -> None:
    def free(q: np.ndarray) -> np.ndarray:
        return np.abs(q[:, 0]) > 0.3

    start, goal = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    assert free_motion(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, 0) is None


def shelf_view(tmp_path: Path, *extra: Mesh) -> list[tuple[np.ndarray, float, int, bool]]:
    """Return the bases and grasps that reach the cube at both ends, with a further hull in the room."""
    room, shape = room_of(tmp_path), robot_shape(PANDA)
    bare = RoomHulls(room, {"cube_9"}, START[:3])
    near = RoomHulls(room, {"cube_9"}, START[:3], *extra)
    grasps = object_grasps([c.mesh for c in room.free["cube_9"].colliders], np.zeros(3), PANDA.gripper).tool
    down = grasps[grasps[:, 2, 2] < -0.99]
    down = down[:: max(1, len(down) // 8)]
    some = list(itertools.islice(bases(shape, bare, matrix(START), matrix(GOAL)), 48))
    return list(reached(shape, near, {"grasp": matrix(START), "place": matrix(GOAL)}, some, down, 0, Misses()))


def test_bases_and_grasps_are_tried_in_turn(tmp_path: Path) -> None:
    """Neither one base nor one grasp takes all of the first ten pairs."""
    found = shelf_view(tmp_path)
    pairs = [(base[:3, 3].tobytes(), k) for base, _, k, _ in found]
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


def test_a_plan_passes_home_and_both_ends(plan: PickPlan) -> None:
    swept = plan.swept(PANDA, np.zeros((1, 3)))
    for end in (START, GOAL):
        assert np.linalg.norm(swept - end[:3], axis=1).min() < 0.005
    home = matrix(plan.base) @ kinematics(PANDA).tool(np.array([PANDA.home]))[0]
    assert np.linalg.norm(swept - home[:3, 3], axis=1).min() < 0.1


def test_the_corners_and_edges_of_what_is_held_are_tested_too() -> None:
    """A frame's corner met a headboard between the points that stood for the frame."""
    plate = convex.box(np.zeros(3), np.eye(3), np.array([0.19, 0.02, 0.22]))
    foot = convex.box(np.array([0.0, 0.05, -0.1]), np.eye(3), np.array([0.02, 0.12, 0.02]))
    points = surface_points([plate, foot])
    for hull in (plate, foot):
        corners = hull.vertices[~convex.contains(plate, hull.vertices, -1e-3)]
        a, b = (hull.vertices[hull.faces[:, k]].astype(float) for k in (0, 1))
        edges = np.concatenate([a + t * (b - a) for t in np.linspace(0.0, 1.0, 30)])
        edges = edges[~convex.contains(plate, edges, -1e-3)]
        assert np.linalg.norm(corners[:, None] - points, axis=2).min(axis=1).max() < 1e-6
        assert np.linalg.norm(edges[:, None] - points, axis=2).min(axis=1).max() < 0.02
    assert len(points) < 600


def held_points(room: SimRoom, found: PickPlan) -> np.ndarray:
    """Return points on the cube's surface as a plan carries it, shape [pose point 3]."""
    surface = surface_points([collider.mesh for collider in room.free["cube_9"].colliders])
    body = matrix(found.base) @ robot_shape(PANDA).kin.tool(found.carry) @ np.linalg.inv(found.grasp)
    return surface @ body[:, :3, :3].transpose(0, 2, 1) + body[:, None, :3, 3]


def test_no_base_has_anything_where_its_shoulder_turns(tmp_path: Path) -> None:
    """The motor at the side of the first link reaches 0.149 m out, 0.332 m up; the column above the base has 0.12 m."""
    room, shape, goal = room_of(tmp_path), robot_shape(PANDA), matrix(GOAL)
    base, _ = next(bases(shape, RoomHulls(room, {"cube_9"}, START[:3]), matrix(START), goal, (0.0,)))
    towards = base[:3, :3] @ [0.0, 1.0, 0.0]
    post = convex.box(base[:3, 3] + 0.155 * towards + [0.0, 0.0, 0.332], base[:3, :3], np.array([0.02, 0.03, 0.02]))
    near = RoomHulls(room, {"cube_9"}, START[:3], post)
    found = bases(shape, near, matrix(START), goal, (0.0,))
    assert not any(np.allclose(pose, base) for pose, _ in found)
    column = base[:3, 3] + np.linspace(0.17, 0.33, 5)[:, None] * [0.0, 0.0, 1.0]
    assert near.depth(column[None], np.full(5, PANDA.base.radius))[0] == 0.0


def test_what_is_held_is_carried_well_clear_of_what_its_nearest_way_grazes(plan: PickPlan, tmp_path: Path) -> None:
    """A bottle that had slipped by 3 mm met the front of a drawer that its path was to pass by 5 mm."""
    passed = held_points(room_of(tmp_path), plan)
    middle = (START + GOAL)[1] / 2
    top = passed[np.abs(passed[..., 1] - middle) < 0.03][:, 2].min() - 0.008
    fence = box((0.2, middle, (top + 0.802) / 2), (0.1, 0.005, (top - 0.802) / 2))
    room = room_of(tmp_path, beside=[fence])
    near = RoomHulls(room, {"cube_9"}, START[:3])
    assert near.depth(passed, np.full(passed.shape[1], 0.005)).max() == 0.0
    points = held_points(room, plan_pick(room, "cube_9", START, GOAL, PANDA))
    assert near.depth(points, np.full(points.shape[1], WIDE[0])).max() <= 1e-3


def test_a_plan_on_which_the_arm_turns_far_between_start_and_place_comes_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """A held bear was carried 2.5 m around the robot for a way of 25 cm, and lost: its place was reached on another branch."""
    search = object.__new__(pick_place._Search)
    still, eye = np.zeros((2, 7)), np.eye(4)

    def path(name: float, turn: float) -> StraightPaths:
        return eye, name, still, eye, 0.05, still + turn

    blocks = [[path(1.0, 3.0)], [path(2.0, 1.0)], [], [path(3.0, 3.0), path(4.0, 0.2)]]
    monkeypatch.setattr(search, "_paths", lambda some, _: iter(some), raising=False)
    monkeypatch.setattr(search, "_joined", lambda *of: of[1], raising=False)
    assert list(search._found(iter(blocks), None)) == [2.0, 1.0, 4.0, 3.0]  # type: ignore[arg-type, list-item]


def test_the_branch_on_which_the_arm_comes_is_among_those_it_can_go_on_with() -> None:
    kin = kinematics(robot.load("panda"))
    joints = kin.lower + 0.3 * (kin.upper - kin.lower)
    poses = np.tile(kin.tool(joints[None])[0], (3, 1, 1))
    poses[:, 2, 3] += [0.0, 0.01, 0.02]
    (paths,) = follow(kin, poses, np.eye(4)[None], 1, near=joints[None])
    assert np.abs(paths[:, 0] - joints).max(axis=1).min() < 1e-3
