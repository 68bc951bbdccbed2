"""Pictures show the scan's colours, and what moved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import TRAVEL, write_cabinet
from settings import load

from s2a import robot
from s2a.scene.geometry.mesh_ops import BLOCK, bake, merge
from s2a.scene.geometry.mesh_query import ray_mesh
from s2a.scene.scene import Mesh
from s2a.scene.usd import sim_stage
from s2a.sim.camera import Camera, CameraConfig, blocked, viewpoint
from s2a.sim.world import read_stage


def test_the_texture_holds_each_corner_in_its_color() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 30]], dtype=np.uint8)
    uv, texture = bake(faces, colors)
    assert texture.shape == (2 * BLOCK, 2 * BLOCK, 4)
    size = len(texture)
    # A texture's v points up, its rows go down; a corner lies in the middle of its texel.
    found = [texture[int((1.0 - v) * size), int(u * size), :3].tolist() for u, v in uv]
    assert found == colors[faces.ravel()].tolist()


@pytest.mark.slow
def test_a_picture_changes_where_the_drawer_moved(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    start = robot.load(stage.robot).start
    camera = Camera(stage, replace(load(CameraConfig, "camera/default"), width=96, height=64))
    closed, opened = (camera.image(torch.tensor([*start, q])) for q in (0.0, TRAVEL))
    assert closed.shape == (64, 96, 3)
    assert np.array_equal(closed, camera.image(torch.tensor([*start, 0.0])))
    changed = (closed != opened).any(axis=2).mean()
    assert 0.005 < changed < 0.5


def test_a_wall_hides_what_is_behind_it_and_nothing_else() -> None:
    wall = ray_mesh(np.array([[1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 2.0]]), np.array([[0, 1, 2]]))
    eye, behind = np.array([0.0, 0.0, 0.5]), np.array([2.0, 0.0, 0.5])
    assert blocked(eye, behind[None], wall).all() and blocked(behind, eye[None], wall).all()
    # Before the wall, the surface that is looked at, above it.
    assert not blocked(eye, np.array([[0.9, 0.0, 0.5], [1.04, 0.0, 0.5], [2.0, 0.0, 5.0]]), wall).any()


def test_the_camera_goes_where_no_wall_stands_between(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    asked = (2.0, 1.1, 0.45)
    free, middle = viewpoint(stage, *asked)
    away = free - middle
    assert abs(np.linalg.norm(away) - 2.0) < 1e-9
    # A wall through the middle of that way sends it to the other side.
    side = np.cross(away, [0.0, 0.0, 1.0])
    place = middle + 0.5 * away
    corners = np.array([place - side, place + side, place + [0.0, 0.0, 3.0], place - [0.0, 0.0, 3.0]])
    room = sim_stage.read(stage.path)
    wall = Mesh(corners, [[0, 1, 2], [0, 3, 1]])
    sim_stage.write(replace(room, static_visual=merge([room.static_visual, wall])), tmp_path / "walled.usda")
    walled = read_stage(tmp_path / "walled.usda")
    found, _ = viewpoint(walled, *asked)
    assert np.linalg.norm(found - free) > 0.3
    assert not blocked(found, stage.grasp[None, :3], ray_mesh(wall.vertices, wall.faces)).any()
