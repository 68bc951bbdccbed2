"""Robots: one folder and one YAML file each; kinematics, geometry and limits of all of them."""

from __future__ import annotations

from functools import cache

from s2a.core import config
from s2a.core.errors import InputError
from s2a.robot.spec import RobotSpec


def names() -> list[str]:
    """Return the names of all robots: the files of conf/robot."""
    return sorted(path.stem for path in (config.folder() / "robot").glob("*.yaml"))


@cache
def load(name: str) -> RobotSpec:
    """Return the robot that conf/robot/<name>.yaml describes.

    Raises:
        InputError: there is no such robot, or its file is incomplete.
    """
    if name not in names():
        raise InputError(f"robot {name!r} does not exist{config.nearest(name, names())}")
    return config.load(RobotSpec, config.file(f"robot/{name}"))


def check_unchanged(spec: RobotSpec) -> None:
    """Raise InputError where a command changed single values of a robot: all that read it must see the same one."""
    if spec != load(spec.name):
        raise InputError(
            f"robot {spec.name!r} differs from conf/robot/{spec.name}.yaml; change it there, not by robot.<key>="
        )
