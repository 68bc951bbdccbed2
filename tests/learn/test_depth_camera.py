"""Frames of a cabinet's drawer: points on its surfaces, a mask of the drawer alone, errors of known size."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, box, write_cabinet
from settings import load

from s2a.learn.perception import depth_camera
from s2a.learn.perception.depth_camera import FLAT, DepthCameraConfig, PartCloud, VisibleRoom, capture, sample
from s2a.robot.tool_path import matrices
from s2a.scene.geometry.mesh_query import nearest_faces, ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.sim.world import SimStage, read_stage

FRONT = 0.32465
"""[m] Plane of the drawer's front, x in the scene."""


def exact(**changes: object) -> DepthCameraConfig:
    return load(
        DepthCameraConfig,
        "depth_camera/default",
        **{"noise": 0.0, "calibration_shift": 0.0, "calibration_turn": 0.0, **changes},
    )


def scene(tmp_path: Path, **more: object) -> tuple[VisibleRoom, SimStage]:
    path = write_cabinet(tmp_path / "room.usda", **more)  # type: ignore[arg-type]
    return VisibleRoom(sim_stage.read(path)), read_stage(path)


def in_scene(stage: SimStage, points: np.ndarray) -> np.ndarray:
    base = matrices(stage.base[None])[0]
    return points @ base[:3, :3].T + base[:3, 3]


def distance(mesh: Mesh, points: np.ndarray) -> np.ndarray:
    return nearest_faces(ray_mesh(mesh.vertices, mesh.faces), points)[1]


def frame(room: VisibleRoom, stage: SimStage, config: DepthCameraConfig, seed: int = 0) -> PartCloud:
    found = capture(room, stage, config, np.random.default_rng(seed))
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(4))
def test_without_errors_the_masked_points_lie_on_the_drawer_and_the_others_do_not(tmp_path: Path, seed: int) -> None:
    room, stage = scene(tmp_path)
    found, drawer = frame(room, stage, exact(), seed), room.surface("drawer_2")
    assert drawer is not None
    points = in_scene(stage, found.points)
    assert distance(drawer, points[found.is_part]).max() < 1e-3
    assert np.median(distance(drawer, points[~found.is_part])) > 0.01
    assert found.is_part.sum() > 2000
    near_handle = np.linalg.norm(points[found.is_part] - HANDLE, axis=1) < 0.08
    assert near_handle.sum() > 50, "the camera stands where it sees the handle"


def test_depth_errors_grow_with_the_square_of_the_distance(tmp_path: Path) -> None:
    room, stage = scene(tmp_path)
    near = {"distance": (1.0, 1.0), "azimuth": 0.0, "elevation": (0.0, 0.0), "aim_error": 0.0}
    for far, expected in ((1.0, 0.004), (2.0, 0.016)):
        found = frame(room, stage, exact(**near | {"noise": 0.004, "distance": (far, far)}))
        x = in_scene(stage, found.points)[found.is_part, 0]
        on_front = np.abs(x - FRONT) < 4.0 * expected
        # The camera looks along x, and the front is some 7 mm nearer to it than the drawer's middle.
        assert np.std(x[on_front]) == pytest.approx(expected, rel=0.2)


def test_a_calibration_error_moves_all_points_alike(tmp_path: Path) -> None:
    room, stage = scene(tmp_path)
    shifted = frame(room, stage, exact(calibration_shift=0.02))
    x = in_scene(stage, shifted.points)[shifted.is_part, 0]
    front = x[np.abs(x - np.median(x)) < 0.004]
    assert np.std(front) < 1e-3 < abs(np.median(front) - FRONT)


def test_what_stands_before_the_drawer_hides_it(tmp_path: Path) -> None:
    hidden = [box((0.6, 0.0, 0.8), (0.01, 3.0, 0.8)), box((0.0, 0.0, 1.7), (1.0, 3.0, 0.01))]
    room, stage = scene(tmp_path, beside=hidden)
    behind = replace(stage, base=np.array([1.2, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]))
    assert depth_camera.take(room, behind, exact(), 2, seed=0) == []


def test_the_robot_is_not_among_the_points(tmp_path: Path) -> None:
    room, stage = scene(tmp_path)
    found = frame(room, stage, exact())
    everything = [room.surface(name) for name in ("drawer_2", "cabinet_1")]
    points = in_scene(stage, found.points)
    on_furniture = np.min([distance(each, points) for each in everything if each is not None], axis=0) < 1e-3
    on_walls = np.minimum(np.abs(points[:, 2]), np.abs(points[:, 0] + 0.48)) < 1e-3
    assert (on_furniture | on_walls).all()


def test_a_cloud_has_as_many_points_as_asked_the_handle_among_them_and_tells_its_height(tmp_path: Path) -> None:
    room, stage = scene(tmp_path)
    found = frame(room, stage, exact())
    cloud = sample(found, 512, np.random.default_rng(0))
    assert cloud.points.shape == (512, 3) and cloud.height.shape == (512,)
    points = in_scene(stage, cloud.points.astype(float) + cloud.center)
    out = points[:, 0] - FRONT
    assert np.abs(cloud.height[cloud.is_part] - out[cloud.is_part]).max() < 2e-3
    share = (cloud.height[cloud.is_part] > FLAT).mean()
    assert share > 2.0 * (in_scene(stage, found.points)[found.is_part, 0] > FRONT + FLAT).mean(), (
        "more than their share"
    )


def test_a_part_of_a_few_pixels_is_repeated_to_as_many_points() -> None:
    few = PartCloud(np.random.default_rng(0).normal(size=(5, 3)), np.array([True, True, True, False, False]))
    assert sample(few, 64, np.random.default_rng(0)).points.shape == (64, 3)


def test_frames_are_read_as_they_were_written_and_come_again_for_the_same_seed(tmp_path: Path) -> None:
    room, stage = scene(tmp_path)
    once, again = (depth_camera.take(room, stage, exact(points=128), 2, seed=3) for _ in range(2))
    depth_camera.save(once, tmp_path / "frames.npz")
    for known, other, read in zip(once, again, depth_camera.load(tmp_path / "frames.npz"), strict=True):
        for name in depth_camera.NAMES:
            assert (getattr(known, name) == getattr(other, name)).all()
            assert (getattr(known, name) == getattr(read, name)).all()
