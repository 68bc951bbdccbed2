"""Videos, frame by frame: colours for learners, depth without loss."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import av
import numpy as np

KEYFRAMES = 2
"""Every second frame can be read without the one before it, as LeRobot writes its own: learners read single frames."""


class ColourVideo:
    """An mp4 file (H.264) of frames [height width 3], uint8, and the statistics of its pixels.

    Attributes:
        path: the file.
    """

    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        """Open a file to write."""
        self.path, self._sums = path, np.zeros((4, 3))
        self._sums[0], self._frames = np.inf, 0
        self._file, self._stream = _opened(path, "libx264", "yuv420p", (width, height), fps)
        self._stream.options = {"g": str(KEYFRAMES), "crf": "23", "preset": "veryfast"}

    def add(self, image: np.ndarray) -> None:
        """Append a frame."""
        for packet in self._stream.encode(av.VideoFrame.from_ndarray(image, format="rgb24")):
            self._file.mux(packet)
        pixels = image.reshape(-1, 3) / 255.0
        self._sums[0] = np.minimum(self._sums[0], pixels.min(axis=0))
        self._sums[1] = np.maximum(self._sums[1], pixels.max(axis=0))
        self._sums[2:] += [pixels.mean(axis=0), (pixels**2).mean(axis=0)]
        self._frames += 1

    def close(self) -> dict[str, Any]:
        """Finish the file; return min, max, mean and std of the channels in [0, 1], shape [3 1 1], and the number of frames."""
        _finish(self._file, self._stream)
        mean, squares = self._sums[2:] / max(self._frames, 1)
        found = {
            "min": self._sums[0],
            "max": self._sums[1],
            "mean": mean,
            "std": np.sqrt(np.maximum(squares - mean**2, 0.0)),
        }
        return {**{kind: each.reshape(3, 1, 1).tolist() for kind, each in found.items()}, "count": [self._frames]}


class DepthVideo:
    """An mkv file (FFV1, lossless) of frames [height width], uint16: millimetres, 0 where nothing is seen.

    Attributes:
        path: the file.
    """

    def __init__(self, path: Path, width: int, height: int, fps: int) -> None:
        """Open a file to write."""
        self.path = path
        self._file, self._stream = _opened(path, "ffv1", "gray16le", (width, height), fps)

    def add(self, image: np.ndarray) -> None:
        """Append a frame."""
        for packet in self._stream.encode(av.VideoFrame.from_ndarray(image, format="gray16le")):
            self._file.mux(packet)

    def close(self) -> None:
        """Finish the file."""
        _finish(self._file, self._stream)


def _opened(path: Path, codec: str, pixels: str, size: tuple[int, int], fps: int) -> tuple[Any, Any]:
    path.parent.mkdir(parents=True, exist_ok=True)
    file = av.open(str(path), "w")
    stream: Any = file.add_stream(codec, rate=fps)
    stream.width, stream.height = size
    stream.pix_fmt = pixels
    return file, stream


def _finish(file: Any, stream: Any) -> None:
    for packet in stream.encode():
        file.mux(packet)
    file.close()
