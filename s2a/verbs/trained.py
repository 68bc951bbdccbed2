"""The world that a policy was trained in, kept beside its checkpoints: elsewhere its actions mean something else."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path
from typing import Any

from s2a.config import leaves
from s2a.errors import InputError
from s2a.sim.simulation import SimConfig
from s2a.task.open_drawer import OpenDrawerConfig

FILE = "world.json"


def write_world(sim: SimConfig, task: OpenDrawerConfig, out: Path) -> None:
    """Write how physics is stepped and what the robot has to do into the folder of a training run."""
    (out / FILE).write_text(json.dumps({"sim": asdict(sim), "task": asdict(task)}, indent=1))


def check_world(sim: SimConfig, task: OpenDrawerConfig, checkpoint: Path) -> None:
    """Raise an InputError that names the first key in which a checkpoint's training differs from what is given.

    Checkpoints without the file, from elsewhere, are taken as they are.
    """
    file = checkpoint.parent / FILE
    if not file.is_file():
        return
    trained = dict(leaves(json.loads(file.read_text())))
    given: dict[str, Any] = dict(leaves(json.loads(json.dumps({"sim": asdict(sim), "task": asdict(task)}))))
    different = [key for key in given if trained.get(key) != given[key]]
    if different:
        key = different[0]
        raise InputError(
            f"{checkpoint} was trained with {key}={trained.get(key)}, not {given[key]}"
            f" ({len(different)} keys differ); add sim=paper, or the keys given to s2a train"
        )
