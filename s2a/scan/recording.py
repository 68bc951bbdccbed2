"""Recordings of posed depth and colour: their images, whether they agree with each other, and the keyframes that a scan keeps."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Iterator
from dataclasses import asdict, astuple, dataclass, field
from functools import partial
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError

KEYFRAMES = "keyframes"  # Folder in a scan's with the sharp, well spread images of its recording, and their cameras
KEYFRAME_LIST = "keyframes.json"  # File in it with the camera and the pose of each image
FEW, MANY = 40, 120  # Keyframes that a walk through a room should have; short ones have fewer

# From a camera that looks along -z, y up, to one that looks along z, y down, shape [4 4]
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])

_PAIRS = 24  # of frames that are compared
_APART = np.cos(
    np.radians(8.0)
)  # how far their cameras are turned: what frames that stand still show fits any convention
_TOO_FAR = np.cos(np.radians(30.0))  # how far they may be turned to see much the same
_AHEAD = 60  # frames within which such a partner is sought
_AGREE = 0.5  # least share of points that the other frame confirms; right recordings have 0.7 to 1

_BETTER = 0.25  # by which a change of convention must raise it to be the likely one
_CLOSE = 0.3  # of the tolerance of depth, for changes of unit


@dataclass(frozen=True)
class Intrinsics:
    """A pinhole camera without distortion, in pixels; the centre of the first pixel is (0, 0)."""

    fx: float  # focal length along rows
    fy: float  # focal length along columns
    cx: float  # column of the optical axis
    cy: float  # row of the optical axis

    def scaled(self, size: tuple[float, float], target: tuple[float, float]) -> Intrinsics:
        """Return the camera of an image (width, height) of another size with the same borders; InputError for no size."""
        if not (size[0] > 0 and size[1] > 0):
            raise InputError(f"a camera states images of {size[0]:g} x {size[1]:g} pixels; give the size of its images")
        x, y = target[0] / size[0], target[1] / size[1]
        return Intrinsics(self.fx * x, self.fy * y, (self.cx + 0.5) * x - 0.5, (self.cy + 0.5) * y - 0.5)


@dataclass(frozen=True)
class FrameImage:
    """An image that is opened when it is needed."""

    name: str  # of its file, for messages
    load: Callable[[], np.ndarray]  # returns it, shape [row column] or [row column channel]
    file: Path | None = None  # that holds nothing but it, or None


@dataclass(frozen=True, eq=False)
class PosedFrame:
    """One posed frame."""

    depth: FrameImage  # 16 bit image in units of the recording, or floats in metres
    color: FrameImage | None  # RGB image, or None
    pose: np.ndarray  # depth camera to world, x right, y down, z forward, [m], shape [4 4]
    depth_camera: Intrinsics  # of the depth image
    color_camera: Intrinsics  # of the colour image
    # image of the depth image's shape, 0 where depth is not to be believed, or None
    confidence: FrameImage | None = None


@dataclass(frozen=True, eq=False)
class RgbdRecording:
    """Frames of one walk through a room."""

    kind: str  # the format
    frames: tuple[PosedFrame, ...]  # in the order of the walk
    metres: float  # metres a unit of depth
    lost: int  # number of frames without a valid pose, left out
    # transform from the depth camera's coordinates to the colour camera's, shape [4 4]; one where depth is
    # registered to colour
    color_from_depth: np.ndarray = field(default_factory=lambda: np.eye(4))
    gravity: str | None = None  # axis of the world that points up, "y" or "z", where the format states it

    @property
    def registered(self) -> bool:
        """True if one camera saw depth and colour."""
        return np.array_equal(self.color_from_depth, np.eye(4))

    @property
    def up(self) -> np.ndarray | None:
        """Up direction that the cameras speak for, unit, shape [3]: square to their rows of pixels, which people hold level.

        None where the format states it: phones are held upright, too.
        """
        if self.gravity:
            return None
        right = np.stack([frame.pose[:3, 0] for frame in self.frames])
        upwards = -np.stack([frame.pose[:3, 1] for frame in self.frames]).mean(axis=0)
        direction: np.ndarray = np.linalg.eigh(right.T @ right)[1][:, 0]
        return direction * (1.0 if direction @ upwards >= 0 else -1.0)


def images(
    recording: RgbdRecording, every: int, far: float
) -> Iterator[tuple[PosedFrame, np.ndarray, np.ndarray | None]]:
    """Yield every so many frames, their depth [m], shape [row column], 0 beyond a distance [m], and their colours, or None.

    Raises:
        InputError: an image that cannot be read, or depth that is not 16 bits or floats of the same size in all frames.
    """
    size = None
    for frame in recording.frames[::every]:
        depth = measured(recording, frame, far)
        if size is not None and depth.shape != size:
            raise InputError(
                f"{frame.depth.name}: has {depth.shape[1]} x {depth.shape[0]} pixels, frames before {size[1]} x {size[0]}"
            )
        size = depth.shape
        color = None if frame.color is None else frame.color.load()
        if frame.color and color is not None and (color.ndim != 3 or color.shape[2] < 3 or color.dtype != np.uint8):
            raise InputError(f"{frame.color.name}: is no colour image; expected RGB")
        yield frame, depth, None if color is None else color[..., :3]


def measured(recording: RgbdRecording, frame: PosedFrame, far: float = np.inf) -> np.ndarray:
    """Return a frame's depth [m], shape [row column], float32, 0 where there is none, no confidence, or it is far.

    Raises:
        InputError: an image that cannot be read, or no depth image.
    """
    raw = frame.depth.load()
    if raw.ndim != 2 or raw.dtype.itemsize < 2:
        raise InputError(f"{frame.depth.name}: is not a 16 bit depth image; expected a PNG with one channel of 16 bits")
    if raw.dtype.kind == "f":
        depth = np.nan_to_num(raw, nan=0.0, posinf=0.0, neginf=0.0).astype(np.float32)
        valid = depth > 0
    else:
        depth = raw.astype(np.float32) * np.float32(recording.metres)
        valid = raw < 65535
    if frame.confidence:
        sure = frame.confidence.load()
        if sure.shape != raw.shape:
            raise InputError(
                f"{frame.confidence.name}: has the shape {list(sure.shape)}, the depth image {list(raw.shape)}"
            )
        valid &= sure > 0
    return np.where(valid & (depth < far), depth, 0)


def check(recording: RgbdRecording) -> str | None:
    """Compare frames that overlap; return a doubt where none do, or None.

    The points of one frame, moved by the two poses, must have the depth that the other frame measured there.

    Raises:
        InputError: they have not; the line says which convention or unit would make them.
    """
    pairs = [_Pair.of(recording, *pair) for pair in _partners(recording)]
    scale = max(_SCALES, key=lambda each: _agreement(pairs, partial(_moved, scale=each), _CLOSE) or 0.0)
    words = f"depth and positions are in different units: they agree with positions times {scale:.3g}"
    changes: dict[str, Callable[[np.ndarray], np.ndarray]] = {**_CHANGES, words: partial(_moved, scale=scale)}
    stated, close = (_agreement(pairs, lambda pose: pose, tolerance) for tolerance in (1.0, _CLOSE))
    others = {words: _agreement(pairs, change) or 0.0 for words, change in changes.items()}
    best = max(others, key=lambda words: others[words])
    if others[words] > 0.6 and stated is not None and close is not None:
        # Frames that move little agree roughly in any unit.
        if (_agreement(pairs, changes[words], _CLOSE) or 0.0) > close + _BETTER:
            best, stated = words, min(stated, close)
    likely = f"; likely {best}" if others[best] > 0.6 else ""
    what = f"{recording.kind} recording: neighbouring frames contradict each other"
    if stated is None and others[best] > 0.7:
        raise InputError(f"{what} (they share nothing){likely}")
    if stated is None:
        return "no two frames overlap, so that poses and units are not checked"
    if stated < _AGREE or others[best] > stated + _BETTER:
        likely = likely or "; check the poses, the unit of depth and the intrinsics"
        raise InputError(f"{what} ({100 * stated:.0f} % of the points agree){likely}")
    return None


def check_color(recording: RgbdRecording) -> str | None:
    """Return a doubt where frames agree better in colour if depth is registered to it, though that is not stated; or None."""
    if recording.registered:
        return None
    stated: list[float] = []
    registered: list[float] = []
    for one, two in _partners(recording):
        if one.color is None or two.color is None:
            continue
        x, y, near = _Pair.of(recording, one, two).matched(lambda pose: pose, _CLOSE)
        greys = [picture.load()[..., :3].mean(axis=2) for picture in (one.color, two.color)]
        for move, cameras, differences in (
            (recording.color_from_depth, (one.color_camera, two.color_camera), stated),
            (np.eye(4), (one.depth_camera, two.depth_camera), registered),
        ):
            levels = [
                _sampled(grey, points[near] @ move[:3, :3].T + move[:3, 3], camera)
                for grey, points, camera in zip(greys, (x, y), cameras, strict=True)
            ]
            both = levels[0] - levels[1]
            both = both[np.isfinite(both)]
            if len(both) >= 100:
                differences.append(float(np.abs(both - np.median(both)).mean()))
    if len(stated) < 3 or len(registered) < 3 or np.mean(registered) > 0.9 * np.mean(stated):
        return None
    camera = ",".join(f"{number:g}" for number in (*astuple(recording.frames[0].depth_camera), 0, 0, 0))
    return f"colours agree better as if depth were registered to them; if it is, give color_camera=[{camera}]"


def _sampled(image: np.ndarray, points: np.ndarray, camera: Intrinsics) -> np.ndarray:
    """Return the levels of an image at points in its camera's coordinates [m], shape [point]; NaN where they are not in it."""
    columns = np.round(camera.fx * points[:, 0] / points[:, 2] + camera.cx)
    rows = np.round(camera.fy * points[:, 1] / points[:, 2] + camera.cy)
    inside = (columns >= 0) & (rows >= 0) & (columns < image.shape[1]) & (rows < image.shape[0])
    levels = np.full(len(points), np.nan)
    levels[inside] = image[rows[inside].astype(int), columns[inside].astype(int)]
    return levels


