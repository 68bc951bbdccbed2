"""Readers of recordings of posed depth and colour: one a format, recognised by the names of files."""

import io
import zipfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import astuple, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import recording_files as raw
from s2a.scan.recording import FrameImage, Intrinsics, PosedFrame, RgbdRecording

MIN_FRAMES = 2  # Frames below which nothing is fused
# Depth camera of 7-Scenes, which states it on its page and says there that depth is not registered to colour
KINECT = Intrinsics(585.0, 585.0, 320.0, 240.0)
# Its colour camera: the Kinect's usual one; of RedKitchen, frames agree best in colour at a focal length of 525
KINECT_COLOR = Intrinsics(525.0, 525.0, 320.0, 240.0)
# Of depth points to the colour camera [m]: the two lenses' distance, with the sign with which RedKitchen's frames agree
KINECT_OFFSET = (-0.025, 0.0, 0.0)

_LAYOUTS = (
    "frame-000000.depth.png, .color.png or .jpg, .pose.txt (7-Scenes); folders depth, color, pose and intrinsic (ScanNet); "
    "transforms.json with depth_file_path (nerfstudio); lowres_depth, lowres_wide.traj (ARKitScenes); odometry.csv, "
    "camera_matrix.csv, depth, rgb.mp4 (Stray Scanner); keyframes/depth, cameras, images (Polycam); a .r3d file, or its "
    "metadata and rgbd (Record3D)"
)


def recognise(path: Path) -> bool:
    """Return True for a folder, or a .r3d file, laid out as a known recording."""
    return _reader(path) is not None


def read(path: Path, color: Sequence[float] | None = None) -> RgbdRecording:
    """Read which frames a recording holds; images are opened when they are fused.

    Args:
        path: folder, or .r3d file.
        color: the colour camera where it is not the depth camera: fx, fy, cx, cy [pixel] and what is added to a point in the
            depth camera's coordinates [m]; None as the format says.

    Raises:
        InputError: no such folder, an unknown layout, a frame without depth or pose, a damaged pose or camera, too few frames.
    """
    if not path.is_dir() and path.suffix.lower() != ".r3d":
        raise InputError(f"frames {str(path)!r} is no folder; give the folder of one recording")
    reader = _reader(path)
    if reader is None:
        raise InputError(f"{path}: holds no known recording; possible: {_LAYOUTS}")
    recording = reader(path)
    if len(recording.frames) < MIN_FRAMES:
        raise InputError(
            f"{path}: {len(recording.frames)} frames have a valid pose and depth, {recording.lost} have no pose; "
            f"give a recording of {MIN_FRAMES} or more"
        )
    if color is not None:
        recording = _with_color(recording, Intrinsics(*color[:4]), color[4:])
    _fit({frame.depth_camera: frame.depth for frame in reversed(recording.frames)}, "depth")
    _fit({frame.color_camera: frame.color for frame in reversed(recording.frames) if frame.color}, "colour")
    return recording


def _reader(path: Path) -> Callable[[Path], RgbdRecording] | None:
    if path.suffix.lower() == ".r3d" and path.is_file():
        return _record3d_file
    if next(path.glob("frame-*.depth.png"), None):
        return _seven_scenes
    if (path / "odometry.csv").is_file():
        return _stray
    if (path / "keyframes" / "depth").is_dir():
        return _polycam
    if (path / "lowres_depth").is_dir():
        return _arkitscenes
    if (path / "transforms.json").is_file():
        return _nerfstudio
    if (path / "depth").is_dir() and (path / "pose").is_dir():
        return _scannet
    if any((path / name).is_file() for name in ("metadata", "metadata.json")):
        return _record3d
    return None


