"""Command `s2a doctor`: list what is installed, what is missing, and the usable devices."""

import importlib
import os
import platform
import shutil
import sys
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, packages_distributions, version
from importlib.util import find_spec
from pathlib import Path

from s2a.core import cache
from s2a.core.errors import MODULES

# Distributions without which there is no s2a
CORE = ("usd-core", "newton-usd-schemas", "numpy", "trimesh", "hydra-core", "omegaconf")


@dataclass(frozen=True)
class Config:
    """The command has no keys."""


def run(config: Config) -> str:
    """Return a report, one line each: versions, extras with the command that installs what is missing, devices, caches."""
    lines = [
        f"s2a {version('s2a')}, {Path(__file__).parents[1]}",
        f"Python {platform.python_version()} ({sys.executable}), {platform.platform()}, {os.cpu_count()} processors",
        "core: " + ", ".join(f"{name} {version(name)}" for name in CORE),
    ]
    lines += [_extra(name, modules) for name, modules in MODULES.items()]
    lines += [_devices(), _cache("kernels", Path(os.environ.get("WARP_CACHE_PATH") or Path.home() / ".cache" / "warp"))]
    lines.append(_cache("results", cache.folder()))
    lines.append(f"git: {shutil.which('git') or 'not there; nothing of s2a needs it'}")
    return "\n".join(lines)


def _extra(name: str, modules: tuple[str, ...]) -> str:
    """Return the line of an extra of the package: what is installed of it, with versions, and what is missing."""
    distributions = packages_distributions()
    names = {module: distributions.get(module, [module])[0] for module in modules}
    # Robot models are a distribution without a module.
    there = [module for module in modules if find_spec(module) or (module not in distributions and _version(module))]
    missing = sorted(set(modules) - set(there))
    versions = {names[module]: _version(names[module]) for module in there}
    remedy = f"missing {', '.join(missing)}; give: pip install 's2a[{name}]'" if missing else ""
    return f"extra {name}: " + "; ".join(filter(None, (", ".join(map(" ".join, sorted(versions.items()))), remedy)))


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:  # a module on PYTHONPATH, or none
        return ""


def _devices() -> str:
    """Return the line of the devices that Warp and torch find."""
    if not find_spec("warp"):
        return "devices: not known without the extra sim"
    warp = importlib.import_module("warp")  # of an extra
    warp.config.log_level = warp.LOG_WARNING
    names = [
        f"{device.alias} {device.name}, {device.total_memory / 2**30:.0f} GiB" for device in warp.get_cuda_devices()
    ]
    if find_spec("torch") and names and not importlib.import_module("torch").cuda.is_available():
        names.append("which the installed torch cannot use: trainings need a torch that is built for CUDA")
    return "devices: " + ("; ".join(names) or "the processor alone; no CUDA device that Warp could use")


def _cache(what: str, folder: Path) -> str:
    """Return the line of a cache, and whether it can be written."""
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    can = "" if os.access(existing, os.W_OK) else "; it cannot be written: set WARP_CACHE_PATH or S2A_CACHE"
    return f"cache of {what}: {folder}{can}"
