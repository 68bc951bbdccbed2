"""Resistance of a joint beside its dry friction, as attributes of the joint; `s2a.scene.usd.sim_stage` documents the file."""

from __future__ import annotations

import math
from dataclasses import dataclass

from pxr import Sdf, Usd

from s2a.core.errors import InputError
from s2a.scene.usd.stage import read_attribute, where, write_attribute

SETTINGS = ("damping", "stiffness")
"""What the simulation's settings say where a joint does not."""
SOFT_CLOSE = ("force", "damping", "reach")


@dataclass(frozen=True)
class SoftClose:
    """A mechanism that draws a part in before it is shut, and damps it there as it closes; per unit of its coordinate.

    Attributes:
        force: that draws it in [N] or [N m].
        damping: while it closes [N s/m] or [N m s/rad].
        reach: the coordinate from which on it acts, as a distance from zero [m] or [rad].
    """

    force: float
    damping: float
    reach: float


@dataclass(frozen=True)
class Resistance:
    """What was identified of a joint beside its dry friction in motion, per unit of its coordinate.

    Attributes:
        damping: [N s/m] or [N m s/rad]; None: what the simulation's settings say, as with `stiffness`.
        stiffness: of the spring that draws the part to its scanned pose [N/m] or [N m/rad].
        breakaway: how much more dry friction holds it at rest [N] or [N m].
        soft_close: None: it has none.
    """

    damping: float | None = None
    stiffness: float | None = None
    breakaway: float = 0.0
    soft_close: SoftClose | None = None


def write(joint: Usd.Prim, resistance: Resistance) -> None:
    """Write on a joint what resists, and nothing of what it does not say."""
    kind = Sdf.ValueTypeNames.Double
    for name in SETTINGS:
        if (value := getattr(resistance, name)) is not None:
            write_attribute(joint, name, kind, value)
    if resistance.breakaway:
        write_attribute(joint, "breakaway", kind, resistance.breakaway)
    for name in SOFT_CLOSE if resistance.soft_close else ():
        write_attribute(joint, f"softClose:{name}", kind, getattr(resistance.soft_close, name))


def read(joint: Usd.Prim) -> Resistance | None:
    """Return what was written on a joint; None where nothing was.

    Raises:
        InputError: a number below 0 or infinite, or a soft close of which one is missing.
    """
    names = (*SETTINGS, "breakaway", *(f"softClose:{name}" for name in SOFT_CLOSE))
    found = {name: read_attribute(joint, name, float) for name in names}
    for name, value in found.items():
        if value is not None and not (0.0 <= value < math.inf):
            raise InputError(f"{where(joint)}: s2a:{name} is {value:g}; expected 0 or more: identify the joint again")
    if set(found.values()) == {None}:
        return None
    closes = [found[name] for name in names[3:]]
    if None in closes and set(closes) != {None}:
        missing = names[3 + closes.index(None)]
        raise InputError(f"{where(joint)} has a soft close without s2a:{missing}; identify the joint again")
    soft = None if None in closes else SoftClose(*closes)
    return Resistance(found["damping"], found["stiffness"], found["breakaway"] or 0.0, soft)
