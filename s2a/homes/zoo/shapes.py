"""Shapes of household objects beyond boxes and lathes, the zoo's colours (sRGB), and its objects: a shape with a label.

Objects are built upright in millimetres and handed out in metres.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike
from PIL import ImageFont
from scipy.interpolate import PchipInterpolator

from s2a.homes import solids as p

LETTERS = 12  # Size of the font that letters are drawn in, each of whose dots becomes part of a box


def put(
    surface: p.Surface,
    x: float = 0.0,
    y: float = 0.0,
    z: float = 0.0,
    roll: float = 0.0,
    pitch: float = 0.0,
    yaw: float = 0.0,
) -> p.Surface:
    """Return a surface turned about x, then y, then z [deg], and then moved."""
    turn = np.eye(4)
    for axis, angle in enumerate((roll, pitch, yaw)):
        turn = p.rotation(tuple(np.radians(angle) * np.eye(3)[axis])) @ turn
    return surface.moved(p.translation((x, y, z)) @ turn)


def scaled(surface: p.Surface, x: float, y: float, z: float) -> p.Surface:
    """Return a surface stretched along the axes by positive factors."""
    return replace(surface, vertices=surface.vertices * (x, y, z))


def settled(surface: p.Surface, sink: float = 0.0) -> p.Surface:
    """Return a surface that stands on z = 0 on a flat: what is lower than `sink` above its lowest point is pressed up."""
    low = surface.vertices[:, 2].min() + sink
    vertices = surface.vertices.copy()
    vertices[:, 2] = np.maximum(vertices[:, 2] - low, 0.0)
    return replace(surface, vertices=vertices)


def smooth(points: ArrayLike, count: int) -> np.ndarray:
    """Return points on a curve through some, shape [point dimension] -> [count dimension], that never overshoots them."""
    through = np.asarray(points, np.float64)
    way = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(through, axis=0), axis=1))])
    return np.asarray(PchipInterpolator(way, through)(np.linspace(0.0, way[-1], count)))


def turned(profile: list[tuple[float, float]], color: p.Color, texture: int = p.PLAIN, sides: int = 28) -> p.Surface:
    """Return the solid that a smooth curve through some (radius, z) sweeps about z, closed with flat ends."""
    curve = [(float(r), float(z)) for r, z in smooth(profile, 6 * len(profile))]
    return p.lathe([(0.0, curve[0][1]), *curve, (0.0, curve[-1][1])], color, texture, sides)


def arc(radius: float, start: float, stop: float, count: int = 13) -> np.ndarray:
    """Return points of a circle about the origin from one angle to another [deg], shape [count 2]."""
    angle = np.radians(np.linspace(start, stop, count))
    return radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def in_plane(points: ArrayLike, axis: int, level: float = 0.0) -> np.ndarray:
    """Return plane points [point 2] in space, shape [point 3]: normal to axis 0 they are (y, z), to 1 (x, z), to 2 (x, y)."""
    return np.insert(np.asarray(points, np.float64), axis, level, axis=1)


def tube(
    path: ArrayLike, radius: ArrayLike, color: p.Color, sides: int = 10, closed: bool = False, flat: float = 1.0
) -> p.Surface:
    """Return a round rod along a path, its ends closed.

    Args:
        path: points, shape [point 3].
        radius: one, or one a point, shape [point].
        color: its paint.
        sides: of its cross-section.
        closed: The path ends where it starts (without repeating that point).
        flat: thickness across the plane in which the path lies, as a share of that within it.
    """
    line = np.asarray(path, np.float64)
    ahead, behind = np.roll(line, -1, axis=0), np.roll(line, 1, axis=0)
    if not closed:
        ahead[-1], behind[0] = line[-1], line[0]
    tangent = (ahead - behind) / np.linalg.norm(ahead - behind, axis=1)[:, None]
    # The normal of the plane that the path comes closest to lying in, carried along.
    normal = np.linalg.svd(line - line.mean(axis=0))[2][-1]
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = []
    for place, direction, r in zip(line, tangent, np.broadcast_to(radius, len(line)), strict=True):
        normal = normal - direction * (normal @ direction)
        normal /= np.linalg.norm(normal)
        beside = np.cross(direction, normal)
        rings.append(place + r * (np.outer(np.cos(angle), beside) + flat * np.outer(np.sin(angle), normal)))
    return skin(np.array(rings), closed, color)


def skin(rings: np.ndarray, closed: bool, color: p.Color) -> p.Surface:
    """Return the surface over rings of points, shape [ring side 3]."""
    count, sides = rings.shape[:2]
    here = np.arange(count * sides).reshape(count, sides)
    following = np.roll(here, -1, axis=0)
    a, b = (here, following) if closed else (here[:-1], following[:-1])
    a, b, c, d = (x.ravel() for x in (a, np.roll(a, -1, axis=1), np.roll(b, -1, axis=1), b))
    faces = [np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]
    vertices = rings.reshape(-1, 3)
    if not closed:
        ends = count * sides + np.zeros(sides, int)
        faces += [np.stack([np.roll(here[0], -1), here[0], ends], axis=1)]
        faces += [np.stack([here[-1], np.roll(here[-1], -1), ends + 1], axis=1)]
        vertices = np.concatenate([vertices, [rings[0].mean(axis=0), rings[-1].mean(axis=0)]])
    return outwards(p.painted(vertices, np.concatenate(faces), color))


def loft(sections: Sequence[tuple[float, ...]], color: p.Color, sides: int = 24, power: float = 2.0) -> p.Surface:
    """Return the solid through upright sections of (z, half width x, half width y, centre x = 0, centre y = 0).

    Sections are ellipses at power 2 and boxes with round corners above.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    around = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    around = np.sign(around) * np.abs(np.where(np.abs(around) < 1e-9, 0.0, around)) ** (2 / power)
    rings = [in_plane(around * s[1:3] + (*s[3:], 0.0, 0.0)[:2], 2, s[0]) for s in sections]
    return skin(np.array(rings), False, color)


