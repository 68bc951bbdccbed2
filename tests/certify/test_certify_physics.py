"""Certificates under physics: clean furniture passes, and what only a simulator notices is named."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, box, write_cabinet
from pxr import Gf, Sdf, Usd, UsdGeom, Vt
from scipy.spatial.transform import Rotation
from seeded_defects import JOINT, STATIC_DEFECTS, TARGET, attribute, edit, nan_point, reshape
from settings import load

from s2a import robot
from s2a.certify import contents, grasp, physics
from s2a.certify.check_suite import CertifyConfig, certify
from s2a.certify.physics import MujocoWorld
from s2a.scene.scene import Mesh
from s2a.scene.usd.joints import frame
from s2a.scene.usd.stage import new_stage, save
from s2a.tasks.open_part import OpenPartConfig

ROOM = "/scene/static/colliders/room_3_01"
PANDA = robot.load("panda")
CONFIG: CertifyConfig = load(CertifyConfig, "certify/default")
QUICK = replace(CONFIG, motion=replace(CONFIG.motion, rest_time=0.2, open_time=0.2))


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return write_cabinet(tmp_path / "sim.usda")


def test_a_finger_presses_from_the_force_and_distance_on_as_in_the_tasks() -> None:
    task: OpenPartConfig = load(OpenPartConfig, "task/open_part")
    assert (grasp.PRESS_FORCE, grasp.ON_REGION) == (task.contact_force, task.contact_distance)


def clash(stage: Usd.Stage) -> None:
    """Something of the room stands 5 mm in the drawer's front."""
    reshape(stage, ROOM, box((0.3397, 0.25, 0.7), (0.02, 0.05, 0.05)))


def obstacle(stage: Usd.Stage) -> None:
    """Something of the room stands 20 cm before the drawer, out of the hand's way."""
    reshape(stage, ROOM, box((0.55, 0.3, 0.7), (0.02, 0.02, 0.05)))


def jam(stage: Usd.Stage) -> None:
    attribute(stage, f"{JOINT}.newton:friction", 50.0)


def slope(stage: Usd.Stage) -> None:
    """The drawer runs down a slope of five degrees, and nothing holds it."""
    axis = (math.cos(0.0873), 0.0, -math.sin(0.0873))
    attribute(stage, f"{JOINT}.s2a:axis", Gf.Vec3d(*axis))
    for end in (0, 1):
        attribute(stage, f"{JOINT}.physics:localRot{end}", frame(axis))


def upright(stage: Usd.Stage) -> None:
    """The drawer has to be lifted, 5.32 kg."""
    attribute(stage, f"{JOINT}.s2a:axis", Gf.Vec3d(0, 0, 1))
    for end in (0, 1):
        attribute(stage, f"{JOINT}.physics:localRot{end}", frame((0.0, 0.0, 1.0)))


def swallowed_gap(stage: Usd.Stage) -> None:
    """The bar's collider is a block of 9 cm, as a hull over a coarse decomposition would be."""
    reshape(stage, f"{TARGET}/colliders/hull_00", box(tuple(HANDLE), (0.0071, 0.084, 0.045)))


MOTION = {clash: "rest_penetration", obstacle: "sweep_penetration", jam: "joint_sweep", slope: "self_opening"}


@pytest.mark.parametrize("defect", MOTION, ids=lambda defect: defect.__name__)
def test_a_defect_of_motion_is_named(defect: Callable[[Usd.Stage], None], stage: Path) -> None:
    edit(stage, defect)
    found = {check.name: check for check in physics.MOTION.ask(MujocoWorld(stage, CONFIG.physics), QUICK.motion)}
    check = found[MOTION[defect]]
    assert check.status == "fail" and check.value > check.bound and check.remedy
    if defect is obstacle:
        assert found["joint_sweep"].prim == ROOM


def test_a_body_that_falls_is_named_though_it_is_called_like_the_robot(stage: Path) -> None:
    def add(edited: Usd.Stage) -> None:
        Sdf.CopySpec(edited.GetRootLayer(), TARGET, edited.GetRootLayer(), "/scene/panda_9")
        edited.RemovePrim("/scene/panda_9/colliders")

    edit(stage, add)
    settle, _ = physics.rest(MujocoWorld(stage, CONFIG.physics), QUICK.motion)
    # 0.2 s of free fall
    assert settle.prim == "/scene/panda_9" and settle.value == pytest.approx(0.5 * 9.81 * 0.2**2, rel=0.05)


def test_what_turns_about_its_own_grasp_point_gets_an_answer_too(stage: Path) -> None:
    world = MujocoWorld(stage, CONFIG.physics)
    world.stage = replace(
        world.stage, joint=replace(world.stage.joint, kind="revolute", origin=tuple(world.stage.grasp[:3]))
    )
    assert world.lever_arm == 0.0
    # Half of its 0.4 rad are tried, at which the model's drawer stands 0.2 m out, around the hand.
    assert grasp.grip(world, CONFIG.grip).prim.startswith(f"{TARGET}/colliders")


