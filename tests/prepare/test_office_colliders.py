"""The colliders of a virtual scan's drawers, measured against what was scanned."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from closeness import gap_points, surface_distance
from settings import load

from s2a.prepare.grasp import find_grasp, find_target
from s2a.prepare.part_hulls import find_handle, target_colliders
from s2a.prepare.room import PrepareConfig
from s2a.scene.geometry.front_panel import fraction_inside
from s2a.scene.geometry.mesh_ops import merge, sample
from s2a.scene.scene import Scene
from s2a.scene.usd import geometric
from s2a.scene.usd.sim_scene import Grasp

DRAWERS = ("drawer_15", "drawer_16")
"""Two of the demo's cabinet, with rails."""


@pytest.fixture(scope="module")
def truth(office_scan: Path) -> Scene:
    return geometric.read(office_scan / "truth" / "truth.usda")


@pytest.mark.parametrize("target", DRAWERS)
def test_the_true_finger_gap_is_free_though_the_scan_closed_part_of_it(
    target: str, office: Scene, truth: Scene
) -> None:
    found = find_target(office, target)
    colliders = target_colliders(found, *find_handle(found), _settings())
    # The truth is asked about the grasp that was found in the scan.
    space = find_handle(find_target(truth, target, grasp=_grasped(truth, target, found.grasp)))[0].space
    assert space.behind is not None
    assert space.boxes and fraction_inside([collider.mesh for collider in colliders], gap_points(space)) <= 0.01
    assert len(colliders) <= 32


@pytest.mark.parametrize("target", DRAWERS)
def test_pieces_are_no_farther_from_the_true_handle_than_the_scan_is(target: str, office: Scene, truth: Scene) -> None:
    found = find_target(office, target)
    colliders = target_colliders(found, *find_handle(found), _settings())
    grasped = office.grasp_parts(target)
    true = merge([truth.parts[i].mesh for i in grasped])
    pieces = [collider.mesh for collider in colliders if collider.part in grasped]
    points = sample(merge([office.parts[i].mesh for i in grasped]), 3000, 0)
    scan_error = np.linalg.norm(sample(true, 500, 1)[:, None] - points[None], axis=2).min(axis=1).mean()
    assert surface_distance(pieces, sample(true, 500, 1)).mean() <= scan_error


@pytest.mark.parametrize("target", DRAWERS)
def test_the_rail_is_measured_as_thick_as_it_is(target: str, office: Scene, office_scan: Path) -> None:
    (handle,) = (i for i in office.grasp_parts(target) if i != target)
    facts = json.loads((office_scan / "truth/truth.json").read_text())["parts"][handle]["facts"]
    assert find_grasp(office, target).size[1] == pytest.approx(facts["width"], abs=0.003)


def _grasped(scene: Scene, target: str, grasp: Grasp) -> Grasp:
    """Return a grasp of the same orientation of another scene's part."""
    point = tuple(map(float, scene.grasp_point(target)))
    return replace(grasp, point=point, region=merge([scene.parts[i].mesh for i in scene.grasp_parts(target)]))


def _settings():  # noqa: ANN202
    return load(PrepareConfig, "prepare/handle").colliders
