"""The folder of a training run: its settings, checkpoints and log."""

import hashlib
import json
import logging
import shutil
import time
import zipfile
from collections.abc import Callable, Collection, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from torch.utils.tensorboard import SummaryWriter

from s2a import tasks
from s2a.core.config import leaves, load
from s2a.core.errors import InputError
from s2a.core.outputs import atomic_write
from s2a.core.provenance import STARTS, starts
from s2a.scene.usd.stamp import layer_hash
from s2a.sim.simulation import SimConfig
from s2a.tasks import pool
from s2a.tasks.base import MdpConfig

SETTINGS = "settings.json"
BEST = "model_best.pt"  # Copy of the checkpoint with the best score so far
# Keys that may change when a run goes on
FREE = ("init", "resume", "device", "export", "out", "ppo.iterations", "ppo.save_interval", "ppo.target")

_log = logging.getLogger(__name__)


def keep_settings(values: Mapping[str, Any], out: Path, without_effect: Callable[[], Collection[str]] = tuple) -> None:
    """Write the nested settings of a run into its folder; if it has some already, they must be the same, save FREE ones.

    `without_effect`: returns dotted keys that may change too, as they change nothing in this run; asked only if one
    differs.

    Raises:
        InputError: naming the first key that differs, with both values.
    """
    file, now = out / SETTINGS, json.loads(json.dumps(values, default=str))
    if file.is_file() or latest(out):
        try:
            begun = json.loads(file.read_text())
            then = dict(leaves(begun))
        except (OSError, ValueError, AttributeError) as error:
            raise InputError(f"{file}: not what this version's s2a train writes ({error}); train again") from error
        given = dict(leaves(now))
        for key in given | then:  # what is no longer there counts too: a reward term that is not listed weighs nothing
            same = given.get(key) == then.get(key) or _may_change(key, given.get(key), then.get(key))
            if not same and key not in without_effect():
                begun_with = f"with {then[key]!r}" if key in then else "without it"
                raise InputError(
                    f"key {key!r} is {given.get(key)!r}, but {out} was begun {begun_with}; "
                    "resume with the same settings (0 for a reward term that is new), or train into another folder"
                )
    with atomic_write(file) as new:
        new.write_text(json.dumps(now, indent=1))


def _may_change(key: str, now: object, then: object) -> bool:
    """Return whether a key may differ from the run's: FREE ones, what is reported alone, what has no effect."""
    # A list or a fraction that one version does not have, and that neither run uses.
    if None in (now, then) and not now and not then:
        return True
    return key in FREE or key.startswith("metrics.") or (key.startswith("reward.") and not now and not then)


def keep_start(out: Path, iteration: int, stage: Path, about: Mapping[str, object]) -> list[dict[str, Any]]:
    """Note in a run's folder with which code, on which machine and stage it begins or goes on; return all its starts.

    Raises:
        InputError: the stage is another than the run was begun with.
    """
    earlier = starts(out)
    content = hashlib.sha256(stage.read_bytes()).hexdigest() if pool.is_index(stage) else layer_hash(stage)
    if earlier and earlier[0]["stage_sha256"] != content:
        raise InputError(
            f"{stage} has changed since {out} was begun; resume with what it was, or train into another folder"
        )
    every = [*earlier, {"iteration": iteration, "stage_sha256": content, **about}]
    with atomic_write(out / STARTS) as new:
        new.write_text(json.dumps(every, indent=1))
    return every


def latest(out: Path) -> Path | None:
    """Return the checkpoint of the last iteration in a folder; None if it has none.

    One that is not whole, as a full disk or a lost machine may leave it, is passed over with a warning.
    """
    numbered = [file for file in out.glob("model_*.pt") if iteration(file) >= 0]
    for file in sorted(numbered, key=iteration, reverse=True):
        if _whole(file):
            return file
        _log.warning("%s is not whole; continuing from an earlier one", file)
    return None


def iteration(checkpoint: Path) -> int:
    """Return N of a model_N.pt, -1 for any other name."""
    number = checkpoint.stem.removeprefix("model_")
    return int(number) if number.isdecimal() else -1


def _whole(file: Path) -> bool:
    """Return whether a file that torch wrote has all its contents, as their checksums say."""
    try:
        with zipfile.ZipFile(file) as archive:
            return archive.testzip() is None
    except (zipfile.BadZipFile, OSError):
        return False


def cut(out: Path, first: int) -> None:
    """Remove what a killed process left half-written, and make the log forget iterations from `first` on."""
    for folder in (*out.glob(".model_*"), *out.glob(".metrics.json.*")):
        shutil.rmtree(folder)
    if any(out.glob("events.*")):
        # TensorBoard reads event files by name, of second and number: of one second, the tenth comes before the ninth.
        time.sleep(1.01 - time.time() % 1.0)
        SummaryWriter(str(out), purge_step=first).close()
        time.sleep(1.01 - time.time() % 1.0)


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
    """Return the world that a world.json describes; InputError: it was written by another version, or is damaged."""
    try:
        values = json.loads(text)
        return load(SimConfig, values["sim"]), load(tasks.of(values).Config, values["task"])
    except (ValueError, KeyError, TypeError, AttributeError, InputError) as error:
        raise InputError(f"{file}: not what this version's s2a train writes ({error}); train again") from error
