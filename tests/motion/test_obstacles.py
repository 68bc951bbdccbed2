"""Obstacles: hulls are solid, surfaces are named, and there may be none."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from cabinet import box
from cube_room import room_of, with_hulls

from s2a import robot
from s2a.motion.obstacles import Obstacles, surface_points, uneven_rests
from s2a.scene.geometry import convex
from s2a.scene.scene import Mesh

PANDA = robot.load("panda")
FEW = 20, 40
"""Points at which grasps are looked for, where any will do."""


def test_what_is_within_a_hull_is_in_it(tmp_path: Path) -> None:
    block = box((3.0, 0.0, 1.0), (0.2, 0.2, 0.2))
    hulls = with_hulls(Obstacles.of_room(room_of(tmp_path), {"cube_9"}, np.array([3.0, 0.0, 1.0])), block)
    points = np.array([[[3.0, 0.0, 1.0]], [[3.15, 0.0, 1.0]], [[3.203, 0.0, 1.0]], [[3.21, 0.21, 1.0]]])
    in_plane = np.array([[[x, 0.2, 1.2]] for x in np.linspace(3.2 + 1e-4, 3.4, 500)])  # nearest to an edge
    assert hulls.depth(in_plane, np.array([0.005])).max() <= 0.005
    # 0.2 m to the surface from its middle, 0.05 from near it; 3 mm and 14 mm (past an edge) before it.
    assert hulls.depth(points, np.array([0.005])) == pytest.approx([0.205, 0.055, 0.002, 0.0], abs=1e-5)


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


def test_surfaces_name_what_spheres_reach_into() -> None:
    bounds = {"near": [[0, 0, 0], [1, 1, 1]], "far": [[5, 0, 0], [6, 1, 1]]}
    boxes = {i: trimesh.creation.box(bounds=ends) for i, ends in bounds.items()}
    meshes = [(i, Mesh(solid.vertices, solid.faces)) for i, solid in boxes.items()]
    centers, middle = np.array([[-0.05, 0.5, 0.5], [4.97, 0.5, 0.5]]), np.array([[0.5, 0.5, 0.5]])
    for solid in (True, False):
        obstacles = Obstacles(meshes, solid=solid)
        depth, name = obstacles.deepest(centers, np.array([0.1, 0.1]))
        assert (name, depth) == ("far", pytest.approx(0.07, abs=1e-6))
        assert obstacles.deepest(np.array([[3.0, 0.5, 0.5]]), np.array([0.1])) == (0.0, "")
        assert obstacles.without(["far"]).deepest(centers, np.array([0.1, 0.1]))[1] == "near"
        # 0.5 m to every side, beyond the depth that is noticed; 0.2 m behind a side it is in the solid, and not at its surface.
        assert obstacles.depth(middle - [0.3, 0.0, 0.0], np.array([0.05])) == pytest.approx(
            0.25 if solid else 0.0, abs=1e-6
        )


@pytest.mark.parametrize("solid", [True, False])
def test_there_may_be_no_obstacle(solid: bool) -> None:
    nothing = Obstacles([], solid=solid)
    assert nothing.deepest(np.zeros((1, 3)), np.ones(1)) == (0.0, "")
    np.testing.assert_array_equal(nothing.depth(np.zeros((2, 3, 3)), np.ones(3)), [0.0, 0.0])
    height, _ = nothing.below(np.zeros((1, 3)))
    assert height[0] == -np.inf


@pytest.mark.parametrize(("ball", "depth"), [((0.2, 0.0, 0.1), 0.02), ((0.0, 0.0, 0.33), 0.07), ((0.0, 0.0, 0.5), 0.0)])
def test_a_column_is_upright_under_a_foot(ball: tuple[float, float, float], depth: float) -> None:
    nothing = Obstacles([], solid=False)
    stand = nothing.with_column(np.array([0.0, 0.0, 0.3]), 0.3, 0.12)
    assert stand.deepest(np.array([ball]), np.array([0.1]))[0] == pytest.approx(depth, abs=1e-9)
    assert stand.depth(np.array([ball]), np.array([0.1])) == pytest.approx(depth, abs=1e-9)
    assert nothing.deepest(np.array([ball]), np.array([0.1]))[0] == 0.0


@pytest.mark.parametrize(
    ("degrees", "height", "rests"), [(0.0, 0.05, True), (4.0, 0.05, True), (4.0, 0.6, False), (9.0, 0.05, False)]
)
def test_an_object_leans_as_what_carries_it_unless_it_slides_or_falls_over(
    degrees: float, height: float, rests: bool
) -> None:
    """A block 5 cm wide on a slope of 1 by 1 m that rises along x; 0.6 m high it is 4.8 degrees from falling over."""
    turn = trimesh.transformations.rotation_matrix(np.radians(-degrees), [0.0, 1.0, 0.0])[:3, :3]
    slope = convex.box(turn @ [0.0, 0.0, -0.05], turn, np.array([1.0, 1.0, 0.1]))
    block = convex.box(np.zeros(3), np.eye(3), np.array([0.05, 0.05, height]))
    spots = np.array([[x, y] for x in (-0.2, -0.12) for y in (0.0, 0.04)])
    each = list(uneven_rests(Obstacles([("slope", slope)], solid=True), "slope", block, np.zeros(3), spots, 1.0))
    assert [k for k, *_ in each] == ([0, 1, 2, 3] if rests else [])
    for k, lean, z in each:
        np.testing.assert_allclose(np.degrees(lean.as_rotvec()), [0.0, -degrees, 0.0], atol=0.1)
        assert z == pytest.approx(spots[k, 0] * np.tan(np.radians(degrees)) + height / 2, abs=1e-3)


def test_an_object_rests_on_three_bumps_around_its_middle_and_on_no_edge() -> None:
    """Bumps 8, 8 and 12 mm high below three corners of a block of 10 cm; a table that ends below its middle."""
    bumps = [(0.04, 0.04, 0.008), (0.04, -0.04, 0.008), (-0.04, 0.0, 0.012)]
    named = [("table", convex.box(np.array([x, y, h / 2]), np.eye(3), np.array([0.02, 0.02, h]))) for x, y, h in bumps]
    table = convex.box(np.array([0.0, 0.0, -0.01]), np.eye(3), np.array([1.0, 1.0, 0.02]))
    block = convex.box(np.zeros(3), np.eye(3), np.array([0.1, 0.1, 0.04]))
    near = Obstacles([("table", table), *named], solid=True)
    ((_, lean, z),) = uneven_rests(near, "table", block, np.zeros(3), np.zeros((1, 2)), 1.0)
    assert np.degrees(lean.as_rotvec()[1]) == pytest.approx(
        np.degrees(4 / 60), abs=1.0
    )  # between 4 mm in 6 and in 10 cm
    assert 0.02 + 0.008 < z < 0.02 + 0.012
    edge = np.array([[0.49, 0.0], [0.53, 0.0]])
    assert not list(uneven_rests(near, "table", block, np.zeros(3), edge, 1.0))
