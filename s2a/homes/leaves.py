"""Fronts that close a cell of a cabinet: drawers, doors, pairs of doors, flaps, rising shutters, with their handles.

Drawers run on 3/4 or full extension runners of 250 to 650 mm (Blum Tandem, Hettich Quadro); hinges open by 80 to 110 degrees
(Blum Clip Top 107 and 110, Salice 94); flaps by 75 to 107 degrees (Blum Aventos); reveals are 2 to 5 mm. Local frames: the
front's middle, its face at x = 0, z up, metres.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.homes import clutter, fronts, grips
from s2a.homes.clutter import Board
from s2a.homes.draw import chance, integer
from s2a.homes.fronts import BOTTOM, LEFT, RIGHT, TOP, Side, hinged
from s2a.homes.grips import GripDesign, upright
from s2a.homes.solids import Piece, Surface, at, box, join
from s2a.homes.styles import Opening, Style
from s2a.scene.scene import Joint

HANDLE_HEIGHT = 1.05
"""[m] Height above the floor at which handles of doors are put if the door reaches there."""
Grips = tuple[tuple[Piece, ...], fronts.Pocket | None]


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


def door_grips(grip: GripDesign, side: Side, size: fronts.Size, height: float, inset: float) -> Grips:
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


def flap_grips(grip: GripDesign, side: Side, size: fronts.Size) -> Grips:
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


def _pocket(grip: GripDesign, y: float, z: float) -> fronts.Pocket:
    """Return the hole of a front that a recessed pull lines."""
    half, up = grip.length / 2 + 0.0003, grip.width / 2 + 0.0003
    return (y - half, y + half, z - up, z + up)


def _roll(angle: float) -> np.ndarray:
    """Return a rotation in the plane of a front, shape [4 4]."""
    turn = np.eye(4)
    turn[1:3, 1:3] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    return turn


SIDES: dict[str, Side] = {"left": LEFT, "right": RIGHT, "up": TOP, "down": BOTTOM}
"""Where a leaf has its hinge, by its kind; left and right as seen by who stands before it."""
ASKEW = 0.0004
"""[m] Farthest that a corner of a front hangs out of place."""
Span = tuple[float, float]


def close(rng: np.random.Generator, opening: Opening, y: Span, z: Span, depth: float, style: Style) -> list[Piece]:
    """Return the fronts of a cell, in the cabinet's frame.

    Args:
        rng: how askew they hang, and what is in a drawer.
        opening: their kind.
        y: the cell from right to left, gaps included [m].
        z: from below, gaps included [m].
        depth: of the cabinet: where its fronts' faces lie [m].
        style: materials and handles.
    """
    if opening.kind == "open":
        return []
    if opening.kind == "pair":
        middle = (y[0] + y[1]) / 2
        halves = ((y[0], middle), "left"), ((middle, y[1]), "right")
        return [f for span, kind in halves for f in close(rng, replace(opening, kind=kind), span, z, depth, style)]
    drawer = opening.kind == "drawer"
    level = opening.kind in ("drawer", "up", "down", "rise", "fixed")
    grip = opening.grip or (style.grip if level else style.door_grip)
    wide = y[1] - y[0] - style.gap - (0.0 if level else grip.rim)
    high = z[1] - z[0] - style.gap - (grip.rim if level else 0.0)
    size = (opening.thick or style.thick, wide, high)
    aside = 0.0 if level else SIDES[opening.kind][0] * grip.rim / 2
    centre = at(depth, sum(y) / 2 + aside, sum(z) / 2 - (grip.rim / 2 if level else 0.0))
    if drawer:
        front = _drawer(rng, opening, size, depth, grip, style)
    elif opening.kind == "rise":
        return _shutter(opening, size, grip, style, centre)
    elif opening.kind == "fixed":
        return [Piece("panel", _panel(opening, size, style, None, style.panel)).moved(centre)]
    else:
        front = _leaf(opening, size, grip, style, centre[2, 3])
    tilt = float(np.degrees(ASKEW / (max(size[1:]) / 2)))
    return [front.tilted(rng, tilt).moved(centre)]


def _drawer(
    rng: np.random.Generator, opening: Opening, size: fronts.Size, depth: float, grip: GripDesign, style: Style
) -> Piece:
    """Return a drawer: panel, tray, handles, and what lies in it."""
    thick, wide, high = size
    handles, pocket = level_grips(rng, grip, wide, high, style.place)
    length = depth - thick - style.board - 0.014
    across, up = wide - 0.06, max(0.03, min(high - 0.05, 0.3))
    limit = opening.limit or round(style.extension * length, 4)
    shape = join(_panel(opening, size, style, pocket, style.drawer_panel), _tray(thick, length, across, up))
    inside = Board(
        (-thick - length + 0.01, -thick - 0.01), (-across / 2 + 0.008, across / 2 - 0.008), 0.002 - up / 2, up
    )
    things = clutter.fill(rng, inside, style.drawer_theme, integer(rng, 0, 4))
    joint = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, min(limit, length)))
    facts = {"soft_close": style.soft_close}
    return Piece(opening.name or "drawer", shape, handles, joint, contents=things, facts=facts)


def _tray(thick: float, length: float, across: float, up: float) -> Surface:
    """Return the box behind a drawer's panel."""
    wood, back, y, z = (205, 186, 150), -thick - length, across / 2, up / 2
    return join(
        box((back, -thick), (-y, -y + 0.006), (-z, z), wood),
        box((back, -thick), (y - 0.006, y), (-z, z), wood),
        box((back, back + 0.006), (-y, y), (-z, z), wood),
        box((back, -thick), (-y, y), (-z, -z + 0.002), wood),
    )


