"""Carrying a soft body: what honest episodes give, and what cheats give away."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from s2a.tasks.soft import SoftEpisode, SoftMetrics, outcome

METRICS = SoftMetrics()
RATE, GOAL = 60, np.array([0.5, 0.0, 0.2])
STILL, UP, OVER, DOWN, END = 30, 60, 120, 60, 120
FIRST, RELEASED = STILL, STILL + UP + OVER + DOWN


def honest() -> SoftEpisode:
    """Return an episode: grasped at the origin, lifted by 0.2 m, carried over 0.5 m, lowered to GOAL, released."""
    corners = np.array([[0, 0, 0.1], [0, 0, 0.1], [0, 0, 0.3], [0.5, 0, 0.3], GOAL, GOAL])
    counts = (STILL, UP, OVER, DOWN, END)
    center = np.concatenate([np.linspace(a, b, n) for a, b, n in zip(corners, corners[1:], counts, strict=False)])
    forces = np.zeros((len(center), 2, 3))
    forces[FIRST - 10 : RELEASED, 0, 1], forces[FIRST - 10 : RELEASED, 1, 1] = 20.0, -20.0
    gap = np.where(forces.any(axis=(1, 2)), 0.0, 0.05)
    return SoftEpisode(center, forces, gap, np.zeros(len(center)), RATE)


def failed(episode: SoftEpisode) -> set[str]:
    """Return the columns by which an episode fails."""
    found = outcome(episode, GOAL, METRICS)
    assert not found["success"]
    return {name for name, value in found.items() if value is False} - {"success"}


def test_an_honest_episode_succeeds() -> None:
    found = outcome(honest(), GOAL, METRICS)
    assert found["success"]
    assert found["carried_fraction"] > 0.99
    assert found["grip_force"] == 20.0


def test_trembling_where_it_stands_is_no_path() -> None:
    """As a soft body does: by 0.7 mm a step, 0.5 m in all in ten seconds, beside the 0.8 that it is carried."""
    episode, count = honest(), 600
    still = np.repeat(episode.center[:1], count, axis=0) + 0.5e-3 * np.random.default_rng(0).normal(size=(count, 3))
    longer = SoftEpisode(
        np.concatenate([still, episode.center]), np.concatenate([np.zeros((count, 2, 3)), episode.forces]),
        np.concatenate([np.full(count, 0.05), episode.gap]), np.zeros(count + len(episode.depth)), RATE,
    )  # fmt: skip
    assert outcome(longer, GOAL, METRICS)["carried_fraction"] > 0.95


def test_dropped_from_a_height_is_not_released_at_rest() -> None:
    episode = honest()
    forces = episode.forces.copy()
    forces[RELEASED - DOWN :] = 0.0  # it falls the last 0.1 m of its path of 0.8 m
    assert failed(replace(episode, forces=forces)) == {"released_at_rest"}


def test_carried_a_little_and_then_pushed_slowly_is_not_carried() -> None:
    """The last 0.25 m of 0.85 by one finger at 6 mm/s, slower than a body that stands trembles from step to step."""
    episode, count = honest(), 2500
    pushed = np.linspace(GOAL, GOAL + [0.25, 0.0, 0.0], count)
    forces = np.zeros((count, 2, 3))
    forces[:, 0, 0] = 5.0
    parts = slice(0, RELEASED), slice(RELEASED, None)
    center, force = ([each[part] for part in parts] for each in (episode.center, episode.forces))
    gap = [episode.gap[part] for part in parts]
    longer = SoftEpisode(
        np.concatenate([center[0], pushed, center[1] + [0.25, 0.0, 0.0]]), np.concatenate([force[0], forces, force[1]]),
        np.concatenate([gap[0], np.zeros(count), gap[1]]), np.zeros(count + len(episode.depth)), RATE,
    )  # fmt: skip
    found = outcome(longer, GOAL + [0.25, 0.0, 0.0], METRICS)
    assert [name for name, value in found.items() if value is False] == ["success", "carried"]


def test_pushed_by_one_finger_is_not_carried() -> None:
    forces = honest().forces.copy()
    forces[:, 1] = 0.0
    assert failed(replace(honest(), forces=forces)) == {"carried"}


def test_scooped_with_both_fingers_below_is_not_carried() -> None:
    forces = honest().forces.copy()
    forces[FIRST:RELEASED] = [0.0, 0.0, -20.0]
    assert failed(replace(honest(), forces=forces)) == {"carried"}


def test_pinned_to_the_gripper_is_not_carried() -> None:
    """What moves with the gripper without a force of the fingers hangs on a constraint."""
    episode = honest()
    forces = np.zeros_like(episode.forces)
    forces[FIRST - 10 : FIRST] = episode.forces[FIRST - 10 : FIRST]  # it is touched, and then teleported
    assert failed(replace(episode, forces=forces)) == {"carried", "released_at_rest"}


def test_held_for_the_lift_alone_is_not_carried() -> None:
    episode = honest()
    forces = episode.forces.copy()
    forces[FIRST + UP : RELEASED - 2] = 0.0
    assert failed(replace(episode, forces=forces)) == {"carried"}


def test_what_is_still_held_is_not_placed() -> None:
    forces = honest().forces.copy()
    forces[RELEASED:] = forces[RELEASED - 1]
    assert failed(replace(honest(), forces=forces)) == {"gripper_gone"}


def test_fingers_that_open_and_stay_are_not_gone() -> None:
    gap = np.where(np.arange(len(honest().gap)) >= RELEASED, 0.01, honest().gap)
    assert failed(replace(honest(), gap=gap)) == {"gripper_gone"}


def test_what_rolls_on_is_not_at_rest() -> None:
    center = honest().center.copy()
    center[-60:] += np.linspace(0.0, [0.02, 0.0, 0.0], 60)  # 2 cm/s
    assert "at_rest" in failed(replace(honest(), center=center))


def test_six_centimetres_off_is_not_placed() -> None:
    center = honest().center.copy()
    center[FIRST:] += np.linspace(0.0, 1.0, len(center) - FIRST)[:, None] ** 0.01 * [0.0, 0.06, 0.0]
    assert "placed" in failed(replace(honest(), center=center))


def test_an_arm_that_passes_through_the_room_fails() -> None:
    depth = honest().depth.copy()
    depth[100] = 0.02
    assert failed(replace(honest(), depth=depth)) == {"arm_clear"}


@pytest.mark.parametrize("where", [0, -1])
def test_what_is_lost_to_infinity_fails(where: int) -> None:
    center = honest().center.copy()
    center[where] = np.nan
    assert "finite" in failed(replace(honest(), center=center))