def outwards(surface: p.Surface) -> p.Surface:
    """Return a closed surface with its faces outwards."""
    a, b, c = np.moveaxis(surface.vertices[surface.faces], 1, 0)
    inverted = np.einsum("ij,ij->i", a, np.cross(b, c)).sum() < 0
    return replace(surface, faces=surface.faces[:, ::-1]) if inverted else surface


def ring(radius: float, thickness: float, color: p.Color, flat: float = 1.0, sides: int = 10) -> p.Surface:
    """Return a torus that lies about the origin, its middle line a circle of this radius."""
    circle = in_plane(arc(radius, 0, 360, 33)[:-1], 2)
    return tube(circle, thickness / 2, color, sides, closed=True, flat=flat)


def plate(outline: ArrayLike, span: tuple[float, float], color: p.Color, axis: int = 2) -> p.Surface:
    """Return an outline [corner 2], seen whole from its mean, extruded along an axis normal to it (see `in_plane`)."""
    corners = np.asarray(outline, np.float64)
    n = len(corners)
    corners = np.concatenate([corners, corners.mean(axis=0)[None]])
    vertices = np.concatenate([in_plane(corners, axis, level) for level in span])
    i = np.arange(n)
    j, top = (i + 1) % n, n + 1
    centre = np.full(n, n)
    faces = [(i, j, j + top), (i, j + top, i + top), (j, i, centre), (i + top, j + top, centre + top)]
    return outwards(p.painted(vertices, np.concatenate([np.stack(f, axis=1) for f in faces]), color))


def ball(
    size: Size, color: p.Color, *place: float, texture: int = p.PLAIN, sides: int = 12, **turn: float
) -> p.Surface:
    """Return an ellipsoid of given full extents, turned and moved by the arguments of `put`."""
    return put(p.ellipsoid(size, color, texture, sides), *place, **turn)


def rod(radius: float, height: float, color: p.Color, *place: float, sides: int = 24, **turn: float) -> p.Surface:
    """Return a cylinder that stands on the origin, turned and moved by the arguments of `put`."""
    return put(p.cylinder(radius, height, color, sides=sides), *place, **turn)


def pebble(
    size: Size,
    color: p.Color,
    power: float = 3.0,
    *place: float,
    texture: int = p.PLAIN,
    sides: int = 32,
    **turn: float,
) -> p.Surface:
    """Return a superellipsoid on z = 0, then `put`: power 2 is an ellipsoid, 6 a box with round edges."""
    up, around = np.linspace(-np.pi / 2, np.pi / 2, 15), 2 * np.pi * np.arange(sides) / sides

    def bulge(value: np.ndarray) -> np.ndarray:
        return np.sign(value) * np.abs(np.where(np.abs(value) < 1e-9, 0.0, value)) ** (2 / power)

    sphere = p.lathe([(1.0, float(height)) for height in up], color, texture, sides)
    level = np.repeat(up, sides)
    across = [np.tile(bulge(wave), 15) for wave in (np.cos(around), np.sin(around))]
    vertices = np.stack([*(bulge(np.cos(level)) * each for each in across), bulge(np.sin(level))], axis=1)
    a, b, c = np.moveaxis(vertices[sphere.faces], 1, 0)
    full = np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-9
    solid = p.painted(vertices, sphere.faces[full], color, texture)
    return put(put(scaled(solid, *(np.array(size) / 2)), z=size[2] / 2), *place, **turn)


