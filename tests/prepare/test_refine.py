"""Joints refined from one scan: a cabinet made by hand, whose true joints are known."""

from dataclasses import replace

import numpy as np
import pytest
from flat_cabinet import DRAWER, FRONT, LEFT, RIGHT, TRUE, cabinet, tilted, with_part

from s2a.core import config
from s2a.prepare.refine import HASTY, refine, sentence, with_joints
from s2a.prepare.refine_loss import Loss, PartPath, RefineConfig, Term
from s2a.prepare.refine_room import fit, joints_of, priors
from s2a.scene.scene import Joint, Mesh, Part

SETTINGS = config.load(RefineConfig, config.file("refine/default"))
WRONG = {
    "drawer_2": tilted(DRAWER, 2.0, (0.0, 0.6, 0.8)),
    "door_3": tilted(LEFT, 2.0, (0.8, 0.6, 0.0), np.array([0.0, 0.01, 0.0])),
    "door_4": tilted(RIGHT, 2.0, (0.0, 1.0, 0.0), np.array([0.01, 0.0, 0.0])),
}


def angle(joint: Joint, other: Joint) -> float:
    """Return the angle between two axes [deg]."""
    return float(np.degrees(np.arccos(np.clip(np.dot(joint.axis, other.axis), -1.0, 1.0))))


def off(joint: Joint, true: Joint) -> float:
    """Return the distance of the true origin from a line [m]."""
    return float(np.linalg.norm(np.cross(np.subtract(true.origin, joint.origin), joint.axis)))


@pytest.fixture(scope="module")
def refined():
    return refine(cabinet(WRONG), SETTINGS)


@pytest.mark.parametrize("part", TRUE)
def test_an_axis_two_degrees_off_is_found(refined, part) -> None:
    assert angle(WRONG[part], TRUE[part]) == pytest.approx(2.0, abs=1e-6)
    assert angle(refined[part].joint, TRUE[part]) < 0.3
    assert np.degrees(refined[part].change.angle) == pytest.approx(2.0, abs=0.3)


@pytest.mark.parametrize("part", ["door_3", "door_4"])
def test_a_hinge_line_ten_millimetres_off_is_moved_to_the_edge(refined, part) -> None:
    assert off(WRONG[part], TRUE[part]) == pytest.approx(0.01, abs=2e-4)
    assert off(refined[part].joint, TRUE[part]) < 0.005


def test_no_joint_is_worse_by_its_own_loss(refined) -> None:
    assert all(found.after < found.before for found in refined.values())


def test_the_truth_lies_within_three_standard_deviations(refined) -> None:
    for part, found in refined.items():
        assert angle(found.joint, TRUE[part]) < 3.0 * np.sqrt(2.0) * np.degrees(found.change.angle_sigma)


def test_who_dreads_harm_moves_less_and_what_is_sure_all_the_same() -> None:
    bold, shy = replace(SETTINGS, regret=0.0), replace(SETTINGS, worse=0.0, regret=0.1)
    right = [sum(each.change.angle for each in refine(cabinet(), one).values()) for one in (shy, bold)]
    assert right[0] < right[1]
    assert angle(refine(cabinet(WRONG), shy)["drawer_2"].joint, DRAWER) < 0.3


def test_a_fit_is_a_minimum() -> None:
    room = joints_of(cabinet(WRONG), SETTINGS)
    found = fit(room, HASTY, room.free, SETTINGS)
    loss = room.loss.of([*room.terms, *priors(room, HASTY, SETTINGS)], room.paths)
    gradient = loss(np.concatenate([found.values.ravel(), found.turns.ravel()]))[1][: found.values.size]
    assert np.abs(gradient * found.sigma.ravel())[room.free.ravel()].max() < 0.01


def test_right_joints_hardly_move() -> None:
    for found in refine(cabinet(), SETTINGS).values():
        assert np.degrees(found.change.angle) < 0.15
        assert found.change.shift < 0.004
        assert found.change.zero == 0.0


def test_a_part_that_shows_nothing_stays_as_annotated_and_says_so() -> None:
    joint = tilted(DRAWER, 2.0, (0.0, 0.0, 1.0))
    unseen = Part("drawer", Mesh(np.empty((0, 3)), np.empty((0, 3))), None, joint)
    # 2 degrees off gravity's axes: furniture that shows no front has no direction either.
    found = refine(with_part(cabinet(), "drawer_9", unseen), SETTINGS)["drawer_9"]
    assert found.joint is joint
    assert found.change.unknown == ("axis sideways",) or "axis sideways" in found.change.unknown
    assert "the scan does not tell: axis sideways" in sentence("drawer_9", found.change)


