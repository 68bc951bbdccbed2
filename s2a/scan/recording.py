"""Recordings of posed depth and colour frames in a folder: recognised by their files, and checked before anything is fused."""

from __future__ import annotations

import json
import re
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError

KEYFRAMES = "keyframes"
"""Folder in a scan's with the sharp, well spread images of its recording, and their cameras."""
MIN_FRAMES = 2
"""Frames below which nothing is fused."""

_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])  # a camera that looks along -z, y up, to one that looks along z, y down
_LAYOUTS = (
    "frame-000000.depth.png, .color.png or .jpg, .pose.txt and camera-intrinsics.txt (7-Scenes, BundleFusion); "
    "folders depth, color, pose and intrinsic (ScanNet); transforms.json with depth_file_path (nerfstudio)"
)


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion, in pixels; the centre of the first pixel is (0, 0).

    Attributes:
        fx: focal length along rows.
        fy: focal length along columns.
        cx: column of the optical axis.
        cy: row of the optical axis.
    """

    fx: float
    fy: float
    cx: float
    cy: float


@dataclass(frozen=True, eq=False)
class PosedFrame:
    """One posed frame.

    Attributes:
        depth: 16 bit PNG file.
        color: image file, or None.
        pose: camera to world, x right, y down, z forward, [m], shape [4 4].
    """

    depth: Path
    color: Path | None
    pose: np.ndarray


@dataclass(frozen=True)
class RgbdRecording:
    """Frames of one walk through a room.

    Attributes:
        kind: layout of the folder.
        frames: in the order of the walk.
        depth_camera: of the depth images.
        color_camera: of the colour images; the same where they are registered.
        metres: metres a unit of depth.
        lost: number of frames without a valid pose, left out.
    """

    kind: str
    frames: tuple[PosedFrame, ...]
    depth_camera: Intrinsics
    color_camera: Intrinsics
    metres: float
    lost: int

    @property
    def up(self) -> np.ndarray:
        """Up direction that the cameras speak for, unit, shape [3]: square to their rows of pixels, which people hold level."""
        right = np.stack([frame.pose[:3, 0] for frame in self.frames])
        upwards = -np.stack([frame.pose[:3, 1] for frame in self.frames]).mean(axis=0)
        direction: np.ndarray = np.linalg.eigh(right.T @ right)[1][:, 0]
        return direction * (1.0 if direction @ upwards >= 0 else -1.0)


def recognise(folder: Path) -> bool:
    """Return True for a folder whose files are laid out as a known recording."""
    return _reader(folder) is not None


def read(folder: Path) -> RgbdRecording:
    """Read which frames a recording holds; images are opened when they are fused.

    Raises:
        InputError: no such folder, an unknown layout, a frame without depth or pose, a damaged pose or camera, too few frames.
    """
    if not folder.is_dir():
        raise InputError(f"frames {str(folder)!r} is no folder; give the folder of one recording")
    reader = _reader(folder)
    if reader is None:
        raise InputError(f"{folder}: holds no known recording; possible: {_LAYOUTS}")
    recording = reader(folder)
    if len(recording.frames) < MIN_FRAMES:
        raise InputError(
            f"{folder}: {len(recording.frames)} frames have a valid pose and depth, {recording.lost} have no pose; "
            f"give a recording of {MIN_FRAMES} or more"
        )
    return recording


def images(
    recording: RgbdRecording, every: int, far: float
) -> Iterator[tuple[PosedFrame, np.ndarray, np.ndarray | None]]:
    """Yield every so many frames, their depth [m], shape [row column], 0 beyond a distance [m], and their colours, or None.

    Raises:
        InputError: an image that cannot be read, or depth that is no 16 bit image of the same size in all frames.
    """
    size = None
    for frame in recording.frames[::every]:
        raw = _image(frame.depth)
        if raw.ndim != 2 or raw.dtype.itemsize < 2:
            raise InputError(f"{frame.depth}: is no 16 bit depth image; expected a PNG with one channel of 16 bits")
        if size is not None and raw.shape != size:
            raise InputError(
                f"{frame.depth}: has {raw.shape[1]} x {raw.shape[0]} pixels, frames before {size[1]} x {size[0]}"
            )
        size = raw.shape
        depth = raw.astype(np.float32) * np.float32(recording.metres)
        color = None if frame.color is None else _image(frame.color)
        if color is not None and (color.ndim != 3 or color.shape[2] < 3):
            raise InputError(f"{frame.color}: is no colour image; expected RGB")
        yield frame, np.where((raw < 65535) & (depth < far), depth, 0), None if color is None else color[..., :3]


def keyframes(recording: RgbdRecording, sharpness: np.ndarray, spread: float = 0.35, turn: float = 25.0) -> list[int]:
    """Return indices of sharp frames that are well spread: the sharpest first, none near to one that is chosen.

    Args:
        recording: the frames.
        sharpness: of each frame; NaN leaves it out, shape [frame].
        spread: distance from which on frames are not near [m].
        turn: angle between optical axes from which on frames are not near [deg].
    """
    poses = np.stack([frame.pose for frame in recording.frames])
    chosen: list[int] = []
    for index in np.argsort(-np.nan_to_num(sharpness, nan=-np.inf)):
        if not np.isfinite(sharpness[index]):
            break
        far = np.linalg.norm(poses[chosen, :3, 3] - poses[index, :3, 3], axis=1) > spread
        turned = poses[chosen, :3, 2] @ poses[index, :3, 2] < np.cos(np.radians(turn))
        if (far | turned).all():
            chosen.append(int(index))
    return sorted(chosen)


def write_keyframes(folder: Path, recording: RgbdRecording, chosen: list[int], to_scan: np.ndarray) -> None:
    """Write the colour images of some frames, their cameras and their poses in the scan, into a folder of a scan.

    Args:
        folder: of the scan.
        recording: the frames.
        chosen: their indices.
        to_scan: transform from the recording's coordinates to the scan's, a rigid motion, shape [4 4].
    """
    target = folder / KEYFRAMES
    target.mkdir()
    records = []
    for index in chosen:
        frame = recording.frames[index]
        if frame.color is None:
            continue
        shutil.copyfile(frame.color, target / frame.color.name)
        records.append({"image": frame.color.name, "camera_to_scan": (to_scan @ frame.pose).tolist()})
    data = {"camera": asdict(recording.color_camera), "frames": records}
    (target / "keyframes.json").write_text(json.dumps(data, indent=1), encoding="utf-8")


def sharpness(color: np.ndarray | None) -> float:
    """Return how sharp an image is: the mean square of what its neighbours do not foretell; NaN without one."""
    if color is None:
        return float("nan")
    grey = color.astype(np.float32).mean(axis=2)
    inner = 4 * grey[1:-1, 1:-1] - grey[:-2, 1:-1] - grey[2:, 1:-1] - grey[1:-1, :-2] - grey[1:-1, 2:]
    return float(np.mean(inner**2))


def _image(path: Path) -> np.ndarray:
    from PIL import Image  # of the extra sim

    try:
        with Image.open(path) as opened:
            return np.asarray(opened)
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{path}: damaged or no image ({' '.join(str(error).split())[:80]})") from error


def _reader(folder: Path) -> Callable[[Path], RgbdRecording] | None:
    if next(folder.glob("frame-*.depth.png"), None):
        return _seven_scenes
    if (folder / "depth").is_dir() and (folder / "pose").is_dir():
        return _scannet
    if (folder / "transforms.json").is_file():
        return _nerfstudio
    return None


def _seven_scenes(folder: Path) -> RgbdRecording:
    """Read frames as 7-Scenes, BundleFusion and tsdf-fusion-python name them: depth in mm, 65535 or 0 where there is none."""
    depths = sorted(folder.glob("frame-*.depth.png"))
    stems = [path.name.removesuffix(".depth.png") for path in depths]
    poses = [_pose(folder / f"{stem}.pose.txt") for stem in stems]
    colors = [_first(folder / f"{stem}.color.jpg", folder / f"{stem}.color.png") for stem in stems]
    camera = _camera(folder / "camera-intrinsics.txt")
    return _recording("7-Scenes", depths, colors, poses, camera, camera, 0.001)


def _scannet(folder: Path) -> RgbdRecording:
    """Read frames as ScanNet's SensReader exports them: depth in mm, poses of minus infinity where tracking was lost."""
    depths = sorted(folder.glob("depth/*.png"), key=lambda path: _number(path.stem))
    poses = [_pose(folder / "pose" / f"{path.stem}.txt") for path in depths]
    colors = [_first(folder / "color" / f"{path.stem}.jpg", folder / "color" / f"{path.stem}.png") for path in depths]
    camera = _camera(folder / "intrinsic" / "intrinsic_depth.txt")
    color = folder / "intrinsic" / "intrinsic_color.txt"
    return _recording("ScanNet", depths, colors, poses, camera, _camera(color) if color.is_file() else camera, 0.001)