def writing(text: str, width: float, color: p.Color, depth: float = 0.5) -> p.Surface:
    """Return raised letters that face +x and read along +y, in the middle of y, their feet on z = 0."""
    mask = ImageFont.load_default(LETTERS).getmask(text, mode="1")
    dots = np.array(mask).reshape(mask.size[::-1]) > 0
    rows, columns = np.flatnonzero(dots.any(axis=1)), np.flatnonzero(dots.any(axis=0))
    dots = dots[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    dot = width / dots.shape[1]
    strokes = []
    for row, line in enumerate(dots[::-1]):
        edges = np.flatnonzero(np.diff(np.concatenate([[0], line.astype(int), [0]])))
        for left, right in edges.reshape(-1, 2) - len(line) / 2:
            strokes.append(p.box((0, depth), (left * dot, right * dot), (row * dot, (row + 1) * dot), color))
    return p.join(*strokes)


def wrapped(surface: p.Surface, radius: float, squeeze: float = 1.0) -> p.Surface:
    """Return a surface at x = 0 that faces +x laid around an upright cylinder; its y is scaled by `squeeze`."""
    x, y, z = surface.vertices.T
    angle = y / (radius * max(squeeze, 1.0))
    vertices = np.stack([(radius + x) * np.cos(angle), squeeze * (radius + x) * np.sin(angle), z], axis=1)
    return replace(surface, vertices=vertices)


Size = tuple[float, float, float]
BLACK, DARK, GREY, STEEL = (32, 32, 36), (70, 70, 76), (130, 132, 136), (176, 180, 186)
SILVER, WHITE, RED, ROSE = (210, 212, 216), (246, 246, 243), (204, 40, 40), (212, 92, 130)
PINK, ORANGE, AMBER, YELLOW = (243, 164, 186), (240, 132, 30), (222, 158, 44), (252, 212, 56)
GREEN, LEAF, TEAL, SKY = (52, 160, 84), (60, 132, 56), (38, 150, 150), (160, 206, 236)
BLUE, NAVY, PURPLE, LIME = (40, 92, 190), (28, 46, 104), (122, 70, 160), (206, 230, 40)
SCREEN, TERRACOTTA, IVORY, STRAW = (176, 200, 168), (196, 104, 66), (232, 214, 170), (232, 200, 120)
BRONZE, CHOCOLATE, WINE, BOTTLE = (186, 118, 56), (74, 40, 24), (122, 24, 44), (40, 104, 60)
CREAM, TAN, BEECH, BROWN = (248, 236, 206), (214, 178, 128), (206, 160, 104), (134, 84, 44)
WALNUT, GOLD, COPPER = (84, 52, 32), (218, 172, 60), (190, 110, 70)

# The kinds of places that objects belong to, in the order in which the zoo has them
Category = Literal["bathroom", "kitchen", "bedroom", "stationery", "living room"]
Placement = Literal["on", "against wall", "hanging", "inside"]


@dataclass(frozen=True)
class ZooObject:
    """A labelled object."""

    label: str  # what it is called
    category: Category  # the kind of place it belongs to
    surface: p.Surface  # its shape [m], upright in its natural pose on z = 0, its front towards +x
    placement: Placement  # on something, standing or leaning against a wall, hanging on one, or kept inside something
    rare: bool  # The label is a brand's or a rare word

    @property
    def slug(self) -> str:
        """The label as a file name."""
        return "_".join("".join(c if c.isalnum() else " " for c in self.label.lower()).split())


Maker = Callable[[], p.Surface]
MAKERS: list[Callable[[], ZooObject]] = []  # What makes the objects of the modules that were imported


def zoo_object(
    label: str, category: Category, placement: Placement = "on", *, rare: bool = False
) -> Callable[[Maker], Maker]:
    """Return a decorator for what makes a shape in millimetres: the zoo has it as an object, set on z = 0."""

    def made(make: Maker) -> ZooObject:
        shape = scaled(make(), 1e-3, 1e-3, 1e-3)
        shape.vertices[:, 2] -= shape.vertices[:, 2].min()
        return ZooObject(label, category, shape, placement, rare)

    def add(make: Maker) -> Maker:
        MAKERS.append(partial(made, make))
        return make

    return add