def keyframes(recording: RgbdRecording, sharpness: np.ndarray, spread: float = 0.35, turn: float = 25.0) -> list[int]:
    """Return indices of sharp frames that are well spread, so that there are 40 to 120 of a long walk.

    A frame is sharp beside its neighbours in time, which show the same: a plain wall has fewer edges than a shelf.

    Args:
        recording: the frames.
        sharpness: of each frame; NaN leaves it out, shape [frame].
        spread: distance from which on frames are not near, to begin with [m].
        turn: angle between optical axes from which on frames are not near, to begin with [deg].
    """
    usable = np.flatnonzero(np.isfinite(sharpness))
    values = sharpness[usable]
    around = [np.median(values[max(0, index - 10) : index + 11]) for index in range(len(usable))]
    order = usable[np.argsort(-values / np.maximum(around, 1e-9), kind="stable")]
    chosen = _spread_out(recording, order, spread, turn)
    for _ in range(8):
        if FEW <= len(chosen) <= MANY or (len(chosen) < FEW and len(chosen) >= len(usable) // 4):
            break
        factor = 0.8 if len(chosen) < FEW else 1.25
        spread, turn = factor * spread, factor * turn
        chosen = _spread_out(recording, order, spread, turn)
    return chosen


def _spread_out(recording: RgbdRecording, order: np.ndarray, spread: float, turn: float) -> list[int]:
    """Return the first frames in an order of which none is near to an earlier one, sorted."""
    poses = np.stack([frame.pose for frame in recording.frames])
    chosen: list[int] = []
    for index in order:
        far = np.linalg.norm(poses[chosen, :3, 3] - poses[index, :3, 3], axis=1) > spread
        turned = poses[chosen, :3, 2] @ poses[index, :3, 2] < np.cos(np.radians(turn))
        if (far | turned).all():
            chosen.append(int(index))
    return sorted(chosen)


def write_keyframes(
    folder: Path, recording: RgbdRecording, chosen: list[int], to_scan: np.ndarray, sharpness: np.ndarray
) -> None:
    """Write the colour images of some frames, and their cameras and poses in the scan, into a folder of a scan.

    Args:
        folder: of the scan.
        recording: the frames.
        chosen: their indices.
        to_scan: transform from the recording's coordinates to the scan's, a rigid motion and a scale, shape [4 4].
        sharpness: of each frame, shape [frame].
    """
    target = folder / KEYFRAMES
    target.mkdir()
    records = []
    depth_from_color = np.linalg.inv(recording.color_from_depth)
    for index in chosen:
        frame = recording.frames[index]
        if frame.color is None:
            continue
        name = frame.color.file.name if frame.color.file else f"{index:06d}.jpg"
        if frame.color.file:
            shutil.copyfile(frame.color.file, target / name)
        else:
            _write_jpeg(frame.color.load()[..., :3], target / name)
        pose = to_scan @ frame.pose @ depth_from_color
        pose[:3, :3] /= np.cbrt(np.linalg.det(pose[:3, :3]))
        record = {"image": name, "camera": asdict(frame.color_camera), "camera_to_scan": pose.tolist()}
        records.append({**record, "sharpness": float(sharpness[index])})
    (target / KEYFRAME_LIST).write_text(json.dumps({"frames": records}, indent=1), encoding="utf-8")


def copy_keyframes(folder: Path, out: Path, shift: np.ndarray | None = None) -> None:
    """Copy the keyframes of a scan's folder, where it has any, into another; poses are moved by a shift [m], shape [3]."""
    if not (folder / KEYFRAMES / KEYFRAME_LIST).is_file():
        return
    shutil.copytree(folder / KEYFRAMES, out / KEYFRAMES)
    if shift is None or not shift.any():
        return
    path = out / KEYFRAMES / KEYFRAME_LIST
    data = json.loads(path.read_text(encoding="utf-8"))
    for frame in data["frames"]:
        for row, by in zip(frame["camera_to_scan"], shift.tolist(), strict=False):
            row[3] += by
    path.write_text(json.dumps(data, indent=1), encoding="utf-8")


def _write_jpeg(color: np.ndarray, path: Path) -> None:
    from PIL import Image  # of the extra sim

    Image.fromarray(color).save(path, format="JPEG", quality=95)


def sharpness(color: np.ndarray | None) -> float:
    """Return how sharp an image is: the mean square of what its neighbours do not foretell; NaN without one."""
    if color is None:
        return float("nan")
    grey = color.astype(np.float32).mean(axis=2)
    inner = 4 * grey[1:-1, 1:-1] - grey[:-2, 1:-1] - grey[2:, 1:-1] - grey[1:-1, :-2] - grey[1:-1, 2:]
    return float(np.mean(inner**2))


_CHANGES: dict[str, Callable[[np.ndarray], np.ndarray]] = {
    "the cameras look along -z (OpenGL) where +z is expected, or the other way round": lambda pose: pose @ OPENGL,
    "the poses are world to camera where camera to world is expected": np.linalg.inv,
    "the poses are world to camera of cameras that look along the other way": lambda pose: np.linalg.inv(pose) @ OPENGL,
    "the images are turned by 90 degrees": lambda pose: pose @ _turn(1),
    "the images are turned by -90 degrees": lambda pose: pose @ _turn(-1),
    "the images are upside down": lambda pose: pose @ _turn(2),
}


_SCALES = [
    scale for scale in (*10.0 ** np.arange(-4.0, 5.0), 0.2, 5.0, *np.geomspace(0.06, 18.0, 36)) if abs(scale - 1) > 0.2
]


def _turn(quarters: int) -> np.ndarray:
    turn = np.eye(4)
    turn[:2, :2] = np.linalg.matrix_power(np.array([[0.0, -1.0], [1.0, 0.0]]), quarters % 4)
    return turn


def _moved(pose: np.ndarray, scale: float) -> np.ndarray:
    moved = pose.copy()
    moved[:3, 3] *= scale
    return moved


def _partners(recording: RgbdRecording) -> list[tuple[PosedFrame, PosedFrame]]:
    """Return pairs of frames whose cameras are turned by some degrees, which no convention changes, and moved the most."""
    frames = recording.frames
    pairs = []
    for first in np.unique(np.linspace(0, len(frames) - 2, _PAIRS).astype(int)):
        later = frames[first + 1 : first + 1 + _AHEAD]
        cosines = [(np.trace(frames[first].pose[:3, :3].T @ other.pose[:3, :3]) - 1) / 2 for other in later]
        turned = np.flatnonzero((np.array(cosines) < _APART) & (np.array(cosines) > _TOO_FAR))
        moved = [np.linalg.norm(later[index].pose[:3, 3] - frames[first].pose[:3, 3]) for index in turned]
        pairs.append((frames[first], later[turned[np.argmax(moved)]] if len(turned) else later[0]))
    return pairs


@dataclass(frozen=True, eq=False)
class _Pair:
    """Points of one frame in its camera [m], shape [point 3], its pose, and the other's depth image [m], pose and camera."""

    points: np.ndarray
    pose: np.ndarray
    depth: np.ndarray
    other: np.ndarray
    camera: Intrinsics

    @classmethod
    def of(cls, recording: RgbdRecording, one: PosedFrame, two: PosedFrame) -> _Pair:
        depth = measured(recording, one)
        step = max(1, int(np.sqrt(depth.size / 2000)))
        rows, columns = np.mgrid[0 : depth.shape[0] : step, 0 : depth.shape[1] : step]
        some, camera = depth[::step, ::step], one.depth_camera
        rays = np.stack([(columns - camera.cx) / camera.fx, (rows - camera.cy) / camera.fy, np.ones(rows.shape)], -1)
        points = (rays * some[..., None])[some > 0]
        return cls(points, one.pose, measured(recording, two), two.pose, two.depth_camera)

    def matched(
        self, change: Callable[[np.ndarray], np.ndarray], tolerance: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the points that both frames see in the one's and in the other's camera [m], and whether depth agrees."""
        move = np.linalg.inv(change(self.other)) @ change(self.pose)
        x = self.points @ move[:3, :3].T + move[:3, 3]
        ahead = x[:, 2] > 0.1
        own, x = self.points[ahead], x[ahead]
        columns = np.round(self.camera.fx * x[:, 0] / x[:, 2] + self.camera.cx)
        rows = np.round(self.camera.fy * x[:, 1] / x[:, 2] + self.camera.cy)
        height, width = self.depth.shape
        inside = (columns >= 0) & (rows >= 0) & (columns < width) & (rows < height)
        z = self.depth[rows[inside].astype(int), columns[inside].astype(int)]
        near = np.abs(z - x[inside, 2])[z > 0] < tolerance * (0.03 + 0.03 * z[z > 0])
        return own[inside][z > 0], x[inside][z > 0], near

    def agreement(self, change: Callable[[np.ndarray], np.ndarray], tolerance: float) -> float:
        """Return the share of points that both frames see and have at the same depth; NaN where few are seen by both."""
        near = self.matched(change, tolerance)[2]
        return float(near.mean()) if len(near) >= max(30, 0.08 * len(self.points)) else np.nan


def _agreement(pairs: list[_Pair], change: Callable[[np.ndarray], np.ndarray], tolerance: float = 1.0) -> float | None:
    """Return the median share of points of the pairs that overlap; None where fewer than two pairs do."""
    shares = np.array([pair.agreement(change, tolerance) for pair in pairs])
    shares = shares[np.isfinite(shares)]
    return float(np.median(shares)) if len(shares) >= min(2, len(pairs)) and len(shares) else None
