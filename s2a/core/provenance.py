"""Provenance of a result: commit, package versions, device; the log of a training run."""

import json
import logging
import math
import os
import platform
import re
import subprocess
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path
from typing import Any

from s2a.core.errors import InputError, required

STARTS = "starts.json"
PACKAGES = ("s2a", "newton", "warp-lang", "mujoco-warp", "torch", "rsl-rl-lib", "usd-core")


def provenance(device: str) -> dict[str, object]:
    """Return the git commit (None outside a checkout, "+" after it where files were changed), versions, and the device's name."""
    return {
        "commit": _commit(),
        "versions": {name: _version(name) for name in PACKAGES},
        "device": _device_name(device),
    }


def _device_name(device: str) -> str:
    if not device.startswith("cuda"):
        return f"CPU, {platform.machine()}"
    import torch  # an optional dependency, and a second to import

    return torch.cuda.get_device_name(device)


def _version(name: str) -> str:
    """Return a package's version; torch's own file also tells the build (+cpu, +cu130), without the import."""
    try:
        package = distribution(name)
    except PackageNotFoundError:
        return "not installed"
    if name != "torch":
        return package.version
    text = Path(str(package.locate_file("torch/version.py"))).read_text()
    build = re.search(r"__version__ = '([^']+)'", text)
    return build[1] if build else package.version


def _commit() -> str | None:
    """Return the commit of the checkout that the package runs from, not of one that merely surrounds an installed copy.

    Without one it is S2A_COMMIT, which can be set where the code was copied to a machine without git.
    """
    folder, other = Path(__file__).resolve().parent, os.environ.get("S2A_COMMIT")

    def git(*arguments: str) -> str:
        return subprocess.run(["git", "-C", str(folder), *arguments], capture_output=True, text=True).stdout.strip()

    try:
        if not git("ls-files", Path(__file__).name):
            return other
        changed = git("status", "--porcelain", "--untracked-files=no")
        return git("rev-parse", "--short", "HEAD") + ("+" if changed else "")
    except FileNotFoundError:
        return other


def starts(out: Path) -> list[dict[str, Any]]:
    """Return with which code, on which machine and stage a run began and went on; nothing if that was not yet noted.

    Raises:
        InputError: the file is damaged.
    """
    file = out / STARTS
    if not file.is_file():
        return []
    try:
        every = json.loads(file.read_text())
        if [start["stage_sha256"] for start in every]:
            return every
        raise ValueError("it is empty")
    except (OSError, ValueError, TypeError, KeyError) as error:
        raise InputError(
            f"{file}: not what s2a train writes ({error}); delete it, or train into another folder"
        ) from error


def curve(out: Path) -> list[dict[str, float]]:
    """Return what TensorBoard logged of episodes, a row per iteration: rates and values by name, and the mean reward."""
    events = _events(out)
    tags = {tag: re.fullmatch(r"Episode/(?!rew_|term/)(.+)", tag) for tag in events.Tags()["scalars"]}
    rows: dict[int, dict[str, float]] = {}
    for tag, match in tags.items():
        name = match[1] if match else "reward" if tag == "Train/mean_reward" else ""
        for event in events.Scalars(tag) if name else ():
            if math.isfinite(event.value):
                rows.setdefault(event.step, {"iteration": event.step})[name] = event.value
    return [rows[i] for i in sorted(rows)]


def scalars(out: Path, tag: str) -> list[Any]:
    """Return the events that TensorBoard logged under a tag, less what was cut; none if it was never logged."""
    events = _events(out)
    return events.Scalars(tag) if tag in events.Tags()["scalars"] else []


def _events(out: Path) -> Any:
    """Return what TensorBoard logged in a folder.

    Raises:
        InputError: the extra "learn" is not installed.
    """
    with required():
        from tensorboard.backend.event_processing.event_accumulator import EventAccumulator  # of the extra "learn"
    logging.getLogger("tensorboard").setLevel(logging.ERROR)  # it warns of every iteration that was cut
    return EventAccumulator(str(out), size_guidance={"scalars": 0}).Reload()
