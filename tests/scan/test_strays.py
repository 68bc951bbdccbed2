"""What a label spills onto is no part of an object, and what is thin is."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from s2a.scan.ply import ScanMesh
from s2a.scan.rest import stray_faces

CELL = 0.02
SHAPE = (90, 90, 80)
Cells = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]
"""(x, y, z) of the middles of cells [m] -> those that belong to a thing."""


def between(x0: float, x1: float, y0: float, y1: float, z0: float, z1: float) -> Cells:
    return lambda x, y, z: (x > x0) & (x < x1) & (y > y0) & (y < y1) & (z > z0) & (z < z1)


def scanned(*solids: Cells) -> tuple[ScanMesh, np.ndarray]:
    """Return the surface of a room with a floor below 0.04 m and a wall before 0.04 m of x, and the owner of each face.

    Owner 0 is the object, of one or several solids; -1 all else.
    """
    grid = np.stack(np.meshgrid(*((np.arange(n) + 0.5) * CELL for n in SHAPE), indexing="ij"))
    owner = np.where((grid[2] < 0.04) | (grid[0] < 0.04), -1, -2)  # -2: air
    for solid in solids:
        owner[solid(*grid) & (owner == -2)] = 0
    corners, owners = [], []
    for axis in range(3):
        a, b = [u for u in range(3) if u != axis]
        for step in (0, 1):
            neighbour = np.roll(owner, 1 - 2 * step, axis)
            edge = np.take(np.arange(SHAPE[axis]), [-step], 0)
            faces = (owner > -2) & (neighbour == -2)
            np.moveaxis(faces, axis, 0)[edge] = False
            cells = np.argwhere(faces)
            quad = np.repeat(cells[:, None], 4, axis=1)
            quad[:, :, axis] += step
            quad[:, [1, 2], a] += 1
            quad[:, [2, 3], b] += 1
            corners.append(quad)
            owners.append(owner[tuple(cells.T)])
    quads = np.concatenate(corners)
    vertices, index = np.unique(quads.reshape(-1, 3), axis=0, return_inverse=True)
    index = index.reshape(-1, 4)
    faces = np.stack([index[:, :3], index[:, [0, 2, 3]]], axis=1).reshape(-1, 3)
    surface = ScanMesh(
        Path("room.ply"), (vertices * CELL).astype(np.float32), faces.astype(np.int32), None, np.zeros(3)
    )
    return surface, np.repeat(np.concatenate(owners), 2)


def left(surface: ScanMesh, owner: np.ndarray, label: str = "thing") -> tuple[float, np.ndarray]:
    """Return the fraction of the object's faces that stays, and its extents [m]."""
    own = np.setdiff1d(np.flatnonzero(owner == 0), stray_faces(surface, owner, {0: label}))
    return len(own) / (owner == 0).sum(), np.ptp(surface.vertices[surface.faces[own]].reshape(-1, 3), axis=0)


THIN = {
    "floor lamp": (
        between(0.8, 1.1, 0.8, 1.1, 0, 0.07),
        between(0.94, 0.98, 0.94, 0.98, 0, 1.3),
        between(0.8, 1.1, 0.8, 1.1, 1.2, 1.5),
    ),
    "arc lamp": (
        between(0.6, 0.9, 0.8, 1.1, 0, 0.07),
        between(0.74, 0.78, 0.94, 0.98, 0, 1.3),
        between(0.74, 1.4, 0.94, 0.98, 1.26, 1.3),
        between(1.3, 1.5, 0.86, 1.06, 1.1, 1.3),
    ),
    "table": (
        between(0.5, 1.4, 0.5, 1.1, 0.68, 0.72),
        *(between(x, x + 0.04, y, y + 0.04, 0, 0.7) for x in (0.5, 1.36) for y in (0.5, 1.06)),
    ),
    "guitar": (between(0.8, 0.9, 0.6, 1.0, 0, 0.5), between(0.84, 0.88, 0.78, 0.84, 0.4, 1.05)),
    "chair": (
        between(0.8, 1.24, 0.8, 1.24, 0.4, 0.46),
        between(0.8, 0.84, 0.8, 1.24, 0.4, 0.9),
        *(between(x, x + 0.04, y, y + 0.04, 0, 0.4) for x in (0.8, 1.2) for y in (0.8, 1.2)),
    ),
    "office chair": (
        between(0.8, 1.24, 0.8, 1.24, 0.44, 0.5),
        between(1.0, 1.04, 1.0, 1.04, 0, 0.46),
        between(0.72, 1.32, 1.0, 1.04, 0, 0.1),
        between(1.0, 1.04, 0.72, 1.32, 0, 0.1),
    ),
    "couch with an arm": (between(0.3, 1.6, 0.2, 0.6, 0, 0.5), between(1.3, 1.6, 0.2, 1.5, 0, 0.4)),
    "cabinet at a wall": (between(0.04, 0.4, 0.4, 1.2, 0.6, 1.3),),
    "plant": (
        between(0.8, 1.0, 0.8, 1.0, 0, 0.2),
        *(between(0.8 + k / 20, 0.84 + k / 20, 0.86, 0.9, 0.1, 0.6 + k / 10) for k in range(4)),
    ),
}


