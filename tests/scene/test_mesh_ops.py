"""Cutting, merging, flattening and asking surfaces."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh
from closeness import surface_distance

from s2a.scene.geometry import convex, mesh_ops, planes
from s2a.scene.geometry.front_panel import fraction_inside
from s2a.scene.geometry.simplify import decimate, is_structure
from s2a.scene.scene import BLOCK, Mesh


def rough_wall(width: float, height: float, noise: float, step: float = 0.02) -> Mesh:
    """Return an upright rough surface that looks along -y, its left third red."""
    x, z = np.meshgrid(np.arange(0, width, step), np.arange(0, height, step), indexing="ij")
    rough = np.random.default_rng(0).normal(scale=noise, size=x.shape)
    points = np.stack([x, 2.0 + rough, z], axis=-1).reshape(-1, 3)
    index = np.arange(x.size).reshape(x.shape)
    a, b, c, d = (s.ravel() for s in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    colors = np.where(points[:, :1] < width / 3, [[200, 0, 0]], [[0, 0, 200]])
    return Mesh(points, np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)]), colors)


def test_merging_keeps_faces_and_makes_colourless_parts_grey() -> None:
    wall = rough_wall(0.2, 0.2, 0.0)
    plain = Mesh(wall.vertices + 1, wall.faces)
    both = mesh_ops.merge([wall, plain])
    assert both.face_areas.sum() == pytest.approx(2 * wall.face_areas.sum())
    assert both.colors is not None
    assert (both.colors[len(wall.vertices) :] == mesh_ops.GREY).all()


def test_welding_undoes_the_cut_into_parts() -> None:
    wall = rough_wall(0.4, 0.4, 0.001)
    left = mesh_ops.centroids(wall)[:, 0] < 0.2
    cut = mesh_ops.merge([mesh_ops.keep(wall, left), mesh_ops.keep(wall, ~left)])
    assert len(cut.vertices) > len(wall.vertices)
    assert len(mesh_ops.weld(cut).vertices) == len(wall.vertices)


def test_samples_lie_on_the_surface_as_densely_everywhere() -> None:
    wall = rough_wall(0.3, 0.3, 0.0)
    points = mesh_ops.sample(wall, 9000, seed=0)
    assert np.ptp(points[:, 1]) < 1e-6
    assert np.histogram(points[:, 0], 3)[0] == pytest.approx([3000] * 3, rel=0.1)


@pytest.mark.parametrize("ratio", [0.1, 0.3])
def test_decimation_reaches_its_ratio_and_stays_near_the_surface(ratio: float) -> None:
    wall = rough_wall(2.0, 2.0, 0.001)
    less = decimate(wall, ratio, 3.0)
    assert len(less.faces) == pytest.approx(ratio * len(wall.faces), rel=0.01)
    assert np.abs(less.vertices[:, 1] - 2.0).max() < 0.006
    assert less.face_areas.sum() == pytest.approx(4.0, rel=0.05)


def test_a_wall_cabinet_is_no_wall() -> None:
    labels = ("wall", "floor", "ceiling")
    assert is_structure("wall", labels) and is_structure("Office_Floor", labels)
    assert not any(is_structure(label, labels) for label in ("wall cabinet", "floor lamp", "whiteboard", ""))


def test_a_rough_wall_becomes_one_box_behind_its_surface() -> None:
    wall = rough_wall(1.0, 0.8, 0.002)
    (plane,) = planes.find_planes(wall, 0.02, min_area=0.05, count=4)
    assert plane.normal == pytest.approx([0, -1, 0], abs=0.01)
    (box,) = planes.slabs(wall, plane, 0.05, closing=1, thickness=0.02, count=4)
    assert box.bounds == pytest.approx(np.array([[0, 2.0, 0], [1.0, 2.02, 0.8]]), abs=0.06)
    assert box.bounds[0, 1] == pytest.approx(2.0, abs=0.001)


def test_a_door_opening_stays_open() -> None:
    wall = rough_wall(3.0, 2.0, 0.0)
    middle = mesh_ops.centroids(wall)
    wall = mesh_ops.keep(wall, (np.abs(middle[:, 0] - 1.5) > 0.5) | (middle[:, 2] > 1.8))
    (plane,) = planes.find_planes(wall, 0.02, min_area=0.05, count=4)
    boxes = planes.slabs(wall, plane, 0.05, closing=3, thickness=0.02, count=8)
    assert fraction_inside(boxes, np.array([[x, 2.01, z] for x in (1.1, 1.5, 1.9) for z in (0.3, 1.0, 1.6)])) == 0.0
    assert fraction_inside(boxes, np.array([[x, 2.01, z] for x in (0.3, 2.7) for z in (0.3, 1.0, 1.6)])) == 1.0


def test_a_floor_in_a_turned_room_becomes_one_box() -> None:
    flat = rough_wall(1.0, 0.6, 0.001)
    turn = trimesh.transformations.rotation_matrix(0.5, [0, 0, 1])[:3, :3]
    floor = Mesh(np.stack([flat.vertices[:, 0], flat.vertices[:, 2], 2 - flat.vertices[:, 1]], 1) @ turn.T, flat.faces)
    (plane,) = planes.find_planes(floor, 0.02, min_area=0.05, count=4)
    assert plane.normal[2] > 0.99
    boxes = planes.slabs(floor, plane, 0.05, closing=1, thickness=0.02, count=4)
    assert convex.volume(boxes[0]) == pytest.approx(0.6 * 0.02, rel=0.15)


def test_rectangles_cover_an_l_by_two() -> None:
    cells = np.zeros((6, 6), bool)
    cells[:, :2] = cells[4:, :] = True
    found = planes.rectangles(cells, 5, min_fraction=1.0)
    covered = np.zeros_like(cells)
    for first, last in found:
        covered[first[0] : last[0], first[1] : last[1]] = True
    assert len(found) == 2
    assert (covered == cells).all()


def test_distance_from_a_union_ignores_surfaces_inside_of_it() -> None:
    cubes = [convex.box(np.array([x, 0, 0]), np.eye(3), np.ones(3)) for x in (0.0, 0.5)]
    points = np.array([[0.25, 0, 0], [1.5, 0, 0], [-0.6, 0, 0.6]])
    assert surface_distance(cubes, points)[1:] == pytest.approx([0.5, np.hypot(0.1, 0.1)], abs=1e-6)
    assert surface_distance(cubes, points)[0] >= 0.25 - 1e-6


def test_a_box_takes_the_faces_whose_own_boxes_meet_it() -> None:
    random = np.random.default_rng(0)
    corners = random.uniform(-1.0, 1.0, (400, 1, 3)) + random.uniform(-0.3, 0.3, (400, 3, 3))
    mesh = Mesh(corners.reshape(-1, 3), np.arange(1200).reshape(-1, 3))
    low, high = np.array([-0.5, -0.2, -np.inf]), np.array([0.1, 0.6, 0.3])
    triangles = mesh.vertices[mesh.faces]
    meets = ((triangles.min(axis=1) <= high) & (triangles.max(axis=1) >= low)).all(axis=1)
    found = mesh_ops.within(mesh, low, high)
    assert 0 < meets.sum() < 400
    assert np.array_equal(found.vertices[found.faces], triangles[meets])
    assert np.array_equal(np.unique(found.faces), np.arange(len(found.vertices)))


def test_areas_and_normals_do_not_depend_on_how_many_faces_are_measured_at_a_time() -> None:
    # One triangle of sides 3 and 4 in the plane x = 0, more often than a block holds.
    mesh = Mesh([[0, 0, 0], [0, 3, 0], [0, 0, 4]], np.tile([[0, 1, 2]], (BLOCK + 3, 1)))
    assert (mesh.face_areas == 6.0).all() and len(mesh.face_areas) == BLOCK + 3
    assert (mesh_ops.normals(mesh) == [1.0, 0.0, 0.0]).all()
    assert mesh_ops.normals(mesh, np.array([BLOCK + 2, 0])).tolist() == [[1.0, 0.0, 0.0]] * 2
