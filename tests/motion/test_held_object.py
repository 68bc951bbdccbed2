"""What has slipped in the hand is placed where it was planned to be."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
import warp as wp
from scipy.spatial.transform import Rotation

from s2a import robot as robots
from s2a.motion.correction import Correction, lead_held, target_in_tool
from s2a.motion.trajectory import Anchor, Trajectory
from s2a.robot.kinematics import kinematics

SPEC = robots.load("panda")
HELD = np.eye(4)
"""Planned pose of the object in the tool frame."""
HELD[:3, :3] = Rotation.from_euler("x", 180, degrees=True).as_matrix()
HELD[:3, 3] = [0.0, 0.01, 0.02]
SEEN, READY, RELEASED, BACK = 5, 15, 60, 70


def lowering() -> np.ndarray:
    """Return joints [step arm] that stand until READY, and move down until RELEASED."""
    down = np.array(SPEC.home) + np.linspace(0.0, 1.0, RELEASED - READY + 1)[:, None] * [0, 0.1, 0, -0.1, 0, 0.05, 0]
    return np.concatenate([np.tile(SPEC.home, (READY, 1)), down, np.tile(down[-1], (40, 1))])


def holding(slips: list[np.ndarray]) -> SimpleNamespace:
    """Return a simulation in which the arm is at home and each world's object is off in the tool frame by a motion [4 4]."""
    tool = kinematics(SPEC).tool(np.array([SPEC.home]))[0]
    link = tool.copy()
    link[:3, 3] -= tool[:3, :3] @ SPEC.tool_offset
    poses = [[seven(link), seven(tool @ slip @ HELD)] for slip in slips]
    body_q = wp.array(np.array(poses, np.float32).reshape(-1, 7), dtype=wp.transform, device="cpu")
    layout = SimpleNamespace(tool_body=0, part_body=1)
    return SimpleNamespace(
        num_envs=len(slips), device="cpu", robot=SPEC, layout=layout, state=SimpleNamespace(body_q=body_q)
    )


def seven(pose: np.ndarray) -> np.ndarray:
    return np.array([*pose[:3, 3], *Rotation.from_matrix(pose[:3, :3]).as_quat()])


def slip(metres: float, degrees: float) -> np.ndarray:
    """Return a motion in the tool frame: along x, about y, the axis that the fingers close along."""
    found = np.eye(4)
    found[:3, :3] = Rotation.from_euler("y", degrees, degrees=True).as_matrix()
    found[0, 3] = metres
    return found


def corrected(slips: list[np.ndarray], looked: bool = True, wrist: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Return the planned joints [step arm], the last one turned by `wrist` [rad], and those of every world [world step arm]."""
    arm = lowering() + [0, 0, 0, 0, 0, 0, wrist]
    targets = np.concatenate([arm, np.zeros((len(arm), 2))], axis=1)
    trajectory = Trajectory(targets, np.zeros(len(arm)), 1, 0)
    sim = holding(slips)
    held = Correction(sim, [trajectory], [Anchor("held", SEEN, READY, RELEASED, BACK, HELD)])
    if looked:
        worlds = torch.ones(len(slips), dtype=torch.bool)
        lead_held(held, worlds, target_in_tool(sim, worlds))
    moved = [held(torch.full((len(slips),), step)).numpy() for step in range(len(arm))]
    return arm, arm + np.stack(moved, axis=1)


def test_the_object_passes_where_it_was_planned_to() -> None:
    slips = [slip(0.015, 10.0), slip(0.0, -15.0)]
    planned, arms = corrected(slips)
    for world, off in enumerate(slips):
        for step in range(READY, RELEASED + 1, 5):
            tool, asked = kinematics(SPEC).tool(np.stack([arms[world, step], planned[step]]))
            assert (tool @ off @ HELD)[:3, 3] == pytest.approx((asked @ HELD)[:3, 3], abs=1e-3)
            assert np.trace((tool @ off)[:3, :3].T @ asked[:3, :3]) == pytest.approx(3.0, abs=1e-3)


def test_what_the_arm_cannot_make_up_for_is_placed_as_it_is_held() -> None:
    """The last joint is 0.03 rad before its end: one of two opposite turns about its axis is out of reach."""
    turns = [np.eye(4), np.eye(4)]
    for turn, angle in zip(turns, (35.0, -35.0), strict=True):
        turn[:3, :3] = Rotation.from_euler("z", angle, degrees=True).as_matrix()
    upper = kinematics(SPEC).upper[6]
    planned, arms = corrected(turns, wrist=float(upper) - 0.03 - SPEC.home[6])
    moved = np.abs(arms - planned).max(axis=(1, 2))
    assert moved.min() == 0.0 and moved.max() == pytest.approx(np.radians(35.0), abs=0.05)


def test_it_begins_and_ends_at_the_plan() -> None:
    planned, (arm,) = corrected([slip(0.02, 10.0)])
    assert arm[: SEEN + 1] == pytest.approx(planned[: SEEN + 1], abs=1e-6)
    assert arm[BACK:] == pytest.approx(planned[BACK:], abs=1e-6)
    assert np.abs(np.diff(arm, axis=0)).max() < 0.08, "no jump in between"


def test_what_has_fallen_or_was_not_looked_at_is_not_followed() -> None:
    planned, arms = corrected([slip(0.2, 0.0), slip(0.0, 90.0)])
    assert arms == pytest.approx(np.stack([planned, planned]), abs=1e-6)
    planned, arms = corrected([slip(0.01, 0.0)], looked=False)
    assert arms[0] == pytest.approx(planned, abs=1e-6)
