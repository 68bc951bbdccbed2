"""The command line: `s2a <command> key=value ...`.

A command is a module of `s2a.commands`, or of the package `commands` of a satellite such as `s2a.homes`: a `Config`, a
`run(config) -> str`, and a docstring whose first line, "Command `s2a NAME`: MEANING.", is its help. Its values are those of
`conf/<command>.yaml` with the user's overrides. User errors are one line on stderr and exit code 2.
"""

import contextlib
import errno
import gc
import importlib
import itertools
import logging
import os
import re
import shutil
import signal
import sys
import tempfile
import time
import traceback
from collections.abc import Iterator, Sequence
from functools import cache
from importlib.metadata import version
from pathlib import Path
from typing import Any, get_type_hints

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from s2a.commands import usage
from s2a.core import config, errors, outputs, progress
from s2a.core.errors import CheckFailed, InputError
from s2a.core.progress import StdoutFilter

# Commands as a scan meets them; those of satellites follow, room by room
ORDER = (
    "import", "annotate", "check", "export", "prepare", "certify", "convert",
    "dataset", "train", "evaluate", "bench", "perceive", "collect", "replay", "view", "report",
)  # fmt: skip
ASSIGNMENT = re.compile(r"[+~]*[\w.@/]+=|~")  # How an argument begins that is key=value, or removes a key
SURROGATES = re.compile("[\ud800-\udfff]")  # What stands in an argument for bytes that are no UTF-8
_HELP = re.compile(r'"""Command `s2a [\w-]+`: (.*?)\.(?:\n|""")', re.S)
# What the system answers where the path or its permissions are the cause
UNREACHED = (errno.ENOENT, errno.ENOTDIR, errno.EACCES, errno.EPERM, errno.EROFS)
FLAGS = ("--help", "-h", "--help-all", "--version", "--debug", "--multirun", "-m")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0; 1 for a failed check or a bug; 2 for bad input; 130 if interrupted."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    progress.set_up()
    progress.log_in_lines("--debug" in arguments)
    _give_a_home()
    try:
        return _dispatch(arguments)
    except progress.Terminated:
        return _fail("terminated", 128 + signal.SIGTERM)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)
    except CheckFailed:
        return 1
    except Exception as error:
        if "--debug" in arguments:
            progress.note(traceback.format_exc())
        if isinstance(error, UnicodeEncodeError) and any(
            each in error.object for each in SURROGATES.findall("".join(arguments))
        ):
            return _fail("an argument is not UTF-8; rename the file that it names", 2)
        if _is_out_of_memory(error):
            reason = " ".join(str(error).split())[:200] or "no more can be had"
            return _fail(f"out of memory: {reason}; lower {_size(arguments)}, or free some memory", 2)
        if isinstance(error, (InputError, OSError)):
            return _fail(_said(error), 2)
        return _fail(
            f"{type(error).__name__}: {error}; this is a bug{_unless(arguments)}: report what --debug shows", 1
        )


def _said(error: Exception) -> str:
    """Return the message of an error of the user or of the system, with what to do about the latter."""
    if isinstance(error, FileNotFoundError) and error.filename is None:  # of os.getcwd
        return "the current folder does not exist any more; change to another one"
    if not isinstance(error, OSError) or not isinstance(error.filename, str) or not error.strerror:
        return str(error)
    remedy = "; check the path and its permissions" if error.errno in UNREACHED else ""
    if "warp" in Path(error.filename).parts:  # Warp's cache cannot be written
        remedy = "; set WARP_CACHE_PATH to a folder that can be written"
    return f"{error.filename}: {error.strerror}{remedy}"


def _size(arguments: Sequence[str]) -> str:
    """Return what of a command takes the most memory."""
    command = next((each for each in arguments if each in commands()), "")
    parallel = bool(command) and "num_envs" in get_type_hints(settings_of(command))
    return "num_envs" if parallel else "a size or a number that was given"


def _is_out_of_memory(error: BaseException) -> bool:
    """Return True for what Python, NumPy, torch and Warp raise where the machine, or its GPU, has not enough memory."""
    words = ("out of memory", "failed to allocate", "not enough memory", "can't allocate memory")
    return isinstance(error, MemoryError) or (
        isinstance(error, RuntimeError) and any(each in str(error).lower() for each in words)
    )


def _give_a_home() -> None:
    """Give a user who has no home that can be written, as in a container, one for caches: libraries would fail without."""
    with contextlib.suppress(RuntimeError, OSError):  # nobody knows the user, or it is another one's home
        caches = Path.home() / ".cache"
        if os.access(next(path for path in (caches, *caches.parents) if path.exists()), os.W_OK):
            return
    if {"S2A_CACHE", "WARP_CACHE_PATH", "HOME"} <= os.environ.keys():
        return
    home = Path(tempfile.gettempdir(), f"s2a-{os.getuid()}")
    with contextlib.suppress(OSError):  # then they cannot keep anything, and say so
        home.mkdir(mode=0o700, exist_ok=True)
    os.environ |= {"HOME": str(home), "USER": os.environ.get("USER", str(os.getuid()))}
    progress.report(f"warning: there is no writable home directory; caches go to {home}: set HOME to keep them")


