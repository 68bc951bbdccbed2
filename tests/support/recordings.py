"""Recordings of a box-shaped room, z up and in metres, in every layout; the camera walks round its middle and looks out."""

from __future__ import annotations

import json
import zipfile
from functools import cache
from pathlib import Path

import av
import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

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


def image(pose: np.ndarray, scale: int = 1, offset: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the depth [m], shape [row column], and the colours, shape [row column 3], that a camera in the room sees.

    Images have the same borders at every scale; the camera is moved along its x axis by an offset [m].
    """
    return _image(pose.tobytes(), scale, offset)


@cache
def _image(given: bytes, scale: int, offset: float) -> tuple[np.ndarray, np.ndarray]:
    pose = np.frombuffer(given).reshape(4, 4)
    rows, columns = (np.mgrid[0 : HEIGHT * scale, 0 : WIDTH * scale] + 0.5) / scale - 0.5
    rays = (
        np.stack([(columns - WIDTH / 2) / FOCAL, (rows - HEIGHT / 2) / FOCAL, np.ones(rows.shape)], axis=-1)
        @ pose[:3, :3].T
    )
    eye = pose[:3, 3] + offset * pose[:3, 0]
    with np.errstate(divide="ignore"):
        distances = np.where(rays > 0, SIZE - eye, -eye) / rays
    distances = np.where(np.isfinite(distances), distances, np.inf)
    floor = (distances.argmin(axis=-1) == 2) & (rays[..., 2] < 0)
    depth, color = distances.min(axis=-1), np.where(floor[..., None], RED, GREY).astype(np.uint8)
    depth.flags.writeable = color.flags.writeable = False  # shared by all who ask
    return depth, color


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
    # The first pixel's centre is (0.5, 0.5).
    camera = {"fl_x": FOCAL, "fl_y": FOCAL, "cx": WIDTH / 2 + 0.5, "cy": HEIGHT / 2 + 0.5, "w": WIDTH, "h": HEIGHT}
    (folder / "transforms.json").write_text(json.dumps({**camera, "frames": frames}))
    return folder


LARGE = 2
"""Pixels of a colour image along one of the depth image, as phones write them."""
FLIP = np.diag([1.0, -1.0, -1.0, 1.0])
Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""From a world that is z up to one that is y up."""


def _large() -> tuple[float, float, float]:
    """Return the focal length and the centre of the large images."""
    return FOCAL * LARGE, (WIDTH / 2 + 0.5) * LARGE - 0.5, (HEIGHT / 2 + 0.5) * LARGE - 0.5


def _quaternion(pose: np.ndarray) -> list[float]:
    return Rotation.from_matrix(pose[:3, :3]).as_quat().tolist()


def _confidence(depth: np.ndarray, high: int) -> tuple[np.ndarray, np.ndarray]:
    """Return a depth image that is wrong in a corner, and the confidence that says so."""
    wrong, sure = depth.copy(), np.full(depth.shape, high, np.uint8)
    wrong[:20, :20] *= 0.5
    sure[:20, :20] = 0
    return wrong, sure


def arkitscenes(folder: Path, count: int) -> Path:
    """Write a recording as ARKitScenes' raw videos: poses from world to camera as axis angles, of every second image."""
    for name in ("lowres_depth", "lowres_wide", "lowres_wide_intrinsics", "confidence"):
        (folder / name).mkdir(parents=True)
    lines = []
    for index, pose in enumerate(poses(count)):
        wrong, sure = _confidence(image(pose)[0], 2)
        stem, inverse = f"41048190_{3414.2 + index / 10:.3f}", np.linalg.inv(pose)
        _png(folder / "lowres_depth" / f"{stem}.png", wrong)
        _png(folder / "lowres_depth" / f"41048190_{3414.25 + index / 10:.3f}.png", wrong)
        Image.fromarray(sure).save(folder / "confidence" / f"{stem}.png")
        Image.fromarray(image(pose)[1]).save(folder / "lowres_wide" / f"{stem}.png")
        for extra in (stem, f"41048190_{3414.25 + index / 10:.3f}"):
            path = folder / "lowres_wide_intrinsics" / f"{extra}.pincam"
            path.write_text(f"{WIDTH} {HEIGHT} {FOCAL} {FOCAL} {WIDTH / 2} {HEIGHT / 2}")
        numbers = [*Rotation.from_matrix(inverse[:3, :3]).as_rotvec(), *inverse[:3, 3]]
        lines.append(" ".join(map(str, [f"{3414.201 + index / 10:.3f}", *numbers])))
    (folder / "lowres_wide.traj").write_text("\n".join(lines))
    return folder


def stray(folder: Path, count: int) -> Path:
    """Write a recording as Stray Scanner does: a video, y up."""
    for name in ("depth", "confidence"):
        (folder / name).mkdir(parents=True)
    focal, x, y = _large()
    np.savetxt(folder / "camera_matrix.csv", [[focal, 0, x], [0, focal, y], [0, 0, 1]], delimiter=",")
    lines = ["timestamp, frame, x, y, z, qx, qy, qz, qw"]
    with av.open(str(folder / "rgb.mp4"), "w") as video:
        stream = video.add_stream("mpeg4", rate=30)
        stream.width, stream.height, stream.pix_fmt, stream.bit_rate = (
            WIDTH * LARGE,
            HEIGHT * LARGE,
            "yuv420p",
            8_000_000,
        )
        for index, pose in enumerate(poses(count)):
            wrong, sure = _confidence(image(pose)[0], 2)
            _png(folder / "depth" / f"{index:06d}.png", wrong)
            Image.fromarray(sure).save(folder / "confidence" / f"{index:06d}.png")
            video.mux(stream.encode(av.VideoFrame.from_ndarray(image(pose, LARGE)[1], format="rgb24")))
            turned = Y_UP @ pose
            lines.append(", ".join(map(str, [index / 30, f"{index:06d}", *turned[:3, 3], *_quaternion(turned)])))
        video.mux(stream.encode(None))
    (folder / "odometry.csv").write_text("\n".join(lines))
    return folder


def polycam(folder: Path, count: int) -> Path:
    """Write a recording as Polycam's raw data: ARKit's cameras, y up."""
    root = folder / "keyframes"
    for name in ("images", "cameras", "depth", "confidence"):
        (root / name).mkdir(parents=True)
    focal, x, y = _large()
    for index, pose in enumerate(poses(count)):
        wrong, sure = _confidence(image(pose)[0], 255)
        stem = str(9_000_000 + 500_000 * index)
        _png(root / "depth" / f"{stem}.png", wrong)
        Image.fromarray(sure).save(root / "confidence" / f"{stem}.png")
        Image.fromarray(image(pose, LARGE)[1]).save(root / "images" / f"{stem}.jpg", quality=95)
        camera = {"fx": focal, "fy": focal, "cx": x, "cy": y, "width": WIDTH * LARGE, "height": HEIGHT * LARGE}
        turned = Y_UP @ pose @ FLIP
        camera |= {f"t_{row}{column}": turned[row, column] for row in range(3) for column in range(4)}
        (root / "cameras" / f"{stem}.json").write_text(json.dumps({**camera, "blur_score": 100.0}))
    return folder


def record3d(folder: Path, count: int) -> Path:
    """Write a recording as an unpacked .r3d file of Record3D: ARKit's cameras, y up; blocks of LZFSE that are not packed."""
    (folder / "rgbd").mkdir(parents=True)
    focal, x, y = _large()
    rows = []
    for index, pose in enumerate(poses(count)):
        wrong, sure = _confidence(image(pose)[0], 2)
        for name, data in (("depth", wrong.astype("<f4").tobytes()), ("conf", sure.tobytes())):
            packed = b"bvx-" + len(data).to_bytes(4, "little") + data + b"bvx$"
            (folder / "rgbd" / f"{index}.{name}").write_bytes(packed)
        Image.fromarray(image(pose, LARGE)[1]).save(folder / "rgbd" / f"{index}.jpg", quality=95)
        turned = Y_UP @ pose @ FLIP
        rows.append([*_quaternion(turned), *turned[:3, 3].tolist()])
    size = {"w": WIDTH * LARGE, "h": HEIGHT * LARGE, "dw": WIDTH, "dh": HEIGHT}
    (folder / "metadata").write_text(json.dumps({"K": [focal, 0, 0, 0, focal, 0, x, y, 1], "poses": rows, **size}))
    return folder


def r3d(file: Path, count: int) -> Path:
    """Write a .r3d file."""
    whole = record3d(file.with_suffix(""), count)
    with zipfile.ZipFile(file, "w") as archive:
        for path in sorted(whole.rglob("*")):
            archive.write(path, path.relative_to(whole).as_posix())
    return file
