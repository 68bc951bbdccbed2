"""Provenance of a result: commit, package versions, device."""

import os
import platform
import re
import subprocess
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

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