def run(command: str, values: dict[str, Any]) -> None:
    """Run a command with composed values and print its summary; a CheckFailed is printed and raised again."""
    module = _module(command)
    settings = config.load(module.Config, values)
    written = {key: path for key in outputs.keys(module.Config) if (path := getattr(settings, key)) is not None}
    _refuse_replacing_input(settings, written)
    start = time.perf_counter()
    verdict: CheckFailed | None = None
    is_first = os.environ.get("RANK", "0") == "0"  # of the processes of torchrun, which alone writes files
    with (
        contextlib.redirect_stdout(StdoutFilter()),
        errors.required(),
        outputs.locked(written if is_first else {}, f"s2a {command}"),
    ):
        try:
            summary = module.run(settings)
        except CheckFailed as no:
            verdict, summary = no, str(no)
    if summary:  # all but the first process of torchrun are silent
        progress.show(summary)
    progress.note(f"{command}: {time.perf_counter() - start:.1f} s")
    if verdict is not None:
        raise verdict


def job(composed: Any) -> None:
    """Run one job of a sweep; its outputs lie below the job's own folder."""
    progress.log_in_lines()
    context = HydraConfig.get()
    command, values = str(context.job.config_name), config.plain(composed)
    for key in outputs.keys(settings_of(command)):
        place = values.get(key)
        if place in (None, config.REQUIRED):
            continue
        if Path(place).is_absolute():
            raise InputError(
                f"key {key!r} is {place!r}; in a sweep, whose runs would overwrite it, give a relative path"
            )
        values[key] = str(Path(context.runtime.output_dir) / place)
    run(command, values)


def sweep(command: str, overrides: Sequence[str]) -> None:
    """Run a command once per combination of the comma-separated values, with Hydra's sweeper and launcher.

    Raises:
        InputError: an override that cannot be read, or that names an unknown key or option.
    """
    # Hydra reads its arguments from sys.argv, and prints errors itself unless asked to raise them.
    texts, (folder, made) = config.quoted(overrides, settings_of(command)), _sweep_folder(overrides)
    sys.argv = ["s2a", "--multirun", "hydra/job_logging=none", *config.opened(texts), f"hydra.sweep.dir={folder}"]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    root = logging.getLogger()
    handlers, level = root.handlers[:], root.level
    try:
        with outputs.locked({"hydra.sweep.dir": folder}, f"s2a {command} --multirun"):
            hydra.main(config_path=str(config.folder()), config_name=command, version_base="1.3")(job)()
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(config.explain(error, config.keys(config.compose(command)))) from error
    finally:
        # Hydra leaves its own handlers, which keep writing to the stdout of this call, and its level.
        root.handlers[:] = handlers
        root.setLevel(level)
        _overview(command, folder)
        for empty in (folder, *folder.parents) if made else ():
            with contextlib.suppress(OSError):  # there are results in it
                empty.rmdir()


@cache
def commands() -> dict[str, str]:
    """Return the name of each command and its module's; nothing is imported."""
    package = Path(__file__).parents[1]
    modules = {}
    for folder in [package / "commands", *sorted(package.glob("*/commands"))]:
        for file in sorted(folder.glob("*.py")):
            if _HELP.match(file.read_text(encoding="utf-8")):
                module = ".".join(["s2a", *file.relative_to(package).with_suffix("").parts])
                modules[file.stem.removesuffix("_")] = module  # import_, since no statement could import a keyword
    return {name: modules.pop(name) for name in ORDER if name in modules} | modules


def meaning(command: str) -> str:
    """Return what a command does, in a line, from its module's docstring."""
    file = Path(__file__).parents[2].joinpath(*commands()[command].split(".")).with_suffix(".py")
    match = _HELP.match(file.read_text(encoding="utf-8"))
    return " ".join(match[1].split()) if match else ""


def _module(command: str) -> Any:
    """Import a command; InputError: it needs an extra that is not installed."""
    name = commands()[command]
    if name in sys.modules:
        return sys.modules[name]
    with errors.required(), _uncollected():
        return importlib.import_module(name)


def settings_of(command: str) -> type:
    """Return the class of a command's settings; InputError where it needs an extra that is not installed."""
    settings: type = _module(command).Config
    return settings


@contextlib.contextmanager
def _uncollected() -> Iterator[None]:
    """Keep Python's collector from the objects that are made meanwhile.

    To go through those of torch and Newton, while they are imported and once more at the end, takes half of the ten seconds
    that a command needs to start and end.
    """
    gc.disable()
    try:
        yield
    finally:
        gc.freeze()
        gc.enable()


