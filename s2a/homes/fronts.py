"""Fronts of furniture and their styles: slab, framed, glazed, grooved, louvred, mirrored; hinged panels, lids, boxes.

Local frames: face at x = 0, centred in y and z, z up, metres. Sizes as cabinet makers use them: boards 16 to 22 mm thick, frames
55 to 90 mm wide around panels that lie 5 to 10 mm deeper.
"""

from dataclasses import dataclass

import numpy as np

from s2a.homes import grips, solids
from s2a.homes import solids as p
from s2a.homes.grips import QUARTER, GripDesign
from s2a.scene.scene import Joint


@dataclass(frozen=True)
class Opening:
    """What closes a cell; what is None follows the style."""

    # "drawer", "left", "right", "pair" (two doors), "up", "down" (flaps), "rise" (shutter that slides up behind a
    # fixed upper half), "open" (nothing) or "fixed" (a panel)
    kind: str
    name: str | None = None  # of the part
    panel: str | None = None  # its profile, see `front`
    grip: GripDesign | None = None  # the handle
    thick: float | None = None  # of the front [m]
    limit: float | None = None  # how far it opens [m] or [rad]
    color: p.Color | None = None  # of the front


DRAWER, OPEN = Opening("drawer"), Opening("open")


@dataclass(frozen=True)
class Style:
    """Materials and fittings that all fronts of a cabinet share."""

    body: p.Color  # colour of the cabinet body and shelves
    front: p.Color  # colour of the fronts
    top: p.Color  # colour of the top board
    dark: p.Color  # colour of plinth and legs
    texture: int  # of all of these
    panel: str  # profile of doors, see `front`
    drawer_panel: str  # of drawers
    grip: GripDesign  # handles of drawers and flaps
    door_grip: GripDesign  # handles of doors
    thick: float  # of the fronts [m]
    board: float  # thickness of the cabinet body [m]
    gap: float  # between fronts [m]
    frame: float  # width of framed fronts' frames [m]
    place: float  # of drawers' handles, from 0 (the middle) to 1 (near the upper edge)
    inset: float  # of doors' handles from the free edge [m]
    angle: float  # by which doors open [rad]
    extension: float  # part of a drawer's length by which it comes out
    soft_close: bool  # Dampers pull the fronts shut
    theme: str  # of what is in it, see `clutter.THEMES`
    top_theme: str  # of what is on it
    drawer_theme: str  # of what is in its drawers

    @property
    def paint(self) -> tuple[p.Color, int]:
        """Colour and texture of the cabinet body."""
        return self.body, self.texture