def _seven_scenes(folder: Path) -> RgbdRecording:
    """Read frames as 7-Scenes and tsdf-fusion-python name them: depth in mm, 65535 or 0 where there is none.

    With 7-Scenes' depth camera, stated or by default, colour is that of its Kinect, which is not registered.
    """
    depths = sorted(folder.glob("frame-*.depth.png"))
    stems = [path.name.removesuffix(".depth.png") for path in depths]
    poses = [raw.read_pose(folder / f"{stem}.pose.txt") for stem in stems]
    colors = [raw.first_file(folder / f"{stem}.color.jpg", folder / f"{stem}.color.png") for stem in stems]
    file = folder / "camera-intrinsics.txt"
    camera = raw.read_camera(file) if file.is_file() else KINECT
    recording = _recording("7-Scenes", depths, colors, poses, [camera] * len(depths), [camera] * len(depths))
    if np.allclose(astuple(camera), astuple(KINECT)) and recording.frames and raw.image_size(depths[0]) == (640, 480):
        return _with_color(recording, KINECT_COLOR, KINECT_OFFSET)
    return recording


def _scannet(folder: Path) -> RgbdRecording:
    """Read frames as ScanNet's SensReader exports them: depth in mm, poses of minus infinity where tracking was lost."""
    depths = sorted(folder.glob("depth/*.png"), key=lambda path: raw.frame_number(path.stem))
    poses = [raw.read_pose(folder / "pose" / f"{path.stem}.txt") for path in depths]
    colors = [
        raw.first_file(folder / "color" / f"{path.stem}.jpg", folder / "color" / f"{path.stem}.png") for path in depths
    ]
    camera = raw.read_camera(folder / "intrinsic" / "intrinsic_depth.txt")
    file = folder / "intrinsic" / "intrinsic_color.txt"
    color_camera = raw.read_camera(file) if file.is_file() else camera
    count = len(depths)
    recording = _recording("ScanNet", depths, colors, poses, [camera] * count, [color_camera] * count)
    # Of each camera in the rig, which is the depth camera's: a scene's .txt calls the colour camera's colorToDepthExtrinsics.
    moves = [folder / "intrinsic" / f"extrinsic_{name}.txt" for name in ("depth", "color")]
    if all(move.is_file() for move in moves):
        depth_move, color_move = (raw.checked_pose(raw.read_matrix(move, (4, 4)), move) for move in moves)
        if depth_move is not None and color_move is not None and not np.allclose(depth_move, color_move, atol=1e-6):
            return replace(recording, color_from_depth=np.linalg.inv(color_move) @ depth_move)
    return recording


def _nerfstudio(folder: Path) -> RgbdRecording:
    """Read transforms.json: cameras that look along -z, for all frames or each, with depth in mm (PNG) or metres (NPY).

    The format is that of nerfstudio's data conventions: the first pixel's centre is (0.5, 0.5).
    """
    path = folder / "transforms.json"
    data = raw.read_json(path)
    try:
        frames = data["frames"]
        sizes = [(float({**data, **frame}["w"]), float({**data, **frame}["h"])) for frame in frames]
        cameras = [
            Intrinsics(*(float({**data, **frame}[key]) - shift for key, shift in _NERF_KEYS)) for frame in frames
        ]
        poses = [raw.checked_pose(np.array(frame["transform_matrix"], dtype=float), path) for frame in frames]
        depths = [folder / frame["depth_file_path"] for frame in frames]
        colors = [raw.first_file(folder / frame["file_path"]) for frame in frames]
        bent = max(abs(float({**data, **frame}.get(key, 0) or 0)) for frame in frames for key in _NERF_DISTORTION)
        model, scale = str(data.get("camera_model", "OPENCV")), float(data.get("depth_unit_scale_factor", 0.001))
    except (ValueError, KeyError, TypeError) as error:
        reason = " ".join(f"{type(error).__name__} {error}".split())[:120]
        raise InputError(f"{path}: damaged or without depth ({reason}); export it with depth images") from error
    raw.require_images(depths, path)
    if bent > 1e-3 or "FISHEYE" in model:
        raise InputError(f"{path}: the lens is distorted ({model}, coefficient {bent:.3g}); undistort the images first")
    depth_cameras = [
        camera.scaled(size, raw.image_size(depth)) for camera, size, depth in zip(cameras, sizes, depths, strict=True)
    ]
    return _recording("nerfstudio", depths, colors, raw.turned_poses(poses), depth_cameras, cameras, metres=scale)