@pytest.mark.parametrize("name", THIN)
def test_what_is_thin_stays_whole(name: str) -> None:
    surface, owner = scanned(*THIN[name])
    fraction, extents = left(surface, owner)
    assert fraction == 1.0
    assert extents == pytest.approx(np.ptp(surface.vertices[surface.faces[owner == 0]].reshape(-1, 3), axis=0))


SPILLS = {
    "a tongue along the wall": lambda p: (p[:, 0] < 0.05) & (p[:, 1] < 1.6) & (np.abs(p[:, 2] - 1.0) < 0.06),
    "a patch of the wall, apart": lambda p: (p[:, 0] < 0.05) & (p[:, 1] > 1.5) & (p[:, 2] > 1.2) & (p[:, 2] < 1.4),
    "a tongue over the floor": lambda p: (p[:, 2] < 0.05) & (p[:, 0] < 1.6) & (np.abs(p[:, 1] - 0.6) < 0.06),
}


@pytest.mark.parametrize("name", SPILLS)
def test_what_a_label_spills_onto_is_no_part_of_a_cabinet(name: str) -> None:
    surface, owner = scanned(between(0.04, 0.6, 0.2, 0.9, 0.04, 1.3))
    true = np.ptp(surface.vertices[surface.faces[owner == 0]].reshape(-1, 3), axis=0)
    middles = surface.vertices[surface.faces].mean(axis=1)
    spilled = owner.copy()
    spilled[SPILLS[name](middles) & (owner == -1)] = 0
    before = np.ptp(surface.vertices[surface.faces[spilled == 0]].reshape(-1, 3), axis=0)
    assert (before > 1.3 * true).any()
    _, extents = left(surface, spilled)
    assert extents == pytest.approx(true, abs=0.041)


def test_what_hangs_in_the_air_apart_is_no_part_of_a_cabinet() -> None:
    body, sheet = between(0.04, 0.6, 0.2, 0.9, 0.04, 1.3), between(0.5, 0.54, 0.92, 1.6, 0.9, 1.2)
    alone, both = (left(*scanned(*solids))[1] for solids in ((body,), (body, sheet)))
    assert both == pytest.approx(alone, abs=0.041)


def test_no_more_than_a_third_of_an_object_is_taken_for_a_spill() -> None:
    surface, owner = scanned(between(0.3, 0.6, 0.3, 0.6, 0.04, 0.4))
    middles = surface.vertices[surface.faces].mean(axis=1)
    owner[(middles[:, 2] < 0.05) & (middles[:, 0] < 1.5) & (middles[:, 1] < 1.5) & (owner == -1)] = 0
    assert left(surface, owner)[0] > 0.66


@pytest.mark.parametrize(("label", "height"), [("old_nightstand", 0.66), ("thing", 0.96), ("refrigerator", 0.96)])
def test_what_stands_on_a_piece_too_high_for_its_kind_is_no_part_of_it(label: str, height: float) -> None:
    surface, owner = scanned(between(0.3, 0.8, 0.3, 0.7, 0.04, 0.7), between(0.5, 0.64, 0.4, 0.56, 0.6, 1.0))
    assert left(surface, owner, label)[1][2] == pytest.approx(height, abs=0.021)


def test_a_top_is_no_open_lid_and_a_pile_on_it_may_be_large() -> None:
    oven, lid = between(0.3, 0.7, 0.3, 0.8, 0.04, 0.3), between(0.7, 1.2, 0.3, 0.8, 0.04, 0.12)
    surface, owner = scanned(oven, lid, between(0.35, 0.65, 0.35, 0.75, 0.26, 0.5))
    assert left(surface, owner, "toaster oven")[1][2] == pytest.approx(0.26, abs=0.021)


def test_edges_of_a_thin_front_stay_and_those_of_a_wall_go() -> None:
    surface, owner = scanned(between(0.1, 0.14, 0.3, 1.5, 0.5, 1.3), between(0.04, 0.1, 0.3, 0.7, 0.5, 0.52))
    assert left(surface, owner)[1][0] == pytest.approx(0.1, abs=0.001)
    assert left(surface, owner, "wall")[1][0] == pytest.approx(0.04, abs=0.001)
