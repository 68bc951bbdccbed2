"""Recordings of a box-shaped room, z up and in metres, in every layout; the camera walks round its middle and looks out."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from PIL import Image

SIZE = np.array([4.0, 3.0, 2.5])
WIDTH, HEIGHT, FOCAL = 160, 120, 120.0
RED, GREY = (200, 40, 30), (150, 150, 150)
"""RGB of the floor and of all else."""


def poses(count: int) -> list[np.ndarray]:
    """Return cameras [4 4] near the middle of the room, x right, y down, z forward, that turn once and look up and down."""
    result = []
    for index in range(count):
        yaw, pitch = 2 * np.pi * index / count, 0.5 * np.sin(3.0 * index)
        forward = np.array([np.cos(yaw) * np.cos(pitch), np.sin(yaw) * np.cos(pitch), np.sin(pitch)])
        right = np.array([np.sin(yaw), -np.cos(yaw), 0.0])
        pose = np.eye(4)
        pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], axis=1)
        pose[:3, 3] = [2.0 - 0.4 * np.cos(yaw), 1.5 - 0.4 * np.sin(yaw), 1.3]
        result.append(pose)
    return result


def image(pose: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the depth [m], shape [row column], and the colours, shape [row column 3], that a camera in the room sees."""
    rows, columns = np.mgrid[0:HEIGHT, 0:WIDTH]
    rays = (
        np.stack([(columns - WIDTH / 2) / FOCAL, (rows - HEIGHT / 2) / FOCAL, np.ones(rows.shape)], axis=-1)
        @ pose[:3, :3].T
    )
    with np.errstate(divide="ignore"):
        distances = np.where(rays > 0, SIZE - pose[:3, 3], -pose[:3, 3]) / rays
    distances = np.where(np.isfinite(distances), distances, np.inf)
    floor = (distances.argmin(axis=-1) == 2) & (rays[..., 2] < 0)
    return distances.min(axis=-1), np.where(floor[..., None], RED, GREY).astype(np.uint8)


def _png(path: Path, depth: np.ndarray) -> None:
    Image.fromarray(np.round(1000 * depth).astype(np.uint16)).save(path)


def seven_scenes(folder: Path, count: int, world: np.ndarray | None = None) -> Path:
    """Write a recording as 7-Scenes and tsdf-fusion-python do; `world` [4 4] turns its coordinates."""
    folder.mkdir()
    matrix = [[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2], [0, 0, 1]]
    np.savetxt(folder / "camera-intrinsics.txt", matrix)
    for index, pose in enumerate(poses(count)):
        depth, color = image(pose)
        _png(folder / f"frame-{index:06d}.depth.png", depth)
        Image.fromarray(color).save(folder / f"frame-{index:06d}.color.png")
        np.savetxt(folder / f"frame-{index:06d}.pose.txt", pose if world is None else world @ pose)
    return folder


def scannet(folder: Path, count: int) -> Path:
    """Write a recording as ScanNet's reader exports it: the third frame's pose is lost."""
    for name in ("depth", "color", "pose", "intrinsic"):
        (folder / name).mkdir(parents=True)
    matrix = np.eye(4)
    matrix[:2, :3] = [[FOCAL, 0, WIDTH / 2], [0, FOCAL, HEIGHT / 2]]
    np.savetxt(folder / "intrinsic" / "intrinsic_depth.txt", matrix)
    for index, pose in enumerate(poses(count)):
        depth, color = image(pose)
        _png(folder / "depth" / f"{index}.png", depth)
        Image.fromarray(color).save(folder / "color" / f"{index}.jpg")
        np.savetxt(folder / "pose" / f"{index}.txt", np.full((4, 4), -np.inf) if index == 2 else pose)
    return folder


def nerfstudio(folder: Path, count: int) -> Path:
    """Write a recording as nerfstudio reads it: cameras look along -z, y up."""
    folder.mkdir()
    frames = []
    for index, pose in enumerate(poses(count)):
        depth, color = image(pose)
        _png(folder / f"depth_{index}.png", depth)
        Image.fromarray(color).save(folder / f"image_{index}.png")
        matrix = (pose @ np.diag([1.0, -1.0, -1.0, 1.0])).tolist()
        frames.append(
            {"file_path": f"image_{index}.png", "depth_file_path": f"depth_{index}.png", "transform_matrix": matrix}
        )
    camera = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": WIDTH / 2, "cy": HEIGHT / 2, "w": WIDTH, "h": HEIGHT}
    (folder / "transforms.json").write_text(json.dumps({**camera, "frames": frames}))
    return folder
