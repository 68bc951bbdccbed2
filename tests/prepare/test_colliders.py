"""Colliders of handles: what a scan shows of a bar, a knob, a cup or an edge pull, and what its shadows add."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from closeness import surface_distance
from seen_handles import FRAME, PLANE, block, cup, edge, knob, outside, ring_behind, seen, turned_knob

from s2a.prepare.part_hulls import Handle, flatten
from s2a.scene.geometry.bar import bar_depth, bar_hulls, bar_profile
from s2a.scene.geometry.front_panel import FingerSpace, fraction_inside, reassign_border
from s2a.scene.geometry.knob import knob_hulls
from s2a.scene.geometry.mesh_ops import keep, merge, normals, sample
from s2a.scene.geometry.sheet import before_wall, hidden_wall, sheet_hulls, sheet_opening
from s2a.scene.scene import Mesh

GAP = 0.026
"""[m] Between front and bar."""


def bar(*posts: float) -> Mesh:
    """Return a bar, 160 mm long, 14 mm wide, 12 mm deep, with posts, 12 mm wide, at places along it, as seen."""
    rod = block((GAP, -0.08, -0.007), (GAP + 0.012, 0.08, 0.007))
    return seen(merge([rod, *(block((0, y - 0.006, -0.007), (GAP, y + 0.006, 0.007)) for y in posts)]))


def skirt(first: float, last: float) -> Mesh:
    """Return a sheet that hangs from a bar's lower edge and runs to the front, from y = first to last [m]."""
    corners = [[GAP, first, -0.007], [GAP, last, -0.007], [0, last, 0.0], [0, first, 0.0]]
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).subdivide_to_size(0.004)
    return Mesh(sheet.vertices, sheet.faces)


def pieces_of(region: Mesh) -> list[Mesh]:
    profile = bar_profile(region, FRAME, 24)
    assert profile is not None
    found = bar_hulls(region, FRAME, profile, 0.0)
    assert found is not None
    return found


def behind(first: float, last: float) -> np.ndarray:
    """Return points between bar and front, 2 mm off either, from y = first to last [m]."""
    return np.random.default_rng(0).uniform([0.002, first, -0.007], [GAP - 0.002, last, 0.007], (2000, 3))


def test_a_bar_is_as_deep_as_its_sides_and_lies_within_half_a_millimetre_of_its_pieces() -> None:
    region = bar(-0.074, 0.074)
    profile = bar_profile(region, FRAME, 24)
    assert profile is not None and profile.thickness == pytest.approx(0.014, abs=0.0005)
    assert bar_depth(sample(region, 40000, 0) @ FRAME, profile, 0.0) == pytest.approx(0.012, abs=0.0015)
    assert surface_distance(pieces_of(region), sample(region, 1000, 0)).mean() < 0.0005


def test_posts_at_the_ends_stand_and_the_gap_between_them_is_free() -> None:
    pieces = pieces_of(bar(-0.074, 0.074))
    assert fraction_inside(pieces, behind(-0.079, -0.069)) > 0.95
    assert fraction_inside(pieces, behind(0.069, 0.079)) > 0.95
    assert fraction_inside(pieces, behind(-0.06, 0.06)) == 0.0


def test_a_single_post_in_the_middle_stands() -> None:
    pieces = pieces_of(bar(0.0))
    assert fraction_inside(pieces, behind(-0.005, 0.005)) > 0.95
    assert fraction_inside(pieces, np.concatenate([behind(-0.078, -0.012), behind(0.012, 0.078)])) == 0.0


def test_a_skirt_behind_a_bar_is_carved() -> None:
    pieces = pieces_of(merge([bar(-0.074, 0.074), skirt(-0.06, 0.06)]))
    assert fraction_inside(pieces, behind(-0.035, 0.035)) == 0.0


