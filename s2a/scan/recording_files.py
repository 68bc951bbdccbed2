"""Files of recordings, checked: images, arrays, poses, cameras, tables and times in names."""

import io
import json
import re
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan.recording import OPENGL, Intrinsics

POSE_TIME = 0.005  # [s] by which the times of an image and its pose may differ: ARKitScenes' own reader allows as much


def read_image(path: Path) -> np.ndarray:
    """Return an image file as an array; InputError where it is damaged."""
    return opened_image(path, str(path))


def opened_image(source: Path | io.BytesIO, name: str) -> np.ndarray:
    """Return an image as an array; InputError, which names it, where it is damaged."""
    with image_file(source, name) as image:
        return np.asarray(image)


@contextmanager
def image_file(source: Path | io.BytesIO, name: object) -> Iterator[Any]:
    """Open an image of PIL; InputError, which names it, where it is damaged."""
    from PIL import Image  # of the extra sim

    try:
        with Image.open(source) as image:
            yield image
    except (OSError, SyntaxError, ValueError) as error:
        raise InputError(f"{name}: damaged or no image ({' '.join(str(error).split())[:80]})") from error


def read_array(path: Path) -> np.ndarray:
    """Return the depth of a NPY file: floats are metres, integers units of the recording."""
    try:
        data = np.load(path, allow_pickle=False)
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: damaged or no array ({str(error)[:80]})") from error
    return data[..., 0] if data.ndim == 3 and data.shape[2] == 1 else data


def image_size(path: Path) -> tuple[float, float]:
    """Return the width and height of an image, from its header alone."""
    if path.suffix == ".npy":
        height, width = read_array(path).shape[:2]
        return float(width), float(height)
    with image_file(path, path) as image:
        return float(image.size[0]), float(image.size[1])


def require_images(depths: list[Path], path: Path) -> None:
    """Refuse a recording whose depth images are not all there."""
    missing = [depth for depth in depths if not depth.is_file()]
    if missing:
        raise InputError(f"{path}: {len(missing)} of {len(depths)} depth images are missing, first {missing[0].name}")


def read_pose(path: Path) -> np.ndarray | None:
    """Return a camera's pose [4 4]; None where tracking was lost."""
    return checked_pose(read_matrix(path, (4, 4)), path)


def checked_pose(pose: np.ndarray, path: Path) -> np.ndarray | None:
    """Return a pose, or None if it is not finite; InputError: it is no rigid motion."""
    if pose.shape != (4, 4):
        raise InputError(f"{path}: a pose has the shape {list(pose.shape)}; expected 4 rows of 4 numbers")
    if not np.isfinite(pose).all():
        return None
    rotation = pose[:3, :3]
    if not np.allclose(rotation @ rotation.T, np.eye(3), atol=0.02) or np.linalg.det(rotation) < 0:
        raise InputError(f"{path}: a pose is no rotation and translation; expected camera to world, in metres")
    return pose


def turned_poses(poses: Iterable[np.ndarray | None]) -> list[np.ndarray | None]:
    """Return the poses of cameras that look along -z as those of cameras that look along z."""
    return [None if pose is None else pose @ OPENGL for pose in poses]


def pose_of_quaternion(q: np.ndarray, position: np.ndarray, path: Path) -> np.ndarray | None:
    """Return a pose from a quaternion x, y, z, w and a position; None where they are not finite."""
    if not np.isfinite([*q, *position]).all():
        return None
    length = float(np.linalg.norm(q))
    if abs(length - 1) > 0.02:
        raise InputError(f"{path}: a quaternion has the length {length:.3g}; expected 1")
    x, y, z, w = q / length
    pose = np.eye(4)
    pose[:3, :3] = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    pose[:3, 3] = position
    return pose


def rotation_of_vector(vector: np.ndarray) -> np.ndarray:
    """Return the rotation by a vector's length [rad] about it, shape [3 3]."""
    angle = float(np.linalg.norm(vector))
    if angle < 1e-12:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    rotation: np.ndarray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return rotation


