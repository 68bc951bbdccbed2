"""Floor below a base: scanned at the height of its foot, or a hole of the scan amid such floor."""

from __future__ import annotations

import numpy as np
import pytest
from cabinet import box

from s2a.scan.evidence.surface import FloorConfig, FloorSupport, floor_support
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.mesh_query import ray_mesh
from s2a.scene.scene import Mesh

FLOOR = box((0.0, 0.0, -0.01), (1.0, 1.0, 0.01))  # its upper side is 2 x 2 m at z = 0


@pytest.mark.parametrize(
    ("base", "pedestal", "fraction"),
    [
        ((0.0, 0.0, 0.0), 0.0, 1.0),
        ((0.0, 0.0, 0.2), 0.2, 1.0),
        ((0.0, 0.0, 0.2), 0.0, 0.0),  # it would float
        ((0.0, 0.95, 0.0), 0.0, 6 / 9),  # of nine places three lie 8.5 to 12 cm farther out
        ((0.0, 1.05, 0.0), 0.0, 3 / 9),
        ((0.0, 2.0, 0.0), 0.0, 0.0),
    ],
)
def test_floor_is_where_it_was_scanned(base: tuple[float, ...], pedestal: float, fraction: float) -> None:
    support = below([FLOOR], base, pedestal)
    assert support.fraction == pytest.approx(fraction)
    assert support.scanned == (fraction >= 0.5)


def below(meshes: list[Mesh], base: tuple[float, ...] = (0.0, 0.0, 0.0), pedestal: float = 0.0) -> FloorSupport:
    solid = merge([Mesh(mesh.vertices, mesh.faces) for mesh in meshes])
    return floor_support(np.array(base), pedestal, 0.12, ray_mesh(solid.vertices, solid.faces), FloorConfig())


def slab(low: tuple[float, float], high: tuple[float, float], top: float = 0.0, thickness: float = 0.02) -> Mesh:
    """Return a level solid between two corners (x, y) whose upper side is at a height [m]."""
    (x, y), (u, v) = low, high
    return box(((x + u) / 2, (y + v) / 2, top - thickness / 2), ((u - x) / 2, (v - y) / 2, thickness / 2))


def around(half: float) -> list[Mesh]:
    """Return floor out to 2 m around a square hole of a half width [m]: to the west, east, south and north."""
    west, east = slab((-2.0, -2.0), (-half, 2.0)), slab((half, -2.0), (2.0, 2.0))
    return [west, east, slab((-half, -2.0), (half, -half)), slab((-half, half), (half, 2.0))]


CABINET = box((0.0, 0.85, 0.5), (2.0, 0.3, 0.4))  # its front at y = 0.55, 0.1 m above the floor
WALL = box((0.0, 0.3, 1.0), (2.0, 0.02, 1.0))


@pytest.mark.parametrize(
    ("meshes", "assumed", "sides"),
    [
        (around(0.5), True, 16),
        (
            around(0.9),
            False,
            4,
        ),  # along the axes it is 0.9 m away, and seen from 0.9 to 1 m; along the diagonals 1.27 m
        ([*around(0.5), slab((-0.5, -0.5), (0.5, 0.5), -1.5)], False, 0),  # a shaft
        ([*around(0.5), slab((-0.5, 0.2), (0.5, 0.5), -0.18)], False, 16),  # stairs that begin beside the base
        ([*around(0.5), slab((-0.5, -0.5), (0.5, 0.5), 0.5)], False, 0),  # a bed, of whose floor nothing can be seen
        ([*around(0.5)[:3], CABINET], True, 13),  # before a cabinet, which hides three sides
        ([around(0.5)[0]], False, 5),  # the scan ends there: floor up to 45 degrees from west
        ([*around(0.5)[2:3], WALL], False, 3),  # before a wall, with floor on the other side alone
        ([slab((-2.0, 0.4), (2.0, 2.0)), WALL], False, 0),  # outside: the floor is behind the wall
        ([], False, 0),
    ],
)
def test_a_hole_amid_floor_of_the_same_height_is_assumed_to_be_floor(
    meshes: list[Mesh], assumed: bool, sides: int
) -> None:
    support = below([*meshes, slab((8.0, 8.0), (9.0, 9.0))])
    assert (support.scanned, support.fraction) == (False, 0.0)
    assert (support.assumed, support.sides) == (assumed, sides)


def test_a_hole_is_assumed_below_a_pedestal_at_the_height_of_its_foot() -> None:
    assert below(around(0.5), (0.0, 0.0, 0.4), 0.4).assumed
    assert not below(around(0.5), (0.0, 0.0, 0.4), 0.3).assumed