def _nerfstudio(folder: Path) -> RgbdRecording:
    """Read transforms.json: one camera for all frames, which look along -z, with depth images in mm."""
    path = folder / "transforms.json"
    try:
        data = json.loads(path.read_bytes())
        frames = data["frames"]
        width, depth_width = float(data["w"]), float(data.get("depth_w", data["w"]))
        camera = Intrinsics(*(float(data[key]) for key in ("fl_x", "fl_y", "cx", "cy")))
        poses = [_checked(np.array(frame["transform_matrix"], dtype=float), path) for frame in frames]
        depths = [folder / frame["depth_file_path"] for frame in frames]
        colors = [_first(folder / frame["file_path"]) for frame in frames]
    except (ValueError, KeyError, TypeError) as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:120]
        raise InputError(f"{path}: damaged or without depth ({reason}); export it with depth images") from error
    missing = [depth for depth in depths if not depth.is_file()]
    if missing:
        raise InputError(f"{path}: {len(missing)} of {len(depths)} depth images are missing, first {missing[0].name}")
    scale = depth_width / width
    depth_camera = Intrinsics(camera.fx * scale, camera.fy * scale, camera.cx * scale, camera.cy * scale)
    turned = [None if pose is None else pose @ _OPENGL for pose in poses]
    return _recording(
        "nerfstudio", depths, colors, turned, depth_camera, camera, float(data.get("depth_unit_scale_factor", 0.001))
    )


