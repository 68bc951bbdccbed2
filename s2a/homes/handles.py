"""Handles: bars, knobs, levers, cups, edge pulls. Local frames: on a front at x = 0, z up, metres."""

from __future__ import annotations

import numpy as np

from s2a.homes.solids import Color, Piece, Surface, at, box, cylinder, join, painted, prism, rotation, stadium

STEEL: Color = (158, 160, 164)
QUARTER = float(np.pi / 2)


def bar(length: float, width: float, depth: float, gap: float, post: float, color: Color = STEEL) -> Piece:
    """Return a bar with round ends on two posts, long along y, on a front at x = 0.

    Args:
        length: of the bar along y [m].
        width: of the bar along z [m].
        depth: of the bar along x [m].
        gap: between the front and the back of the bar [m].
        post: width of each post along y [m]; posts are flush with the bar's ends.
        color: of everything.
    """
    rod = prism(stadium(length, width), (gap, gap + depth), color)
    half = length / 2
    posts = [box((0, gap + depth / 2), (y, y + post), (-width / 2, width / 2), color) for y in (-half, half - post)]
    return Piece("handle", join(rod, *posts), style="bar")


def knob(radius: float, depth: float, color: Color = STEEL) -> Piece:
    """Return a round knob on a front at x = 0."""
    shape = join(
        cylinder(radius * 0.45, depth * 0.6, color), cylinder(radius, depth * 0.5, color).moved(at(0, 0, depth / 2))
    )
    return Piece("knob", shape.moved(rotation((0, QUARTER, 0))), style="knob")


def lever(length: float, side: int, color: Color = STEEL) -> Piece:
    """Return a handle base with a lever that points along y to a side (+1 or -1), on a front at x = 0."""
    plate = box((0, 0.008), (-0.021, 0.021), (-0.13, 0.06), color)
    neck = cylinder(0.009, 0.05, color).moved(rotation((0, QUARTER, 0)))
    rod = prism(stadium(length, 0.022), (0.042, 0.058), color).moved(at(0, side * (length / 2 - 0.011)))
    return Piece("handle base", plate, (Piece("handle", join(neck, rod), style="lever"),))


def upright(handle: Piece) -> Piece:
    """Return a handle turned from horizontal to vertical."""
    return handle.moved(rotation((QUARTER, 0, 0)))


def cup(width: float, height: float, depth: float, color: Color = STEEL) -> Piece:
    """Return a cup pull: half a bowl, open below, its upper rim at z = 0 on the front; fingers reach in from below.

    Args:
        width: along y [m].
        height: along z [m].
        depth: along x [m].
        color: of everything.
    """
    outside = _bowl((depth, width / 2, height), color)
    inside = _bowl((depth - 0.002, width / 2 - 0.002, height - 0.002), color)
    shell = Surface(inside.vertices, inside.faces[:, ::-1].copy(), inside.colors, inside.textures, inside.dropout)
    return Piece("handle", join(outside, shell).moved(at(0, 0, -height)), style="cup")


def _bowl(radii: tuple[float, float, float], color: Color) -> Surface:
    """Return the quarter of an ellipsoid with x >= 0 and z >= 0, open below and at the back [m]."""
    across, up = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, QUARTER, 7), indexing="ij")
    points = np.stack([np.sin(across) * np.cos(up), np.cos(across), np.sin(across) * np.sin(up)], axis=-1)
    index = np.arange(17 * 7).reshape(17, 7)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return painted(points.reshape(-1, 3) * radii, faces, color)


def edge(length: float, depth: float = 0.02, lip: float = 0.014, color: Color = STEEL) -> Piece:
    """Return an edge pull: a thin profile, long along y, that stands out from a front's upper edge and bends down.

    Args:
        length: along y [m].
        depth: how far it stands out along x [m].
        lip: how far its front bends down [m].
        color: of everything.
    """
    half = length / 2
    top = box((-0.012, depth), (-half, half), (0, 0.002), color)
    return Piece("handle", join(top, box((depth - 0.002, depth), (-half, half), (-lip, 0), color)), style="edge")
