"""Episodes as a LeRobot dataset, with depth and instances beside what LeRobot reads."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import ClassVar

from s2a.learn.collect.episode import Episode, Features, write_replay
from s2a.learn.collect.lerobot import LeRobotDataset
from s2a.learn.collect.video import ColourVideo, ImageFile, LosslessVideo

LOSSLESS = "{kind}/{camera}/episode_{index:06d}.mkv"
IMAGES = "observation.images.{camera}"


class LeRobot:
    """See `s2a.learn.collect.episode.Dataset`."""

    FILES: ClassVar[Mapping[str, type[ImageFile]]] = {
        "image": ColourVideo,
        "depth": LosslessVideo,
        "instances": LosslessVideo,
    }

    def __init__(self, root: Path, features: Features) -> None:
        """Begin a dataset or go on with one."""
        self.root = root
        self._set = LeRobotDataset(root, features.fps, features.robot, _features(features))

    @property
    def count(self) -> int:
        """Number of finished episodes."""
        return self._set.count

    @property
    def frames(self) -> int:
        """Number of frames in all of them."""
        return int(self._set.info["total_frames"])

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
        self._set.add(episode.columns, videos, stats, episode.task)


def _features(features: Features) -> dict[str, dict[str, object]]:
    """Return the features as info.json has them."""
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
