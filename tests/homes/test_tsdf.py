"""Panoramas become one surface: where it was measured, and nowhere else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from s2a.homes.panorama import NoiseConfig, View, cast_panorama, measure, pixel_tangents
from s2a.homes.scanner import FusionConfig, fuse, project_to_scan
from s2a.homes.solids import box, join, rotation, translation
from s2a.scene.geometry.mesh_ops import normals, sample_with_faces
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.geometry.surface_nets import Net, extract
from s2a.scene.scene import Mesh

EXACT = NoiseConfig(
    white=0.0,
    correlated=0.0,
    correlation=0.1,
    registration=0.0,
    grazing_cutoff=0.0,
    tripod_blind_cone=np.pi / 2,
    max_elevation=2.0,
)
FUSION = FusionConfig(voxel=0.02, truncation=3.0, reach=1.3, depth=9.0)
GREY = (200, 200, 200)
SPACING = 0.008
SPAN = (-0.5, 0.5)


def panorama(yaw: float, place: tuple[float, float, float], noise: NoiseConfig = EXACT, seed: int = 0) -> np.ndarray:
    """Return what a scanner sees inside a cube of 1 m that stands at a yaw [rad]; ranges [m], shape [pixel]."""
    cube = box(SPAN, SPAN, SPAN, (200, 200, 200))
    pose = rotation((0.0, 0.0, -yaw)) @ translation(place)
    mesh = ray_mesh(cube.vertices, cube.faces)
    return cast_panorama(mesh, cube.dropout, pose, SPACING, noise, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def views() -> list[View]:
    """The inside of the cube at a yaw of 0.4, scanned from two places."""
    places = np.array([(0.1, 0.0, 0.05), (-0.15, 0.1, -0.1)])
    return measure([panorama(0.4, tuple(place)) for place in places], places, SPACING)


@pytest.fixture(scope="module")
def net(views: list[View]) -> Net:
    """What is fused of it."""
    return extract(fuse(views, np.array([(-0.8,) * 3, (0.8,) * 3]), FUSION))


def test_pixels_are_almost_evenly_spaced() -> None:
    steps = np.diff(np.arctan(pixel_tangents(0.01)))
    assert 0.8 < steps.min() / steps.mean() < steps.max() / steps.mean() < 1.25


def test_ranges_are_distances_along_the_ray() -> None:
    """From the middle of a cube of 1 m: half a metre to a face, half the root of 3 to a corner."""
    ranges = panorama(0.0, (0.0, 0.0, 0.0))
    assert abs(ranges.min() - 0.5) < 1e-4
    assert np.sqrt(3) / 2 - 0.01 < ranges.max() < np.sqrt(3) / 2 + 1e-6


def test_a_turned_scanner_sees_what_a_turned_room_shows(net: Net) -> None:
    """Without noise the surface lies on the cube to a tenth of a voxel, except along its edges, which are rounded."""
    cube = box(SPAN, SPAN, SPAN, (200, 200, 200)).moved(rotation((0.0, 0.0, 0.4)))
    gap = nearest_faces(ray_mesh(cube.vertices, cube.faces), net.points)[1]
    inside = np.abs(net.points @ rotation((0.0, 0.0, 0.4))[:3, :3])
    flat = (inside < 0.5 - 3 * FUSION.voxel).sum(axis=1) == 2
    assert flat.sum() > 5000
    assert gap[flat].max() < 0.1 * FUSION.voxel


def test_faces_look_at_free_space(net: Net) -> None:
    a, b, c = np.moveaxis(net.points[net.faces].astype(np.float64), 1, 0)
    towards = -((a + b + c) / 3)
    assert (np.einsum("ij,ij->i", np.cross(b - a, c - a), towards) > 0.0).mean() > 0.999


def test_a_closed_room_gives_a_closed_surface(net: Net) -> None:
    edges = np.sort(net.faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    _, uses = np.unique(edges, axis=0, return_counts=True)
    assert (uses == 2).mean() > 0.99


def test_the_noise_has_the_stated_size() -> None:
    noise = NoiseConfig(
        white=0.0005,
        correlated=0.0012,
        correlation=0.05,
        registration=0.0,
        grazing_cutoff=0.0,
        tripod_blind_cone=np.pi / 2,
        max_elevation=2.0,
    )
    error = panorama(0.0, (0.0, 0.0, 0.0), noise) - panorama(0.0, (0.0, 0.0, 0.0))
    assert abs(error.std() / np.hypot(0.0005, 0.0012) - 1.0) < 0.15
    assert abs(error.mean()) < 0.0003


def test_nothing_returns_from_below_the_tripod() -> None:
    noise = replace(EXACT, tripod_blind_cone=np.pi / 4)
    ranges = panorama(0.0, (0.0, 0.0, 0.0), noise)
    lost = (ranges == 0.0).mean()
    assert 0.10 < lost < 0.20, "a cap of 45 degrees covers 14.6 % of the sphere"


def test_nothing_returns_from_above_the_highest_elevation() -> None:
    ranges = panorama(0.0, (0.0, 0.0, 0.0), replace(EXACT, max_elevation=np.pi / 4))
    assert 0.10 < (ranges == 0.0).mean() < 0.20, "a cap of 45 degrees covers 14.6 % of the sphere"
    assert (panorama(0.0, (0.0, 0.0, 0.0), EXACT) > 0.0).all(), "a laser sees its zenith"


def test_what_lies_deep_in_a_shadow_is_not_taken_for_filled() -> None:
    """A bar of 0.08 m stands 0.16 m before a wall, seen from above: its plane, drawn on, would fill the gap."""
    whole = join(
        box((0.5, 0.6), (-1, 1), (-1, 1), (200, 200, 200)),
        box((0.26, 0.34), (-0.3, 0.3), (-0.04, 0.04), (200, 200, 200)),
    )
    place = np.array([(-0.5, 0.0, 0.5)])
    pose, mesh = translation(tuple(place[0])), ray_mesh(whole.vertices, whole.faces)
    seen = [cast_panorama(mesh, whole.dropout, pose, SPACING, EXACT, np.random.default_rng(0))]

    def phantoms(depth: float) -> int:
        config = replace(FUSION, depth=depth, truncation=5.0)
        points = extract(fuse(measure(seen, place, SPACING), np.array([(-0.8,) * 3, (0.8,) * 3]), config)).points
        off = nearest_faces(mesh, points)[1] > 1.5 * FUSION.voxel
        return int((off & (points[:, 0] > 0.34) & (points[:, 0] < 0.5)).sum())

    assert phantoms(3.0) < 0.5 * phantoms(12.0)


BAR = 0.012
"""[m] Depth and height of a bar that stands 40 mm before a wall."""


@pytest.fixture(scope="module")
def bar() -> tuple[Net, list[View]]:
    """The bar, in voxels half as large as itself, and the four panoramas that it was fused from, at a demo scan's spacing."""
    whole = join(
        box((0.0, 0.02), (-0.5, 0.5), (-0.3, 0.3), GREY),
        box((-0.04 - BAR, -0.04), (-0.4, 0.4), (-BAR / 2, BAR / 2), GREY),
    )
    places = np.array([(-1.3, -0.9, 0.8), (-1.2, 0.9, 0.6), (-2.0, -0.5, 0.5), (-1.6, 0.1, 0.9)])
    mesh, turn = ray_mesh(whole.vertices, whole.faces), rotation((0.0, 0.0, -0.4))
    turned = places @ turn[:3, :3]
    poses = [turn @ translation(tuple(place)) for place in turned]
    seen = [cast_panorama(mesh, whole.dropout, pose, 0.0025, EXACT, np.random.default_rng(0)) for pose in poses]
    fusion = FusionConfig(voxel=BAR / 2, truncation=3.0, reach=1.3, depth=3.0)
    views = measure(seen, turned, 0.0025)
    return extract(fuse(views, np.array([(-0.7,) * 3, (0.7,) * 3]), fusion)), views