def test_a_bar_is_as_deep_as_the_side_that_does_not_flare_out() -> None:
    rod = bar(-0.074, 0.074)
    above = keep(rod, normals(rod)[:, 2] > -0.5)
    face = GAP + 0.012
    corners = [
        [face, -0.067, -0.007],
        [face, 0.067, -0.007],
        [face - 0.009, 0.067, -0.014],
        [face - 0.009, -0.067, -0.014],
    ]
    sheet = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).subdivide_to_size(0.004)
    region = merge([above, Mesh(sheet.vertices, sheet.faces)])
    profile = bar_profile(region, FRAME, 24)
    assert profile is not None
    assert bar_depth(sample(region, 40000, 0) @ FRAME, profile, 0.0) == pytest.approx(0.012, abs=0.0015)


def test_a_levers_neck_stands_on_its_plate_as_thick_as_it_is_seen_from_one_side() -> None:
    plate = 0.008
    neck = block((plate, -0.08, -0.0052), (GAP, -0.064, 0.0052))
    region = merge([bar(), keep(seen(neck), normals(seen(neck))[:, 2] > -0.5)])
    profile = bar_profile(region, FRAME, 24)
    assert profile is not None
    pieces = bar_hulls(region, FRAME, profile, 0.0, -plate)
    assert pieces is not None
    inside = np.random.default_rng(0).uniform(
        [plate + 0.001, -0.078, -0.0048], [GAP - 0.002, -0.067, 0.0048], (2000, 3)
    )
    beside = inside * [1, 1, 0] + [0, 0, 0.0062]
    assert fraction_inside(pieces, inside) > 0.95
    assert fraction_inside(pieces, beside) == fraction_inside(pieces, beside * [1, 1, -1]) == 0.0


def test_a_knob_lies_within_half_a_millimetre_of_its_pieces_with_a_free_neck() -> None:
    pieces = knob_hulls(knob(), FRAME, 0.0)
    assert pieces is not None and len(pieces) <= 8
    touched = sample(knob(), 2000, 0)
    assert surface_distance(pieces, touched[touched[:, 0] > 0.016]).mean() < 0.0005
    neck = np.random.default_rng(0).uniform([0.002, 0.0095, -0.002], [0.011, 0.014, 0.002], (1000, 3))
    assert fraction_inside(pieces, neck) == 0.0


def test_a_skirt_on_one_side_of_a_knob_is_no_knob() -> None:
    hanging = trimesh.Trimesh(
        [[0.026, -0.008, -0.013], [0.026, 0.008, -0.013], [0.0, 0.008, -0.03], [0.0, -0.008, -0.03]],
        [[0, 2, 1], [0, 3, 2]],
    ).subdivide_to_size(0.004)
    pieces = knob_hulls(merge([knob(), Mesh(hanging.vertices, hanging.faces)]), FRAME, 0.0)
    assert pieces is not None
    below = np.random.default_rng(0).uniform([0.002, -0.005, -0.03], [0.026, 0.005, -0.017], (1000, 3))
    assert fraction_inside(pieces, below) < 0.01


def test_a_fillet_behind_a_knobs_head_is_fusions_and_its_stalk_runs_up_to_the_head() -> None:
    pieces = knob_hulls(turned_knob([(0.007, 0.0), (0.007, 0.009), (0.015, 0.014), (0.015, 0.028)]), FRAME, 0.0)
    assert pieces is not None
    assert fraction_inside(pieces, ring_behind(0.0075, 0.0145, 0.013)) <= 0.05
    assert fraction_inside(pieces, ring_behind(0.0, 0.0065, 0.013)) > 0.95


def test_a_cone_stays_a_cone() -> None:
    cone = turned_knob([(0.006, 0.0), (0.016, 0.025)])
    pieces = knob_hulls(cone, FRAME, 0.0)
    assert pieces is not None
    assert surface_distance(pieces, sample(cone, 1000, 0)).mean() < 0.0007


def test_a_square_handle_is_no_knob() -> None:
    assert knob_hulls(seen(block((0, -0.04, -0.01), (0.028, 0.04, 0.01))), FRAME, 0.0) is None


