"""The stage that episodes were collected in, as a file: planning for it again takes a minute, and may end elsewhere."""

from __future__ import annotations

import json
from dataclasses import asdict, fields, replace
from pathlib import Path
from typing import TypeVar

import dacite
import numpy as np

from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.scene.usd import sim_stage
from s2a.sim.world import SimStage

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