def outward_bias(net: Net) -> float:
    """Return how far the bar's scanned front stands before its true one on average [m]; negative: within."""
    placed = Mesh(net.points @ rotation((0.0, 0.0, -0.4))[:3, :3].T, net.faces)
    points, faces = sample_with_faces(placed, 400_000, seed=0)
    front = (normals(placed)[faces][:, 0] < -0.7) & (points[:, 0] < -0.045) & (np.abs(points[:, 1]) < 0.35)
    return float((-0.04 - BAR - points[front, 0]).mean())


def test_a_thin_bar_is_drawn_onto_what_was_measured(bar: tuple[Net, list[View]]) -> None:
    net, views = bar
    before, after = outward_bias(net), outward_bias(project_to_scan(net, views, BAR / 2))
    assert before < -0.0015, "nets and rays that pass beside it make it thinner"
    assert abs(after) < 0.4 * abs(before)


def test_walls_stay_where_the_field_has_them(net: Net, views: list[View]) -> None:
    moved = np.linalg.norm(project_to_scan(net, views, FUSION.voxel).points - net.points, axis=1)
    assert np.median(moved) < 0.01 * FUSION.voxel


def test_what_nothing_was_measured_near_stays(bar: tuple[Net, list[View]]) -> None:
    net, views = bar
    blind = [replace(view, ranges=wp.zeros_like(view.ranges)) for view in views]
    assert np.array_equal(project_to_scan(net, blind, BAR / 2).points, net.points)
    assert not np.array_equal(project_to_scan(net, views, BAR / 2).points, net.points)
