"""The files of a LeRobot dataset, and how it grows."""

from __future__ import annotations

import json
from pathlib import Path

import av
import numpy as np
import pyarrow.parquet as pq
import pytest

from s2a.core.errors import InputError
from s2a.learn.collect.lerobot import CHUNK, LeRobotDataset
from s2a.learn.collect.video import ColourVideo, LosslessVideo, quantiles

CAMERA = "observation.images.scene"
FEATURES = {
    "observation.state": {"dtype": "float32", "shape": [2], "names": ["a", "b"]},
    "grip": {"dtype": "float32", "shape": [1], "names": ["g"]},
    CAMERA: {"dtype": "video", "shape": [4, 6, 3], "names": ["height", "width", "channels"]},
}


def episode(length: int, level: float) -> dict[str, np.ndarray]:
    """Return columns that rise from a level by 1 a frame; the second number is twice the first."""
    rising = level + np.arange(length, dtype=np.float32)
    return {"observation.state": np.stack([rising, 2 * rising], axis=1), "grip": np.zeros((length, 1), np.float32)}


def add(dataset: LeRobotDataset, folder: Path, length: int, level: float, task: str = "open the drawer") -> None:
    """Add an episode with a file in the place of its video."""
    video = folder / "v.mp4"
    video.write_bytes(b"video")
    stats = {
        CAMERA: {**{k: np.full((3, 1, 1), level).tolist() for k in ("min", "max", "mean", "std")}, "count": [length]}
    }
    dataset.append(episode(length, level), {CAMERA: video}, stats, task)


def begun(folder: Path) -> LeRobotDataset:
    """Return a dataset in a folder."""
    return LeRobotDataset(folder / "set", 20, "panda", FEATURES)


def test_frames_are_counted_through_all_episodes(tmp_path: Path) -> None:
    dataset = begun(tmp_path)
    add(dataset, tmp_path, 3, 0.0)
    add(dataset, tmp_path, 2, 10.0, "close it")
    add(dataset, tmp_path, 1, 5.0)
    root = tmp_path / "set"
    info = json.loads((root / "meta/info.json").read_text())
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"], info["splits"]) == (
        3,
        6,
        2,
        {"train": "0:3"},
    )
    tables = [pq.read_table(root / info["data_path"].format(chunk_index=0, file_index=i)).to_pydict() for i in range(3)]
    assert [t["index"] for t in tables] == [[0, 1, 2], [3, 4], [5]]
    assert [t["frame_index"] for t in tables] == [[0, 1, 2], [0, 1], [0]]
    assert [t["episode_index"] for t in tables] == [[0] * 3, [1] * 2, [2]]
    assert [t["task_index"] for t in tables] == [[0] * 3, [1] * 2, [0]]
    assert tables[1]["timestamp"] == pytest.approx([0.0, 0.05])
    assert tables[1]["observation.state"] == [[10.0, 20.0], [11.0, 22.0]] and tables[1]["grip"] == [0.0, 0.0]
    rows = [pq.read_table(root / f"meta/episodes/chunk-000/file-00{i}.parquet").to_pylist()[0] for i in range(3)]
    assert [(r["dataset_from_index"], r["dataset_to_index"], r["length"]) for r in rows] == [
        (0, 3, 3),
        (3, 5, 2),
        (5, 6, 1),
    ]
    assert [r["tasks"] for r in rows] == [["open the drawer"], ["close it"], ["open the drawer"]]
    assert rows[1][f"videos/{CAMERA}/file_index"] == 1 and rows[1][f"videos/{CAMERA}/to_timestamp"] == pytest.approx(
        0.1
    )
    assert (root / info["video_path"].format(video_key=CAMERA, chunk_index=0, file_index=2)).read_bytes() == b"video"
    tasks = pq.read_table(root / "meta/tasks.parquet")
    assert tasks.to_pydict() == {"task_index": [0, 1], "task": ["open the drawer", "close it"]}
    assert json.loads(tasks.schema.metadata[b"pandas"])["index_columns"] == ["task"]