_NERF_KEYS = (("fl_x", 0.0), ("fl_y", 0.0), ("cx", 0.5), ("cy", 0.5))
_NERF_DISTORTION = ("k1", "k2", "k3", "k4", "p1", "p2")


def _arkitscenes(folder: Path) -> RgbdRecording:
    """Read a raw video of ARKitScenes, as its own tenFpsDataLoader does: axis angle and translation from world to camera.

    Colour is that of vga_wide where it was downloaded, else lowres_wide. The world is z up.
    """
    path = next(iter([*folder.glob("lowres_wide.traj"), *folder.glob("*.traj")]), folder / "lowres_wide.traj")
    rows = raw.read_table(path, 7)
    times = rows[:, 0]
    files: dict[str, list[tuple[float, Path]]] = {}
    for name in (
        "lowres_depth",
        "confidence",
        "vga_wide",
        "lowres_wide",
        "vga_wide_intrinsics",
        "lowres_wide_intrinsics",
    ):
        files[name] = sorted((raw.time_in_name(file), file) for file in (folder / name).glob("[!.]*_*.*"))
    wide = "vga_wide" if files["vga_wide"] and files["vga_wide_intrinsics"] else "lowres_wide"
    depths, colors, sure, poses, depth_cameras, color_cameras = [], [], [], [], [], []
    for time, depth in files["lowres_depth"]:
        index = int(np.argmin(np.abs(times - time)))
        lens = raw.file_at(files["lowres_wide_intrinsics"], time) or raw.file_at(files[f"{wide}_intrinsics"], time)
        color, color_lens = raw.file_at(files[wide], time), raw.file_at(files[f"{wide}_intrinsics"], time)
        if lens is None:
            raise InputError(
                f"{depth}: no camera of this time in {folder.name}/lowres_wide_intrinsics; download it, too"
            )
        size, camera = raw.read_pincam(lens)
        depths.append(depth)
        colors.append(color if color_lens else None)
        sure.append(raw.file_at(files["confidence"], time))
        depth_cameras.append(
            camera.scaled(size, raw.image_size(depth) if depths[1:] == [] else raw.image_size(depths[0]))
        )
        color_cameras.append(raw.read_pincam(color_lens)[1] if color_lens else camera)
        pose = np.eye(4)
        pose[:3, :3], pose[:3, 3] = raw.rotation_of_vector(rows[index, 1:4]), rows[index, 4:7]
        poses.append(np.linalg.inv(pose) if abs(times[index] - time) < raw.POSE_TIME else None)
    return _recording("ARKitScenes", depths, colors, poses, depth_cameras, color_cameras, sure, gravity="z")


def _stray(folder: Path) -> RgbdRecording:
    """Read a recording of Stray Scanner (its docs/format.md): depth in mm, poses as in its own StrayVisualizer, y up.

    The intrinsics are those of the video's images.
    """
    path = folder / "odometry.csv"
    try:
        names = [name.strip() for name in path.read_text(encoding="utf-8").splitlines()[0].split(",")]
        columns = [names.index(name) for name in ("frame", "x", "y", "z", "qx", "qy", "qz", "qw")]
    except (ValueError, IndexError, OSError) as error:
        raise InputError(f"{path}: its first line names no frame, x, y, z, qx, qy, qz, qw ({error})") from error
    rows = raw.read_table(path, len(names), ",", 1)[:, columns]
    numbers = rows[:, 0].astype(int)
    depths = [
        raw.first_file(folder / "depth" / f"{number:06d}.png", folder / "depth" / f"{number:06d}.npy")
        or folder / "depth" / f"{number:06d}.png"
        for number in numbers
    ]
    raw.require_images(depths, path)
    camera = raw.read_camera(folder / "camera_matrix.csv", ",")
    video = _Video(folder / "rgb.mp4")
    depth_camera = camera.scaled(video.size, raw.image_size(depths[0]))
    colors = [FrameImage(f"{video.path} frame {number}", partial(video.image, int(number))) for number in numbers]
    sure = [raw.first_file(folder / "confidence" / f"{number:06d}.png") for number in numbers]
    poses = [raw.pose_of_quaternion(row[4:8], row[1:4], path) for row in rows]
    count = len(numbers)
    recording = _recording(
        "Stray Scanner", depths, colors, poses, [depth_camera] * count, [camera] * count, sure, gravity="y"
    )
    images = len(list((folder / "depth").glob("[!.]*")))
    return replace(recording, lost=max(0, images - len(recording.frames)))