def _refuse_replacing_input(settings: Any, written: dict[str, Path]) -> None:
    """Raise an InputError if an output is an input file."""
    read = {name: path for name, path in vars(settings).items() if isinstance(path, Path) and name not in written}
    for (key, out), (name, path) in itertools.product(written.items(), read.items()):
        if path.is_file() and os.path.realpath(out) == os.path.realpath(path):
            raise InputError(f"{key} {str(out)!r} would replace what the key {name!r} names; choose another path")


def _sweep_folder(overrides: Sequence[str]) -> tuple[Path, bool]:
    """Return the folder of a sweep, and whether it was made: the requested one, else a new one with Hydra's naming."""
    folders = [text.partition("=")[2] for text in overrides if text.startswith("hydra.sweep.dir=")]
    if folders:
        return Path(folders[-1]), False
    first = Path(time.strftime("multirun/%Y-%m-%d/%H-%M-%S"))
    for number in itertools.count(1):  # another sweep may have begun in the same second
        folder = first if number == 1 else first.with_name(f"{first.name}-{number}")
        with contextlib.suppress(FileExistsError):
            folder.mkdir(parents=True)
            return folder, True
    raise AssertionError("there is always another number")


def _overview(command: str, folder: Path) -> None:
    """Print a command's overview of all jobs of a sweep, if it has one."""
    module = _module(command)
    if hasattr(module, "overview") and (text := module.overview(folder)):
        progress.show(text)


def _dispatch(arguments: list[str]) -> int:
    """Run the command, sweep or help text that the arguments select."""
    flags = [argument for argument in arguments if argument.startswith("-")]
    command, *overrides = [argument for argument in arguments if not argument.startswith("-")] or [""]
    if unknown := [flag for flag in flags if flag not in FLAGS]:
        raise InputError(f"flag {unknown[0]!r} is unknown{config.nearest(unknown[0], FLAGS)}")
    if "--version" in flags:
        progress.show(version("s2a"))
    elif not command:
        progress.show(usage.general({name: meaning(name) for name in commands()}).rstrip())
    elif command not in commands():
        raise InputError(f"command {command!r} is unknown{config.nearest(command, commands())}")
    elif flags and {"--help", "-h", "--help-all"}.intersection(flags):
        text = _help(command, "--help-all" in flags)
        progress.show(usage.fitted(text, shutil.get_terminal_size().columns) if sys.stdout.isatty() else text)
    elif "--multirun" in flags or "-m" in flags:
        sweep(command, overrides)
    else:
        run(command, compose(command, overrides))
    return 0


def _help(command: str, every: bool) -> str:
    """Return the help text of a command, from the cache if it is there: to import a simulator for it takes seconds."""
    # NumPy takes 0.1 s to import, which commands that finish at once should not pay.
    import numpy as np

    from s2a.core.cache import recall

    def make() -> dict[str, np.ndarray]:
        return {"text": np.array(usage.command(command, meaning(command), _module(command).Config, every))}

    # The names of files are options; robots are this package's, and the user's.
    files = [*config.folder().rglob("*.yaml"), *Path(__file__).parents[1].glob("robot/*/*.yaml")]
    files += [Path(each).expanduser() for each in os.environ.get("S2A_ROBOTS", "").split(os.pathsep)]
    texts = [f"{file}\n{file.read_text(encoding='utf-8')}" for file in sorted(files) if file.is_file()]
    key = [command, str(every), os.environ.get("S2A_ROBOTS", ""), *texts]
    return str(recall("help", key, make)["text"])


def compose(command: str, arguments: Sequence[str]) -> dict[str, Any]:
    """Return a command's values with its arguments: key=value, and words for its key SENTENCE, if it has one.

    Raises:
        InputError: an argument that cannot be read, an unknown key or option, or several arguments of words.
    """
    key = getattr(_module(command), "SENTENCE", None)
    words = [argument for argument in arguments if key and not ASSIGNMENT.match(argument)]
    if len(words) > 1:
        raise InputError(
            f'{" ".join(words)[:80]!r} are {len(words)} arguments; put the {key} into quotation marks: "..."'
        )
    values = config.compose(command, [each for each in arguments if each not in words], settings_of(command))
    return values | ({key: words[0]} if key and words else {})


def _unless(arguments: Sequence[str]) -> str:
    """Name the nested keys that were overridden: not all of their values are validated, so one may be the cause."""
    tunables = [argument for argument in arguments if "." in argument.partition("=")[0]]
    return f", unless {' or '.join(tunables)} makes no sense" if tunables else ""


def _fail(message: str, code: int) -> int:
    """Print an error message; return the exit code."""
    progress.report(message)
    return code
