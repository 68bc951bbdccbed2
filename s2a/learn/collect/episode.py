"""One episode that is kept, and what every format has to do with it."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, ClassVar, Protocol, TypeVar

import dacite
import numpy as np

from s2a.core.cache import UNREADABLE
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write, replace_file
from s2a.learn.collect.video import ImageFile, Images, Key
from s2a.scene.usd import sim_stage
from s2a.sim.world import SimStage

ABOUT = "meta/s2a.json"
"""What a dataset is of; the first file that is written."""
UNFINISHED = ".unfinished_"
"""What the names of folders with images of episodes that are not finished begin with."""
REPLAY = "replay/episode_{index:06d}.npz"


@dataclass(frozen=True)
class Episode:
    """What one world saw and did.

    Attributes:
        columns: numbers of every frame by the name of their feature, shape [frame n].
        images: finished files.
        task: what the robot was to do, in words.
        result: the task's metrics by name.
        origin: "seed" of its batch, "world" in it, and "worlds": how many there were.
        actions: of every control step, shape [step action].
        start: what `VecEnv.state_dict` has of its world at the start.
    """

    columns: dict[str, np.ndarray]
    images: dict[Key, Images]
    task: str
    result: dict[str, float]
    origin: dict[str, int]
    actions: np.ndarray
    start: dict[str, np.ndarray]


@dataclass(frozen=True)
class Features:
    """What every frame holds.

    Attributes:
        robot: its name.
        fps: frames a second.
        columns: names of the numbers of each feature.
        cameras: their names.
        size: width and height of the images [pixel].
        action_range: least and greatest joint target [rad, m], shape [2 joint].
        world: physics and task, as plain values.
    """

    robot: str
    fps: int
    columns: Mapping[str, Sequence[str]]
    cameras: Sequence[str]
    size: tuple[int, int]
    action_range: np.ndarray
    world: Mapping[str, object]


class Dataset(Protocol):
    """A folder that grows by whole episodes.

    Attributes:
        FILES: how images of each kind are kept.
        root: the folder.
        count: finished episodes.
        frames: in all of them.
    """

    FILES: ClassVar[Mapping[str, type[ImageFile]]]
    root: Path

    def __init__(self, root: Path, features: Features) -> None:
        """Begin a dataset or go on with one; InputError where the folder holds something else."""

    @property
    def count(self) -> int:
        """Number of finished episodes."""

    @property
    def frames(self) -> int:
        """Number of frames in all of them."""

    def add(self, episode: Episode) -> None:
        """Write an episode; it counts when all of it is there."""


def is_foreign(root: Path) -> bool:
    """Return whether a folder holds files, and none that a run of `s2a collect` began with, even if it was killed at once."""
    found = [path.name for path in root.iterdir() if not path.name.startswith(UNFINISHED)] if root.is_dir() else []
    return bool(found) and not (root / ABOUT).is_file()


def write_replay(root: Path, index: int, episode: Episode) -> None:
    """Write what it takes to play an episode again."""
    path = root / REPLAY.format(index=index)
    groups: dict[str, Mapping[str, Any]] = {"start": episode.start, "origin": episode.origin, "result": episode.result}
    content: dict[str, Any] = {"actions": episode.actions}
    content |= {f"{group}.{name}": value for group, values in groups.items() for name, value in values.items()}
    replace_file(path, lambda part: _save(part, content))


def _save(path: Path, content: Mapping[str, Any]) -> None:
    with path.open("wb") as file:  # to a path, NumPy adds an ending of its own
        np.savez_compressed(file, **content)


def read_replay(root: Path, index: int) -> tuple[dict[str, np.ndarray], np.ndarray]:
    """Return how an episode began, by name, and its actions [step action]; InputError where the file is damaged."""
    path = root / REPLAY.format(index=index)
    try:
        with np.load(path) as file:
            names = [name for name in file.files if name.startswith("start.")]
            return {name.removeprefix("start."): file[name] for name in names}, file["actions"]
    except UNREADABLE as error:
        raise InputError(f"{path}: cannot be read ({error})") from error


Stage = TypeVar("Stage", bound=SimStage)
FILE = "meta/stage.json"
ROOM = ("path", "room")
"""What is read of the room's file."""


def write(stage: SimStage, root: Path) -> None:
    """Write all of a stage but its room into a dataset's folder."""
    kept = {each.name: getattr(stage, each.name) for each in fields(stage) if each.name not in ROOM}
    empty = replace(stage, room=None)  # type: ignore[arg-type]  # not to be copied
    values = {name: value for name, value in asdict(empty).items() if name in kept}
    (root / FILE).parent.mkdir(parents=True, exist_ok=True)
    with atomic_write(root / FILE) as out:
        out.write_text(json.dumps(values, default=_plain) + "\n")


def read(kind: type[Stage], path: Path, root: Path) -> Stage:
    """Return a stage of a task's kind in a room's file; InputError where the dataset's file is missing or damaged."""
    file = root / FILE
    rules = dacite.Config(type_hooks={np.ndarray: np.asarray, Path: Path}, cast=[tuple])
    try:
        values = json.loads(file.read_text())
        return dacite.from_dict(kind, {**values, "path": path, "room": sim_stage.read(path, visuals=False)}, rules)
    except (OSError, ValueError, TypeError, dacite.DaciteError) as error:
        raise InputError(f"{file}: not of this version's s2a collect ({error}); collect again") from error


def _plain(value: object) -> object:
    """Return arrays and paths as JSON has them."""
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)