def _polycam(folder: Path) -> RgbdRecording:
    """Read Polycam's raw data (README of PolyCam/polyform): ARKit's cameras, y up, which look along -z; depth in mm.

    Poses and images that Polycam corrected are preferred.
    """
    root = folder / "keyframes"
    corrected = (root / "corrected_cameras").is_dir() and (root / "corrected_images").is_dir()
    prefix = "corrected_" if corrected else ""
    depths = sorted((root / "depth").glob("[!.]*.png"), key=lambda path: raw.frame_number(path.stem))
    poses: list[np.ndarray | None] = []
    colors, cameras, depth_cameras, sure = [], [], [], []
    for depth in depths:
        path = root / f"{prefix}cameras" / f"{depth.stem}.json"
        if corrected and not path.is_file():
            poses.append(None)
            cameras.append(KINECT)
            depth_cameras.append(KINECT)
        else:
            data = raw.read_json(path)
            try:
                rows = [[float(data[f"t_{row}{column}"]) for column in range(4)] for row in range(3)]
                camera = Intrinsics(*(float(data[key]) for key in ("fx", "fy", "cx", "cy")))
                size = float(data["width"]), float(data["height"])
            except (KeyError, TypeError, ValueError) as error:
                raise InputError(f"{path}: is not a camera of Polycam ({type(error).__name__} {error})") from error
            poses.append(raw.checked_pose(np.array([*rows, [0, 0, 0, 1]]), path))
            cameras.append(camera)
            depth_cameras.append(camera.scaled(size, raw.image_size(depths[0])))
        images = root / f"{prefix}images"
        colors.append(raw.first_file(images / f"{depth.stem}.jpg", images / f"{depth.stem}.png"))
        sure.append(raw.first_file(root / "confidence" / depth.name))
    return _recording("Polycam", depths, colors, raw.turned_poses(poses), depth_cameras, cameras, sure, gravity="y")


def _record3d_file(path: Path) -> RgbdRecording:
    """Read a .r3d file, a ZIP archive."""
    try:
        archive = zipfile.ZipFile(path)
        names = set(archive.namelist())
        data = raw.parsed_json(archive.read("metadata"), path)
    except (zipfile.BadZipFile, KeyError, OSError) as error:
        raise InputError(f"{path}: damaged or no recording of Record3D ({str(error)[:80]})") from error
    return _record3d_frames(path, data, names, archive.read)


def _record3d(folder: Path) -> RgbdRecording:
    """Read what a .r3d file was unpacked to."""
    path = next(folder / name for name in ("metadata", "metadata.json") if (folder / name).is_file())
    names = {str(file.relative_to(folder)) for name in ("rgbd", "rgb", "depth") for file in (folder / name).glob("*")}
    return _record3d_frames(folder, raw.read_json(path), names, lambda name: (folder / name).read_bytes())