def test_the_way_of_a_body_is_that_of_its_farthest_point() -> None:
    random = np.random.default_rng(0)
    turns, points = Rotation.random(6, rng=0), random.normal(size=(3, 2, 3))
    poses = np.concatenate([random.normal(size=(6, 3)), turns.as_quat()], axis=1)
    places = np.array([turns[i].apply(points[i % 3]) + poses[i, :3] for i in range(6)])
    expected = np.linalg.norm(places[3:] - places[:3], axis=2).max(axis=1)
    assert physics.displacements(poses[:3], poses[3:], points) == pytest.approx(expected)


def test_clean_furniture_keeps_still_runs_freely_and_survives_mujoco(stage: Path) -> None:
    found = physics.MOTION.ask(MujocoWorld(stage, CONFIG.physics), CONFIG.motion)
    assert [check for check in found if check.status not in ("pass", "info")] == []
    assert {check.name for check in found} >= {"rest_displacement", "self_opening", "mujoco_reload", *MOTION.values()}


def test_what_has_to_be_lifted_is_no_jam_and_its_weight_is_told(stage: Path) -> None:
    edit(stage, upright)
    sweep = physics.joint_sweep(MujocoWorld(stage, CONFIG.physics), CONFIG.motion)
    assert (
        sweep.status == "pass" and f"{5.32 * 9.81:.1f} N or less" in sweep.message
    )  # five times the force of the sweep


@pytest.mark.parametrize(
    ("mass", "friction"), [(5.32, 6.0), (20.0, 0.028 * 20.0 * 9.81), (5.32, 9.0), (60.0, 0.028 * 60.0 * 9.81)]
)
def test_dry_friction_below_the_force_is_no_jam(stage: Path, mass: float, friction: float) -> None:
    def heavy(edited: Usd.Stage) -> None:
        attribute(edited, f"{TARGET}.physics:mass", mass)
        attribute(edited, f"{JOINT}.newton:friction", friction)

    edit(stage, heavy)
    sweep = physics.joint_sweep(MujocoWorld(stage, CONFIG.physics), CONFIG.motion)
    assert sweep.status == "pass", (sweep.value, sweep.message)


def test_dry_friction_that_holds_a_part_lets_it_not_creep(stage: Path) -> None:
    def sticky_slope(edited: Usd.Stage) -> None:
        slope(edited)
        attribute(edited, f"{JOINT}.newton:friction", 9.0)  # twice the 4.55 N with which the drawer pulls

    edit(stage, sticky_slope)
    _, opened = physics.rest(MujocoWorld(stage, CONFIG.physics), replace(CONFIG.motion, rest_time=0.2, open_time=1.0))
    assert opened.value < 1e-4


def test_the_hand_holds_a_bar_of_known_thickness(stage: Path) -> None:
    attempt = grasp.grip(MujocoWorld(stage, CONFIG.physics), CONFIG.grip)
    width = int(attempt.message.split(" mm")[0])
    assert attempt.holds and width in (23, 24)  # the bar is 23.8 mm high; contacts give way by tenths of a millimetre
    assert 0.0 <= attempt.slip < CONFIG.grip.slip


def test_fingers_are_not_wedged_between_hulls_that_meet_unevenly(stage: Path) -> None:
    def uneven(edited: Usd.Stage) -> None:
        """The bar is of three hulls; from below the middle one, 16 mm long, lies 2.3 mm deeper than its neighbours."""
        hulls, (x, y, z) = f"{TARGET}/colliders", HANDLE
        for name, middle, length, low in (
            ("00", 0.0, 0.016, 0.0096),
            ("08", -0.046, 0.076, 0.0119),
            ("09", 0.046, 0.076, 0.0119),
        ):
            if name != "00":
                Sdf.CopySpec(edited.GetRootLayer(), f"{hulls}/hull_00", edited.GetRootLayer(), f"{hulls}/hull_{name}")
            reshape(
                edited,
                f"{hulls}/hull_{name}",
                box((x, y + middle, z + 0.00595 - low / 2), (0.0071, length / 2, 0.00595 + low / 2)),
            )

    edit(stage, uneven)
    # The pads are 17.6 mm wide: on either side 0.8 mm rest on a neighbour, so that they stop at the 23.8 mm of the bar, if they
    # do not dig in before.
    world = MujocoWorld(stage, CONFIG.physics)
    slow, fast = (grasp.grip(world, config) for config in (CONFIG.grip, replace(CONFIG.grip, speed=0.05)))
    assert slow.holds and slow.message.startswith("23 mm") and fast.message.startswith("20 mm")


def test_what_falls_shut_is_held_open_until_the_hand_has_closed(stage: Path) -> None:
    edit(stage, upright)
    # In the 0.6 s in which the hand closes it would fall all the 50 mm that it is open.
    attempt = grasp.grip(MujocoWorld(stage, CONFIG.physics), replace(CONFIG.grip, pull=0.0, pull_time=0.0))
    assert attempt.holds and attempt.message.startswith("23 mm")


