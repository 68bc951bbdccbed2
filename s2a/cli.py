"""The command line: `s2a <verb> key=value ...`.

A verb is a module of `s2a.commands` with a `Config` and a `run(config) -> str`; its values are `conf/<verb>.yaml` and what
the user overrides. Errors of the user are one line on stderr and exit code 2.
"""

from __future__ import annotations

import contextlib
import importlib
import logging
import os
import sys
import time
import traceback
import warnings
from collections.abc import Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any

import hydra
from hydra.core.hydra_config import HydraConfig
from hydra.errors import HydraException
from omegaconf.errors import OmegaConfBaseException

from s2a import config, extras, usage
from s2a.errors import InputError, NotPassed
from s2a.progress import Chatter

COMMANDS = {
    "sample": "furnish a virtual room and scan it: writes an annotated scan",
    "export": "turn an annotated scan into two flavours of USD, descriptive and geometric",
    "insert": "put objects into a room where they belong, as a layer over its stage",
    "prepare": "make one jointed part of a geometric stage ready for simulation",
    "certify": "measure how ready for simulation a stage is; exits with 1 if a check fails",
    "train": "train a policy by reinforcement learning (PPO)",
    "evaluate": "measure how well a policy or the planner does",
    "zoo": "write a hundred labelled objects as they come off the web, to insert",
    "view": "look at a scan or a stage: its tree as text, or a picture",
}
WRITTEN = ("out", "picture", "pictures", "record")
"""Keys that name what a verb writes."""
FLAGS = ("--help", "-h", "--version", "--debug", "--multirun", "-m")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code: 0, 1 for a verdict of no or a bug, 2 for bad input, 130 if interrupted."""
    arguments = list(sys.argv[1:] if arguments is None else arguments)
    _log_in_lines("--debug" in arguments)
    try:
        return _dispatch(arguments)
    except KeyboardInterrupt:
        return _fail("interrupted", 130)
    except NotPassed:
        return 1
    except BrokenPipeError:  # the reader of our output, such as head, has seen enough
        sys.stdout = None
        return 0
    except Exception as error:
        if "--debug" in arguments:
            traceback.print_exc()
        if isinstance(error, (InputError, OSError)):
            return _fail(str(error), 2)
        return _fail(
            f"{type(error).__name__}: {error}; this is a bug{_unless(arguments)}: report what --debug shows", 1
        )


def run(verb: str, values: dict[str, Any]) -> None:
    """Run a verb with composed values and print what it says of its work; a NotPassed is printed, and goes on."""
    module = _module(verb)
    settings = config.load(module.Config, values)
    _refuse_replacing_input(settings)
    start = time.perf_counter()
    verdict: NotPassed | None = None
    with contextlib.redirect_stdout(Chatter()), extras.required():
        try:
            summary = module.run(settings)
        except NotPassed as no:
            verdict, summary = no, str(no)
    if summary:  # all but the first process of torchrun are silent
        print(summary)
    print(f"{verb}: {time.perf_counter() - start:.1f} s", file=sys.stderr)
    if verdict is not None:
        raise verdict


def job(composed: Any) -> None:
    """Run one job of a sweep; what it writes lies below the job's own folder, so that no two can collide."""
    _log_in_lines()
    context = HydraConfig.get()
    values = config.plain(composed)
    for key in set(WRITTEN).intersection(values):
        place = values[key]
        if place in (None, config.REQUIRED):
            continue
        if Path(place).is_absolute():
            raise InputError(
                f"key {key!r} is {place!r}; in a sweep, whose runs would overwrite it, give a relative path"
            )
        values[key] = str(Path(context.runtime.output_dir) / place)
    run(str(context.job.config_name), values)


