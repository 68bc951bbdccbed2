"""Pictures show the scan's colours, and what moved."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import torch
from cabinet import TRAVEL, write_cabinet
from settings import load

from s2a.sim.build import read_stage
from s2a.sim.camera import BLOCK, Camera, CameraConfig, bake
from s2a.sim.simulation import SimConfig


def test_the_texture_holds_each_corner_in_its_color() -> None:
    faces = np.array([[0, 1, 2], [2, 1, 3]])
    colors = np.array([[255, 0, 0], [0, 255, 0], [0, 0, 255], [10, 20, 30]], dtype=np.uint8)
    uv, texture = bake(faces, colors)
    assert texture.shape == (2 * BLOCK, 2 * BLOCK, 4)
    size = len(texture)
    # A texture's v points up, its rows go down; a corner lies in the middle of its texel.
    found = [texture[int((1.0 - v) * size), int(u * size), :3].tolist() for u, v in uv]
    assert found == colors[faces.ravel()].tolist()


def test_a_picture_changes_where_the_drawer_moved(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    robot = load(SimConfig, "sim/planner").robot
    camera = Camera(stage, robot, replace(load(CameraConfig, "camera/default"), width=96, height=64))
    closed, opened = (camera.picture(torch.tensor([*robot.start, q])) for q in (0.0, TRAVEL))
    assert closed.shape == (64, 96, 3)
    assert np.array_equal(closed, camera.picture(torch.tensor([*robot.start, 0.0])))
    changed = (closed != opened).any(axis=2).mean()
    assert 0.005 < changed < 0.5
