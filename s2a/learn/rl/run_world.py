"""The world that a policy was trained in, kept beside its checkpoints: elsewhere its actions mean something else."""

from __future__ import annotations

import json
from dataclasses import asdict, fields
from pathlib import Path

from s2a import tasks
from s2a.core import aliases
from s2a.core.config import load
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.env.task import MdpConfig
from s2a.sim.simulation import SimConfig

FILE = "world.json"


def write_world(sim: SimConfig, task: MdpConfig, out: Path) -> None:
    """Write how physics is stepped and what the robot has to do into the folder of a training run."""
    with atomic_write(out / FILE) as new:
        new.write_text(world_json(sim, task))


def world_json(sim: SimConfig, task: MdpConfig) -> str:
    """Return the content of world.json."""
    return json.dumps({"sim": asdict(sim), "task": asdict(task)}, indent=1)


def read_world(checkpoint: Path) -> tuple[SimConfig, MdpConfig] | None:
    """Return the world that a checkpoint was trained in; None for one from elsewhere, which has no such file beside it.

    Raises:
        InputError: the file was written by another version, or is damaged.
    """
    file = checkpoint.parent / FILE
    if not file.is_file():
        return None
    try:
        text = file.read_text()
    except (OSError, ValueError) as error:
        raise InputError(f"{file}: cannot be read ({error}); train again") from error
    return world_of(text, file)


def world_of(text: str, file: Path) -> tuple[SimConfig, MdpConfig]:
    """Return the world that a world.json describes.

    Raises:
        InputError: it was written by another version, or is damaged.
    """
    try:
        values = json.loads(text)
        aliases.complete(values)
        sim, task = (aliases.settings(values[group], group) for group in ("sim", "task"))
        kind = tasks.of(values).Config
        # What has been added to one task's settings is none of another's.
        added = {key.removeprefix("task.") for key in aliases.ADDED} - {each.name for each in fields(kind)}
        task = {name: value for name, value in task.items() if name not in added}
        return load(SimConfig, sim), load(kind, task)
    except (ValueError, KeyError, TypeError, AttributeError, InputError) as error:
        raise InputError(f"{file}: not what this version's s2a train writes ({error}); train again") from error
