"""Metrics of a carried soft body, from the recording of an episode in every control step."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from s2a.core.bounds import Fraction, NotNegative, Positive

COLUMNS = ("success", "placed", "at_rest", "gripper_gone", "carried", "released_at_rest", "arm_clear", "finite")
"""Of an outcome, what holds or not; success: all of the others."""
VALUES = ("position_error", "carried_fraction", "drift", "arm_depth", "grip_force")
"""The others: metres, a fraction, metres, metres, newtons."""
INTERVAL = 0.5
"""[s] The path is how far the body comes in each. In steps, its trembling where it stands made 46 mm of path before it was
touched, and 60 mm after its release. No motion is too slow to count: what is pushed at 6 mm/s is not carried."""


@dataclass(frozen=True)
class SoftMetrics:
    """Thresholds.

    Attributes:
        position: of the centre of mass at its place [m]: a soft body sags, leans and gives way by more than a rigid one, and
            has no one orientation that a tolerance of degrees could be of.
        rest_time: at rest, at the end of the episode [s].
        rest_speed: of the centre of mass, up to which it rests [m/s].
        clear_distance: of fingers and gripper body from the body's vertices, from which the gripper is gone [m].
        contact_force: of each finger, from which a pinch holds [N].
        carried_fraction: of the body's path over which a pinch must have held.
        max_drift: of the body after the last touch [m]: more is dropped or thrown.
        max_depth: of the arm in the room's hulls, at any time [m].
    """

    position: Positive
    rest_time: Positive
    rest_speed: Positive
    clear_distance: NotNegative
    contact_force: Positive
    carried_fraction: Fraction
    max_drift: NotNegative
    max_depth: NotNegative


@dataclass(frozen=True)
class SoftEpisode:
    """What was recorded.

    Attributes:
        center: centre of mass [m], shape [step 3].
        forces: of the body on the left and the right finger [N], shape [step 2 3].
        gap: least distance of fingers and gripper body from the body's vertices [m], shape [step].
        depth: of the arm in the room's hulls [m], shape [step].
        rate: steps a second.
    """

    center: np.ndarray
    forces: np.ndarray
    gap: np.ndarray
    depth: np.ndarray
    rate: float


def outcome(episode: SoftEpisode, goal: np.ndarray, metrics: SoftMetrics) -> dict[str, float | bool]:
    """Return the results of an episode by name: those of `success`, and what they were decided by.

    Args:
        episode: what was recorded, of `rest_time` or more.
        goal: place of the centre of mass [m], shape [3].
        metrics: the thresholds.
    """
    last = round(metrics.rest_time * episode.rate)
    error = np.linalg.norm(episode.center - goal, axis=1)
    steps = np.linalg.norm(np.diff(episode.center, axis=0), axis=1)
    size = np.linalg.norm(episode.forces, axis=2)
    touched = np.flatnonzero((size > 0.0).any(axis=1))
    drift = np.linalg.norm(episode.center[-1] - episode.center[touched[-1] if len(touched) else 0])
    found = {
        "placed": bool((error[-last:] <= metrics.position).all()),
        "at_rest": bool((steps[-last:] * episode.rate <= metrics.rest_speed).all()),
        "gripper_gone": bool((episode.gap[-last:] >= metrics.clear_distance).all() and not size[-last:].any()),
        "carried": (carried := _carried(episode, metrics.contact_force)) >= metrics.carried_fraction,
        "released_at_rest": bool(drift <= metrics.max_drift),
        "arm_clear": bool(episode.depth.max() <= metrics.max_depth),
        "finite": bool(np.isfinite(episode.center).all()),
    }
    values = {"position_error": float(error[-1]), "carried_fraction": carried, "drift": float(drift)}
    values |= {"arm_depth": float(episode.depth.max()), "grip_force": float(size.min(axis=1).max())}
    return {"success": all(found.values()), **found, **values}


def _carried(episode: SoftEpisode, least: float) -> float:
    """Return the fraction of the path on which both fingers pressed from opposite sides, more than 120 degrees apart."""
    size, forces = np.linalg.norm(episode.forces, axis=2), episode.forces
    cosine = (forces[:, 0] * forces[:, 1]).sum(axis=1) / np.maximum(size.prod(axis=1), 1e-12)
    pinched = (size >= least).all(axis=1) & (cosine <= -0.5)
    ends = np.arange(0, len(pinched), max(1, round(INTERVAL * episode.rate)))
    path = np.linalg.norm(np.diff(episode.center[ends], axis=0), axis=1)
    held = np.array([pinched[a : b + 1].mean() for a, b in itertools.pairwise(ends)])
    return float((path * held).sum() / path.sum()) if path.any() else 0.0
