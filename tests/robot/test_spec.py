"""A robot is one YAML file, loaded strictly."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from s2a import robot
from s2a.commands import bench
from s2a.core import config
from s2a.core.errors import InputError
from s2a.robot.spec import MotionLimits


@pytest.mark.parametrize("name", robot.names())
def test_every_robot_is_complete_and_plausible(name: str) -> None:
    spec = robot.load(name)
    gripper = spec.gripper
    assert spec.name == name
    assert len(spec.start) == len(spec.joints) == len(set(spec.joints))
    assert gripper.max_opening == pytest.approx(2 * gripper.finger_joint_open)
    assert 0.0 < gripper.finger_joint_home <= gripper.finger_joint_open
    assert min(*spec.limits.velocity, *spec.limits.acceleration, *spec.limits.torque) > 0.0
    assert gripper.body_behind > 0.0 and max(spec.base.distances) < spec.base.reach
    assert all(abs(q) < 2 * math.pi for q in spec.home)


def test_an_unknown_robot_is_refused_with_the_known_names() -> None:
    with pytest.raises(InputError, match="robot 'pandas' does not exist; did you mean: panda"):
        robot.load("pandas")


def test_one_value_per_arm_joint_is_demanded() -> None:
    spec = robot.load("panda")
    with pytest.raises(InputError, match=r"home has 6 values; give one for each of the 7 arm joints"):
        replace(spec, home=spec.home[:6])
    with pytest.raises(InputError, match=r"drives.rotor_inertia has 1 values"):
        replace(spec, drives=replace(spec.drives, rotor_inertia=(0.1,)))


def test_a_command_takes_a_robot_by_its_name_and_none_of_its_values() -> None:
    given = ["stage=x", "out=z"]
    loaded = config.load(bench.Config, config.compose("bench", [*given, "robot=baxter"]))
    assert loaded.robot == robot.load("baxter")
    with pytest.raises(InputError, match="robot 'pandas' does not exist; did you mean: panda"):
        config.load(bench.Config, config.compose("bench", [*given, "robot=pandas"]))
    with pytest.raises(InputError, match="is unknown|robot"):
        config.compose("bench", [*given, "robot.name=x"])


def test_what_an_arm_keeps_up_leaves_its_joints_a_window_behind() -> None:
    spec = robot.load("panda")
    arm = replace(spec.limits, velocity=(10.0,) * 6 + (0.1,), acceleration=(15.0,) * 7)
    gains = replace(spec.gains, arm_stiffness=400.0, arm_damping=80.0)
    limits = MotionLimits(velocity=1.0, acceleration=0.5, window=0.05, drives=True)
    found = limits.sustained(arm, gains)
    # By hand: a lag of 0.2 s and 7.5 rad/s^2; 0.2 v + v^2 / 15 = 0.05 for v = 0.2320 rad/s.
    assert found.velocity == pytest.approx((0.2320,) * 6 + (0.1,), abs=1e-4)
    assert found.acceleration == (7.5,) * 7
