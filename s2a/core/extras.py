"""Optional dependencies: which extra of the package installs a module that is missing."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from s2a.core.errors import InputError

MODULES = {
    "sim": (
        "coacd",
        "collada",
        "example_robot_data",
        "mujoco",
        "mujoco_warp",
        "newton",
        "PIL",
        "pyfqmr",
        "resolve_robotics_uri_py",
        "scipy",
        "skimage",
        "vhacdx",
        "warp",
    ),
    "learn": ("onnx", "onnxruntime", "rsl_rl", "tensorboard", "tensordict", "torch"),
    "llm": ("httpx2", "openai"),
    "collect": ("av", "h5py", "pyarrow"),
    "view": ("viser",),
}
"""Top-level modules by the extra that installs them."""


@contextmanager
def required() -> Iterator[None]:
    """Turn the failed import of an optional module into an InputError that names the pip command.

    Raises:
        InputError: the block imports a module of an extra that is not installed.
    """
    try:
        yield
    except ModuleNotFoundError as error:
        missing = (error.name or "").partition(".")[0]
        extra = next((name for name, modules in MODULES.items() if missing in modules), None)
        if extra is None:
            raise
        raise InputError(f"{missing} is not installed; give: pip install 's2a[{extra}]'") from error
