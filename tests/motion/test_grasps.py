"""Grasps of boxes, whose antipodal pairs are known by hand."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from cabinet import box

from s2a import robot
from s2a.motion.grasps import ObjectGrasps, object_grasps
from s2a.motion.gripper import FIRM, HANGING, SLOPING, gripper_boxes, gripper_spheres
from s2a.scene.scene import Mesh

GRIPPER = robot.load("panda").gripper


def grasps(*hulls: Mesh) -> ObjectGrasps:
    return object_grasps(hulls, np.zeros(3), GRIPPER)


def test_a_cube_is_pinched_across_opposite_faces() -> None:
    found = grasps(box((0, 0, 0), (0.025, 0.025, 0.025)))
    assert len(found.tool) > 100
    np.testing.assert_allclose(found.width, 0.05, atol=1e-6)
    np.testing.assert_allclose(np.abs(found.tool[:, :3, 1]).max(axis=1), 1.0, atol=1e-6)


def test_a_board_is_pinched_across_its_thin_side_alone() -> None:
    found = grasps(box((0, 0, 0), (0.06, 0.06, 0.01)))
    np.testing.assert_allclose(np.abs(found.tool[:, 2, 1]), 1.0, atol=1e-6)


def test_what_is_wider_than_the_gripper_has_no_grasp() -> None:
    assert len(grasps(box((0, 0, 0), (0.04, 0.04, 0.04))).tool) == 0


def test_two_hulls_side_by_side_are_one_width() -> None:
    halves = [box((x, 0, 0), (0.015, 0.03, 0.03)) for x in (-0.015, 0.015)]
    found = grasps(*halves)
    along_x = np.abs(found.tool[:, 0, 1]) > 0.99
    assert along_x.any()
    np.testing.assert_allclose(found.width, 0.06, atol=1e-6)


def test_a_wide_body_is_grasped_by_its_handle() -> None:
    body, handle = box((0, 0, 0), (0.05, 0.05, 0.05)), box((0.09, 0, 0), (0.04, 0.005, 0.01))
    found = grasps(body, handle)
    assert len(found.tool)
    assert (found.tool[:, 0, 3] > 0.05).all()


def test_no_grasp_has_the_object_in_a_finger_or_in_the_gripper_body() -> None:
    half = np.array([0.03, 0.02, 0.1])
    found = grasps(box((0, 0, 0), tuple(half)))
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * half
    for tool, opened in zip(found.tool, found.opened, strict=True):
        local = (corners - tool[:3, 3]) @ tool[:3, :3]
        nearer = np.array([0.0, (GRIPPER.max_opening - opened) / 2, 0.0])
        for (low, high), side in zip(gripper_boxes(GRIPPER), (-1, 1, 0), strict=True):
            assert not ((local > low + side * nearer) & (local < high + side * nearer)).all(axis=1).any()


def test_the_fingers_open_no_farther_than_a_grasp_needs() -> None:
    """Beside a pencil of 8 mm the pads stand 12 mm off on either side; a cube of 6 cm leaves them 1 cm each."""
    for half, opened in ((0.004, 0.032), (0.03, 0.08)):
        found = grasps(box((0, 0, 0), (half, half, half)))
        np.testing.assert_allclose(found.opened, opened, atol=1e-6)


def test_spheres_of_fingers_move_with_their_opening() -> None:
    """Between pads 3 cm apart each finger is 25 mm nearer to the middle than fully open; the gripper's body is where it was."""
    spheres = gripper_spheres(GRIPPER)
    tool = np.eye(4)[None]
    moved = spheres.placed(tool, np.array([0.03]))[0] - spheres.placed(tool)[0]
    along = np.where(np.abs(spheres.centers[:, 1]) > 0.04, -0.025 * np.sign(spheres.centers[:, 1]), 0.0)
    fingers = spheres.centers[:, 2] > -GRIPPER.body_behind
    np.testing.assert_allclose(moved, np.where(fingers, along, 0.0)[:, None] * [0.0, 1.0, 0.0], atol=1e-12)


