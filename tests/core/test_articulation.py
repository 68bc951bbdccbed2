"""What a joint does to its part: hand-derived poses, and laws that hold for all joints."""

from __future__ import annotations

import math

import numpy as np
import pytest

from s2a.scene.articulation import displace, lever_arm, open_limit, opening_direction, pose_at, transform, travel
from s2a.scene.scene import Joint

SLIDE = Joint("prismatic", (0.0, -1.0, 0.0), (9.0, 9.0, 9.0), (-0.1, 0.4))
DOOR = Joint("revolute", (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (-math.pi / 2, 0.1))
HANDLE = np.array([1.0, 0.5, 0.7])


def test_a_slide_moves_points_along_its_axis() -> None:
    assert displace(HANDLE[None], SLIDE, 0.3)[0] == pytest.approx([1.0, 0.2, 0.7])


def test_a_hinge_turns_right_handed_about_its_axis() -> None:
    # A quarter turn about z through (1, 0) takes (0, 0.5) ahead of the axis to (-0.5, 0).
    assert displace(HANDLE[None], DOOR, math.pi / 2)[0] == pytest.approx([0.5, 0.0, 0.7])


def test_the_open_end_is_the_limit_farther_from_the_scanned_pose() -> None:
    assert (open_limit(SLIDE), open_limit(DOOR)) == (0.4, -math.pi / 2)
    assert opening_direction(DOOR, HANDLE) == pytest.approx([1.0, 0.0, 0.0])


@pytest.mark.parametrize("joint", [SLIDE, DOOR], ids=["slide", "hinge"])
def test_the_first_millimetre_goes_in_the_opening_direction(joint: Joint) -> None:
    q = math.copysign(1e-6, open_limit(joint))
    step = (displace(HANDLE[None], joint, q)[0] - HANDLE) / 1e-6
    assert step == pytest.approx(lever_arm(joint, HANDLE) * opening_direction(joint, HANDLE), abs=1e-5)


def test_travel_is_the_length_of_the_path() -> None:
    points = [displace(HANDLE[None], DOOR, q)[0] for q in np.linspace(0.0, open_limit(DOOR), 2000)]
    length = np.linalg.norm(np.diff(points, axis=0), axis=1).sum()
    assert travel(DOOR, HANDLE) == pytest.approx(length, rel=1e-6) == 0.5 * math.pi / 2


@pytest.mark.parametrize("joint", [SLIDE, DOOR], ids=["slide", "hinge"])
def test_a_pose_moves_as_its_corners_do(joint: Joint) -> None:
    half = math.sqrt(0.5)
    pose = np.array([*HANDLE, half, 0.0, 0.0, half])  # a quarter turn about x: y to z, z to -y
    moved, turn = pose_at(joint, pose, 0.7), transform(joint, 0.7)[:3, :3]
    assert moved[:3] == pytest.approx(displace(HANDLE[None], joint, 0.7)[0])
    x, y, z, w = moved[3:]
    third = [2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)]  # image of z under the quaternion
    assert third == pytest.approx(turn @ [0.0, -1.0, 0.0])
