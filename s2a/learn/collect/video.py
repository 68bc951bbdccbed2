"""Images of one camera in one episode as files, frame by frame: videos for learners, and what must come back as it was."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

import av
import numpy as np

KEYFRAMES = 2
"""Every second frame can be read without the one before it, as LeRobot writes its own: learners read single frames."""
LEVEL = 1
"""Of zlib: the fastest."""


@dataclass(frozen=True)
class Images:
    """A finished file.

    Attributes:
        path: of it.
        frames: how many.
        stats: of a ColourVideo: min, max, mean and std of its channels in [0, 1], shape [3 1 1], and the number of frames.
        lengths: of a DeflatedImages: bytes of each frame.
    """

    path: Path
    frames: int
    stats: dict[str, Any] = field(default_factory=dict)
    lengths: tuple[int, ...] = ()


class ImageFile(Protocol):
    """Takes frames until it is closed."""

    def __init__(self, stem: Path, width: int, height: int, fps: int) -> None:
        """Open a file of this path but for its suffix."""

    def add(self, image: np.ndarray) -> None:
        """Append a frame."""

    def close(self) -> Images:
        """Finish the file."""


class ColourVideo:
    """An mp4 file (H.264) of frames [height width 3], uint8, and the statistics of its pixels."""

    def __init__(self, stem: Path, width: int, height: int, fps: int) -> None:
        """Open a file to write."""
        self._path, self._counts, self._frames = stem.with_suffix(".mp4"), np.zeros((3, 256), dtype=np.int64), 0
        options = {"g": str(KEYFRAMES), "crf": "23", "preset": "veryfast", "threads": "1"}
        self._file, self._stream = _opened(self._path, "libx264", "yuv420p", (width, height), fps, options)

    def add(self, image: np.ndarray) -> None:
        """Append a frame."""
        for packet in self._stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
            self._file.mux(packet)
        for channel, counts in enumerate(self._counts):
            counts += np.bincount(image[..., channel].ravel(), minlength=256)
        self._frames += 1

    def close(self) -> Images:
        """Finish the file."""
        _finish(self._file, self._stream)
        values, pixels = np.arange(256) / 255.0, np.maximum(self._counts.sum(axis=1), 1)
        mean, squares = self._counts @ values / pixels, self._counts @ values**2 / pixels
        found = {
            "min": [values[each.nonzero()[0]].min(initial=1.0) for each in self._counts],
            "max": [values[each.nonzero()[0]].max(initial=0.0) for each in self._counts],
            "mean": mean,
            "std": np.sqrt(np.maximum(squares - mean**2, 0.0)),
        }
        stats = {kind: np.reshape(each, (3, 1, 1)).tolist() for kind, each in found.items()}
        return Images(self._path, self._frames, {**stats, "count": [self._frames]})


class LosslessVideo:
    """An mkv file (FFV1) of frames [height width], uint16, that come back as they were."""

    def __init__(self, stem: Path, width: int, height: int, fps: int) -> None:
        """Open a file to write."""
        self._path, self._frames = stem.with_suffix(".mkv"), 0
        self._file, self._stream = _opened(self._path, "ffv1", "gray16le", (width, height), fps, {"threads": "1"})

    def add(self, image: np.ndarray) -> None:
        """Append a frame."""
        for packet in self._stream.encode(av.VideoFrame.from_ndarray(image, format="gray16le")):
            self._file.mux(packet)
        self._frames += 1

    def close(self) -> Images:
        """Finish the file."""
        _finish(self._file, self._stream)
        return Images(self._path, self._frames)


class DeflatedImages:
    """A file of frames of any shape, each compressed by zlib: the chunks of an HDF5 dataset, before it is known to be kept."""

    def __init__(self, stem: Path, width: int, height: int, fps: int) -> None:
        """Open a file to write; the frames tell their size."""
        self._path, self._lengths = stem.with_suffix(".zlib"), list[int]()
        self._path.parent.mkdir(parents=True, exist_ok=True)
        self._file = self._path.open("wb")

    def add(self, image: np.ndarray) -> None:
        """Append a frame."""
        packed = zlib.compress(image.tobytes(), LEVEL)
        self._file.write(packed)
        self._lengths.append(len(packed))

    def close(self) -> Images:
        """Finish the file."""
        self._file.close()
        return Images(self._path, len(self._lengths), lengths=tuple(self._lengths))


def _opened(
    path: Path, codec: str, pixels: str, size: tuple[int, int], fps: int, options: dict[str, str]
) -> tuple[Any, Any]:
    path.parent.mkdir(parents=True, exist_ok=True)
    file = av.open(str(path), "w")
    stream: Any = file.add_stream(codec, rate=fps, options=options)
    stream.width, stream.height = size
    stream.pix_fmt = pixels
    return file, stream


def _finish(file: Any, stream: Any) -> None:
    for packet in stream.encode():
        file.mux(packet)
    file.close()
