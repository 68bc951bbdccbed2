"""Coloured solids, and pieces of furniture made of them: the clean CAD that a virtual scanner looks at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from s2a.scene.scene import Joint, Mesh

Color = tuple[int, int, int]
Span = tuple[float, float]
Hole = tuple[float, float, float, float]
PLAIN, WOOD, FABRIC, TILES = range(4)  # How a colour varies over a surface (see `s2a.homes.capture`)


@dataclass(frozen=True)
class Surface:
    """Triangles with a look for each."""

    vertices: np.ndarray  # [m], shape [vertex 3], float64
    faces: np.ndarray  # vertex indices, counter-clockwise seen from outside, shape [face 3], int32
    colors: np.ndarray  # RGB, shape [face 3], uint8
    textures: np.ndarray  # PLAIN, WOOD, FABRIC or TILES, shape [face], uint8
    dropout: np.ndarray  # share of laser rays that are not returned, in patches, shape [face], float32

    def moved(self, transform: np.ndarray) -> Surface:
        """Return the surface after a rigid motion, shape [4 4]."""
        return replace(self, vertices=self.vertices @ transform[:3, :3].T + transform[:3, 3])

    @property
    def mesh(self) -> Mesh:
        """The triangles as a Mesh; no two solids share a vertex, so each vertex has its solid's colour."""
        colors = np.zeros((len(self.vertices), 3), np.uint8)
        colors[self.faces] = self.colors[:, None]
        return Mesh(self.vertices, self.faces, colors)


@dataclass(frozen=True)
class Piece:
    """A piece of furniture, or a part of one, with the parts that belong to it."""

    name: str  # what an annotator would call it
    surface: Surface  # its own surface, without its children's
    children: tuple[Piece, ...] = ()  # the parts that belong to it
    # how it moves against what it belongs to; the closed pose is 0; None if it does not move
    joint: Joint | None = None
    # "bar", "bow", "knob", "lever", "cup", "edge", "recess" or "strap" for what a gripper grasps, else None
    style: str | None = None
    # of the frame in which it was built, in which its sides are parallel to the axes, shape [4 4]
    pose: np.ndarray = field(default_factory=lambda: np.eye(4))
    # free objects that lie in or on it and move with it; they are objects of their own, no parts of it
    contents: tuple[Piece, ...] = ()
    # exact numbers and names for the truth: a handle's family, length and clearance; a hinge's damper
    facts: Mapping[str, Any] = field(default_factory=dict)

    @property
    def size(self) -> np.ndarray:
        """Extents of its own surface along the axes of the frame in which it was built [m], shape [3]."""
        return np.ptp(self.surface.vertices @ self.pose[:3, :3], axis=0)

    def moved(self, transform: np.ndarray) -> Piece:
        """Return the piece with all its parts and joints after a rigid motion, shape [4 4]."""
        return replace(
            self,
            surface=self.surface.moved(transform),
            children=tuple(child.moved(transform) for child in self.children),
            joint=None if self.joint is None else moved_joint(self.joint, transform),
            pose=transform @ self.pose,
            contents=tuple(thing.moved(transform) for thing in self.contents),
        )

    def tilted(self, rng: np.random.Generator, max_angle: float = 0.5) -> Piece:
        """Return a front that faces +x turned a little about its centre, its joint with it, as real fronts hang.

        The angle is uniform up to `max_angle` [deg]; little of it is roll, which would push neighbouring fronts together.
        """
        direction = rng.normal(size=3) * (0.2, 1.0, 1.0)
        vector = direction / np.linalg.norm(direction) * np.radians(max_angle) * rng.uniform()
        centre = self.surface.vertices.mean(axis=0)
        return self.moved(translation(centre) @ rotation(vector) @ translation(-centre))


def moved_joint(joint: Joint, transform: np.ndarray) -> Joint:
    """Return a joint after a rigid motion, shape [4 4]."""
    axis = transform[:3, :3] @ joint.axis
    origin = transform[:3, :3] @ joint.origin + transform[:3, 3]
    return Joint(joint.kind, tuple(axis / np.linalg.norm(axis)), tuple(origin), joint.limits)


