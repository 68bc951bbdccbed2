"""What slipped out of the gripper as it was lifted is grasped again where it stands now."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
import torch
import warp as wp
from scipy.spatial.transform import Rotation

from s2a import robot as robots
from s2a.motion.correction import Retries
from s2a.motion.trajectory import Anchor, Retry, Trajectory

SPEC = robots.load("panda")
START = np.array([0.5, 0.0, 0.8, 0.0, 0.0, 0.0, 1.0])
"""Pose of the object where it is picked, 7-vector."""
HELD = np.eye(4)
"""Of the object in the tool frame: the tool is at its origin."""
LIFTED, NEAR, END, LOOKS, BACK = 30, 10, 60, 5, 20
"""Indices of the trajectory, its length, and of the way back: where it looks, and its length."""


class Shifted:
    """The shift of the grasp, the same joints in all worlds: 0.1 rad as long as nothing is seen, then 0.3."""

    def __init__(self) -> None:
        self.seen = torch.zeros(4, dtype=torch.bool)

    def __call__(self, step: torch.Tensor) -> torch.Tensor:
        return torch.where(self.seen, 0.3, 0.1)[:, None].expand(-1, 7)


@pytest.fixture
def lifted() -> tuple[Retries, Shifted, wp.array]:
    """Four worlds in which the tool was lifted by 0.1 m: the object came along, lies at its start, 4 cm off, and far away."""
    tool = START[:3] + [0.0, 0.0, 0.1]
    objects = [tool, START[:3], START[:3] + [0.04, 0.0, 0.0], START[:3] + [0.3, 0.0, 0.0]]
    link = tool - Rotation.identity().apply(SPEC.tool_offset)
    poses = [[*link, *START[3:], *place, *START[3:]] for place in objects]
    body_q = wp.array(np.array(poses, np.float32).reshape(-1, 7), dtype=wp.transform, device="cpu")
    sim = SimpleNamespace(
        num_envs=4, device="cpu", robot=SPEC, stage=SimpleNamespace(grasp=START),
        layout=SimpleNamespace(tool_body=0, part_body=1),
        state=SimpleNamespace(body_q=body_q),
    )  # fmt: skip
    trajectory = Trajectory(
        np.zeros((END, 9)), np.zeros(END), 5, 20, (Anchor("object", 5, NEAR, LIFTED, 40), Anchor("held", 40, 45, 50, 55, HELD)),
        Retry(np.zeros((BACK, 9)), LOOKS),
    )  # fmt: skip
    shifted = Shifted()
    return Retries(sim, trajectory, shifted), shifted, body_q  # type: ignore[arg-type]


def everywhere(step: float) -> torch.Tensor:
    return torch.full((4,), step, dtype=torch.float64)


def test_only_what_lies_near_its_start_is_come_back_for(lifted: tuple[Retries, Shifted, wp.array]) -> None:
    retries, shifted, _ = lifted
    assert retries.see(everywhere(LIFTED).long()) is None
    goes_on = retries.after(everywhere(LIFTED), everywhere(LIFTED + 1))
    assert goes_on.tolist() == [LIFTED + 1, END, END, LIFTED + 1]
    assert retries.see(everywhere(END).long()) is None, "the object may still roll"


def test_it_looks_when_the_fingers_are_open_and_goes_to_where_the_object_stands(
    lifted: tuple[Retries, Shifted, wp.array],
) -> None:
    retries, shifted, _ = lifted
    retries.see(everywhere(LIFTED).long())
    seen = retries.see(everywhere(END + LOOKS).long())
    assert seen is not None and seen.tolist() == [False, True, True, False]
    shifted.seen |= seen
    begins, ends = (retries(everywhere(step).long())[1] for step in (END, END + BACK - 1))
    np.testing.assert_allclose(begins, 0.1, atol=1e-6)  # where the arm stands
    np.testing.assert_allclose(ends, 0.3, atol=1e-6)
    assert retries.after(everywhere(END + BACK - 1), everywhere(END + BACK)).tolist() == 4 * [NEAR]


def test_what_is_lifted_the_second_time_is_carried_on(lifted: tuple[Retries, Shifted, wp.array]) -> None:
    retries, _, body_q = lifted
    retries.see(everywhere(LIFTED).long())
    retries.see(everywhere(END + LOOKS).long())
    poses = body_q.numpy()
    poses[1::2] = poses[1]  # all objects are in the gripper now
    body_q.assign(poses)
    retries.see(everywhere(LIFTED).long())
    assert retries.after(everywhere(LIFTED), everywhere(LIFTED + 1)).tolist() == 4 * [LIFTED + 1]


def test_the_end_of_the_motion_is_not_run_past_into_the_way_back(lifted: tuple[Retries, Shifted, wp.array]) -> None:
    retries, _, _ = lifted
    assert retries.after(everywhere(END - 1), everywhere(END)).tolist() == 4 * [END - 1]
    assert not retries(everywhere(END - 1).long()).any()