def test_statistics_are_those_of_all_frames_together(tmp_path: Path) -> None:
    dataset = begun(tmp_path)
    for length, level in ((3, 0.0), (2, 10.0), (4, -3.0)):
        add(dataset, tmp_path, length, level)
    every = np.concatenate([episode(n, level)["observation.state"] for n, level in ((3, 0.0), (2, 10.0), (4, -3.0))])
    found = json.loads((tmp_path / "set/meta/stats.json").read_text())["observation.state"]
    assert found["count"] == [9]
    for kind in ("min", "max", "mean", "std"):
        assert found[kind] == pytest.approx(getattr(every, kind)(axis=0).tolist(), rel=1e-6)


def test_a_dataset_is_gone_on_with_and_an_unfinished_episode_is_deleted(tmp_path: Path) -> None:
    first = begun(tmp_path)
    add(first, tmp_path, 3, 0.0)
    counted = (tmp_path / "set/meta/info.json").read_text()
    add(first, tmp_path, 2, 1.0)
    (tmp_path / "set/meta/info.json").write_text(counted)  # as if killed before the last file
    second = begun(tmp_path)
    assert second.count == 1
    assert not [*tmp_path.glob("set/*/*/*001*"), *tmp_path.glob("set/*/*/*/*001*")]
    add(second, tmp_path, 4, 2.0, "close it")
    assert (second.count, second.info["total_frames"], second.info["total_tasks"]) == (2, 7, 2)


@pytest.mark.parametrize("lost", ["info.json", "stats.json", "statistics of grip"])
def test_statistics_count_no_episode_twice_and_none_too_few(lost: str, tmp_path: Path) -> None:
    whole, cut = begun(tmp_path / "whole"), begun(tmp_path / "cut")
    for dataset in (whole, cut):
        dataset.root.parent.mkdir()
        add(dataset, dataset.root.parent, 3, 0.0)
    counted = (cut.root / "meta/info.json").read_text()
    add(cut, tmp_path / "cut", 4, 7.0)
    (cut.root / "meta/info.json").write_text(counted)  # killed between the two files, of which info.json counts
    if lost == "stats.json":
        (cut.root / "meta/stats.json").unlink()
    elif lost == "statistics of grip":
        (cut.root / "meta/stats.json").write_text('{"grip": 1}')
    cut = begun(tmp_path / "cut")
    for dataset in (whole, cut):
        add(dataset, dataset.root.parent, 2, -5.0)
    assert cut.info == whole.info
    stats = [json.loads((dataset.root / "meta/stats.json").read_text()) for dataset in (cut, whole)]
    assert stats[0] == stats[1]


def test_an_episode_whose_statistics_are_needed_and_damaged_is_named(tmp_path: Path) -> None:
    dataset = begun(tmp_path)
    add(dataset, tmp_path, 3, 0.0)
    (dataset.root / "meta/episodes/chunk-000/file-000.parquet").write_bytes(b"half")
    assert begun(tmp_path).count == 1
    (dataset.root / "meta/stats.json").unlink()
    with pytest.raises(InputError, match=r"file-000\.parquet: not of a dataset"):
        begun(tmp_path)


