"""A robot's URDF, reduced to arm and gripper, its fingers made alike."""

from __future__ import annotations

import numpy as np
import pytest

from s2a import robot
from s2a.robot import urdf


@pytest.mark.parametrize("name", robot.names())
def test_fingers_are_one_link_each_and_open_from_zero(name: str) -> None:
    spec = robot.load(name)
    tree = urdf.arm(spec)
    hangs = urdf.children(tree)
    for joint, link in zip(spec.gripper.joints, spec.gripper.links, strict=True):
        (found,) = [element for child, element in hangs[spec.gripper.body] if child == link]
        limit = found.find("limit")
        assert found.get("name") == joint and link not in hangs
        assert (float(limit.get("lower")), float(limit.get("upper"))) == (0.0, spec.gripper.finger_joint_open)
    assert not tree.findall("joint/mimic") and not tree.findall("link/visual")
    moving = {element.get("name") for element in tree.findall("joint") if element.get("type") in urdf.MOVING}
    assert moving == set(spec.joints)


@pytest.mark.parametrize("name", robot.names())
def test_the_gripper_alone_is_body_and_fingers(name: str) -> None:
    spec = robot.load(name)
    links = {link.get("name") for link in urdf.gripper(spec).findall("link")}
    assert links == {spec.gripper.body, *spec.gripper.links}


def test_the_origin_of_an_element_is_a_pose_with_fixed_axes() -> None:
    (joint,) = [j for j in urdf.arm(robot.load("panda")).findall("joint") if j.get("name") == "panda_hand_joint"]
    pose, half = urdf.origin(joint), np.sqrt(0.5)
    assert pose[:3, :3] == pytest.approx(np.array([[half, half, 0], [-half, half, 0], [0, 0, 1]]))
