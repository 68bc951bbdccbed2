"""Pictures of insertions show the object, whatever stands around it."""

from __future__ import annotations

import numpy as np
import pytest
from few import few
from rough_furniture import at, block, sheet

from s2a.core import config
from s2a.language.insert.review import viewpoint
from s2a.language.insert.serves import visible_fraction
from s2a.scene.geometry.camera import OrbitCamera
from s2a.scene.geometry.mesh_ops import merge, sample
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh, Part, Scene

CAMERA: OrbitCamera = config.load(OrbitCamera, config.compose("insert", ["stage=none", "out=none"])["camera"])
CUP = block(0.08, 0.08, 0.1)
RED = (255, 0, 0)


def room(*more: Mesh) -> Scene:
    """Four walls around a floor of 4 x 4 m, and other things."""
    flat = sheet((-2, 2), (0, 2.5), 0.0, 0.1)
    walls = [Mesh(flat.vertices[:, [0, 2, 1]] + [0, y, 0], flat.faces) for y in (-2, 2)]
    walls += [Mesh(flat.vertices[:, [2, 0, 1]] + [x, 0, 0], flat.faces) for x in (-2, 2)]
    parts = [sheet((-2, 2), (-2, 2), 0.0, 0.1), *walls, *more]
    return Scene("room", {f"part_{n}": Part("floor" if not n else "part", mesh) for n, mesh in enumerate(parts)})


CASES = {
    "in a corner, its front to the wall": ((1.9, 1.9, 0.0), (1.0, 0.0, 0.0), ()),
    "behind a crate": ((0.0, 1.9, 0.0), (0.0, -1.0, 0.0), (at(block(0.8, 0.4, 0.8), 0.0, 1.5, 0.0),)),
    "under a table": ((0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (at(block(1.2, 1.2, 0.03), 0.0, 0.0, 0.7),)),
    "high on a wall": ((0.0, 1.94, 1.8), (0.0, -1.0, 0.0), ()),
}


@pytest.mark.parametrize("case", few(CASES, 1))
def test_the_object_is_seen_from_inside_the_room(case: str) -> None:
    place, front, more = CASES[case]
    cup = at(CUP, *place)
    cup = Mesh(cup.vertices, cup.faces, np.tile(np.array(RED, np.uint8), (len(cup.vertices), 1)))
    scene = room(*more, cup)
    view = viewpoint(scene, cup, np.array(front), CAMERA)
    assert (np.abs(view.eye[:2]) < 2.0).all()
    assert 0.0 < view.eye[2] < 2.5
    # A third of a box's surface is a view of two or three of its sides.
    obstacles = merge([Mesh(part.mesh.vertices, part.mesh.faces) for part in scene.parts.values()])
    assert visible_fraction(obstacles, sample(cup, 200, seed=1), np.array([view.eye]))[0] > 0.3
    image = render([part.mesh for part in scene.parts.values()], view, CAMERA).astype(int)
    red = (image[..., 0] > 60) & (image[..., 0] > 3 * image[..., 1])  # lit, in its own colour
    assert red.mean() > 0.002


def test_what_hangs_on_a_wall_is_not_seen_through_it() -> None:
    plate = at(block(0.3, 0.03, 0.3), 0.0, 1.985, 1.2)
    scene = room(at(block(0.2, 0.2, 0.2), 0.0, 4.0, 0.0), plate)
    assert viewpoint(scene, plate, np.array((0.0, 1.0, 0.0)), CAMERA).eye[1] < 2.0
