"""Fronts of furniture: the kind of each opening, and the materials that a cabinet's fronts share."""

from __future__ import annotations

from dataclasses import dataclass

from s2a.homes.grips import GripDesign
from s2a.homes.solids import Color


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