def _recording(
    kind: str,
    depths: list[Path],
    colors: list[Path | None],
    poses: list[np.ndarray | None],
    depth_camera: Intrinsics,
    color_camera: Intrinsics,
    metres: float,
) -> RgbdRecording:
    rows = zip(depths, colors, poses, strict=True)
    frames = tuple(PosedFrame(depth, color, pose) for depth, color, pose in rows if pose is not None)
    return RgbdRecording(kind, frames, depth_camera, color_camera, metres, len(poses) - len(frames))


def _pose(path: Path) -> np.ndarray | None:
    """Return a camera's pose [4 4]; None where tracking was lost."""
    return _checked(_matrix(path, (4, 4)), path)


def _checked(pose: np.ndarray, path: Path) -> np.ndarray | None:
    """Return a pose, or None if it is not finite.

    Raises:
        InputError: it is no rigid motion.
    """
    if pose.shape != (4, 4):
        raise InputError(f"{path}: a pose has the shape {list(pose.shape)}; expected 4 rows of 4 numbers")
    if not np.isfinite(pose).all():
        return None
    rotation = pose[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=0.02) or np.linalg.det(rotation) < 0:
        raise InputError(f"{path}: a pose is no rotation and translation; expected camera to world, in metres")
    return pose


def _camera(path: Path) -> Intrinsics:
    """Return the camera in a text file with 3 x 3 or 4 x 4 numbers."""
    matrix = _matrix(path, (3, 3), (4, 4))
    camera = Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    if not (np.isfinite(matrix).all() and camera.fx > 1 and camera.fy > 1):
        raise InputError(f"{path}: focal lengths are {camera.fx:g} and {camera.fy:g} pixels; expected a camera matrix")
    return camera


def _matrix(path: Path, *shapes: tuple[int, int]) -> np.ndarray:
    """Return the numbers of a text file.

    Raises:
        InputError: no such file, no numbers, or another shape.
    """
    try:
        matrix = np.loadtxt(path, dtype=np.float64, ndmin=2)
    except FileNotFoundError as error:
        raise InputError(f"{path}: is missing; a recording needs it for every frame") from error
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: holds no matrix ({' '.join(str(error).split())[:80]})") from error
    if matrix.shape not in shapes:
        expected = " or ".join(f"{rows} x {columns}" for rows, columns in shapes)
        raise InputError(f"{path}: holds {' x '.join(map(str, matrix.shape))} numbers; expected {expected}")
    return matrix


def _first(*paths: Path) -> Path | None:
    return next((path for path in paths if path.is_file()), None)


def _number(stem: str) -> tuple[int, str]:
    """Return a key that orders "2" before "10"."""
    digits = re.findall(r"\d+", stem)
    return (int(digits[-1]) if digits else -1, stem)
