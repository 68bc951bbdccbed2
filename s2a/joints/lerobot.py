"""Recordings out of a LeRobot dataset: format v3.0, as LeRobot 0.4 and later write it, without LeRobot.

`meta/info.json` has the version, the features with the names of their numbers, and where data files lie; `meta/episodes/` says
which of them holds an episode; a data file has a row for each frame, of one episode after the other.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError

VERSION = "v3."
OBSERVED = "observation."
"""Features of this name are what was measured; `action`, which has the same joints, is what was commanded."""
SUFFIXES = {".pos": "", ".torque": "_torque", ".effort": "_torque"}
"""Endings of names by which datasets tell a joint's position from its torque, and what `s2a identify` has in their place."""
TORQUES = ("effort", "efforts", "torque", "torques")
"""Last words of features whose names are joints, and whose numbers their torques."""
CHOICE = "data/chunk_index", "data/file_index"
"""Columns of `meta/episodes`: the file of an episode's frames."""
Column = tuple[str, int | None]
"""A feature, and which of its numbers; None: it is one."""


def names(root: Path) -> tuple[str, ...]:
    """Return the names of a dataset's columns, as a recording's are named (docs/identification.md)."""
    return tuple(_columns(_info(root)))


def tables(root: Path, columns: Sequence[str], episodes: Sequence[int]) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the frames of episodes of a dataset: what to call the episode, and its columns, shape [frame column].

    Args:
        root: folder of the dataset.
        columns: names; the first is `time`.
        episodes: their numbers; none: all.

    Raises:
        InputError: no dataset, another version; a column or an episode is missing; a file that cannot be read.
    """
    info = _info(root)
    found = _columns(info)
    missing = [name for name in columns if name not in found]
    if missing:
        raise InputError(
            f"{root}: no {missing[0]!r} among the names of its features, {', '.join(found)}; it needs {', '.join(columns)}"
        )
    chosen = [found[name] for name in columns]
    files = _files(root, info)
    unknown = [episode for episode in episodes if episode not in files]
    if unknown:
        raise InputError(f"{root}: no episode {unknown[0]}; it has {', '.join(map(str, sorted(files)))}")
    features = sorted({feature for feature, _ in chosen})
    for episode in episodes or sorted(files):
        yield f"{root}, episode {episode}", _frames(files[episode], episode, features, chosen)


def _info(root: Path) -> dict[str, Any]:
    """Return `meta/info.json`."""
    path = root / "meta/info.json"
    try:
        info = json.loads(path.read_text())
    except (OSError, ValueError) as error:
        raise InputError(
            f"{root}: no LeRobot dataset, {path.name} cannot be read ({error}); give a CSV file or a dataset's folder"
        ) from error
    version = str(info.get("codebase_version")) if isinstance(info, dict) else "none"
    if not version.startswith(VERSION) or not {"features", "data_path"} <= {*info}:
        raise InputError(
            f"{path}: codebase_version {version}; v3.0 is read: convert it with LeRobot's convert_dataset_v21_to_v30"
        )
    return info


def _columns(info: dict[str, Any]) -> dict[str, Column]:
    """Return where each named number is; of two with one name the first."""
    found: dict[str, Column] = {"time": ("timestamp", None)}
    for feature, about in info["features"].items():
        if not feature.startswith(OBSERVED) or not str(about.get("dtype")).startswith("float"):
            continue
        given, short = about.get("names"), feature.removeprefix(OBSERVED)
        if isinstance(given, dict):  # {"motors": [...]}, of older recorders
            given = next(iter(given.values()), None)
        single = list(about.get("shape", ())) == [1]  # a number a row then, no list
        for i, name in enumerate(given or ([short] if single else [])):
            torque = short.split(".")[-1] in TORQUES and name != short
            found.setdefault(_name(str(name), torque), (feature, None if single else i))
    return found


def _name(name: str, torque: bool) -> str:
    """Return a name as `s2a identify` has it: `joint` for a position, `joint_torque`."""
    for ending, instead in SUFFIXES.items():
        if name.endswith(ending):
            return name.removesuffix(ending) + instead
    return f"{name}_torque" if torque and not name.endswith("_torque") else name


def _files(root: Path, info: dict[str, Any]) -> dict[int, Path]:
    """Return the data file of each episode."""
    found = {}
    for path in sorted((root / "meta/episodes").glob("*/*.parquet")):
        rows = _read(path, ["episode_index", *CHOICE])
        for episode, chunk, file in zip(*(rows[name] for name in ("episode_index", *CHOICE)), strict=True):
            found[int(episode)] = root / str(info["data_path"]).format(chunk_index=int(chunk), file_index=int(file))
    if not found:
        raise InputError(f"{root}: no episodes in meta/episodes; give the folder of a whole dataset")
    return found


def _frames(path: Path, episode: int, features: Sequence[str], columns: Sequence[Column]) -> np.ndarray:
    """Return the columns of an episode's frames in their order, shape [frame column]."""
    rows = _read(path, ["episode_index", "frame_index", *features])
    own = np.flatnonzero(np.array(rows["episode_index"]) == episode)
    if not len(own):
        raise InputError(f"{path}: no frames of episode {episode}; give the folder of a whole dataset")
    own = own[np.argsort(np.array(rows["frame_index"])[own], kind="stable")]
    values = {name: np.array([rows[name][i] for i in own], float) for name in features}
    table = [values[name] if i is None else values[name][:, i] for name, i in columns]
    return np.stack([column.reshape(len(own)) for column in table], axis=1)


def _read(path: Path, columns: list[str]) -> dict[str, list[Any]]:
    """Return columns of a parquet file."""
    import pyarrow.parquet  # of the extra `collect`, which recordings in CSV do without

    try:
        return dict(pyarrow.parquet.read_table(path, columns=columns).to_pydict())
    except (OSError, pyarrow.ArrowException) as error:
        raise InputError(f"{path}: cannot be read ({error}); give the folder of a whole dataset") from error