def _leaf(opening: Opening, size: fronts.Size, grip: GripDesign, style: Style, height: float) -> Piece:
    """Return a hinged door or flap with its handle."""
    side = SIDES[opening.kind]
    if side[0]:
        handles, pocket = door_grips(grip, side, size, height, style.inset)
    else:
        handles, pocket = flap_grips(grip, side, size)
    shape = _panel(opening, size, style, pocket, style.panel)
    name = opening.name or ("door" if side[0] else "flap")
    limit = opening.limit or (style.angle if side[0] else min(style.angle, 1.5))
    facts = {"soft_close": style.soft_close}
    return replace(hinged(name, shape, side, *handles, angle=limit), facts=facts)


def _shutter(opening: Opening, size: fronts.Size, grip: GripDesign, style: Style, centre: np.ndarray) -> list[Piece]:
    """Return a fixed upper half, and behind its plane a lower half that slides up."""
    thick, wide, high = size
    low, up = 0.55 * high, 0.45 * high - style.gap
    fixed = Piece("panel", fronts.front(style.panel, (0.5 * thick, wide, up), style.front, style.texture, style.frame))
    handles, _ = flap_grips(replace(grip, clearance=min(grip.clearance, 0.02)), TOP, (thick, wide, low))
    shape = fronts.front(
        "grooved", (0.35 * thick, wide - 2 * style.board - 0.008, low), style.front, style.texture, 0.0
    )
    behind = at(-0.5 * thick - 0.002, 0)
    # The handle must stay below the fixed half.
    limit = min(up, low - grip.width - 0.06)
    joint = Joint("prismatic", (0.0, 0.0, 1.0), (0.0, 0.0, 0.0), (0.0, round(limit, 4)))
    moving = Piece(opening.name or "shutter", shape.moved(behind), tuple(h.moved(behind) for h in handles), joint)
    return [fixed.moved(centre @ at(0, 0, (high - up) / 2)), moving.moved(centre @ at(0, 0, (low - high) / 2))]


def _panel(opening: Opening, size: fronts.Size, style: Style, pocket: fronts.Pocket | None, panel: str) -> Surface:
    """Return the panel of a front, with a pocket for a recessed pull where it has one."""
    color = opening.color or style.front
    if pocket is not None:
        return fronts.pocketed(size, pocket, 0.0135, color, style.texture)
    return fronts.front(opening.panel or panel, size, color, style.texture, style.frame)
