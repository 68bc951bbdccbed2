"""Episodes of a LeRobotDataset of s2a collect as states of worlds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np

from s2a import robot
from s2a.core.errors import InputError
from s2a.learn.collect.episode import ABOUT
from s2a.learn.collect.stage_file import FILE
from s2a.view.playback.states import States

INFO = "meta/info.json"
POSE = 7


def read(root: Path, first: int, count: int) -> States:
    """Read some episodes.

    Args:
        root: the dataset's folder.
        first: index of the first one.
        count: of them at most.

    Raises:
        InputError: another folder or format, or no such episode.
    """
    try:
        about, info, stage = (json.loads((root / name).read_text()) for name in (ABOUT, INFO, FILE))
        total = int(info["total_episodes"])
        chosen = range(first, min(first + count, total))
        if not chosen:
            raise InputError(f"{root} has {total} episodes; there is none with index {first}: give a smaller 'first'")
        episodes = [_columns(root, info, index) for index in chosen]
        names = {
            key: info["features"][key]["names"]
            for key in ("observation.part", "observation.objects")
            if key in info["features"]
        }
        joints = len(robot.load(about["robot"]).joints)
        objects = [name.rpartition(".")[0] for name in names.get("observation.objects", [])[::POSE]]
        return States(
            float(info["fps"]),
            about["robot"],
            np.array(stage["base"], dtype=float),
            about["stage_sha256"],
            [f"episode {index}" for index in chosen],
            [each["observation.state"][:, :joints] for each in episodes],
            {
                part: [each["observation.part"][:, i] for each in episodes]
                for i, part in enumerate(names.get("observation.part", []))
            },
            {
                part: [each["observation.objects"][:, POSE * i : POSE * (i + 1)] for each in episodes]
                for i, part in enumerate(objects)
            },
            [True] * len(chosen),  # others are not kept
        )
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError(f"{root}: no LeRobotDataset of s2a collect that can be played ({error!r})") from error


def _columns(root: Path, info: dict[str, Any], index: int) -> dict[str, np.ndarray]:
    """Return the numbers of an episode's frames, shape [frame n] each."""
    import pyarrow.parquet as pq  # of the extra "collect"

    size = info["chunks_size"]
    file = root / info["data_path"].format(chunk_index=index // size, file_index=index % size)
    table = pq.read_table(file)
    wanted = [name for name in table.column_names if name.startswith("observation.")]
    found = {name: np.array(table[name].to_pylist(), dtype=float) for name in wanted}
    return {name: each.reshape(len(each), -1) for name, each in found.items()}