def sweep(verb: str, overrides: Sequence[str]) -> None:
    """Run a verb once with each combination of the comma-separated values, through Hydra's sweeper and launcher.

    Raises:
        InputError: an override that cannot be read, or that names an unknown key or option.
    """
    # Hydra reads its arguments from sys.argv, and prints errors itself unless told to raise them.
    folder = _sweep_folder(overrides)
    sys.argv = ["s2a", "--multirun", "hydra/job_logging=none", *overrides, f"hydra.sweep.dir={folder}"]
    os.environ["HYDRA_FULL_ERROR"] = "1"
    try:
        hydra.main(config_path=str(config.folder()), config_name=verb, version_base="1.3")(job)()
    except (HydraException, OmegaConfBaseException) as error:
        raise InputError(config.explain(error, config.keys(config.compose(verb)))) from error
    finally:
        _overview(verb, folder)


def _module(command: str) -> Any:
    """Import a command.

    Raises:
        InputError: it needs an extra that is not installed.
    """
    with extras.required():
        return importlib.import_module(f"s2a.commands.{command}")


def _refuse_replacing_input(settings: Any) -> None:
    """Raise an InputError where `out` is a file that another key names."""
    paths = {name: value for name, value in vars(settings).items() if isinstance(value, Path)}
    out = paths.pop("out", None)
    for name, path in paths.items():
        if out is not None and path.is_file() and out.resolve() == path.resolve():
            raise InputError(f"out {str(out)!r} would replace what the key {name!r} names; choose another place")


def _sweep_folder(overrides: Sequence[str]) -> Path:
    """Return the folder of a sweep: the one asked for, else a new one, named as Hydra would."""
    asked = [text.partition("=")[2] for text in overrides if text.startswith("hydra.sweep.dir=")]
    return Path(asked[-1] if asked else time.strftime("multirun/%Y-%m-%d/%H-%M-%S"))


def _overview(verb: str, folder: Path) -> None:
    """Print what a verb says of all jobs of a sweep together, if it does."""
    module = _module(verb)
    if hasattr(module, "overview") and (said := module.overview(folder)):
        print(said)


def _dispatch(arguments: list[str]) -> int:
    """Do what the arguments ask for."""
    flags = [argument for argument in arguments if argument.startswith("-")]
    verb, *overrides = [argument for argument in arguments if not argument.startswith("-")] or [""]
    if unknown := [flag for flag in flags if flag not in FLAGS]:
        raise InputError(f"flag {unknown[0]!r} is unknown{config.nearest(unknown[0], FLAGS)}")
    if "--version" in flags:
        print(version("s2a"))
    elif not verb:
        print(usage.general(COMMANDS), end="")
    elif verb not in COMMANDS:
        raise InputError(f"verb {verb!r} is unknown{config.nearest(verb, COMMANDS)}")
    elif "--help" in flags or "-h" in flags:
        print(usage.verb(verb, COMMANDS[verb], _module(verb).Config))
    elif "--multirun" in flags or "-m" in flags:
        sweep(verb, overrides)
    else:
        run(verb, config.compose(verb, overrides))
    return 0


def _unless(arguments: Sequence[str]) -> str:
    """Name the tunables that were given, of which not all are checked; they may be what the error comes from."""
    tunables = [argument for argument in arguments if "." in argument.partition("=")[0]]
    return f", unless {' or '.join(tunables)} makes no sense" if tunables else ""


def _fail(message: str, code: int) -> int:
    """Say what went wrong; return the exit code."""
    _say(message)
    return code


class _Lines(logging.Handler):
    """Writes each log record to stderr, in one line."""

    def emit(self, record: logging.LogRecord) -> None:
        _say(f"{record.levelname.lower()}: {record.getMessage()}")


def _log_in_lines(debug: bool = False) -> None:
    """Show what the code logs as a warning; Python's own warnings are for developers, and shown to those who ask."""
    root = logging.getLogger()
    if not any(isinstance(handler, _Lines) for handler in root.handlers):
        root.addHandler(_Lines(logging.WARNING))
    if not debug and not sys.warnoptions:
        warnings.simplefilter("ignore")


def _say(message: str) -> None:
    """Say something on stderr, in one line."""
    print("s2a:", " ".join(message.split()), file=sys.stderr)
