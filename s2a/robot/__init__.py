"""Robots: one YAML file each, of this package or the user's; kinematics, geometry and limits of all of them."""

import os
from functools import cache
from pathlib import Path
from typing import Annotated

from s2a.core import config
from s2a.core.errors import InputError
from s2a.robot.spec import RobotSpec

FILE = "robot.yaml"  # In the folder of each robot of this package
# Environment variable with the files of further robots, separated as PATH is; processes that a command starts inherit
# those that it was given
FILES = "S2A_ROBOTS"


def names() -> list[str]:
    """Return the names of all robots: the folders s2a/robot/<name> with a robot.yaml, and the files that S2A_ROBOTS lists."""
    return sorted(_files())


def load(name: str) -> RobotSpec:
    """Return the robot of a name, or of a YAML file, which makes it known by its name in this process and its children.

    Raises:
        InputError: there is no such robot or file, it is incomplete, or it has the name of another robot.
    """
    if name.endswith((".yaml", ".yml")):
        name = _register(Path(name).expanduser().resolve())
    if name not in (files := _files()):
        near = config.nearest(name, files)
        raise InputError(f"robot {name!r} does not exist{near}; or give a file: robot=FILE.yaml, or {FILES}=FILE.yaml")
    return _load(name, files[name])


Robot = Annotated[RobotSpec, config.Named(load)]  # A robot as a key: its name or its file


def _files() -> dict[str, Path]:
    files = {path.parent.name: path for path in sorted(Path(__file__).parent.glob(f"*/{FILE}"))}
    for text in filter(None, os.environ.get(FILES, "").split(os.pathsep)):
        path = Path(text).expanduser().resolve()
        if not path.is_file():
            raise InputError(f"{path}: no such file; correct {FILES}")
        if files.setdefault(path.stem, path) != path:
            raise InputError(f"{path}: there is a robot {path.stem!r} already, {files[path.stem]}; rename the file")
    return files


def _register(path: Path) -> str:
    """Add a file to S2A_ROBOTS, and return its robot's name."""
    if not path.is_file():
        raise InputError(f"{path}: no such file; robot= takes a robot's name or its YAML file")
    before = os.environ.get(FILES, "")
    if str(path) not in before.split(os.pathsep):
        os.environ[FILES] = os.pathsep.join(filter(None, [before, str(path)]))
        try:
            _files()
        except InputError:
            os.environ[FILES] = before
            raise
    return path.stem


@cache
def _load(name: str, path: Path) -> RobotSpec:
    values = config.read(path)
    if like := values.get("like"):
        base = _files().get(str(like))
        if base is None or base == path:
            raise InputError(f"{path}: like={like!r} is no other robot; robots are: {', '.join(sorted(_files()))}")
        values = config.read(base) | values
    for each in (values, values.get("attach") or {}):
        if isinstance(model := each.get("model"), str) and (beside := path.parent / Path(model).expanduser()).is_file():
            each["model"] = str(beside.resolve())
    return config.load(RobotSpec, values | {"name": name}, prefix="robot.")