def test_the_best_grasp_is_nearest_to_the_center_of_mass() -> None:
    found = object_grasps([box((0, 0, 0), (0.1, 0.02, 0.02))], np.array([0.06, 0.0, 0.0]), GRIPPER)
    assert found.tool[0, 0, 3] == pytest.approx(0.06, abs=0.02)


def test_what_hangs_is_pinched_beside_its_center_of_mass() -> None:
    """A bar along x whose weight acts 50 mm from its middle: closed along y, it does not turn if held within 8 mm of there."""
    bar, up = [box((0, 0, 0), (0.1, 0.02, 0.02))], np.array([0.0, 0.0, 1.0])
    away = []
    for contact in (FIRM, HANGING[0]):
        found = object_grasps(bar, np.array([0.05, 0.0, 0.0]), GRIPPER, contact=contact, up=up)
        along_y = np.abs(found.tool[:, 1, 1]) > 0.99
        assert along_y.sum() > 20
        away.append(float(np.abs(found.tool[along_y, 0, 3] - 0.05).max()))
    assert away[0] > 0.1
    assert away[1] < 0.009


def test_no_finger_lies_within_a_part_of_the_object() -> None:
    """A wide slab in two hulls that meet: pads across a rib on it, 20 mm wide, would have the fingers in the slab."""
    slab = [box((x, 0, -0.03), (0.05, 0.1, 0.03)) for x in (-0.05, 0.05)]
    rib = box((0, 0, 0.005), (0.01, 0.1, 0.005))
    found = grasps(*slab, rib)
    for k, spheres in enumerate(gripper_spheres(GRIPPER).placed(found.tool, found.opened)):
        for low, high in ((-0.1, 0.0), (0.0, 0.1)):
            inside = (spheres > [low, -0.1, -0.06]) & (spheres < [high, 0.1, 0.0])
            assert not inside.all(axis=1).any(), k


def wedge(degrees: float) -> Mesh:
    """Return a block 60 mm long, 40 mm high and 30 mm thick in its middle, whose sides diverge by an angle along it."""
    slope = np.tan(np.radians(degrees / 2))
    corners = [[x, side * (0.015 + slope * x), z] for x in (-0.03, 0.03) for side in (-1, 1) for z in (-0.02, 0.02)]
    mesh = trimesh.convex.convex_hull(np.array(corners))
    return Mesh(mesh.vertices, mesh.faces)


def across_the_sides(found: ObjectGrasps) -> np.ndarray:
    return np.abs(found.tool[:, 1, 1]) > 0.9


def test_a_wedge_is_not_pinched_where_it_would_slip_out() -> None:
    """Sides that diverge by 20 degrees are 3 mm farther apart at one end of the pads; by 2 degrees 0.3 mm."""
    steep, gentle = (int(across_the_sides(grasps(wedge(angle))).sum()) for angle in (20.0, 2.0))
    assert gentle > 500
    assert steep < 0.01 * gentle


def test_what_tapers_is_pinched_evenly() -> None:
    """Sides that diverge by 8 degrees: by the normal of one the other is 1.1 mm off the pads; between them, each 0.6 mm."""
    found = grasps(wedge(8.0))
    axes = np.abs(found.tool[across_the_sides(found)][:, 1, 1])
    assert len(axes) > 100
    assert np.degrees(np.arccos(axes)).min() < 0.1


def test_what_lies_is_pinched_level() -> None:
    """A block whose sides lean by 5 degrees: closed along a normal, one finger would be 5 mm lower."""
    block = box((0, 0, 0), (0.04, 0.02, 0.01))
    lean = np.radians(5.0)
    turned = np.array([[1, 0, 0], [0, np.cos(lean), -np.sin(lean)], [0, np.sin(lean), np.cos(lean)]])
    mesh = Mesh(block.vertices @ turned.T, block.faces)
    level = object_grasps([mesh], np.zeros(3), GRIPPER, up=np.array([0.0, 0.0, 1.0]))
    alone = object_grasps([mesh], np.zeros(3), GRIPPER)
    upright = [np.abs(each.tool[:, 2, 1]).min() for each in (level, alone)]
    assert upright[0] < 1e-6
    assert upright[1] > 0.08 or upright[1] < 1e-6