WOODS: tuple[p.Color, ...] = (
    (168, 128, 84),
    (196, 162, 118),
    (120, 88, 62),
    (214, 190, 152),
    (146, 104, 66),
    (92, 70, 54),
    (176, 150, 124),
)
PAINTS: tuple[p.Color, ...] = (
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
    """What the furniture of one home has in common."""

    wood: p.Color  # of floors, tables and wooden fronts
    paint: p.Color  # of painted fronts
    metal: p.Color  # of handles
    cloth: p.Color  # of seats and beds


def random_palette(rng: np.random.Generator) -> Palette:
    """Return the colours of a home."""
    cloth = solids.random_color(rng, 60, 200)
    return Palette(_near(rng, p.pick(rng, WOODS)), _near(rng, p.pick(rng, PAINTS)), p.pick(rng, grips.METALS), cloth)


def random_style(
    rng: np.random.Generator,
    colors: Palette,
    theme: str,
    top: str = "nothing",
    drawers: str = "paper",
    panels: tuple[str, ...] = (),
) -> Style:
    """Return the style of one piece of furniture. `panels`: of its doors, see `front`; empty: any."""
    wooden = p.chance(rng, 0.5)
    front = colors.wood if wooden else colors.paint
    body = front if p.chance(rng, 0.6) else p.pick(rng, ((230, 228, 222), colors.wood))
    panel = p.weighted(rng, {name: PANELS.get(name, 0.1) for name in (panels or PANELS)})
    metal = colors.metal if p.chance(rng, 0.7) else None
    grip = grips.design(rng, color=metal)
    door_grip = grip if grip.family not in ("cup",) and p.chance(rng, 0.7) else grips.design(rng, *DOORS, color=metal)
    return Style(
        body=body,
        front=_near(rng, front),
        top=colors.wood if p.chance(rng, 0.4) else body,
        dark=p.pick(rng, ((52, 52, 56), body, colors.wood)),
        texture=p.WOOD if wooden else p.PLAIN,
        panel=panel,
        drawer_panel=panel if panel in ("slab", "framed", "grooved") else "slab",
        grip=grip,
        door_grip=door_grip,
        thick=rng.uniform(0.016, 0.022),
        board=rng.uniform(0.015, 0.02),
        gap=rng.uniform(0.0032, 0.005),
        frame=rng.uniform(0.05, 0.085),
        place=p.pick(rng, (0.0, 0.0, 0.5, 0.9, rng.uniform(0, 1))),
        inset=rng.uniform(0.03, 0.06),
        angle=float(np.radians(rng.uniform(*((80, 110) if p.chance(rng, 0.5) else (86, 92))))),
        extension=rng.uniform(*((0.85, 1.0) if p.chance(rng, 0.6) else (0.62, 0.78))),
        soft_close=p.chance(rng, 0.5),
        theme=theme,
        top_theme=top,
        drawer_theme=drawers,
    )


# Families of handles that doors have
DOORS = ("bar", "rail", "square", "bow", "knob", "edge", "recess", "strap", "none")


def _near(rng: np.random.Generator, color: p.Color) -> p.Color:
    red, green, blue = np.clip(np.array(color) + rng.integers(-12, 13, 3), 0, 255).tolist()
    return (red, green, blue)


Side = tuple[int, int]
# Where a front has its hinge: signs along y and z; left and right as seen by who stands before it
LEFT, RIGHT, TOP, BOTTOM = (-1, 0), (1, 0), (0, 1), (0, -1)

GAP = 0.004  # Between two fronts, and between a front and a worktop [m]; fitters leave 3 to 4 mm


def panel(size: tuple[float, float, float], color: p.Color, texture: int = p.PLAIN, dropout: float = 0.0) -> p.Surface:
    """Return a board of given thickness, width and height [m], its front at x = 0, centred in y and z."""
    thick, width, height = size
    return p.box((-thick, 0), (-width / 2, width / 2), (-height / 2, height / 2), color, texture, dropout)


def hinged(name: str, shape: p.Surface, side: Side, *parts: p.Piece, angle: float = QUARTER) -> p.Piece:
    """Return a front that turns about its own front edge, towards +x for positive angles.

    An overlay hinge comes to the same: on its whole way no point of the front leaves its outline sideways.

    Args:
        name: what it is called.
        shape: its surface, its face at x = 0, centred in y and z.
        side: where the hinge is: LEFT, RIGHT, TOP or BOTTOM.
        parts: what belongs to it, already in place: its handle.
        angle: how far it opens [rad].
    """
    outward = np.array((0.0, *side))
    origin = outward * np.abs(shape.vertices).max(axis=0)
    axis = np.cross((1.0, 0.0, 0.0), outward)
    return p.Piece(name, shape, parts, Joint("revolute", tuple(axis), tuple(origin), (0.0, angle)))


def lid(name: str, shape: p.Surface, *parts: p.Piece, angle: float = QUARTER) -> p.Piece:
    """Return a lid that turns up about its edge at -x; its upper face is at z = 0, centred in x and y.

    Its parts are in the frame of an upright front whose upper edge has the hinge.
    """
    stand_up = p.rotation((0.0, QUARTER, 0.0))
    return hinged(name, shape.moved(stand_up), TOP, *parts, angle=angle).moved(np.linalg.inv(stand_up))


def open_box(size: tuple[float, float, float], wall: float, color: p.Color, texture: int = p.PLAIN) -> p.Surface:
    """Return a box that is open above: its floor at z = 0, centred in x and y, with walls of given thickness [m]."""
    x, y, z = size[0] / 2, size[1] / 2, size[2]
    walls = [
        p.box((-x, x), (-y, y), (0, wall), color, texture),
        p.box((-x, -x + wall), (-y, y), (wall, z), color, texture),
        p.box((x - wall, x), (-y, y), (wall, z), color, texture),
        p.box((-x + wall, x - wall), (-y, -y + wall), (wall, z), color, texture),
        p.box((-x + wall, x - wall), (y - wall, y), (wall, z), color, texture),
    ]
    return p.join(*walls)


def cabinet_body(
    size: tuple[float, float, float], wall: float, color: p.Color, texture: int = p.PLAIN
) -> list[p.Surface]:
    """Return five panels of a box that is open towards +x: its front edge is at x = 0, its floor at z = 0."""
    deep, half, high = size[0], size[1] / 2, size[2]
    return [
        p.box((-deep, -deep + wall), (-half, half), (0, high), color, texture),
        p.box((-deep, 0), (-half, -half + wall), (0, high), color, texture),
        p.box((-deep, 0), (half - wall, half), (0, high), color, texture),
        p.box((-deep, 0), (-half, half), (0, wall), color, texture),
        p.box((-deep, 0), (-half, half), (high - wall, high), color, texture),
    ]


GLASS: p.Color = (96, 112, 118)
DARK_GLASS: p.Color = (30, 32, 36)
MIRROR: p.Color = (150, 164, 172)
Size = tuple[float, float, float]
Pocket = tuple[float, float, float, float]  # A hole of a front: y from, y to, z from, z to [m]


def front(kind: str, size: Size, color: p.Color, texture: int, frame: float) -> p.Surface:
    """Return a front panel.

    Args:
        kind: "slab", "framed", "glazed", "window" (dark glass), "grooved", "louvred" or "mirror".
        size: thickness, width and height [m].
        color: of its wood or paint.
        texture: of the same.
        frame: width of the frame [m], where it has one; small panels have none.
    """
    if kind not in ("slab", "grooved", "mirror") and min(size[1:]) < 3.2 * frame:
        kind = "slab"
    if kind == "framed":
        return p.join(ring(size, frame, color, texture), inset(size, frame, color, texture, 0.4, 0.65, 0.0))
    if kind == "glazed":
        return p.join(ring(size, frame, color, texture), inset(size, frame, GLASS, 0, 0.35, 0.6, 0.75))
    if kind == "window":
        return p.join(ring(size, frame, color, texture), inset(size, frame, DARK_GLASS, 0, 0.0, 0.85, 0.3))
    if kind == "louvred":
        return p.join(ring(size, frame, color, texture), *_slats(size, frame, color, texture))
    if kind == "grooved":
        return _grooved(size, color, texture)
    if kind == "mirror":
        back = panel((size[0] - 0.004, *size[1:]), color, texture).moved(p.at(-0.004, 0))
        return p.join(back, p.box((-0.004, 0), *_inner(size, 0.012), MIRROR, dropout=0.5))
    return panel(size, color, texture)


def ring(size: Size, frame: float, color: p.Color, texture: int) -> p.Surface:
    """Return the frame of a front as four boards."""
    thick, y, z = size[0], size[1] / 2, size[2] / 2
    hole = (-y + frame, y - frame, -z + frame, z - frame)
    return p.join(*p.boards_around(hole, (-thick, 0), (-y, y), (-z, z), color, texture))


def inset(size: Size, frame: float, color: p.Color, texture: int, low: float, high: float, dropout: float) -> p.Surface:
    """Return what fills a frame, from one fraction of its thickness to another, measured from the back."""
    back = -size[0]
    return p.box((back + low * size[0], back + high * size[0]), *_inner(size, frame), color, texture, dropout)


def _inner(size: Size, frame: float) -> tuple[tuple[float, float], tuple[float, float]]:
    y, z = size[1] / 2 - frame, size[2] / 2 - frame
    return (-y, y), (-z, z)


def _slats(size: Size, frame: float, color: p.Color, texture: int) -> list[p.Surface]:
    high, wide = size[2] - 2 * frame, size[1] / 2 - frame
    count = max(2, int(high / 0.04))
    step, deep = high / count, 0.8 * size[0]
    tilt = p.rotation((0.0, 0.6, 0.0))
    slat = p.box((-deep / 2, deep / 2), (-wide, wide), (-0.003, 0.003), color, texture).moved(tilt)
    return [slat.moved(p.at(-size[0] / 2, 0, -high / 2 + (i + 0.5) * step)) for i in range(count)]


def _grooved(size: Size, color: p.Color, texture: int) -> p.Surface:
    """Return a board with upright grooves 3 mm deep."""
    thick, width, height = size
    count = max(2, round(width / 0.08))
    step = width / count
    strips = [
        p.box((-0.003, 0), (y + 0.002, y + step - 0.002), (-height / 2, height / 2), color, texture)
        for y in -width / 2 + step * np.arange(count)
    ]
    return p.join(panel((thick - 0.003, width, height), color, texture).moved(p.at(-0.003, 0)), *strips)


def pocketed(size: Size, hole: Pocket, depth: float, color: p.Color, texture: int) -> p.Surface:
    """Return a slab with a pocket of given depth [m] in its face for a recessed pull."""
    thick, y, z = size[0], size[1] / 2, size[2] / 2
    back = p.box((-thick, -depth), (-y, y), (-z, z), color, texture)
    return p.join(back, *p.boards_around(hole, (-depth, 0.0), (-y, y), (-z, z), color, texture))
