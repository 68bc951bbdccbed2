"""A process that is killed while it writes loses the episode in flight, whichever file it was at."""

from __future__ import annotations

import json
import os
import shutil
import signal
import sys
from pathlib import Path

import av
import h5py
import numpy as np
import pyarrow.parquet as pq
import pytest

from s2a.learn.collect.episodes import UNFINISHED, Dataset, Episode, Features, read_replay, temporary
from s2a.learn.collect.lerobot import IMAGES, LOSSLESS, LeRobot
from s2a.learn.collect.robomimic import INDEX, Robomimic
from s2a.scene.artefacts import DATASET

WRITES = ("os.rename", "os.remove", "os.mkdir", "shutil.move", "shutil.rmtree")
FEATURES = Features(
    "panda", 20, {"observation.state": ("a",), "action": ("joint",)}, ("wrist",), (32, 32), np.array([[-1.0], [1.0]]),
    {"sim": {}, "task": {"name": "open_part"}},
)  # fmt: skip


def add(dataset: Dataset, folder: Path, level: int) -> None:
    """Add an episode of three frames, all of whose numbers are a level."""
    images = {}
    for kind, made in dataset.FILES.items():
        file = made(folder / f"{level}_{kind}", 32, 32, 20)
        for _ in range(3):
            file.add(
                np.full((32, 32, 3) if kind == "image" else (32, 32), level, np.uint8 if kind == "image" else np.uint16)
            )
        images["wrist", kind] = file.close()
    columns = {name: np.full((3, 1), level, np.float32) for name in FEATURES.columns}
    start = {"joint_q": np.full(9, level)}
    dataset.add(Episode(columns, images, "wait", {}, {"seed": 0}, np.full((9, 1), level), start))


def levels(dataset: Dataset) -> list[set[int]]:
    """Return what every file of each episode holds."""
    found = []
    for i in range(dataset.count):
        start, actions = read_replay(dataset.root, i)
        values = [start["joint_q"], actions]
        if isinstance(dataset, Robomimic):
            with h5py.File(dataset.root / INDEX) as file:
                values += [each[:] for name, each in file[f"data/demo_{i}/obs"].items()]
        else:
            table = pq.read_table(dataset.root / f"data/chunk-000/file-00{i}.parquet")
            values.append(table["action"].to_numpy())
            for kind in ("depth", "instances"):
                with av.open(str(dataset.root / LOSSLESS.format(kind=kind, camera="wrist", index=i))) as video:
                    values += [frame.to_ndarray(format="gray16le") for frame in video.decode(video=0)]
            video = f"videos/{IMAGES.format(camera='wrist')}/chunk-000/file-00{i}.mp4"
            assert (dataset.root / video).stat().st_size > 0
        found.append({int(v) for each in values for v in np.unique(each)})
    return found


def is_killed(at: int, root: Path, folder: Path, kind: type[Dataset]) -> bool:
    """Add an episode in a process that is killed at one of its writes; return False where it has none so late."""
    pid = os.fork()
    if not pid:
        left = [at]

        def count(event: str, inputs: tuple) -> None:  # noqa: ARG001
            if event in WRITES or (event == "open" and isinstance(inputs[1], str) and set(inputs[1]) & set("wxa+")):
                left[0] -= 1
                if left[0] < 0:
                    os.kill(os.getpid(), signal.SIGKILL)

        dataset = kind(root, FEATURES)
        sys.addaudithook(count)
        add(dataset, folder, 2)
        os._exit(0)
    return os.WIFSIGNALED(os.waitpid(pid, 0)[1])


@pytest.mark.slow
@pytest.mark.parametrize("kind", [LeRobot, Robomimic])
def test_a_kill_at_any_write_loses_no_finished_episode(kind: type[Dataset], tmp_path: Path) -> None:
    whole = tmp_path / "whole"
    add(kind(whole, FEATURES), tmp_path / "images", 1)
    at = 0
    while True:
        root, images = tmp_path / f"{at}/set", tmp_path / f"{at}/images"
        shutil.copytree(whole, root)
        images.mkdir()
        killed = is_killed(at, root, images, kind)
        again = kind(root, FEATURES)
        assert again.count in ((1, 2) if killed else (2,)), at
        add(again, images, 3)
        kept = [1, *([2] if again.count == 3 else []), 3]
        assert levels(kind(root, FEATURES)) == [{level} for level in kept], at
        if kind is LeRobot:
            stats = json.loads((root / "meta/stats.json").read_text())["action"]
            assert stats["count"] == [3 * len(kept)] and stats["mean"] == pytest.approx([np.mean(kept)]), at
        if not killed:
            break
        at += 1
    assert at >= 8


@pytest.mark.parametrize("kind", [LeRobot, Robomimic])
def test_a_run_that_was_killed_before_its_first_episode_is_gone_on_with(kind: type[Dataset], tmp_path: Path) -> None:
    root = tmp_path / "set"
    (root / f"{UNFINISHED}x").mkdir(parents=True)
    kind(root, FEATURES)  # killed before anything else was written
    (root / DATASET).parent.mkdir()
    (root / DATASET).write_text("{}")
    (root / f"{UNFINISHED}x/0_wrist_image.mp4").write_bytes(b"half")
    dataset = kind(root, FEATURES)
    with temporary(root) as folder:
        assert [path.name for path in root.glob(f"{UNFINISHED}*")] == [Path(folder).name]
        add(dataset, tmp_path, 1)
    assert levels(kind(root, FEATURES)) == [{1}]
