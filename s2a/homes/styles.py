"""Styles of one household's furniture: a palette drawn for a home, and a style drawn from it for each piece."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.homes import grips
from s2a.homes.draw import chance, pick, uniform, weighted
from s2a.homes.grips import GripDesign
from s2a.homes.solids import PLAIN, WOOD, Color


@dataclass(frozen=True)
class Opening:
    """What closes a cell; what is None follows the style.

    Attributes:
        kind: "drawer", "left", "right", "pair" (two doors), "up", "down" (flaps), "rise" (shutter that slides up behind a
            fixed upper half), "open" (nothing) or "fixed" (a panel).
        name: of the part.
        panel: its profile, see `panels.front`.
        grip: the handle.
        thick: of the front [m].
        limit: how far it opens [m] or [rad].
        color: of the front.
    """

    kind: str
    name: str | None = None
    panel: str | None = None
    grip: GripDesign | None = None
    thick: float | None = None
    limit: float | None = None
    color: Color | None = None


@dataclass(frozen=True)
class Style:
    """Materials and fittings that all fronts of a cabinet share.

    Attributes:
        body: colour of the cabinet body and shelves.
        front: colour of the fronts.
        top: colour of the top board.
        dark: colour of plinth and legs.
        texture: of all of these.
        panel: profile of doors, see `panels.front`.
        drawer_panel: of drawers.
        grip: handles of drawers and flaps.
        door_grip: handles of doors.
        thick: of the fronts [m].
        board: thickness of the cabinet body [m].
        gap: between fronts [m].
        frame: width of framed fronts' frames [m].
        place: of drawers' handles, from 0 (the middle) to 1 (near the upper edge).
        inset: of doors' handles from the free edge [m].
        angle: by which doors open [rad].
        extension: part of a drawer's length by which it comes out.
        soft_close: Dampers pull the fronts shut.
        theme: of what is in it, see `clutter.THEMES`.
        top_theme: of what is on it.
        drawer_theme: of what is in its drawers.
    """

    body: Color
    front: Color
    top: Color
    dark: Color
    texture: int
    panel: str
    drawer_panel: str
    grip: GripDesign
    door_grip: GripDesign
    thick: float
    board: float
    gap: float
    frame: float
    place: float
    inset: float
    angle: float
    extension: float
    soft_close: bool
    theme: str
    top_theme: str
    drawer_theme: str

    @property
    def paint(self) -> tuple[Color, int]:
        """Colour and texture of the cabinet body."""
        return self.body, self.texture


WOODS: tuple[Color, ...] = (
    (168, 128, 84),
    (196, 162, 118),
    (120, 88, 62),
    (214, 190, 152),
    (146, 104, 66),
    (92, 70, 54),
    (176, 150, 124),
)
PAINTS: tuple[Color, ...] = (
    (232, 230, 224),
    (206, 208, 206),
    (120, 134, 128),
    (84, 96, 112),
    (72, 74, 78),
    (170, 180, 170),
    (198, 176, 150),
    (150, 84, 70),
)
PANELS = {"slab": 0.52, "framed": 0.3, "grooved": 0.08, "louvred": 0.04, "glazed": 0.06}


@dataclass(frozen=True)
class Palette:
    """What the furniture of one home has in common.

    Attributes:
        wood: of floors, tables and wooden fronts.
        paint: of painted fronts.
        metal: of handles.
        cloth: of seats and beds.
    """

    wood: Color
    paint: Color
    metal: Color
    cloth: Color


def palette(rng: np.random.Generator) -> Palette:
    """Return the colours of a home."""
    red, green, blue = rng.integers(60, 200, 3).tolist()
    return Palette(
        _near(rng, pick(rng, WOODS)), _near(rng, pick(rng, PAINTS)), pick(rng, grips.METALS), (red, green, blue)
    )


def style(
    rng: np.random.Generator,
    colors: Palette,
    theme: str,
    top: str = "nothing",
    drawers: str = "paper",
    panels: tuple[str, ...] = (),
) -> Style:
    """Return the style of one piece of furniture.

    Args:
        rng: all that is not given.
        colors: of the home.
        theme: of what is in it, see `clutter.THEMES`.
        top: of what is on it.
        drawers: of what is in its drawers.
        panels: of its doors, see `panels.front`; empty: any.
    """
    wooden = chance(rng, 0.5)
    front = colors.wood if wooden else colors.paint
    body = front if chance(rng, 0.6) else pick(rng, ((230, 228, 222), colors.wood))
    panel = weighted(rng, {name: PANELS.get(name, 0.1) for name in (panels or PANELS)})
    metal = colors.metal if chance(rng, 0.7) else None
    grip = grips.design(rng, color=metal)
    door_grip = grip if grip.family not in ("cup",) and chance(rng, 0.7) else grips.design(rng, *DOORS, color=metal)
    return Style(
        body=body,
        front=_near(rng, front),
        top=colors.wood if chance(rng, 0.4) else body,
        dark=pick(rng, ((52, 52, 56), body, colors.wood)),
        texture=WOOD if wooden else PLAIN,
        panel=panel,
        drawer_panel=panel if panel in ("slab", "framed", "grooved") else "slab",
        grip=grip,
        door_grip=door_grip,
        thick=uniform(rng, (0.016, 0.022)),
        board=uniform(rng, (0.015, 0.02)),
        gap=uniform(rng, (0.0032, 0.005)),
        frame=uniform(rng, (0.05, 0.085)),
        place=pick(rng, (0.0, 0.0, 0.5, 0.9, uniform(rng, (0, 1)))),
        inset=uniform(rng, (0.03, 0.06)),
        angle=float(np.radians(uniform(rng, (80, 110) if chance(rng, 0.5) else (86, 92)))),
        extension=uniform(rng, (0.85, 1.0) if chance(rng, 0.6) else (0.62, 0.78)),
        soft_close=chance(rng, 0.5),
        theme=theme,
        top_theme=top,
        drawer_theme=drawers,
    )


DOORS = ("bar", "rail", "square", "bow", "knob", "edge", "recess", "strap", "none")
"""Families of handles that doors have."""


def _near(rng: np.random.Generator, color: Color) -> Color:
    """Return a colour like another one."""
    red, green, blue = np.clip(np.array(color) + rng.integers(-12, 13, 3), 0, 255).tolist()
    return (red, green, blue)
