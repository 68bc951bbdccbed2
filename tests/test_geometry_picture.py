"""Pictures of meshes: what is where it must be by projection, and the nearer hides the farther."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import box, write_cabinet
from PIL import Image
from settings import load

from s2a.cli import main
from s2a.geometry.look import LookConfig, View, frame
from s2a.geometry.picture import draw, painted
from s2a.scene import Mesh

RED, BLUE = (255, 0, 0), (0, 0, 255)


@pytest.fixture
def look() -> LookConfig:
    """A square picture of 64 pixels over 90 degrees, both sides of a surface visible."""
    return replace(load(LookConfig, "look/above"), width=64, height=64, fov=np.pi / 2, see_through=False)


def mask(picture: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    """Return where a colour's channel outweighs the others, shape [row column]."""
    channel = int(np.argmax(color))
    others = [i for i in range(3) if i != channel]
    return picture[..., channel].astype(int) > picture[..., others].max(axis=2).astype(int) + 20


def test_a_box_covers_the_pixels_that_projection_says(look: LookConfig) -> None:
    front = box((2.5, 0.0, 0.0), (0.5, 0.5, 0.25))
    picture = draw([painted(front, RED)], View((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), look)
    rows, columns = np.nonzero(mask(picture, RED))
    # Its front is 2 m away: half a metre is a quarter of the half picture's 32 pixels, a quarter of a metre an eighth.
    assert (columns.min(), columns.max()) == (24, 39)
    assert (rows.min(), rows.max()) == (28, 35)


def test_the_nearer_hides_the_farther(look: LookConfig) -> None:
    near, far = box((2.0, 0.0, 0.0), (0.1, 1.0, 1.0)), box((4.0, 0.0, 0.0), (0.1, 1.0, 1.0))
    picture = draw([painted(far, BLUE), painted(near, RED)], View((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), look)
    assert mask(picture, RED).any() and not mask(picture, BLUE).any()


def test_a_frame_shows_everything_and_touches_its_edges(look: LookConfig) -> None:
    look = replace(look, margin=1.0, width=96, samples=1)
    scene = box((1.0, -2.0, 0.5), (0.4, 0.8, 0.3))
    view = frame(scene.vertices, np.array([1.0, 0.0, 0.0]), look)
    seen = mask(draw([painted(scene, RED)], view, look), RED)
    edges = [seen[:2].any(), seen[-2:].any(), seen[:, :2].any(), seen[:, -2:].any()]
    assert sum(edges) >= 2, "it fills the picture in one direction"
    wider = mask(draw([painted(scene, RED)], view, replace(look, fov=look.fov + 0.2)), RED)
    assert not (wider[0].any() or wider[-1].any() or wider[:, 0].any() or wider[:, -1].any()), "nothing was cut off"


def test_an_empty_scene_is_white(look: LookConfig) -> None:
    assert (draw([Mesh(np.zeros((0, 3)), np.zeros((0, 3)))], View((0, 0, 0), (1, 0, 0)), look) == 255).all()


def test_view_writes_a_picture_of_a_stage_and_of_its_colliders(tmp_path: Path) -> None:
    stage = write_cabinet(tmp_path / "sim.usda")
    sizes = ["look.width=90", "look.height=60", "look.samples=1"]
    for name, extra in (("visual", []), ("colliders", ["colliders=true"])):
        assert main(["view", f"path={stage}", f"picture={tmp_path / name}.png", *sizes, *extra]) == 0
        assert Image.open(tmp_path / f"{name}.png").size == (90, 60)
    pictures = [np.asarray(Image.open(tmp_path / f"{name}.png")) for name in ("visual", "colliders")]
    assert (pictures[0] != pictures[1]).any()
