"""What nobody annotated falls into floor, walls and objects."""

from __future__ import annotations

import numpy as np
import plain_room
import usd_room

from s2a.annotate import files
from s2a.annotate.surface import ADDED, SplitSurface
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh

X, Y, Z = np.eye(3)


def room() -> Mesh:
    """A floor of 2 x 2 m, a wall of 2 x 2.4 m that looks along +x, a box of 0.4 m in mid-air, a scrap."""
    floor = plain_room.grid(np.zeros(3), X, Y, (2.0, 2.0), (1, 1, 1))
    wall = plain_room.grid(np.zeros(3), Y, Z, (2.0, 2.4), (1, 1, 1))
    scrap = plain_room.grid(np.array([1.5, 1.5, 1.5]), X, Z, (0.06, 0.06), (1, 1, 1))
    return merge([floor, wall, usd_room.box((1.0, 1.0, 0.9), (0.4, 0.4, 0.4)), scrap])


def test_floor_wall_and_object_are_told_apart_and_scraps_join_the_structure() -> None:
    mesh = room()
    surface = SplitSurface.of(mesh.vertices, mesh.faces, None)
    found = files.divide(surface, np.ones(len(mesh.faces), bool))
    assert [label for label, _ in found] == ["floor", "wall", "object"]
    areas = [surface.areas[faces].sum() for _, faces in found]
    np.testing.assert_allclose(areas, [4.0 + 0.0036, 4.8, 6 * 0.16], rtol=1e-5)
    listed = np.concatenate([faces for _, faces in found])
    assert sorted(listed) == list(range(len(mesh.faces)))


def test_what_somebody_has_and_what_was_added_is_left_out() -> None:
    mesh = room()
    surface = SplitSurface.of(mesh.vertices, mesh.faces, None).with_mesh(usd_room.box((1, 1, 2), (0.4, 0.4, 0.4)))
    free = np.ones(len(surface.faces), bool)
    free[:10] = False
    listed = np.concatenate([faces for _, faces in files.divide(surface, free)])
    assert not np.isin(np.arange(10), listed).any() and (surface.source[listed] != ADDED).all()
