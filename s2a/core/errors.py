"""Errors that a user can fix, and extras of the package that a module needs."""

from collections.abc import Iterator
from contextlib import contextmanager


class InputError(ValueError):
    """Bad input: a file, a key, a part or a value that the user gave.

    The message is one line that names what was given (file, key, part, value), what is possible, and what to do.
    The command line prints it and exits with code 2.
    """


class CheckFailed(Exception):
    """A check ran and failed.

    The message is the result, as a command would return it; the command line prints it on stdout and exits with code 1.
    """


def printable(text: str) -> str:
    """Return a text with a space for every character that a terminal would not show but obey, such as ESC."""
    return "".join(letter if letter.isprintable() else " " for letter in encodable(text))


def encodable(text: str) -> str:
    """Return a text with ? for every half of a character (a lone surrogate), which no file and no request can hold."""
    return text.encode("utf-8", "replace").decode()


# Top-level modules by the extra that installs them
MODULES = {
    "sim": (
        "coacd",
        "collada",
        "example_robot_data",
        "mujoco",
        "mujoco_warp",
        "newton",
        "ompl",
        "PIL",
        "pyfqmr",
        "resolve_robotics_uri_py",
        "scipy",
        "skimage",
        "vhacdx",
        "warp",
    ),
    "learn": ("gymnasium", "onnx", "onnxruntime", "rsl_rl", "tensorboard", "tensordict", "torch"),
    "llm": ("httpx2", "openai"),
    "collect": ("av", "h5py", "pyarrow"),
    "view": ("viser",),
}


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