def test_a_cup_is_a_sheet_that_is_open_below_and_empty_inside() -> None:
    region = outside(cup())
    opening = sheet_opening(region, FRAME, PLANE, block((-0.02, -0.3, -0.1), (0.0, 0.3, 0.1)))
    assert opening == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    pieces = sheet_hulls(region, FRAME, opening, 12, 32)
    inside = np.random.default_rng(0).uniform([0.004, -0.02, -0.037], [0.014, 0.02, -0.028], (2000, 3))
    assert fraction_inside(pieces, inside) == 0.0
    assert surface_distance(pieces, sample(region, 1000, 0)).mean() < 0.001


def test_an_edge_pull_is_a_sheet_that_is_open_towards_its_front() -> None:
    region = outside(edge())
    opening = sheet_opening(region, FRAME, PLANE, block((-0.02, -0.3, -0.2), (0.0, 0.3, 0.0)))
    assert opening == pytest.approx([0.0, 0.0, -1.0], abs=1e-6)
    pieces = sheet_hulls(region, FRAME, opening, 12, 32)
    inside = np.random.default_rng(0).uniform([0.002, -0.14, -0.013], [0.014, 0.14, -0.004], (2000, 3))
    assert fraction_inside(pieces, inside) < 0.05


def test_an_edge_pull_whose_wall_no_scanner_saw_is_fixed_to_its_front() -> None:
    whole = edge().subdivide_to_size(0.002)
    mesh = seen(Mesh(whole.vertices, whole.faces))
    opening = np.array([0.0, 0.0, -1.0])
    wall = hidden_wall(keep(mesh, normals(mesh)[:, 2] < 0.5), FRAME, opening, 0.0)
    assert wall is not None
    assert wall.bounds == pytest.approx(np.array([[0.0, -0.147, 0.0], [0.02, 0.147, 0.002]]), abs=0.003)
    assert hidden_wall(mesh, FRAME, opening, 0.0) is None  # the scan shows it: nothing is made up
    assert hidden_wall(mesh, FRAME, np.zeros(3), 0.0) is None


def test_what_fusion_drew_on_beyond_a_hidden_wall_is_no_sheet() -> None:
    opening, wall = np.array([0.0, 0.0, -1.0]), block((0.0, -0.1, 0.0), (0.02, 0.1, 0.002))
    top, beyond = block((0.018, -0.1, -0.014), (0.02, 0.1, 0.012)), block((0.018, -0.1, 0.004), (0.02, 0.1, 0.012))
    (kept,) = before_wall([top, beyond], wall, opening)
    assert kept.bounds[:, 2] == pytest.approx([-0.014, 0.002])


def test_a_bar_in_the_middle_of_its_front_is_no_sheet() -> None:
    front = block((-0.02, -0.3, -0.1), (0.0, 0.3, 0.1))
    assert sheet_opening(merge([bar(-0.074, 0.074), skirt(-0.06, 0.06)]), FRAME, PLANE, front) is None


def test_what_the_front_has_in_the_fingers_way_is_cut_off_at_its_plane() -> None:
    space = FingerSpace(block((0.002, -0.01, -0.007), (GAP - 0.002, 0.01, 0.007)), ())
    handle = Handle(FRAME, bar(), PLANE, 0.0, space)
    bulge, atomic_write = (block((-0.02, y, -0.05), (0.015, y + 0.1, 0.05)) for y in (-0.05, 0.2))
    flat, kept = flatten([bulge, atomic_write], handle)
    assert kept is atomic_write and flat.bounds[1, 0] == pytest.approx(0.0, abs=1e-6)
    assert flat.bounds[0] == pytest.approx(bulge.bounds[0])


def test_a_cup_that_is_sunk_into_its_front_stays_the_handle() -> None:
    front = block((-0.001, -0.2, -0.1), (0.0, 0.2, 0.1))
    cup_behind, bar_before = block((-0.03, -0.05, -0.02), (-0.002, 0.05, 0.02)), bar(0.0)
    assert reassign_border(front, cup_behind, FRAME, PLANE) == (front, cup_behind)
    kept, handle = reassign_border(front, bar_before, FRAME, PLANE)
    assert kept == front and 0 < len(handle.faces) < len(bar_before.faces)  # the post's foot is flush with the front