def test_folders_that_hold_something_else_are_left_alone(tmp_path: Path) -> None:
    (tmp_path / "set").mkdir()
    (tmp_path / "set/thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="holds files that are no dataset; choose another place"):
        begun(tmp_path)
    assert [file.name for file in (tmp_path / "set").iterdir()] == ["thesis.txt"]
    other = LeRobotDataset(tmp_path / "other", 20, "panda", {"grip": FEATURES["grip"]})
    other.append({"grip": np.zeros((2, 1), np.float32)}, {}, {}, "wait")
    with pytest.raises(InputError, match="holds a dataset of other features or another fps"):
        LeRobotDataset(tmp_path / "other", 20, "panda", FEATURES)
    (tmp_path / "other/meta/info.json").write_text("{")
    with pytest.raises(InputError, match=r"info\.json: not of a dataset"):
        LeRobotDataset(tmp_path / "other", 20, "panda", {"grip": FEATURES["grip"]})


def test_the_thousandth_episode_begins_a_new_folder(tmp_path: Path) -> None:
    dataset = begun(tmp_path)
    add(dataset, tmp_path, 1, 0.0)
    dataset.info["total_episodes"] = CHUNK
    add(dataset, tmp_path, 1, 0.0)
    assert (tmp_path / "set/data/chunk-001/file-000.parquet").is_file()


def frames(path: Path, kind: str) -> np.ndarray:
    """Return the frames of a video."""
    with av.open(str(path)) as file:
        return np.stack([frame.to_ndarray(format=kind) for frame in file.decode(video=0)])


def test_depth_comes_back_as_it_was_written_and_colours_nearly(tmp_path: Path) -> None:
    random = np.random.default_rng(0)
    depth = random.integers(0, 2**16, (7, 32, 48)).astype(np.uint16)
    video = LosslessVideo(tmp_path / "d", 48, 32, 20)
    for image in depth:
        video.add(image)
    assert video.close().frames == 7
    assert np.array_equal(frames(tmp_path / "d.mkv", "gray16le"), depth)
    smooth = np.stack([np.full((32, 48, 3), (40 * i, 120, 250 - 40 * i), np.uint8) for i in range(6)])
    colours = ColourVideo(tmp_path / "c", 48, 32, 20)
    for image in smooth:
        colours.add(image)
    stats = colours.close().stats
    assert np.abs(frames(tmp_path / "c.mp4", "rgb24").astype(int) - smooth.astype(int)).max() < 8
    pixels = smooth.reshape(-1, 3) / 255.0
    for kind in ("min", "max", "mean", "std"):
        assert np.allclose(np.ravel(stats[kind]), getattr(pixels, kind)(axis=0), atol=1e-7), kind
    assert stats["count"] == [6]


LEROBOTS = {
    "q01": (-0.9999908804893494, -0.9996777415275574),
    "q10": (-0.9847999811172485, -0.9875308156013489),
    "q50": (-0.2452417016029358, -0.2930706024169922),
    "q90": (0.9396505951881409, 0.9504172444343567),
    "q99": (0.9986153244972229, 0.9981041550636292),
}
"""Of sin(i²), i from 0 to 49, in one episode, and in two of 20 and 30 frames: get_feature_stats and aggregate_feature_stats of
lerobot 0.4.4."""


@pytest.mark.parametrize("lengths", [(50,), (20, 30)])
def test_quantiles_are_those_of_lerobot(tmp_path: Path, lengths: tuple[int, ...]) -> None:
    grip = np.sin(np.arange(50, dtype=np.float32) ** 2)[:, None]
    dataset = LeRobotDataset(tmp_path / "set", 20, "panda", {"grip": FEATURES["grip"]})
    for part in np.split(grip, np.cumsum(lengths)[:-1]):
        dataset.append({"grip": part}, {}, {}, "open the drawer")
    stats = json.loads((tmp_path / "set/meta/stats.json").read_text())
    for name, values in LEROBOTS.items():
        assert stats["grip"][name] == pytest.approx([values[len(lengths) - 1]], abs=1e-6)
        assert len(stats["timestamp"][name]) == len(stats["index"][name]) == 1


@pytest.mark.parametrize(
    "values",
    [
        np.zeros(5, np.float32),
        np.full(9, 0.3, np.float32),
        np.array([2.5], np.float32),
        np.arange(1000),
        np.random.default_rng(0).normal(size=500).astype(np.float32),
    ],
)
def test_quantiles_lie_within_a_bin_of_the_numbers_own(values: np.ndarray) -> None:
    for name, value in quantiles(values).items():
        low, high = (np.quantile(values, int(name[1:]) / 100, method=side) for side in ("lower", "higher"))
        width = np.ptp(values) / 5000 + 1e-6
        assert low - 2 * width <= value <= high + 2 * width


def test_the_pixels_of_a_video_have_quantiles(tmp_path: Path) -> None:
    video = ColourVideo(tmp_path / "v", 16, 16, 20)
    video.add(np.full((16, 16, 3), (0, 51, 255), np.uint8))
    video.add(np.full((16, 16, 3), (0, 51, 255), np.uint8))
    stats = video.close().stats
    for name in ("q01", "q50", "q99"):
        assert np.shape(stats[name]) == (3, 1, 1) and np.ravel(stats[name]) == pytest.approx([0.0, 0.2, 1.0], abs=1e-6)
