"""The world that a policy was trained in, kept beside its checkpoints: elsewhere its actions mean something else."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

from s2a.config import load
from s2a.errors import InputError
from s2a.sim.simulation import SimConfig
from s2a.tasks.open_part.config import LEVELS, OpenDrawerConfig

FILE = "world.json"


def write_world(sim: SimConfig, task: OpenDrawerConfig, out: Path) -> None:
    """Write how physics is stepped and what the robot has to do into the folder of a training run."""
    (out / FILE).write_text(json.dumps({"sim": asdict(sim), "task": asdict(task)}, indent=1))


def read_world(checkpoint: Path, levels: OpenDrawerConfig) -> tuple[SimConfig, OpenDrawerConfig] | None:
    """Return the world that a checkpoint was trained in; None for one from elsewhere, which has no such file beside it.

    Args:
        checkpoint: model_N.pt of a training run.
        levels: whose LEVELS are taken instead of the training's, so that all checkpoints are measured alike.

    Raises:
        InputError: the file was written by another version, or is damaged.
    """
    file = checkpoint.parent / FILE
    if not file.is_file():
        return None
    now = {name: getattr(levels, name) for name in LEVELS}
    try:
        values = json.loads(file.read_text())
        return load(SimConfig, values["sim"]), load(OpenDrawerConfig, values["task"] | now)
    except (ValueError, KeyError, TypeError, AttributeError, InputError) as error:
        raise InputError(f"{file}: not what this version's s2a train writes ({error}); train again") from error