def _record3d_frames(
    path: Path, data: dict[str, Any], names: Iterable[str], read: Callable[[str], bytes]
) -> RgbdRecording:
    """Read Record3D's frames: depth, float32 in metres, and confidence packed by LZFSE; ARKit's cameras, y up, -z ahead.

    K is written column by column; poses are qx, qy, qz, qw, x, y, z from camera to world (nerfstudio's record3d_utils).
    """
    there = set(names)
    count = sum(name.startswith("rgbd/") and name.endswith(".depth") for name in there)
    if not count:
        exr = any(name.endswith(".exr") for name in there)
        raise InputError(f"{path}: holds no rgbd/0.depth{' but EXR images' * exr}; export it from Record3D as .r3d")
    try:
        poses = np.array(data["poses"], dtype=float).reshape(-1, 7)
        size = float(data["w"]), float(data["h"])
        matrix = np.array(data["K"], dtype=float).reshape(3, 3).T
        camera = Intrinsics(matrix[0, 0], matrix[1, 1], matrix[0, 2], matrix[1, 2])
        coefficients = data.get("perFrameIntrinsicCoeffs") or []
        cameras = [Intrinsics(*map(float, row[:4])) for row in coefficients] or [camera] * count
        shape = int(data["dh"]), int(data["dw"])
    except (KeyError, TypeError, ValueError) as error:
        raise InputError(f"{path}: its metadata are damaged ({type(error).__name__} {str(error)[:60]})") from error
    if len(poses) != count or len(cameras) != count:
        raise InputError(
            f"{path}: {count} depth images, {len(poses)} poses and {len(cameras)} cameras; their numbers must be equal"
        )
    moves = [raw.pose_of_quaternion(row[:4], row[4:], path) for row in poses]

    def packed(index: int, ending: str, dtype: str) -> FrameImage | None:
        name = f"rgbd/{index}.{ending}"
        label = f"{path}/{name}"
        return FrameImage(label, lambda: _lzfse(read(name), shape, dtype, label)) if name in there else None

    def color(index: int) -> FrameImage | None:
        name = f"rgbd/{index}.jpg"
        return (
            FrameImage(f"{path}/{name}", lambda: raw.opened_image(io.BytesIO(read(name)), f"{path}/{name}"))
            if name in there
            else None
        )

    depths = [packed(index, "depth", "<f4") for index in range(count)]
    if None in depths:
        raise InputError(f"{path}: rgbd/{depths.index(None)}.depth is missing; its frames count from 0")
    sure = [packed(index, "conf", "u1") for index in range(count)]
    depth_cameras = [each.scaled(size, (shape[1], shape[0])) for each in cameras]
    colors = [color(index) for index in range(count)]
    return _recording("Record3D", depths, colors, raw.turned_poses(moves), depth_cameras, cameras, sure, gravity="y")


def _lzfse(data: bytes, shape: tuple[int, int], dtype: str, name: str) -> np.ndarray:
    """Return an image packed by LZFSE; what is stored plainly (blocks "bvx-") needs no library."""
    plain, place = b"", 0
    while data[place : place + 4] == b"bvx-":
        length = int.from_bytes(data[place + 4 : place + 8], "little")
        plain, place = plain + data[place + 8 : place + 8 + length], place + 8 + length
    if data[place : place + 4] != b"bvx$":
        try:
            import liblzfse  # a package of its own, for this format alone
        except ModuleNotFoundError as error:
            raise InputError(f"{name}: is packed by LZFSE; install its reader: pip install pyliblzfse") from error
        try:
            plain = liblzfse.decompress(data)
        except liblzfse.error as error:
            raise InputError(f"{name}: damaged ({error})") from error
    if len(plain) != shape[0] * shape[1] * np.dtype(dtype).itemsize:
        raise InputError(f"{name}: holds {len(plain)} bytes; expected {shape[1]} x {shape[0]} numbers ({dtype})")
    return np.frombuffer(plain, dtype).reshape(shape)


