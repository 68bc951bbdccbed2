"""Robots: one folder each, with robot.yaml and spheres.csv; kinematics, geometry and limits of all of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated

from s2a.core import config
from s2a.core.errors import InputError
from s2a.robot.spec import RobotSpec

FILE = "robot.yaml"
"""In the folder of each robot."""


def names() -> list[str]:
    """Return the names of all robots: the folders s2a/robot/<name> with a robot.yaml."""
    return sorted(path.parent.name for path in Path(__file__).parent.glob(f"*/{FILE}"))


@cache
def load(name: str) -> RobotSpec:
    """Return the robot that s2a/robot/<name>/robot.yaml describes.

    Raises:
        InputError: there is no such robot, or its file is incomplete.
    """
    if name not in names():
        raise InputError(f"robot {name!r} does not exist{config.nearest(name, names())}")
    return config.load(RobotSpec, config.read(Path(__file__).parent / name / FILE))


Robot = Annotated[RobotSpec, config.Named(load)]
"""A robot as a key: its name."""
