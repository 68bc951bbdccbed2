"""Motions between two joint positions around what is in the way."""

from __future__ import annotations

import gc
import weakref

import numpy as np

from s2a import robot
from s2a.robot.tool_path import free_motion

PANDA = robot.load("panda")
FEW = 20, 40
"""Points at which grasps are looked for, where any will do."""


def test_a_motion_goes_around_what_is_in_its_way() -> None:
    def free(q: np.ndarray) -> np.ndarray:
        return ~((np.abs(q[:, 0]) < 0.3) & (q[:, 1] < 0.5))

    start, goal = np.array([-1.0, -1.0]), np.array([1.0, -1.0])
    path = free_motion(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, 0)
    assert path is not None
    assert free(path).all()
    np.testing.assert_allclose(path[[0, -1]], [start, goal])
    assert np.linalg.norm(np.diff(path, axis=0), axis=1).max() < 0.1
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    assert steps.sum() < 6.0  # straight over the corners: 4.3


def test_a_motion_is_the_same_whatever_was_searched_before() -> None:
    def free(q: np.ndarray) -> np.ndarray:
        return ~((np.abs(q[:, 0]) < 0.3) & (q[:, 1] < 0.5))

    start, goal = np.array([-1.0, -1.0]), np.array([1.0, -1.0])
    first, other, again = (
        free_motion(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, seed) for seed in (0, 1, 0)
    )
    assert first is not None and other is not None and again is not None
    np.testing.assert_array_equal(first, again)
    assert first.shape != other.shape or not np.allclose(first, other)


def test_a_search_holds_nothing_when_it_is_done() -> None:
    """A room's hulls are read for each; held until the garbage is collected, twenty searches took 240 MB."""

    def free(q: np.ndarray) -> np.ndarray:
        return ~((np.abs(q[:, 0]) < 0.3) & (q[:, 1] < 0.5))

    gc.collect()
    gc.disable()
    held = weakref.ref(free)
    free_motion(np.array([-1.0, -1.0]), np.array([1.0, -1.0]), np.full(2, -2.0), np.full(2, 2.0), free, 0)
    del free
    gone = held() is None
    gc.enable()
    assert gone


def test_no_motion_through_a_wall() -> None:
    def free(q: np.ndarray) -> np.ndarray:
        return np.abs(q[:, 0]) > 0.3

    start, goal = np.array([-1.0, 0.0]), np.array([1.0, 0.0])
    assert free_motion(start, goal, np.full(2, -2.0), np.full(2, 2.0), free, 0) is None
