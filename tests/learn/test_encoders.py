"""Images that other processes write: each in its file, in order, and none that is not wanted."""

from __future__ import annotations

import multiprocessing
import os
import signal
import time
from pathlib import Path

import numpy as np
import pytest

from s2a.core.errors import InputError
from s2a.learn.collect.video import SLOTS, DeflatedImages, Encoders, FrameMemory, LosslessVideo

LAYOUT = FrameMemory((("wrist", "image"), ("wrist", "depth")), 3, (6, 4))
FILES = {"image": DeflatedImages, "depth": DeflatedImages}


def read(path: Path, lengths: tuple[int, ...], dtype: type) -> list[np.ndarray]:
    """Return the frames of a DeflatedImages."""
    import zlib

    data, at = path.read_bytes(), np.cumsum([0, *lengths])
    return [np.frombuffer(zlib.decompress(data[a:b]), dtype) for a, b in zip(at[:-1], at[1:], strict=True)]


@pytest.mark.parametrize("count", [1, 4])
def test_frames_come_in_order_while_their_world_is_alive(count: int, tmp_path: Path) -> None:
    frames = 2 * SLOTS + 1
    with Encoders(LAYOUT, FILES, 20, count) as encoders:
        for batch in range(2):  # the processes serve many batches
            encoders.begin(tmp_path / str(batch))
            for k in range(frames):
                slot = encoders.slot()
                for world in range(3):
                    slot["wrist", "image"][world] = 10 * world + k
                    slot["wrist", "depth"][world] = 1000 * world + k
                encoders.add(np.array([True, k < 2, True]))
            found = encoders.end()
    for world, length in enumerate((frames, 2, frames)):
        for kind, dtype, factor in (("image", np.uint8, 10), ("depth", np.uint16, 1000)):
            images = found[world]["wrist", kind]
            assert images.frames == length
            values = [np.unique(each).tolist() for each in read(images.path, images.lengths, dtype)]
            assert values == [[factor * world + k] for k in range(length)]


def test_a_file_that_cannot_be_written_is_one_line(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        Encoders(LAYOUT, {"image": DeflatedImages, "depth": LosslessVideo}, 20, 1) as encoders,
        pytest.raises(InputError, match="images cannot be written: "),
    ):
        encoders.begin(tmp_path / "file")


def _simulate(folder: Path, told: multiprocessing.connection.Connection) -> None:
    with Encoders(LAYOUT, FILES, 20, 2) as encoders:
        encoders.begin(folder)
        told.send([process.pid for process in encoders._processes])
        time.sleep(60.0)


def test_the_processes_end_with_the_one_that_simulates_even_if_it_is_killed(tmp_path: Path) -> None:
    context = multiprocessing.get_context("spawn")
    mine, other = context.Pipe()
    process = context.Process(target=_simulate, args=(tmp_path, other))
    process.start()
    pids = mine.recv()
    os.kill(process.pid or 0, signal.SIGKILL)
    process.join()
    until = time.monotonic() + 20.0
    while time.monotonic() < until and any(map(_runs, pids)):
        time.sleep(0.1)
    assert not any(map(_runs, pids))


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().split()[2] != "Z"
    except FileNotFoundError:
        return False