def read_camera(path: Path, delimiter: str | None = None) -> Intrinsics:
    """Return the camera in a text file with 3 x 3 or 4 x 4 numbers."""
    matrix = read_matrix(path, (3, 3), (4, 4), delimiter=delimiter)
    camera = Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
    if not (np.isfinite(matrix).all() and camera.fx > 1 and camera.fy > 1):
        raise InputError(f"{path}: focal lengths are {camera.fx:g} and {camera.fy:g} pixels; expected a camera matrix")
    return camera


def read_pincam(path: Path) -> tuple[tuple[float, float], Intrinsics]:
    """Return the size of images, and the camera, of a .pincam file: width, height, fx, fy, cx, cy."""
    numbers = read_matrix(path, (1, 6))[0]
    return (float(numbers[0]), float(numbers[1])), Intrinsics(*map(float, numbers[2:]))


def read_matrix(path: Path, *shapes: tuple[int, int], delimiter: str | None = None) -> np.ndarray:
    """Return the numbers of a text file; InputError: no such file, no numbers, or another shape."""
    matrix = _numbers(path, "matrix", "a recording needs it for every frame", delimiter)
    if matrix.shape not in shapes:
        expected = " or ".join(f"{rows} x {columns}" for rows, columns in shapes)
        raise InputError(f"{path}: holds {' x '.join(map(str, matrix.shape))} numbers; expected {expected}")
    return matrix


def read_table(path: Path, columns: int, delimiter: str | None = None, skip: int = 0) -> np.ndarray:
    """Return the rows of numbers of a text file, shape [row column].

    Raises:
        InputError: no such file, no numbers, or another number of columns.
    """
    rows = _numbers(path, "table of poses", "it holds the poses", delimiter, skip)
    if rows.shape[1] != columns or not len(rows):
        raise InputError(f"{path}: {len(rows)} rows of {rows.shape[1]} numbers; expected {columns} a row")
    return rows


def _numbers(path: Path, what: str, purpose: str, delimiter: str | None, skip: int = 0) -> np.ndarray:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of a file without numbers, whose shape says so
            return np.loadtxt(path, dtype=np.float64, ndmin=2, delimiter=delimiter, skiprows=skip)
    except FileNotFoundError as error:
        raise InputError(f"{path}: is missing; {purpose}") from error
    except (ValueError, OSError) as error:
        raise InputError(f"{path}: holds no {what} ({' '.join(str(error).split())[:80]})") from error


def read_json(path: Path) -> dict[str, Any]:
    """Return the object of a JSON file; InputError where it holds none."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: is missing; the recording needs it") from error
    return parsed_json(data, path)


def parsed_json(data: bytes, path: Path) -> dict[str, Any]:
    """Return the object in the bytes of a JSON file; InputError where they hold none."""
    try:
        content = json.loads(data)
    except ValueError as error:
        raise InputError(f"{path}: damaged or no JSON ({str(error)[:80]})") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds no JSON object")
    return content


def first_file(*paths: Path) -> Path | None:
    """Return the first of some paths that is a file, or None."""
    return next((path for path in paths if path.is_file()), None)


def frame_number(stem: str) -> tuple[int, str]:
    """Return a key that orders "2" before "10"."""
    digits = re.findall(r"\d+", stem)
    return (int(digits[-1]) if digits else -1, stem)


def time_in_name(path: Path) -> float:
    """Return the time in a name such as "41048190_3414.349.png" [s]."""
    try:
        return float(path.stem.rsplit("_", 1)[-1])
    except ValueError as error:
        raise InputError(f"{path}: its name does not end with a time; ARKitScenes has <video>_<seconds>") from error


def file_at(files: list[tuple[float, Path]], time: float) -> Path | None:
    """Return the file of a time, within some milliseconds; None without one."""
    times = np.array([each for each, _ in files])
    index = int(np.argmin(np.abs(times - time))) if len(times) else -1
    return files[index][1] if index >= 0 and abs(times[index] - time) < POSE_TIME else None
