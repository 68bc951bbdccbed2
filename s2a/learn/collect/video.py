"""Images of a camera as video files, encoded by processes of their own while the simulation goes on."""

from __future__ import annotations

import multiprocessing
import os
import signal
import zlib
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, Protocol

import av
import numpy as np

from s2a.core.errors import InputError
from s2a.core.outputs import FULL

# Every second frame can be read without the one before it, as LeRobot writes its own: learners read single frames
KEYFRAMES = 2
# What LeRobot keeps, which some policies normalise by
QUANTILES = {"q01": 0.01, "q10": 0.1, "q50": 0.5, "q90": 0.9, "q99": 0.99}
BINS = 5000  # Of the histogram by which LeRobot estimates them
LEVEL = 1  # Of zlib: the fastest


@dataclass(frozen=True)
class Images:
    """A finished file."""

    path: Path  # of it
    frames: int  # how many
    # of a ColourVideo: min, max, mean, std and quantiles of its channels in [0, 1], shape [3 1 1],
    # and the number of frames
    stats: dict[str, Any] = field(default_factory=dict)
    lengths: tuple[int, ...] = ()  # of a DeflatedImages: bytes of each frame


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
        moments = {
            "min": [values[each.nonzero()[0]].min(initial=1.0) for each in self._counts],
            "max": [values[each.nonzero()[0]].max(initial=0.0) for each in self._counts],
            "mean": mean,
            "std": np.sqrt(np.maximum(squares - mean**2, 0.0)),
        }
        if self._frames:
            each = [quantiles(np.arange(256)[counts > 0], counts[counts > 0]) for counts in self._counts]
            moments |= {kind: [channel[kind] / 255.0 for channel in each] for kind in QUANTILES}
        stats = {kind: np.reshape(each, (3, 1, 1)).tolist() for kind, each in moments.items()}
        return Images(self._path, self._frames, {**stats, "count": [self._frames]})


def quantiles(values: np.ndarray, counts: np.ndarray | None = None) -> dict[str, float]:
    """Return the QUANTILES of numbers as LeRobot estimates them, by a histogram in the numbers' own precision.

    Source: RunningQuantileStats in lerobot/datasets/compute_stats.py, huggingface/lerobot 0.4.4.

    Args:
        values: shape [n].
        counts: how often each is there, shape [n]; None: once.
    """
    number = float(len(values) if counts is None else counts.sum())
    if number < 2:
        return dict.fromkeys(QUANTILES, float(values.mean()))
    edges = np.linspace(values.min() - 1e-10, values.max() + 1e-10, BINS + 1)
    below = np.concatenate([[0.0], np.cumsum(np.histogram(values, edges, weights=counts)[0], dtype=float)])

    def quantile(fraction: float) -> float:
        bin_ = int(np.searchsorted(below[1:], fraction * number))
        if bin_ in (0, BINS):
            return float(edges[bin_])
        inside = (fraction * number - below[bin_]) / (below[bin_ + 1] - below[bin_])
        return float(edges[bin_] + inside * (edges[bin_ + 1] - edges[bin_]))

    return {name: quantile(fraction) for name, fraction in QUANTILES.items()}


class LosslessVideo:
    """An mkv file (FFV1) of frames [height width], uint16, that come back as they were."""

    def __init__(self, stem: Path, width: int, height: int, fps: int) -> None:
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
    file = av.open(str(path), "w", container_options={"fflags": "+bitexact"})  # Matroska gets a random number else
    stream: Any = file.add_stream(codec, rate=fps, options=options)
    stream.width, stream.height = size
    stream.pix_fmt = pixels
    return file, stream


def _finish(file: Any, stream: Any) -> None:
    for packet in stream.encode():
        file.mux(packet)
    file.close()


Key = tuple[str, str]  # Camera, and kind of image: "image", "depth" or "instances"
SLOTS = 3  # Frames of all worlds that can wait to be encoded
CHANNELS = {"image": (np.uint8, (3,)), "depth": (np.uint16, ()), "instances": (np.uint16, ())}


@dataclass(frozen=True)
class FrameMemory:
    """How the frames of all worlds lie in memory."""

    keys: tuple[Key, ...]  # what there is of each world
    worlds: int  # how many
    size: tuple[int, int]  # width and height [pixel]

    def arrays(self, memory: Any) -> list[dict[Key, np.ndarray]]:
        """Return the images in shared memory, shape [world height width ...], one dictionary a slot."""
        slots: list[dict[Key, np.ndarray]] = []
        flat, at = np.frombuffer(memory, dtype=np.uint8), 0
        for _ in range(SLOTS):
            slots.append({})
            for key in self.keys:
                dtype, shape = self._array(key)
                end = at + int(np.prod(shape)) * np.dtype(dtype).itemsize
                slots[-1][key] = flat[at:end].view(dtype).reshape(shape)
                at = end
        return slots

    @property
    def bytes(self) -> int:
        """Size of the memory."""
        arrays = map(self._array, self.keys)
        return SLOTS * sum(int(np.prod(shape)) * np.dtype(dtype).itemsize for dtype, shape in arrays)

    def _array(self, key: Key) -> tuple[Any, tuple[int, ...]]:
        dtype, channels = CHANNELS[key[1]]
        return dtype, (self.worlds, self.size[1], self.size[0], *channels)


