"""LeRobotDataset v3.0, written with pyarrow: one parquet file and one video a camera for each episode.

Format: huggingface/lerobot 0.4.4, lerobot/datasets/utils.py (paths, info.json) and lerobot_dataset.py (columns of meta/episodes).
"""

import json
import math
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from s2a.core.errors import InputError
from s2a.core.outputs import PART, replace_file
from s2a.learn.collect.episodes import Episode, Features, is_foreign, write_replay
from s2a.learn.collect.video import QUANTILES, ColourVideo, ImageFile, LosslessVideo, quantiles

VERSION = "v3.0"
CHUNK = 1000  # Files in a folder
FILE = "chunk-{chunk_index:03d}/file-{file_index:03d}"
DATA, VIDEO = f"data/{FILE}.parquet", f"videos/{{video_key}}/{FILE}.mp4"
EPISODES = f"meta/episodes/{FILE}.parquet"
# Columns of every dataset, beside "timestamp"
COUNTED = {name: "int64" for name in ("frame_index", "episode_index", "index", "task_index")}
Stats = dict[str, dict[str, Any]]


class LeRobotDataset:
    """A dataset in a folder that grows by whole episodes; info.json, written last, says how many there are.

    Attributes:
        root: the folder.
        info: content of meta/info.json.
    """

    def __init__(self, root: Path, fps: int, robot: str, features: Mapping[str, Mapping[str, Any]]) -> None:
        """Begin a dataset, or go on with one; files of an episode that was not finished are deleted.

        `fps`: frames a second; `features`: dtype ("float32" or "video"), shape and names of each column or camera.

        Raises:
            InputError: the folder holds something else, or a dataset of other features.
        """
        self.root = root
        own = {name: {"dtype": kind, "shape": [1], "names": None} for name, kind in COUNTED.items()}
        own["timestamp"] = {"dtype": "float32", "shape": [1], "names": None}
        expected = {**{key: dict(value) for key, value in features.items()}, **own}
        file = root / "meta/info.json"
        if file.is_file():
            self.info = _read(file)
            if (self.info.get("features"), self.info.get("fps")) != (json.loads(json.dumps(expected)), fps):
                raise InputError(f"{root} holds a dataset of other features or another fps; choose another place")
        elif is_foreign(root):
            raise InputError(f"{root} holds files that are no dataset; choose another place")
        else:
            self.info = {
                "codebase_version": VERSION,
                "robot_type": robot,
                "total_episodes": 0,
                "total_frames": 0,
                "total_tasks": 0,
                "chunks_size": CHUNK,
                "data_files_size_in_mb": 100,
                "video_files_size_in_mb": 200,
                "fps": fps,
                "splits": {},
                "data_path": DATA,
                "video_path": VIDEO,
                "features": expected,
            }
        self._delete_unfinished()
        tasks = root / "meta/tasks.parquet"
        self._stats = self._stats_of_counted()
        self._tasks: list[str] = pq.read_table(tasks)["task"].to_pylist() if self.count and tasks.is_file() else []

    @property
    def count(self) -> int:
        """Number of finished episodes."""
        return int(self.info["total_episodes"])

    @property
    def frames(self) -> int:
        """Number of frames in all of them."""
        return int(self.info["total_frames"])

    def append(self, columns: Mapping[str, np.ndarray], videos: Mapping[str, Path], stats: Stats, task: str) -> None:
        """Add an episode.

        Args:
            columns: of each feature that is not a video, shape [frame n].
            videos: mp4 file of each camera; it is moved.
            stats: of each camera's pixels: min, max, mean, std, quantiles, shape [3 1 1], and count [1].
            task: what the robot was to do, in words.
        """
        i, length = self.count, len(next(iter(columns.values())))
        place = {"chunk_index": i // CHUNK, "file_index": i % CHUNK}
        self._know(task)
        for key, source in videos.items():
            target = self.root / VIDEO.format(video_key=key, **place)
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.move(source, target)
        first = self.frames
        frames = np.arange(length)
        counted = {
            "timestamp": (frames / self.info["fps"]).astype(np.float32),
            "frame_index": frames,
            "episode_index": np.full(length, i),
            "index": first + frames,
            "task_index": np.full(length, self._tasks.index(task)),
        }
        table = {name: _column(values) for name, values in columns.items()}
        _write(self.root / DATA.format(**place), pa.table({**table, **{k: pa.array(v) for k, v in counted.items()}}))
        every = {**{name: _stats(values) for name, values in {**columns, **counted}.items()}, **stats}
        row = {
            "episode_index": i,
            "tasks": [task],
            "length": length,
            "dataset_from_index": first,
            "dataset_to_index": first + length,
            **{f"data/{key}": value for key, value in place.items()},
            **{f"meta/episodes/{key}": value for key, value in place.items()},
        }
        for key in videos:
            row |= {f"videos/{key}/{name}": value for name, value in place.items()}
            row |= {f"videos/{key}/from_timestamp": 0.0, f"videos/{key}/to_timestamp": length / self.info["fps"]}
        row |= {f"stats/{name}/{kind}": value for name, each in every.items() for kind, value in each.items()}
        _write(self.root / EPISODES.format(**place), pa.table({name: [value] for name, value in row.items()}))
        self._finish(every, length)

    def _finish(self, stats: Stats, length: int) -> None:
        """Write what is kept of all episodes; the count last."""
        self.info["total_episodes"] += 1
        self.info["total_frames"] += length
        self.info |= {"total_tasks": len(self._tasks), "splits": {"train": f"0:{self.count}"}}
        self._stats = _together(self._stats, stats)
        _write_json(self.root / "meta/stats.json", self._stats)
        _write_json(self.root / "meta/info.json", self.info)

    def _know(self, task: str) -> None:
        """Write a task that is new before an episode names it."""
        if task not in self._tasks:
            self._tasks.append(task)
            _write(self.root / "meta/tasks.parquet", _task_table(self._tasks))

    def _stats_of_counted(self) -> Stats:
        """Return the statistics of the episodes that info.json counts.

        stats.json is written before it, and where a run was killed between the two it has an episode more; each episode has its
        own beside it.
        """
        file = self.root / "meta/stats.json"
        stats: Stats = _read(file) if self.count and file.is_file() else {}
        counts = [each.get("count") if isinstance(each, dict) else None for each in stats.values()]
        if not self.count or (counts and all(count == [self.frames] for count in counts)):
            return stats
        stats = {}
        for i in range(self.count):
            file = self.root / EPISODES.format(chunk_index=i // CHUNK, file_index=i % CHUNK)
            stats = _together(stats, _stats_of_episode(file))
        return stats

    def _delete_unfinished(self) -> None:
        """Delete files of episodes that info.json does not count, and what was only begun."""
        for file in self.root.glob(f"**/*{PART}"):
            file.unlink()
        for file in [*self.root.glob("data/*/*.parquet"), *self.root.glob("meta/episodes/*/*.parquet")]:
            if _index(file) >= self.count:
                file.unlink()
        for file in self.root.glob("videos/*/*/*.mp4"):
            if _index(file) >= self.count:
                file.unlink()


def _index(file: Path) -> int:
    """Return the episode of a chunk-NNN/file-NNN."""
    return int(file.parent.name.removeprefix("chunk-")) * CHUNK + int(file.stem.removeprefix("file-"))


def _read(file: Path) -> dict[str, Any]:
    """Return a JSON file; InputError where it is damaged."""
    try:
        return dict(json.loads(file.read_text()))
    except (OSError, ValueError, TypeError) as error:
        raise InputError(f"{file}: not of a dataset ({error}); choose another place") from error


def _write(path: Path, table: pa.Table) -> None:
    replace_file(path, lambda part: pq.write_table(table, part))


def _write_json(path: Path, content: Mapping[str, Any]) -> None:
    replace_file(path, lambda part: part.write_text(json.dumps(content, indent=1)))


def _column(values: np.ndarray) -> pa.Array:
    """Return numbers [frame n] as a column of lists of n, of one number where n is 1."""
    flat = pa.array(np.ascontiguousarray(values, dtype=np.float32).ravel())
    return flat if values.shape[1] == 1 else pa.FixedSizeListArray.from_arrays(flat, values.shape[1])


def _task_table(tasks: Sequence[str]) -> pa.Table:
    """Return the tasks as pandas would write them with the task as the index, which is how LeRobot looks them up."""
    table = pa.table({"task_index": pa.array(range(len(tasks)), pa.int64()), "task": pa.array(tasks)})
    kinds = {"task_index": "int64", "task": "unicode"}
    columns = [
        {"name": name, "field_name": name, "pandas_type": kind, "numpy_type": numpy, "metadata": None}
        for (name, kind), numpy in zip(kinds.items(), ("int64", "object"), strict=True)
    ]
    about = {"index_columns": ["task"], "column_indexes": [], "columns": columns, "pandas_version": "2.0.0"}
    return table.replace_schema_metadata({b"pandas": json.dumps(about).encode()})


def _stats(values: np.ndarray) -> dict[str, Any]:
    """Return min, max, mean, standard deviation and quantiles of a column [frame n], and the number of frames."""
    column = values.reshape(len(values), -1)
    column = column.astype(np.float32) if column.dtype.kind == "f" else column  # as it is stored
    numbers = column.astype(float)
    moments = {kind: getattr(numbers, kind)(axis=0).tolist() for kind in ("min", "max", "mean", "std")}
    each = [quantiles(numbers) for numbers in column.T]
    return {**moments, **{kind: [one[kind] for one in each] for kind in QUANTILES}, "count": [len(values)]}


def _stats_of_episode(file: Path) -> Stats:
    """Return the statistics of an episode, columns stats/NAME/KIND of its row; InputError where it is damaged."""
    try:
        (row,) = pq.read_table(file).to_pylist()
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: not of a dataset ({error}); choose another place") from error
    stats: Stats = {}
    for key, value in row.items():
        if key.startswith("stats/"):
            name, kind = key.removeprefix("stats/").rsplit("/", 1)
            stats.setdefault(name, {})[kind] = value
    return stats


def _together(stats: Stats, more: Stats) -> Stats:
    """Return the statistics of each column in two sets together."""
    return {name: _merged(stats[name], each) if name in stats else each for name, each in more.items()}


def _merged(one: Mapping[str, Any], other: Mapping[str, Any]) -> dict[str, Any]:
    """Return the statistics of two sets together."""
    counts = [float(each["count"][0]) for each in (one, other)]
    means, deviations = ([np.asarray(each[kind]) for each in (one, other)] for kind in ("mean", "std"))
    weights = np.array(counts) / sum(counts)
    mean = weights[0] * means[0] + weights[1] * means[1]
    squares = sum(w * (d**2 + (m - mean) ** 2) for w, d, m in zip(weights, deviations, means, strict=True))
    shared = [kind for kind in QUANTILES if kind in one and kind in other]
    middle = {
        kind: (weights[0] * np.asarray(one[kind]) + weights[1] * np.asarray(other[kind])).tolist() for kind in shared
    }
    return {
        **middle,  # LeRobot, too, takes the mean of the episodes' quantiles
        "min": np.minimum(one["min"], other["min"]).tolist(),
        "max": np.maximum(one["max"], other["max"]).tolist(),
        "mean": mean.tolist(),
        "std": np.sqrt(squares).tolist(),
        "count": [math.floor(sum(counts))],
    }


LOSSLESS = "{kind}/{camera}/episode_{index:06d}.mkv"
IMAGES = "observation.images.{camera}"


class LeRobot(LeRobotDataset):
    """See `s2a.learn.collect.episodes.Dataset`."""

    FILES: ClassVar[Mapping[str, type[ImageFile]]] = {
        "image": ColourVideo,
        "depth": LosslessVideo,
        "instances": LosslessVideo,
    }

    def __init__(self, root: Path, features: Features) -> None:
        super().__init__(root, features.fps, features.robot, _features(features))

    def add(self, episode: Episode) -> None:
        """Write what LeRobot does not read first, the episode itself last."""
        write_replay(self.root, self.count, episode)
        videos, stats = {}, {}
        for (camera, kind), images in episode.images.items():
            if kind == "image":
                videos[IMAGES.format(camera=camera)] = images.path
                stats[IMAGES.format(camera=camera)] = images.stats
                continue
            target = self.root / LOSSLESS.format(kind=kind, camera=camera, index=self.count)
            target.parent.mkdir(parents=True, exist_ok=True)
            images.path.replace(target)
        self.append(episode.columns, videos, stats, episode.task)


def _features(features: Features) -> dict[str, dict[str, object]]:
    width, height = features.size
    about = {
        "video.fps": float(features.fps),
        "video.height": height,
        "video.width": width,
        "video.channels": 3,
        "video.codec": "h264",
        "video.pix_fmt": "yuv420p",
        "video.is_depth_map": False,
        "has_audio": False,
    }
    video: dict[str, object] = {
        "dtype": "video",
        "shape": [height, width, 3],
        "names": ["height", "width", "channels"],
        "info": about,
    }
    numbers: dict[str, dict[str, object]] = {
        name: {"dtype": "float32", "shape": [len(each)], "names": list(each)} for name, each in features.columns.items()
    }
    return {**numbers, **{IMAGES.format(camera=camera): video for camera in features.cameras}}
