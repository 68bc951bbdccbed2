"""Handle families with continuous dimensions: a `GripDesign` is drawn once for a set of fronts and made for each front.

Ranges: bars have hole spacings of 64 to 256 mm (huzhanbrass.com) and are 30 to 50 mm longer (shopmeraki.co); knobs measure 25
to 38 mm across (engineerfix.com), cups 76 to 127 mm, edge profiles 76 to 152 mm along the front (jamiewenzaw.sainer.biz.id).
What is drawn goes beyond these at both ends. Common sizes: bars up to 0.6 m, 6 to 24 mm wide, with 18 to 36 mm behind them;
recessed pulls, straps, all other dimensions. Local frames: on a front at x = 0, z up, metres.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from s2a.homes import solids as p

STEEL: p.Color = (158, 160, 164)
QUARTER = float(np.pi / 2)


def bar(length: float, width: float, depth: float, gap: float, post: float, color: p.Color = STEEL) -> p.Piece:
    """Return a bar with round ends on two posts, long along y, on a front at x = 0.

    Args:
        length: of the bar along y [m].
        width: of the bar along z [m].
        depth: of the bar along x [m].
        gap: between the front and the back of the bar [m].
        post: width of each post along y [m]; posts are flush with the bar's ends.
        color: of everything.
    """
    rod = p.prism(p.stadium(length, width), (gap, gap + depth), color)
    half = length / 2
    posts = [p.box((0, gap + depth / 2), (y, y + post), (-width / 2, width / 2), color) for y in (-half, half - post)]
    return p.Piece("handle", p.join(rod, *posts), style="bar")


def knob(radius: float, depth: float, color: p.Color = STEEL) -> p.Piece:
    """Return a round knob on a front at x = 0."""
    head = p.cylinder(radius, depth * 0.5, color).moved(p.at(0, 0, depth / 2))
    shape = p.join(p.cylinder(radius * 0.45, depth * 0.6, color), head)
    return p.Piece("knob", shape.moved(p.rotation((0, QUARTER, 0))), style="knob")


def upright(handle: p.Piece) -> p.Piece:
    """Return a handle turned from horizontal to vertical."""
    return handle.moved(p.rotation((QUARTER, 0, 0)))


def cup(width: float, height: float, depth: float, color: p.Color = STEEL) -> p.Piece:
    """Return a cup pull: half a bowl, open below, its upper rim at z = 0 on the front; fingers reach in from below.

    Args:
        width: along y [m].
        height: along z [m].
        depth: along x [m].
        color: of everything.
    """
    outside = _bowl((depth, width / 2, height), color)
    inside = _bowl((depth - 0.002, width / 2 - 0.002, height - 0.002), color)
    shell = p.Surface(inside.vertices, inside.faces[:, ::-1].copy(), inside.colors, inside.textures, inside.dropout)
    return p.Piece("handle", p.join(outside, shell).moved(p.at(0, 0, -height)), style="cup")


def _bowl(radii: tuple[float, float, float], color: p.Color) -> p.Surface:
    """Return the quarter of an ellipsoid with x >= 0 and z >= 0, open below and at the back [m]."""
    across, up = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, QUARTER, 7), indexing="ij")
    points = np.stack([np.sin(across) * np.cos(up), np.cos(across), np.sin(across) * np.sin(up)], axis=-1)
    index = np.arange(17 * 7).reshape(17, 7)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return p.painted(points.reshape(-1, 3) * radii, faces, color)


def edge(length: float, depth: float = 0.02, lip: float = 0.014, color: p.Color = STEEL) -> p.Piece:
    """Return an edge pull: a thin profile, long along y, that stands out from a front's upper edge and bends down.

    Args:
        length: along y [m].
        depth: how far it stands out along x [m].
        lip: how far its front bends down [m].
        color: of everything.
    """
    half = length / 2
    top = p.box((-0.012, depth), (-half, half), (0, 0.002), color)
    return p.Piece("handle", p.join(top, p.box((depth - 0.002, depth), (-half, half), (-lip, 0), color)), style="edge")


# Steel, black, brass, bronze, chrome, white, leather or wood
METALS: tuple[p.Color, ...] = (
    (158, 160, 164),
    (44, 44, 48),
    (176, 142, 84),
    (122, 96, 74),
    (206, 206, 208),
    (232, 232, 230),
    (96, 70, 46),
)
# How often each family is drawn; "none" opens by a push
WEIGHTS = dict(
    bar=0.24, rail=0.13, square=0.10, bow=0.13, knob=0.16, cup=0.06, edge=0.07, recess=0.04, strap=0.03, none=0.025
)
# Style of the families that are bars of another section; every other family is its own style
STYLES = {"rail": "bar", "square": "bar"}


@dataclass(frozen=True)
class GripDesign:
    """One handle of a catalogue."""

    # "bar" (flat, round ends), "rail" (round, overhanging its posts), "square", "bow", "knob", "cup", "edge",
    # "recess", "strap" or "none"
    family: str
    length: float  # along the front [m]; of a knob its diameter
    width: float  # across its length, on the front [m]
    depth: float  # thickness of what the fingers close on, away from the front [m]
    clearance: float  # between the front and what the fingers close on [m]
    bend: float  # of a bow, exponent of its arc: 2 is an ellipse, more is a D; of a knob, taper of its neck
    sides: int  # of a knob's section: 4 is square, 24 round
    color: p.Color  # of everything

    @property
    def style(self) -> str | None:
        """The style of its Piece; None for a front without a handle."""
        return None if self.family == "none" else STYLES.get(self.family, self.family)

    @property
    def rim(self) -> float:
        """How far an edge profile stands out of its front's outline, which the front gives up [m]."""
        return 0.002 if self.family == "edge" else 0.0

    def fitted(self, max_length: float) -> GripDesign:
        """Return the design no longer than what a front has room for [m]."""
        return replace(self, length=min(self.length, max_length))