class _Video:
    """Images of a video by their numbers, decoded in order."""

    def __init__(self, path: Path) -> None:
        try:
            import av  # of the extra collect
        except ModuleNotFoundError as error:
            raise InputError(
                f"{path}: a video needs the package av; install the extra: pip install 's2a[collect]'"
            ) from error
        self._av, self.path, self._next, self._last = av, path, 0, np.zeros((0, 0, 3), np.uint8)
        self._frames: Any = None
        try:
            with av.open(str(path)) as container:
                stream = container.streams.video[0]
                self.size = float(stream.codec_context.width), float(stream.codec_context.height)
        except (OSError, IndexError, av.FFmpegError) as error:
            raise InputError(
                f"{path}: is missing, damaged or no video ({' '.join(str(error).split())[:80]})"
            ) from error

    def image(self, number: int) -> np.ndarray:
        """Return an image, RGB, shape [row column 3]; going back starts again at the first."""
        if self._frames is None or number < self._next - 1:
            self._frames, self._next = self._av.open(str(self.path)).decode(video=0), 0
        frame = None
        try:
            while self._next <= number:
                frame, self._next = next(self._frames), self._next + 1
        except (StopIteration, self._av.FFmpegError) as error:
            raise InputError(
                f"{self.path}: ends or is damaged at image {self._next}; odometry.csv names {number}"
            ) from error
        if frame is not None:
            self._last = frame.to_ndarray(format="rgb24")
        return self._last


def _recording(
    kind: str,
    depths: Sequence[Path | FrameImage | None],
    colors: Sequence[Path | FrameImage | None],
    poses: Sequence[np.ndarray | None],
    depth_cameras: Sequence[Intrinsics],
    color_cameras: Sequence[Intrinsics],
    sure: Sequence[Path | FrameImage | None] | None = None,
    metres: float = 0.001,
    gravity: str | None = None,
) -> RgbdRecording:
    rows = zip(depths, colors, poses, depth_cameras, color_cameras, sure or [None] * len(depths), strict=True)
    frames = []
    for depth, color, pose, depth_camera, color_camera, confidence in rows:
        shown = _picture(depth)
        if pose is not None and shown:
            frames.append(PosedFrame(shown, _picture(color), pose, depth_camera, color_camera, _picture(confidence)))
    return RgbdRecording(kind, tuple(frames), metres, len(poses) - len(frames), gravity=gravity)


def _with_color(recording: RgbdRecording, camera: Intrinsics, offset: Sequence[float]) -> RgbdRecording:
    """Return a recording with another colour camera."""
    move = np.eye(4)
    move[:3, 3] = offset
    frames = tuple(replace(frame, color_camera=camera) for frame in recording.frames)
    return replace(recording, frames=frames, color_from_depth=move)


def _fit(images: Mapping[Intrinsics, FrameImage], what: str) -> None:
    """Raise an InputError if a camera cannot be that of its image: its axis is far from the middle.

    Of images of one size, which most recordings have, only one is opened.
    """
    shape: tuple[int, ...] = ()
    for camera, picture in images.items():
        if not shape or not _is_of(camera, shape):
            shape = picture.load().shape
        if not _is_of(camera, shape):
            raise InputError(
                f"{picture.name}: {shape[1]} x {shape[0]} pixels do not go with a {what} camera (fx {camera.fx:.0f}, "
                f"fy {camera.fy:.0f}, centre {camera.cx:.0f}, {camera.cy:.0f}); give the intrinsics of images of this size"
            )


def _is_of(camera: Intrinsics, shape: tuple[int, ...]) -> bool:
    """Return whether a camera can be that of an image of a shape [height, width, ...]."""
    size = np.array([shape[1], shape[0]])
    focal, centre = np.array([camera.fx, camera.fy]) / shape[1], np.array([camera.cx, camera.cy]) / size
    return bool(((0.2 < focal) & (focal < 5) & (0.25 < centre) & (centre < 0.75)).all())


def _picture(source: Path | FrameImage | None) -> FrameImage | None:
    if isinstance(source, Path):
        return FrameImage(
            str(source),
            partial(raw.read_array, source) if source.suffix == ".npy" else partial(raw.read_image, source),
            source,
        )
    return source