def translation(offset: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """Return the motion by an offset [m], shape [4 4]."""
    transform = np.eye(4)
    transform[:3, 3] = offset
    return transform


def rotation(vector: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    """Return the rotation by a vector's length [rad] about its direction, shape [4 4]."""
    x, y, z = vector
    angle = float(np.linalg.norm(vector))
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) / max(angle, 1e-12)
    transform = np.eye(4)
    transform[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return transform


def at(x: float, y: float, z: float = 0.0, yaw: float = 0.0) -> np.ndarray:
    """Return the motion that turns by a yaw [deg] and then moves to a place [m], shape [4 4]."""
    return translation((x, y, z)) @ rotation((0.0, 0.0, np.radians(yaw)))


def join(*surfaces: Surface) -> Surface:
    """Return several surfaces as one."""
    offsets = np.cumsum([0] + [len(s.vertices) for s in surfaces])
    faces = [s.faces + offset for s, offset in zip(surfaces, offsets, strict=False)]
    fields = [np.concatenate([getattr(s, name) for s in surfaces]) for name in ("colors", "textures", "dropout")]
    return Surface(np.concatenate([s.vertices for s in surfaces]), np.concatenate(faces).astype(np.int32), *fields)


def painted(vertices: ArrayLike, faces: ArrayLike, color: Color, texture: int = PLAIN, dropout: float = 0.0) -> Surface:
    """Return triangles that all look the same."""
    corners = np.asarray(faces, np.int32)
    n = len(corners)
    return Surface(
        np.asarray(vertices, np.float64),
        corners,
        np.tile(np.array(color, np.uint8), (n, 1)),
        np.full(n, texture, np.uint8),
        np.full(n, dropout, np.float32),
    )


def box(
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
    color: Color,
    texture: int = PLAIN,
    dropout: float = 0.0,
) -> Surface:
    """Return a box between two coordinates along each axis [m]."""
    vertices = np.array([(a, b, c) for a in x for b in y for c in z])
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [f for a, b, c, d in quads for f in ((a, b, c), (a, c, d))]
    return painted(vertices, faces, color, texture, dropout)


def boards_around(hole: Hole, x: Span, y: Span, z: Span, color: Color, texture: int = PLAIN) -> list[Surface]:
    """Return four boards about a hole (y from, y to, z from, z to) in a slab [m]: below, above, at either side."""
    left, right, low, high = hole
    spans = ((y, (z[0], low)), (y, (high, z[1])), ((y[0], left), (low, high)), ((right, y[1]), (low, high)))
    return [box(x, *span, color, texture) for span in spans]


def posts(
    x: tuple[float, float],
    y: tuple[float, float],
    z: tuple[float, float],
    thick: float,
    color: Color,
    texture: int = PLAIN,
) -> list[Surface]:
    """Return four upright posts of square section [m], the lower corners of each at one of two x and one of two y."""
    return [box((a, a + thick), (b, b + thick), z, color, texture) for a in x for b in y]


def lathe(
    profile: list[tuple[float, float]], color: Color, texture: int = PLAIN, sides: int = 24, squeeze: float = 1.0
) -> Surface:
    """Return the solid that a profile of (radius, z) [m] sweeps about z; y is scaled by `squeeze`.

    A profile that runs up on the outside (and down again on the inside) has its faces outwards.
    """
    angle = 2 * np.pi * np.arange(sides) / sides
    rings = [(r * np.cos(angle), squeeze * r * np.sin(angle), np.full(sides, z)) for r, z in profile]
    vertices = np.concatenate([np.stack(ring, axis=1) for ring in rings])
    here = (np.arange(len(profile) - 1)[:, None] * sides + np.arange(sides)).ravel()
    beside = here - here % sides + (here + 1) % sides
    faces = np.stack([here, beside, beside + sides, here, beside + sides, here + sides], axis=1).reshape(-1, 3)
    a, b, c = np.moveaxis(vertices[faces], 1, 0)
    return painted(vertices, faces[np.linalg.norm(np.cross(b - a, c - a), axis=1) > 1e-12], color, texture)


def cylinder(radius: float, height: float, color: Color, texture: int = PLAIN, sides: int = 24) -> Surface:
    """Return a cylinder that stands on the origin [m]."""
    return lathe([(0, 0), (radius, 0), (radius, height), (0, height)], color, texture, sides)


def ellipsoid(size: tuple[float, float, float], color: Color, texture: int = PLAIN, sides: int = 12) -> Surface:
    """Return an ellipsoid of given full extents about the origin [m]."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, 9)
    ball = lathe([(max(np.cos(a), 0.0), np.sin(a)) for a in angles], color, texture, sides)
    return replace(ball, vertices=ball.vertices * np.array(size) / 2)


def prism(outline: np.ndarray, x: tuple[float, float], color: Color, texture: int = PLAIN) -> Surface:
    """Return a convex outline in the y-z plane, counter-clockwise, shape [corner 2], extruded along x [m]."""
    n = len(outline)
    vertices = np.concatenate([np.column_stack([np.full(n, value), outline]) for value in x])
    sides = [f for i in range(n) for f in ((i, (i + 1) % n, n + (i + 1) % n), (i, n + (i + 1) % n, n + i))]
    caps = [f for i in range(1, n - 1) for f in ((0, i + 1, i), (n, n + i, n + i + 1))]
    return painted(vertices, sides + caps, color, texture)


def stadium(length: float, width: float) -> np.ndarray:
    """Return a bar's outline with round ends, long along y, about the origin [m], shape [corner 2]."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, 9)
    cap = width / 2 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    right = cap + (length / 2 - width / 2, 0)
    return np.concatenate([right, -right])


Item = TypeVar("Item")
Range = tuple[float, float]


def chance(rng: np.random.Generator, probability: float) -> bool:
    """Return True with a given probability."""
    return bool(rng.uniform() < probability)


def pick(rng: np.random.Generator, options: Sequence[Item]) -> Item:
    """Return one of several options, all equally probable."""
    return options[int(rng.integers(len(options)))]


def weighted(rng: np.random.Generator, options: Mapping[Item, float]) -> Item:
    """Return one of several options, each as probable as its weight."""
    weights = np.array(list(options.values()), float)
    return list(options)[int(rng.choice(len(weights), p=weights / weights.sum()))]


def random_color(rng: np.random.Generator, low: int, high: int) -> Color:
    """Return a colour whose three channels are each at least `low` and below `high`."""
    red, green, blue = rng.integers(low, high, 3).tolist()
    return red, green, blue


def integer(rng: np.random.Generator, low: int, high: int) -> int:
    """Return a whole number from low to high, both possible."""
    return int(rng.integers(low, high + 1))