def test_a_rod_is_pinched_by_the_middle_of_the_pads() -> None:
    """A rod of 8 mm, thinner than the pads: 4 mm off their middle it would lie at their edge."""
    rod = box((0, 0, 0), (0.06, 0.004, 0.004))
    found = grasps(rod)
    assert len(found.tool)


def test_what_whole_pads_hold_comes_before_what_is_nearer_to_the_center_of_mass() -> None:
    """A body with a thin fin at its center of mass, which 6 mm of the pads hold, and a block beside that they hold whole."""
    fin, block = box((0, 0, 0), (0.003, 0.01, 0.01)), box((0.03, 0, 0), (0.027, 0.02, 0.02))
    found = object_grasps([fin, block], np.zeros(3), GRIPPER)
    assert found.tool[0, 0, 3] > 0.01


def test_pads_do_not_hold_by_an_edge() -> None:
    """A jar too wide to be held, with a lid of 4 mm: pads of 12 mm find no 6 mm of it. With one of 30 mm they do."""
    body = box((0, 0, 0), (0.045, 0.045, 0.05))
    assert not len(grasps(body, box((0, 0, 0.052), (0.03, 0.03, 0.002))).tool)
    found = grasps(body, box((0, 0, 0.065), (0.03, 0.03, 0.015)))
    assert len(found.tool)
    assert (found.tool[:, 2, 3] > 0.05).all()


def wedged(found: ObjectGrasps, hulls: list[Mesh]) -> np.ndarray:
    """Return at which grasps the surface within 1 mm of the pads' edges stands out by 1 mm over what is between the pads."""
    surface = np.concatenate([trimesh.convex.convex_hull(h.vertices).sample(5000, seed=1) for h in hulls])
    x, _, z = GRIPPER.finger_box
    low, high = np.array([-x / 2, GRIPPER.tip_ahead - z]), np.array([x / 2, GRIPPER.tip_ahead])
    wrong = []
    for tool in found.tool:
        local = (surface - tool[:3, 3]) @ tool[:3, :3]
        plane, out = local[:, [0, 2]], np.abs(local[:, 1])
        within, near = (((plane > low - by) & (plane < high + by)).all(axis=1) for by in (0.0, 1e-3))
        wrong.append(out[near].max() > out[within].max(initial=0.0) + 1e-3)
    return np.array(wrong)


@pytest.mark.slow
def test_the_pads_end_before_a_ledge_rather_than_at_it() -> None:
    """A cube's upper layer stood out by a millimetre over the pads' upper edge, which pressed on it from below."""
    hulls = [box((0, 0, 0), (0.025, 0.025, 0.03)), box((0, 0, 0.04), (0.0265, 0.0265, 0.01))]
    found = object_grasps(hulls, np.array([0.0, 0.0, 0.021]), GRIPPER, samples=1000)
    bad = wedged(found, hulls)
    assert bad.any(), "there are such grasps"
    assert not bad[:50].any()


@pytest.mark.parametrize(("lean", "firm", "sloping"), [(3.0, True, True), (7.0, False, True), (20.0, False, False)])
def test_a_head_that_narrows_is_held_by_sloping_faces_but_not_by_steep_ones(
    lean: float, firm: bool, sloping: bool
) -> None:
    """Over the pads' 17 mm each side recedes by 0.9, 2.0 and 6.0 mm. Away from its ends, where no pad reaches past an edge."""
    high, low = 0.04, 0.034
    top = low - 2 * high * np.tan(np.radians(lean))
    corners = [[x * h, y * h, z] for z, h in ((-high, low), (high, top)) for x in (-1, 1) for y in (-1, 1)]
    head = trimesh.convex.convex_hull(np.array(corners))
    hull = Mesh(np.asarray(head.vertices, np.float32), np.asarray(head.faces))
    up = np.array([0.0, 0.0, 1.0])
    for contact, holds in ((FIRM, firm), (SLOPING, sloping)):
        tool = object_grasps([hull], np.zeros(3), GRIPPER, samples=200, contact=contact, up=up).tool
        assert (np.abs(tool[:, 2, 3]) < 0.02).any() == holds
