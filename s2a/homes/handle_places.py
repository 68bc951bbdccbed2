"""Places of handles on drawers, doors and flaps. Local frames: the front's middle, its face at x = 0, z up, metres."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import grips, panels
from s2a.homes.draw import chance
from s2a.homes.fronts import BOTTOM, Side
from s2a.homes.grips import GripDesign
from s2a.homes.handles import upright
from s2a.homes.solids import Piece, at

HANDLE_HEIGHT = 1.05
"""[m] Height above the floor at which handles of doors are put if the door reaches there."""
Grips = tuple[tuple[Piece, ...], panels.Pocket | None]


def level_grips(rng: np.random.Generator, grip: GripDesign, wide: float, high: float, place: float) -> Grips:
    """Return the handles of a drawer: one in its middle, or, on some wide ones, two."""
    if grip.family == "none" or high < 0.05:
        return (), None
    grip = replace(grip.fitted(0.8 * wide), width=min(grip.width, 0.6 * high))
    if grip.family == "knob":
        grip = grip.fitted(0.5 * high)
    if grip.family == "edge":
        return (grips.make(grip).moved(at(0, 0, high / 2)),), None
    z = place * max(0.0, high / 2 - 0.035 - grip.width / 2)
    if grip.family == "recess":
        return (grips.make(grip).moved(at(0, 0, z)),), _pocket(grip, 0.0, z)
    if wide > 0.75 and grip.length < 0.3 * wide and chance(rng, 0.3):
        return tuple(grips.make(grip).moved(at(0, y, z)) for y in (-0.28 * wide, 0.28 * wide)), None
    return (grips.make(grip).moved(at(0, 0, z)),), None


def door_grips(grip: GripDesign, side: Side, size: panels.Size, height: float, inset: float) -> Grips:
    """Return the upright handle of a door whose middle is at a height above the floor [m]."""
    _, wide, high = size
    if grip.family == "none":
        return (), None
    grip = grip.fitted(0.45 * high)
    reach = max(0.0, high / 2 - grip.length / 2 - 0.04)
    z = float(np.clip(HANDLE_HEIGHT - height, -reach, reach))
    free = -side[0] * wide / 2
    turned = upright(grips.make(grip)) if grip.family != "cup" else grips.make(grip)
    if grip.family == "edge":
        turned = grips.make(grip).moved(_roll(side[0] * np.pi / 2))
        return (turned.moved(at(0, free, z)),), None
    y = free + side[0] * max(min(inset, wide / 3), grip.width / 2 + 0.012)
    if grip.family == "recess":
        return (turned.moved(at(0, y, z)),), _pocket(replace(grip, length=grip.width, width=grip.length), y, z)
    return (turned.moved(at(0, y, z)),), None


def flap_grips(grip: GripDesign, side: Side, size: panels.Size) -> Grips:
    """Return the handle of a flap near the edge across from its hinge."""
    _, wide, high = size
    if grip.family == "none":
        return (), None
    grip = replace(grip.fitted(0.7 * wide), width=min(grip.width, 0.5 * high))
    if grip.family == "edge":
        turn = np.eye(4) if side is BOTTOM else _roll(np.pi)
        return (grips.make(grip).moved(turn).moved(at(0, 0, -side[1] * high / 2)),), None
    z = -side[1] * max(0.0, high / 2 - 0.03 - grip.width / 2)
    return (grips.make(grip).moved(at(0, 0, z)),), _pocket(grip, 0.0, z) if grip.family == "recess" else None


def _pocket(grip: GripDesign, y: float, z: float) -> panels.Pocket:
    """Return the hole of a front that a recessed pull lines."""
    half, up = grip.length / 2 + 0.0003, grip.width / 2 + 0.0003
    return (y - half, y + half, z - up, z + up)


def _roll(angle: float) -> np.ndarray:
    """Return a rotation in the plane of a front, shape [4 4]."""
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn
