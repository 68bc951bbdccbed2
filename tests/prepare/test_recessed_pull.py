"""Recessed pulls: a pocket is found, kept free, and held from within."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch
from box_room import bar
from cabinet import write_cabinet
from part_worlds import contacts, grasped, make_env
from pxr import Gf, Sdf, Usd, UsdGeom
from recessed_drawer import HEIGHT, recessed_drawer
from scipy.spatial.transform import Rotation
from settings import load

from s2a import robot
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.learn.evaluate import evaluate
from s2a.motion.open import demonstration, opening_path
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.prepare.grasp import find_grasp, grasp_frame
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.geometry.convex import contains
from s2a.scene.geometry.front_panel import find_pocket, pocket_hulls
from s2a.scene.usd import sim_stage
from s2a.sim.world import read_stage

FRONT = (np.array([1.0, 0.0, 0.0]), 0.0)
GRIPPER = robot.load("panda").gripper


def pocket(**sides: float):
    region = recessed_drawer(**sides).parts["handle_4"].mesh
    return find_pocket(region, grasp_frame(region, np.array([-1.0, 0.0, 0.0])), FRONT)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("recess") / "room.usd"
    sim_stage.write(prepare(recessed_drawer(), ("drawer_3",), load(PrepareConfig, "prepare/handle")), path)
    return path


def test_a_pocket_is_as_large_as_it_was_made() -> None:
    found = pocket()
    assert found is not None
    assert found.size == pytest.approx((0.13, 0.05), abs=1e-3) and found.depth == pytest.approx(0.01, abs=1e-6)
    assert found.center == pytest.approx((0.0, 0.0, HEIGHT), abs=1e-3)
    assert found.frame[:, 2] == pytest.approx((-1.0, 0.0, 0.0), abs=1e-6)


def test_what_stands_before_a_front_or_hardly_behind_it_is_no_pocket() -> None:
    before = bar((-0.1, 0.1), (0.59, 0.61), (0.0, 0.03))
    assert find_pocket(before, grasp_frame(before, np.array([-1.0, 0.0, 0.0])), FRONT) is None
    assert pocket(depth=0.005) is None


def test_its_walls_are_solid_and_its_inside_is_free() -> None:
    found = pocket()
    assert found is not None
    inside = np.random.default_rng(0).uniform(
        (-0.0099, -0.0635, HEIGHT - 0.0235), (0.02, 0.0635, HEIGHT + 0.0235), (500, 3)
    )
    hulls = pocket_hulls(found)
    assert not any(contains(piece, inside).any() for piece in hulls)
    beside = np.array(
        [(-0.005, 0.0, HEIGHT + 0.027), (-0.005, 0.0, HEIGHT - 0.027), (-0.005, 0.067, HEIGHT), (-0.012, 0, HEIGHT)]
    )
    assert np.any([contains(piece, beside) for piece in hulls], axis=0).all()


@pytest.mark.parametrize(
    ("length", "width", "spreads"),
    [(0.13, 0.05, (0, 0, 1)), (0.09, 0.03, (0, 1, 0)), (0.15, 0.03, None), (0.034, 0.03, None), (0.2, 0.13, None)],
)
def test_fingers_spread_along_the_shorter_side_that_they_fit_into(length: float, width: float, spreads) -> None:
    """Closed they are 30 mm thick and 18 mm wide; open they reach 110 mm."""
    grasp = find_grasp(recessed_drawer(length, width), "drawer_3")
    assert grasp.internal == (spreads is not None)
    if spreads is not None:
        turn = Rotation.from_quat(grasp.orientation).as_matrix()
        assert np.abs(turn[:, 1]) == pytest.approx(spreads, abs=1e-3)
        assert grasp.size[1] == pytest.approx(width if spreads[2] else length, abs=2e-3)
        tips = np.array(grasp.point) + GRIPPER.tip_ahead * turn[:, 2]
        assert tips[0] == pytest.approx(-0.01 + 0.0015, abs=1e-5)


def test_a_prepared_room_keeps_the_pocket_and_the_grasp(room: Path) -> None:
    read = sim_stage.read(room)
    assert read.articulations["drawer_3"].grasp.internal and read_stage(room).internal
    colliders = [each.mesh for body in read.bodies.values() for each in body.colliders]
    inside = np.random.default_rng(0).uniform(
        (-0.0099, -0.063, HEIGHT - 0.023), (0.02, 0.063, HEIGHT + 0.023), (500, 3)
    )
    assert colliders and not any(contains(piece, inside).any() for piece in colliders)


@pytest.mark.slow
def test_the_planner_opens_it_by_a_grasp(room: Path) -> None:
    env = make_env(read_stage(room), episode_steps=1200, sim="sim/planner")
    result = evaluate(env, Planner(env, load(PlannerConfig, "planner/default")))
    assert result["grasp_success"]["rate"] == 1.0 and result["opening"]["min"] > 0.25


@pytest.mark.slow
def test_an_episode_may_start_in_the_grip(room: Path) -> None:
    """Closed on the way, then 2 mm off the walls of a pocket of 50 mm: half of it less a finger of 15.2 mm."""
    env = make_env(read_stage(room), sim="sim/planner")
    motion = demonstration(env.sim, load(PlannerConfig, "planner/default"), partial(opening_path, config=None))
    fingers = motion.positions[:, 7:9]
    assert (fingers[: motion.grasped] == 0.0).all()
    assert fingers[motion.grasped :] == pytest.approx(0.025 - 0.0152 - 0.002, abs=1e-3)
    assert (motion.targets[motion.grasped :, 7:9] == GRIPPER.finger_joint_open).all()


@pytest.mark.slow
def test_gripping_and_its_observation_mean_the_same_from_within(room: Path) -> None:
    """An action of -1 grips: outside it closes the fingers, within it opens them, and both look alike to a policy."""
    stage = read_stage(room)
    seen = {}
    for internal in (False, True):
        env = make_env(replace(stage, internal=internal), start_noise=0.0, describe_part=True)
        wide = env.sim.joint_q[:, 7:9].clone()
        action = torch.zeros(env.num_envs, 9)
        action[:, 7:] = -1.0
        for _ in range(5):
            env.step(action)
        moved = env.sim.joint_q[:, 7:9] - wide
        assert ((moved > 1e-3) if internal else (moved < -1e-3)).all()
        seen[internal] = env.observation.clone()
    fingers = [7, 8, 16, 17, 30, 31, 39, 40]
    assert torch.allclose(seen[False][:, fingers], seen[True][:, fingers], atol=0.02)


@pytest.mark.slow
def test_validation_passes_and_finds_a_grasp_beside_the_pocket(room: Path, tmp_path: Path) -> None:
    settings = load(CertifyConfig, "certify/default")
    (right,) = certify(room, settings)
    checks = {check.name: check for check in right.checks}
    about = [name for name in checks if name.startswith(("grasp", "finger", "region", "cover", "collider", "handle"))]
    assert len(about) > 8 and {checks[name].status for name in about} == {"pass"}
    stage = Usd.Stage.Open(str(room))
    site = UsdGeom.Xformable(stage.GetPrimAtPath("/scene/drawer_3/grasp"))
    place = site.GetPrim().GetAttribute("xformOp:translate")
    place.Set(place.Get() + Gf.Vec3d(0.0, 0.0, 0.02))
    moved = tmp_path / "moved.usd"
    stage.Export(str(moved))
    (wrong,) = certify(moved, settings)
    assert {check.name: check for check in wrong.checks}["grasp_site"].status == "fail"


def test_one_finger_in_a_long_pocket_or_a_fist_is_no_grasp(room: Path) -> None:
    """Wider than the gripper opens between the pads, a pocket is still held by two fingers or not at all."""
    stage = replace(read_stage(room), internal=True, grasp_size=np.array([0.03, 0.105, 0.01]))
    env = make_env(stage, 3)
    found = contacts(env)
    found["on_region"][:] = torch.tensor([[5.0, 0.0], [5.0, 5.0], [5.0, 5.0]])
    up, down = [0.0, 0.0, 1.0], [0.0, 0.0, -1.0]
    found["normal"][:] = torch.tensor([[up, down], [up, up], [up, down]])
    assert grasped(env) == [0, 0, 1]


@pytest.mark.slow
def test_validation_finds_a_bar_that_is_said_to_be_a_pocket(tmp_path: Path) -> None:
    stage = Usd.Stage.Open(str(write_cabinet(tmp_path / "room.usda")))
    site = stage.GetPrimAtPath("/scene/drawer_2/grasp")
    site.CreateAttribute("s2a:internal", Sdf.ValueTypeNames.Bool, custom=True).Set(True)
    stage.Save()
    (wrong,) = certify(tmp_path / "room.usda", load(CertifyConfig, "certify/default"))
    assert {check.name: check for check in wrong.checks}["grasp_internal"].status == "fail"