class Encoders:
    """Files of all worlds of a batch of episodes.

    Where this process ends, however, the others do too: their pipe is closed.
    """

    def __init__(
        self, layout: FrameMemory, files: Mapping[str, type[ImageFile]], fps: int, count: int | None = None
    ) -> None:
        """Start the processes.

        Args:
            layout: of the images.
            files: for each kind of image.
            fps: frames a second.
            count: of the processes; None: one a core, but for one that simulates.
        """
        self._layout, self._frame = layout, 0
        # Colours take longest: in this order every process gets as many of them.
        items = [(w, key) for key in sorted(layout.keys, key=lambda key: key[1]) for w in range(layout.worlds)]
        cores = len(os.sched_getaffinity(0))
        count = min(count or max(1, cores - 1), len(items))
        context = multiprocessing.get_context("spawn")  # a fork would copy what Warp and CUDA hold
        memory = context.RawArray("B", layout.bytes)
        self._arrays = layout.arrays(memory)
        self._pipes: list[Connection] = []
        self._processes = []
        for k in range(count):
            mine, other = context.Pipe()
            inputs = other, memory, layout, items[k::count], dict(files), fps
            process = context.Process(target=_work, args=inputs, daemon=True)
            process.start()
            other.close()
            self._pipes.append(mine)
            self._processes.append(process)
        self._pending = 0  # frames that were sent, and are not known to be encoded

    def __enter__(self) -> Encoders:
        return self

    def __exit__(self, *_: object) -> None:
        for pipe in self._pipes:
            pipe.close()
        for process in self._processes:
            process.join()

    def begin(self, folder: Path) -> None:
        """Open the files of a batch in a folder."""
        self._ask("begin", folder)
        self._answers()

    def slot(self) -> dict[Key, np.ndarray]:
        """Return where the next frame's images belong, shape [world height width ...]; waits until they are free."""
        while self._pending == SLOTS:
            self._answers()
            self._pending -= 1
        return self._arrays[self._frame % SLOTS]

    def add(self, alive: np.ndarray) -> None:
        """Append what is in the slot to the files of those worlds that are alive, shape [world]."""
        self._ask("add", self._frame % SLOTS, alive)
        self._frame += 1
        self._pending += 1

    def end(self) -> list[dict[Key, Images]]:
        """Finish the files, and return those of each world."""
        for _ in range(self._pending):
            self._answers()
        self._pending = 0
        self._ask("end")
        files: list[dict[Key, Images]] = [{} for _ in range(self._layout.worlds)]
        for part in self._answers():
            for (world, key), images in part.items():
                files[world][key] = images
        return files

    def _ask(self, *message: object) -> None:
        with suppress(ConnectionError):  # of a process that has ended, as its answer tells
            for pipe in self._pipes:
                pipe.send(message)

    def _answers(self) -> list[Any]:
        """Return the answers to the oldest message of all processes; InputError where one failed."""
        try:
            answers = [pipe.recv() for pipe in self._pipes]
        except (EOFError, ConnectionError) as error:
            raise InputError(
                "an image encoder has ended, perhaps out of memory; free some, or lower num_envs"
            ) from error
        for number, reason in (answer for good, answer in answers if not good):
            raise OSError(number, reason) if number in FULL else InputError(f"images cannot be written: {reason}")
        return [answer for _, answer in answers]


class _Worker:
    """The files of one process."""

    def __init__(
        self, memory: Any, layout: FrameMemory, items: Sequence[tuple[int, Key]], files: Any, fps: int
    ) -> None:
        self._arrays, self._items, self._types = layout.arrays(memory), items, files
        self._size, self._fps = layout.size, fps
        self._files: dict[tuple[int, Key], ImageFile] = {}

    def begin(self, folder: Path) -> None:
        for world, (camera, kind) in self._items:
            stem = folder / f"{world}_{camera}_{kind}"
            self._files[world, (camera, kind)] = self._types[kind](stem, *self._size, self._fps)

    def add(self, slot: int, alive: np.ndarray) -> None:
        for (world, key), file in self._files.items():
            if alive[world]:
                file.add(self._arrays[slot][key][world])

    def end(self) -> dict[tuple[int, Key], Images]:
        return {name: file.close() for name, file in self._files.items()}


def _work(pipe: Connection, memory: Any, layout: FrameMemory, items: Sequence[Any], files: Any, fps: int) -> None:
    """Do what is asked through a pipe until it is closed."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the one that simulates is interrupted, and closes the pipe
    worker = _Worker(memory, layout, items, files, fps)
    while True:
        try:
            name, *inputs = pipe.recv()
        except (EOFError, ConnectionError):
            return
        try:
            answer = True, getattr(worker, name)(*inputs)
        except Exception as error:
            answer = False, (getattr(error, "errno", None), str(error) or repr(error))
        with suppress(ConnectionError):  # the one that simulates has ended
            pipe.send(answer)
