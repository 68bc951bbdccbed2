"""What a robot's torques tell of a part that it holds."""

from __future__ import annotations

import numpy as np
import pytest
from pulled_bodies import DOOR, DRAWER

from s2a import robot
from s2a.core.errors import InputError
from s2a.joints.pull import ArmDynamics, Recording, along, recorded_pull
from s2a.robot.kinematics import kinematics

PANDA = robot.load("panda")


def test_a_still_arm_feels_the_wrench_whose_work_its_torques_do() -> None:
    q = np.array([[*PANDA.home, 0.02, 0.02]])
    wrench, step, zero = np.array([5.0, -3.0, 2.0, 0.0, 0.0, 0.0]), 1e-5, np.zeros((1, 9))
    turned = q[0, :7] + step * np.vstack([np.eye(7), -np.eye(7)])
    tool = kinematics(PANDA).tool(np.vstack([turned, q[:, :7]]))[:, :3, 3]
    torque = ((tool[:7] - tool[7:14]) / (2 * step)) @ wrench[:3]  # by virtual work
    found = ArmDynamics(PANDA).wrench(q, zero, zero, torque[None], tool[14:], gravity=False)
    assert found[0] == pytest.approx(wrench, abs=1e-4)


@pytest.mark.parametrize("body", [DRAWER, DOOR], ids=["drawer", "door"])
def test_openings_count_along_the_parts_path(body: object) -> None:
    opening, off = along(np.stack([body.point, body.point + [0.0, 0.0, 0.02]]), body)
    assert opening[0] == pytest.approx(0.0, abs=1e-9) and off == pytest.approx([0.0, 0.02], abs=1e-9)


def test_a_tool_that_is_nowhere_near_the_part_is_refused() -> None:
    still = Recording(np.tile([*PANDA.home, 0.02, 0.02], (60, 1)), np.zeros((60, 7)), 1 / 60)
    with pytest.raises(InputError, match="record a pull that holds the part"):
        recorded_pull(still, PANDA, np.array([5.0, 5.0, 0.0, 0.0, 0.0, 0.0, 1.0]), DRAWER, gravity=False)
