"""Where a number came from: code, versions, machine."""

from __future__ import annotations

import os
import platform
import subprocess
from importlib.metadata import version
from pathlib import Path

import torch

PACKAGES = ("s2a", "newton", "warp-lang", "mujoco-warp", "torch", "rsl-rl-lib", "usd-core")


def provenance(device: str) -> dict[str, object]:
    """Return the git commit (None outside a checkout, "+" after it where files were changed), versions, and the device's name."""
    cuda = device.startswith("cuda")
    return {
        "commit": _commit(),
        "versions": {name: _version(name) for name in PACKAGES},
        "device": torch.cuda.get_device_name(device) if cuda else f"CPU, {platform.machine()}",
    }


def _version(name: str) -> str:
    """Return a package's version; torch says more of itself than its metadata does."""
    try:
        return torch.__version__ if name == "torch" else version(name)
    except ModuleNotFoundError:
        return "not installed"


def _commit() -> str | None:
    """Return the commit of the checkout that the package runs from, not of one that merely surrounds an installed copy.

    Where there is none, it is what S2A_COMMIT says: whoever copies the code to a machine without git knows it.
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
