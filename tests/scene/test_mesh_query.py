"""Rays and closest points on meshes."""

from __future__ import annotations

import gc

import numpy as np
import pytest

from s2a.scene.geometry import mesh_query
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import Forest, first_hits, kept_ray_mesh, nearest_faces, nearest_meshes, ray_mesh
from s2a.scene.scene import Mesh


def test_the_nearest_face_and_the_first_hit_of_a_triangle() -> None:
    surface = ray_mesh(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], float), np.array([[0, 1, 2]]))
    face, gap = nearest_faces(surface, np.array([[0.2, 0.2, 0.3], [0.2, 0.2, 5.0]]), 1.0)
    assert face.tolist() == [0, -1] and gap.tolist() == [pytest.approx(0.3, abs=1e-6), np.inf]
    down = np.tile([0.0, 0.0, -1.0], (2, 1))
    assert first_hits(surface, np.array([[0.2, 0.2, 1.0], [0.9, 0.9, 1.0]]), down).tolist() == [1.0, np.inf]


def test_a_mesh_without_faces_is_met_by_nothing() -> None:
    nothing = ray_mesh(np.zeros((0, 3)), np.zeros((0, 3), int))
    face, _ = nearest_faces(nothing, np.zeros((3, 3)))
    assert face.tolist() == [-1, -1, -1]
    assert np.isinf(first_hits(nothing, np.zeros((3, 3)), np.tile([1.0, 0.0, 0.0], (3, 1)))).all()


def _soup(random: np.random.Generator, count: int) -> Mesh:
    """Return loose triangles of up to 0.2 m in a cube of 2 m."""
    corners = random.uniform(-1.0, 1.0, (count, 1, 3)) + random.uniform(-0.1, 0.1, (count, 3, 3))
    return Mesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3))


def test_several_meshes_answer_as_one() -> None:
    random = np.random.default_rng(0)
    meshes = [_soup(random, count) for count in (50, 1, 200)]
    whole, owner = merge(meshes), np.repeat([0, 1, 2], [50, 1, 200])
    tree, forest = ray_mesh(whole.vertices, whole.faces), Forest(meshes)
    points = random.uniform(-1.2, 1.2, (500, 3))
    face, gap = nearest_faces(tree, points, 0.2)
    index, away = nearest_meshes(forest, points, 0.2)
    assert (face < 0).any() and (face >= 0).any()
    assert np.array_equal(index, np.where(face >= 0, owner[face], -1)) and np.array_equal(away, gap)
    ahead = random.normal(size=(500, 3))
    ahead /= np.linalg.norm(ahead, axis=1, keepdims=True)
    assert np.array_equal(first_hits(forest, points, ahead), first_hits(tree, points, ahead))


def test_no_meshes_are_met_by_nothing() -> None:
    nothing = Forest([Mesh(np.zeros((0, 3)), np.zeros((0, 3), int))])
    assert np.isinf(first_hits(nothing, np.zeros((2, 3)), np.eye(3)[:2])).all()


def test_a_search_tree_is_built_once_and_goes_with_its_mesh() -> None:
    mesh = _soup(np.random.default_rng(0), 3)
    tree, key = kept_ray_mesh(mesh), id(mesh)
    assert kept_ray_mesh(mesh) is tree and key in mesh_query._kept
    del mesh
    gc.collect()
    assert key not in mesh_query._kept