@pytest.mark.slow
def test_a_load_along_the_way_of_the_fingers_is_held_by_their_gear(stage: Path) -> None:
    edit(stage, upright)
    # Of the weight of 52.2 N each finger's gear takes half: 26.1 N / 20 kN/m = 1.3 mm, and the contacts give way by tenths of a
    # millimetre. Above 60 N the fingers are pushed open.
    world, weight = MujocoWorld(stage, CONFIG.physics), replace(CONFIG.grip, pull=0.0)
    assert 0.0013 < grasp.grip(world, weight).slip < CONFIG.grip.slip
    assert grasp.grip(world, replace(weight, gear=0.0)).slip > 0.02
    assert not grasp.grip(world, CONFIG.grip).holds


@pytest.mark.slow
def test_a_pull_beyond_friction_slips(stage: Path) -> None:
    # Two fingers of 30 N at a friction coefficient of 1 hold 60 N.
    world = MujocoWorld(stage, CONFIG.physics)
    assert grasp.grip(world, replace(CONFIG.grip, pull=55.0)).holds
    assert not grasp.grip(world, replace(CONFIG.grip, pull=65.0)).holds


def test_colliders_that_fill_what_the_scan_leaves_free_are_named(stage: Path) -> None:
    assert grasp.gap(stage, contents.read(stage), PANDA.gripper).fill_ratio == 0.0
    edit(stage, swallowed_gap)
    room = grasp.gap(stage, contents.read(stage), PANDA.gripper)
    assert room.graspable(CONFIG.gap) and room.fill_ratio > 0.5
    attempt = grasp.grip(MujocoWorld(stage, CONFIG.physics), CONFIG.grip)
    assert not attempt.holds and attempt.prim == f"{TARGET}/colliders/hull_00"


def flush(stage: Usd.Stage) -> None:
    """A drawer without a handle, annotated to be taken at the middle of its flat front."""
    patch = box((0.32455, 0.0, HANDLE[2]), (0.0001, 0.04, 0.01))
    middle = Gf.Vec3d(0.32455, 0.0, float(HANDLE[2]))
    front = box((0.31515, 0.0, 0.7172), (0.0095, 0.3594, 0.0619))
    reshape(stage, f"{TARGET}/region", patch)
    attribute(stage, f"{TARGET}/grasp.xformOp:translate", middle)
    visual = UsdGeom.Mesh(stage.GetPrimAtPath(f"{TARGET}/visual"))
    visual.GetPointsAttr().Set(Vt.Vec3fArray.FromNumpy(np.tile(front.vertices, (4, 1))))
    for i in range(3):
        reshape(stage, f"{TARGET}/colliders/hull_{i:02d}", front)


def test_a_flat_front_is_not_graspable_which_is_no_defect(stage: Path) -> None:
    edit(stage, flush)
    (result,) = certify(stage, QUICK)
    closure = next(check for check in result.checks if check.name == "grasp_hold")
    assert result.graspable is False and closure.status == "info"
    assert "not graspable by a parallel gripper" in closure.message
    assert {check.name for check in result.failed} <= {"usd"}


@pytest.mark.parametrize("scanned", [True, False])
def test_what_leaves_no_room_for_the_hand_is_a_defect_unless_it_was_scanned(scanned: bool, stage: Path) -> None:
    # 60 mm above the bar, where fingers have room, but not the body of the hand, which is 200 mm wide.
    beam = box((HANDLE[0] + 0.09, 0.0, HANDLE[2] + 0.08), (0.03, 0.05, 0.02))

    def add(edited: Usd.Stage) -> None:
        reshape(edited, ROOM, beam)
        if scanned:
            reshape(edited, "/scene/static/visual", Mesh(np.tile(beam.vertices, (2, 1)), beam.faces))

    edit(stage, add)
    (result,) = certify(stage, replace(QUICK, grip=replace(QUICK.grip, depths=(0.0,))))
    closure = next(check for check in result.checks if check.name == "grasp_hold")
    assert result.graspable is False and closure.prim == ROOM
    assert closure.status == ("info" if scanned else "fail")
    # The beam is wider than the hand's body, which is 63 mm thick: a surface is 32 mm deep in it at most.
    assert ("static is 32 mm deep in the path of the gripper body" in closure.message) == scanned


def test_a_broken_structure_is_not_simulated(stage: Path) -> None:
    edit(stage, nan_point)
    (result,) = certify(stage, CONFIG)
    assert not result.passed and result.graspable is None
    assert next(check for check in result.checks if check.name == "physics").status == "skipped"


@pytest.mark.slow
@pytest.mark.parametrize("defect", [*STATIC_DEFECTS, *MOTION, swallowed_gap], ids=lambda defect: defect.__name__)
def test_every_seeded_defect_costs_the_certificate(defect: Callable[[Usd.Stage], None], stage: Path) -> None:
    save(new_stage(), stage.with_name("other.usda"))
    edit(stage, defect)
    named = {**STATIC_DEFECTS, **MOTION, swallowed_gap: "finger_gap"}[defect]
    assert named in {check.name for check in certify(stage, CONFIG)[0].failed}


def test_the_clean_stage_passes_everything(stage: Path) -> None:
    (result,) = certify(stage, CONFIG)
    assert result.passed and result.graspable
    assert {check.status for check in result.checks} <= {"pass", "info", "skipped"}
    assert result.target == "drawer_2" and result.seconds > 0