def test_a_slide_has_no_place(refined) -> None:
    assert refined["drawer_2"].joint.origin == WRONG["drawer_2"].origin
    assert refined["drawer_2"].change.shift == 0.0


def test_a_drawer_that_was_scanned_ajar_closes_behind_zero() -> None:
    found = refine(cabinet(ajar=0.03), SETTINGS)["drawer_2"]
    assert found.joint.limits[0] == pytest.approx(-0.03, abs=0.006)
    assert found.joint.limits[1] == DRAWER.limits[1]
    assert "scanned" in sentence("drawer_2", found.change)


def test_only_joints_change(refined) -> None:
    scene = cabinet(WRONG)
    other = with_joints(scene, refined)
    assert all(replace(other.parts[i], motion=part.motion) == part for i, part in scene.parts.items())
    assert other.joint("door_3") == refined["door_3"].joint


def test_a_room_without_joints_has_nothing_to_refine() -> None:
    assert refine(cabinet({}), SETTINGS) == {}


KINDS = {"slide": DRAWER, "hinge": tilted(RIGHT, 3.0, (0.0, 1.0, 0.0))}


@pytest.mark.parametrize("cut", [0.0, 2.0])
@pytest.mark.parametrize("kind", range(7))
@pytest.mark.parametrize("joint", KINDS.values(), ids=KINDS)
def test_gradients_of_terms_are_central_differences(joint, kind, cut) -> None:
    rng = np.random.default_rng(kind)
    loss = Loss([joint], [np.array([1.0, 0.0, 0.0])], [np.eye(3)])
    directions = rng.normal(size=(3, 3))
    terms = [
        Term(kind, 0, 0.01, 0, i, d / np.linalg.norm(d), rng.normal(size=3), 0.02, cut)
        for i, d in enumerate(directions)
    ]
    agree(loss.of(terms), rng)


@pytest.mark.parametrize("joint", KINDS.values(), ids=KINDS)
def test_gradients_of_paths_are_central_differences(joint) -> None:
    rng = np.random.default_rng(0)
    loss = Loss([joint], [np.array([1.0, 0.0, 0.0])], [])
    grid = rng.normal(0.0, 0.02, (12, 11, 10))
    points, steps = rng.uniform(-0.2, 0.9, (60, 3)) + (FRONT, 0.0, 0.0), np.array([0.0, 0.1, 0.3])
    low = np.array([-0.3, -0.5, -0.3])
    agree(loss.of([], [PartPath(0, points, np.full(60, 0.001), steps, low, 0.15, grid, 1e4)]), rng)


def agree(loss: Loss, rng: np.random.Generator) -> None:
    """Compare a gradient with central differences, by direction and by size."""
    at, step = rng.normal(0.0, 0.02, loss.size), 1e-6
    found = loss(at)[1]
    expected = np.array([(loss(at + h)[0] - loss(at - h)[0]) / (2 * step) for h in step * np.eye(loss.size)])
    assert np.linalg.norm(expected) > 0.0
    assert found @ expected > 0.999 * np.linalg.norm(found) * np.linalg.norm(expected)
    assert np.abs(found - expected).max() < 1e-3 * np.abs(expected).max()


def test_the_hessian_of_joints_that_meet_in_a_frame_is_complete() -> None:
    joints = [DRAWER, RIGHT, LEFT]
    loss = Loss(joints, 3 * [np.array([1.0, 0.0, 0.0])], [np.eye(3), np.eye(3)])
    frame = [0, 1, 0]
    terms = [Term(2, i, 0.01, frame[i], k) for i in range(3) for k in range(3)]
    terms += [Term(5, i, 0.02, index=k) for i in range(3) for k in range(5)] + [
        Term(4, 0, 0.1, f, k) for f in (0, 1) for k in range(3)
    ]
    loss.of(terms)
    at = np.random.default_rng(0).normal(0.0, 0.02, loss.size)
    full = np.array([(loss(at + h)[1] - loss(at - h)[1]) / 2e-5 for h in 1e-5 * np.eye(loss.size)])
    assert np.abs(loss.hessian(at, frame) - full).max() < 1e-6 * np.abs(full).max()