# Length, width, depth and clearance of each family [m]
SIZES: dict[str, tuple[p.Range, p.Range, p.Range, p.Range]] = {
    "bar": ((0.08, 0.6), (0.008, 0.024), (0.007, 0.014), (0.02, 0.036)),
    "rail": ((0.1, 0.6), (0.008, 0.016), (0.008, 0.016), (0.02, 0.036)),
    "square": ((0.07, 0.6), (0.006, 0.02), (0.006, 0.014), (0.02, 0.036)),
    "bow": ((0.072, 0.32), (0.008, 0.024), (0.006, 0.012), (0.018, 0.034)),
    "knob": ((0.02, 0.045), (0.02, 0.045), (0.008, 0.018), (0.01, 0.024)),
    "cup": ((0.064, 0.14), (0.026, 0.05), (0.018, 0.032), (0.012, 0.02)),
    "edge": ((0.08, 0.6), (0.006, 0.02), (0.014, 0.035), (0.01, 0.03)),
    "recess": ((0.08, 0.2), (0.03, 0.06), (0.009, 0.013), (0.0, 0.0)),
    "strap": ((0.09, 0.18), (0.014, 0.03), (0.0025, 0.004), (0.018, 0.03)),
    "none": ((0.1, 0.1), (0.01, 0.01), (0.01, 0.01), (0.0, 0.0)),
}


def design(rng: np.random.Generator, *families: str, color: p.Color | None = None) -> GripDesign:
    """Return a drawn design, of one of the given families or of any."""
    family = p.weighted(rng, {f: WEIGHTS[f] for f in (families or WEIGHTS)})
    lengths, widths, depths, gaps = SIZES[family]
    # Short handles are more common than long ones.
    length = lengths[0] + (lengths[1] - lengths[0]) * float(rng.beta(1.3, 2.2))
    depth = rng.uniform(*depths)
    width = depth if family == "rail" else rng.uniform(*widths)
    bend, sides = rng.uniform(*((0.35, 0.75) if family == "knob" else (2.0, 5.0))), 4 if p.chance(rng, 0.2) else 24
    return GripDesign(family, length, width, depth, rng.uniform(*gaps), bend, sides, color or p.pick(rng, METALS))


def make(grip: GripDesign) -> p.Piece:
    """Return the handle of a design, long along y, about the origin; of an edge profile or a cup its upper edge is there.

    Raises:
        ValueError: the design has no handle.
    """
    if grip.family == "none":
        raise ValueError("this front opens by a push: it has no handle")
    makers = {"bar": _bar, "rail": _rail, "square": _square, "bow": _bow, "knob": _knob, "cup": _cup}
    makers |= {"edge": _edge, "recess": _recess, "strap": _strap}
    piece = makers[grip.family](grip)
    names = ("length", "width", "depth", "clearance")
    facts = {"family": grip.family} | {name: round(getattr(grip, name), 5) for name in names}
    return replace(piece, style=grip.style, facts=facts)


def _bar(grip: GripDesign) -> p.Piece:
    post = min(0.012, grip.length / 5)
    return bar(grip.length, grip.width, grip.depth, grip.clearance, post, grip.color)


def _rail(grip: GripDesign) -> p.Piece:
    """Return a round rod on two round posts inside of its ends, in steps of 32 mm as drawers are bored."""
    radius, far = grip.depth / 2, grip.clearance + grip.depth / 2
    bores = max(np.floor((grip.length - 0.03) / 0.032) * 0.032, grip.length / 2)
    lying = p.at(far, grip.length / 2) @ p.rotation((QUARTER, 0, 0))
    rod = p.cylinder(radius, grip.length, grip.color, sides=16).moved(lying)
    turn = p.rotation((0, QUARTER, 0))
    posts = [p.cylinder(0.8 * radius, far, grip.color, sides=12).moved(p.at(0, s * bores / 2) @ turn) for s in (-1, 1)]
    return p.Piece("handle", p.join(rod, *posts))


