"""Episodes as robomimic reads them: HDF5, each episode a file of its own, and one that links to all.

Format: robomimic 0.3, docs/datasets/overview.md and utils/dataset.py. A file that is being written when its process is killed can
be beyond repair; linked, no finished episode is ever open.
"""

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, ClassVar

import h5py
import numpy as np

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.learn.collect.episodes import Episode, Features, is_foreign, write_replay
from s2a.learn.collect.video import LEVEL, DeflatedImages, ImageFile, Images

INDEX = "demos.hdf5"
EPISODE = "episodes/demo_{index}.hdf5"
# As robosuite calls them, whose datasets robomimic comes with
NAMES = {"image": "{camera}_image", "depth": "{camera}_depth", "instances": "{camera}_segmentation_instance"}
GYM_TYPE = 2  # robomimic's number for environments of Gymnasium
HELD_OUT = 10  # Every so many episodes are those that the mask "valid" names


class Robomimic:
    """See `s2a.learn.collect.episodes.Dataset`."""

    FILES: ClassVar[Mapping[str, type[ImageFile]]] = dict.fromkeys(NAMES, DeflatedImages)

    def __init__(self, root: Path, features: Features) -> None:
        self.root, self._features, self._lengths = root, features, list[int]()
        file = root / INDEX
        if file.is_file():
            self._lengths = self._read(file)
        elif is_foreign(root):
            raise InputError(f"{root} holds files that are no dataset of robomimic; choose another place")

    @property
    def count(self) -> int:
        """Number of finished episodes."""
        return len(self._lengths)

    @property
    def frames(self) -> int:
        """Number of frames in all of them."""
        return sum(self._lengths)

    def add(self, episode: Episode) -> None:
        """Write an episode's own files first, the links last."""
        write_replay(self.root, self.count, episode)
        with _writing(self.root / EPISODE.format(index=self.count)) as file:
            self._write(file.create_group("demo"), episode)
        self._lengths.append(len(episode.columns["action"]))
        with _writing(self.root / INDEX) as file:
            self._link(file)

    def _write(self, demo: h5py.Group, episode: Episode) -> None:
        low, high = self._features.action_range
        targets = episode.columns["action"]
        last = np.arange(len(targets)) == len(targets) - 1
        demo.attrs["num_samples"] = len(targets)
        demo.attrs["instruction"] = episode.task
        demo.attrs["ep_meta"] = json.dumps({"lang": episode.task, **episode.origin, "result": episode.result})
        demo["actions"] = (2.0 * (targets - low) / (high - low) - 1.0).clip(-1.0, 1.0).astype(np.float32)
        demo["joint_targets"] = targets
        demo["rewards"], demo["dones"] = last.astype(np.float32), last.astype(np.int64)
        observed = demo.create_group("obs")
        for name, values in episode.columns.items():
            if name != "action":
                observed[name.removeprefix("observation.")] = values
        for (camera, kind), images in episode.images.items():
            _deflated(observed, NAMES[kind].format(camera=camera), images, self._shape(kind))
        _shifted(demo.create_group("next_obs"), observed)

    def _shape(self, kind: str) -> tuple[tuple[int, ...], type]:
        width, height = self._features.size
        return ((height, width, 3), np.uint8) if kind == "image" else ((height, width, 1), np.uint16)

    def _link(self, file: h5py.File) -> None:
        """Write the file that a user opens."""
        data, mask = file.create_group("data"), file.create_group("mask")
        f = self._features
        about = {"env_name": f"s2a/{f.world['task']['name']}", "type": GYM_TYPE, "env_kwargs": dict(f.world)}  # type: ignore[index]
        data.attrs["env_args"], data.attrs["total"] = json.dumps(about, default=str), self.frames
        data.attrs["lengths"] = self._lengths
        data.attrs["features"] = _identity(f)
        for name, bound in zip(("action_low", "action_high"), f.action_range, strict=True):
            data.attrs[name] = bound
        for index in range(self.count):
            data[f"demo_{index}"] = h5py.ExternalLink(EPISODE.format(index=index), "/demo")
        valid = [i for i in range(self.count) if i % HELD_OUT == HELD_OUT - 1]
        for name, indices in (("valid", valid), ("train", [i for i in range(self.count) if i not in valid])):
            mask[name] = np.array([f"demo_{i}".encode() for i in indices], dtype="S16")

    def _read(self, file: Path) -> list[int]:
        """Return the frames of each episode; InputError where the file is of another dataset."""
        frames = lengths(file)
        with h5py.File(file) as index:
            if index["data"].attrs["features"] != _identity(self._features):
                raise InputError(f"{self.root} holds a dataset of other features or another fps; choose another place")
        return frames


def lengths(file: Path) -> list[int]:
    """Return the frames of each episode of an INDEX; InputError where it is damaged."""
    try:
        with h5py.File(file) as index:
            return [int(n) for n in index["data"].attrs["lengths"]]
    except (OSError, KeyError) as error:
        raise InputError(f"{file}: not of a dataset ({error}); choose another place") from error


def _identity(features: Features) -> str:
    """Return what all episodes of a dataset have in common."""
    columns = {name: list(each) for name, each in features.columns.items()}
    return json.dumps([features.robot, features.fps, columns, list(features.cameras), list(features.size)])


@contextmanager
def _writing(path: Path) -> Iterator[h5py.File]:
    """Yield a file that is put in its place when all of it is written."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(path) as out, h5py.File(out, "w") as file:
        yield file


def _deflated(group: h5py.Group, name: str, images: Images, about: tuple[tuple[int, ...], Any]) -> None:
    """Write images that are compressed already, a chunk each."""
    shape, dtype = about
    options = {"dtype": dtype, "chunks": (1, *shape), "compression": "gzip", "compression_opts": LEVEL}
    data = group.create_dataset(name, (images.frames, *shape), **options)
    with images.path.open("rb") as file:
        for k, length in enumerate(images.lengths):
            data.id.write_direct_chunk((k, *[0] * len(shape)), file.read(length))
    images.path.unlink()


def _shifted(group: h5py.Group, observed: h5py.Group) -> None:
    """Write each observation of the frame after, the last one's own: views of what is there, which take no space."""
    for name, data in observed.items():
        view, source = h5py.VirtualLayout(data.shape, data.dtype), h5py.VirtualSource(data)
        if len(data) > 1:
            view[:-1] = source[1:]
        view[-1:] = source[-1:]
        group.create_virtual_dataset(name, view)
