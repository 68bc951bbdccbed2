"""Joint limits, dry friction and surfaces, as stiff as the time step allows: MuJoCo's defaults are soft."""

from __future__ import annotations

import newton
import warp as wp

SURFACE = 3e4
"""[N/m] Stiffness of what lies free at a point of contact. Ten times as much made a bottle of 170 g tremble between the pads,
and fall: the solver did not converge."""
SKIN = 0.0003
"""[m] Depth in which the stiffness is reached. What is as stiff from the surface on sinks in by so little under its own weight
that contacts come and go: a wine glass of 24 g falls over by itself."""
SOFTEST, HARDEST = 0.9, 0.999
"""Impedances of MuJoCo's constraints: its default's lower end, and where rows become too stiff for single precision."""
RAW = 1
"""Newton's `solref_mode` that hands solref over unscaled."""


def stiffen(builder: newton.ModelBuilder, dof: int, dt: float) -> None:
    """Make one joint's limits and its dry friction as stiff as the time step allows.

    Newton's default limit is so soft that a drawer pulled by 30 N passes it by 0.2 m. MuJoCo's default friction lets an
    oven door creep by 0.4 mm/s though it weighs a third of what the friction holds. MuJoCo keeps a constraint stable down
    to a time constant of two steps.
    """
    fast = wp.vec2(2.0 * dt, 1.0)
    raw = {"solreflimit": fast, "solreflimit_mode": RAW, "solimplimit": (0.99, 0.999, 0.0005, 0.5, 2.0)}
    raw |= {"solreffriction": fast, "solimpfriction": (0.99, 0.999, 0.0005, 0.5, 2.0)}
    for name, value in raw.items():
        _set(builder, name, dof, value)


def harden(builder: newton.ModelBuilder, body: int, dt: float) -> None:
    """Give a body that lies free a stiffness of SURFACE at each point of contact, as near as the time step allows.

    MuJoCo's contacts are springs in proportion to the mass that they move: by default pads that press an eraser of 20 g with
    20 N sink in by 5 mm each, and squeeze it out. A constraint of impedance d and time constant t that moves a mass m has a
    stiffness of m d / ((1 - d) t^2), up to a factor of d^2 (MuJoCo's documentation, "Modeling", solver parameters).
    """
    time = 2.0 * dt
    ratio = SURFACE * time**2 / builder.body_mass[body]
    impedance = min(max(ratio / (1.0 + ratio), SOFTEST), HARDEST)
    raw = {"solref": wp.vec2(time, 1.0), "solref_mode": RAW, "geom_solimp": (SOFTEST, impedance, SKIN, 0.5, 2.0)}
    for shape in builder.body_shapes[body]:
        for name, value in (raw | {"geom_priority": 1}).items():
            _set(builder, name, shape, value)


def _set(builder: newton.ModelBuilder, name: str, index: int, value: object) -> None:
    """Set one of MuJoCo's attributes of a shape or a dof."""
    attribute = builder.custom_attributes[f"mujoco:{name}"]
    attribute.values = {**(attribute.values or {}), index: value}