def _square(grip: GripDesign) -> p.Piece:
    half, wide, front = grip.length / 2, grip.width / 2, grip.clearance + grip.depth
    post = min(grip.width, grip.length / 5)
    rod = p.box((grip.clearance, front), (-half, half), (-wide, wide), grip.color)
    posts = [p.box((0, grip.clearance), (y, y + post), (-wide, wide), grip.color) for y in (-half, half - post)]
    return p.Piece("handle", p.join(rod, *posts))


def _bow(grip: GripDesign) -> p.Piece:
    """Return an arc between two feet: a superellipse from y = -length / 2 to y = length / 2."""
    angle = np.linspace(0.0, np.pi, 25)
    power, high = 2.0 / grip.bend, grip.clearance + grip.depth / 2
    y = (grip.length - grip.depth) / 2 * np.sign(np.cos(angle)) * np.abs(np.cos(angle)) ** power
    x = high * np.sin(angle) ** power
    path = np.stack([x, y, np.zeros_like(x)], axis=1)
    return p.Piece("handle", tube(path, grip.depth / 2, grip.width / 2, grip.color))


def _strap(grip: GripDesign) -> p.Piece:
    """Return a leather loop: a flat band that stands out from two screws."""
    angle = np.linspace(0.0, np.pi, 21)
    y, x = grip.length / 2 * np.cos(angle), grip.clearance * np.sin(angle) ** 1.5 + grip.depth
    path = np.stack([x, y, np.zeros_like(x)], axis=1)
    screw, turn = p.cylinder(0.005, grip.depth + 0.004, grip.color, sides=12), p.rotation((0, QUARTER, 0))
    screws = [screw.moved(p.at(0, s * grip.length / 2) @ turn) for s in (-1, 1)]
    return p.Piece("handle", p.join(tube(path, grip.depth / 2, grip.width / 2, grip.color), *screws))


def _knob(grip: GripDesign) -> p.Piece:
    """Return a knob of round or square section with a tapered neck."""
    radius = grip.length / 2 * (1.0 if grip.sides > 4 else 1.15)
    neck, low, high = grip.bend * radius, grip.clearance, grip.clearance + grip.depth
    rounded = 0.25 * min(grip.depth, radius)
    profile = [(0, 0), (neck, 0), (0.9 * neck, low), (radius, low + rounded), (radius, high - rounded)]
    shape = p.lathe([*profile, (radius - rounded, high), (0, high)], grip.color, sides=grip.sides)
    # A square section lies level, not on its corner.
    level = p.at(0, 0, 0, 180.0 / grip.sides)
    return p.Piece("knob", shape.moved(p.rotation((0, QUARTER, 0)) @ level))


def _cup(grip: GripDesign) -> p.Piece:
    return cup(grip.length, grip.width, grip.depth, grip.color).moved(p.at(0, 0, grip.width / 2))


def _edge(grip: GripDesign) -> p.Piece:
    return edge(grip.length, grip.depth, grip.width, grip.color)


def _recess(grip: GripDesign) -> p.Piece:
    """Return the lining of a pocket in the front: a tray that is open towards +x; see `fronts.pocketed`."""
    y, z, deep, wall = grip.length / 2, grip.width / 2, grip.depth, 0.0015
    hole = (-y + wall, y - wall, -z + wall, z - wall)
    sides = p.boards_around(hole, (-deep, 0), (-y, y), (-z, z), grip.color)
    floor = p.box((-deep, -deep + wall), hole[:2], hole[2:], grip.color)
    return p.Piece("handle", p.join(*sides, floor))


def tube(path: np.ndarray, inner: float, across: float, color: p.Color) -> p.Surface:
    """Return a rod of elliptical section along a path in the x-y plane.

    Args:
        path: points [m], shape [point 3], z = 0.
        inner: half of its thickness in the plane of the path [m].
        across: half of its width along z [m].
        color: of everything.
    """
    tangent = np.gradient(path, axis=0)
    tangent /= np.linalg.norm(tangent, axis=1, keepdims=True)
    normal = np.cross(tangent, (0.0, 0.0, 1.0))
    angle = 2 * np.pi * np.arange(12) / 12
    rings = (
        path[:, None]
        + inner * np.cos(angle)[:, None] * normal[:, None]
        + across * np.sin(angle)[:, None] * (0.0, 0.0, 1.0)
    )
    count, around = len(path), len(angle)
    index = np.arange(count * around).reshape(count, around)
    a, b = index[:-1], np.roll(index[:-1], -1, axis=1)
    c, d = np.roll(index[1:], -1, axis=1), index[1:]
    sides = [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
    fan = np.stack([np.zeros(around - 2, int), np.arange(1, around - 1), np.arange(2, around)], axis=1)
    faces = np.concatenate([*sides, fan[:, ::-1], fan + (count - 1) * around])
    solid = p.painted(rings.reshape(-1, 3), faces, color)
    corners = solid.vertices[solid.faces]
    volume = np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    return solid if volume > 0 else replace(solid, faces=solid.faces[:, ::-1].copy())
