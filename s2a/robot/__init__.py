"""Robots: one folder and one YAML file each; kinematics, geometry and limits of all of them."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from s2a import config
from s2a.errors import InputError
from s2a.robot.spec import RobotSpec

DEFAULT = "panda"
"""Name of the robot of a stage that names none."""


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
    return config.load(RobotSpec, config.compose(f"robot/{name}")["robot"])


def check_stage(spec: RobotSpec, stage: Path, prepared_for: str) -> None:
    """Raise InputError unless a stage was prepared for this robot, as its file describes it.

    Args:
        spec: the robot that the command was given.
        stage: the sim.usd.
        prepared_for: name of the robot that the stage's base pose is for.
    """
    if spec.name != prepared_for:
        raise InputError(
            f"{stage}: prepared for robot {prepared_for!r}, not {spec.name!r}; give robot={prepared_for}, or prepare the "
            f"part again with robot={spec.name}"
        )
    if spec != load(spec.name):
        raise InputError(
            f"robot {spec.name!r} differs from conf/robot/{spec.name}.yaml; change it there, not by robot.<key>="
        )
