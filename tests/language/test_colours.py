"""The colours seen from an object's sides."""

from __future__ import annotations

import numpy as np
from rough_furniture import at, block

from s2a.language.insert.object_file import colour_spread
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh


def painted(mesh: Mesh, color: tuple[int, int, int]) -> Mesh:
    return Mesh(mesh.vertices, mesh.faces, np.tile(np.array(color, np.uint8), (len(mesh.vertices), 1)))


def picture(scale: float = 1.0) -> Mesh:
    """A grey board with a black and a white half before it, along -y."""
    board = painted(block(0.4, 0.02, 0.3), (128, 128, 128))
    left, right = (painted(at(block(0.2, 0.01, 0.3), x, -0.02, 0.0), (v, v, v)) for x, v in ((-0.1, 0), (0.1, 255)))
    whole = merge([board, left, right])
    return Mesh(whole.vertices * np.float32(scale), whole.faces, whole.colors)


def test_the_front_is_the_side_with_the_colours() -> None:
    spread = colour_spread(picture())
    assert spread["+y"] == 0.0
    # Half black, half white: a standard deviation of 127.5, but for the rays along the seam.
    assert 120.0 < spread["-y"] <= 127.5


def test_the_unit_of_the_file_does_not_matter() -> None:
    assert colour_spread(picture(1000.0)) == colour_spread(picture())


def test_without_colours_nothing_is_said() -> None:
    assert colour_spread(block(0.1, 0.1, 0.1)) == {}
