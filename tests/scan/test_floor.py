"""Floor below a base: counted where it was scanned, at the height of the base's foot."""

from __future__ import annotations

import numpy as np
import pytest
from cabinet import box

from s2a.scan.evidence.surface import floor_fraction
from s2a.scene.geometry.mesh_query import ray_mesh

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
    surface = ray_mesh(FLOOR.vertices, FLOOR.faces)
    assert floor_fraction(np.array(base), pedestal, 0.12, surface, 0.05) == pytest.approx(fraction)
