"""Pictures show what projection says, from where it can be seen."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tiny_scan
from cabinet import box, write_cabinet
from PIL import Image
from settings import load

from s2a.commands.cli import main
from s2a.scene.geometry.camera import CameraPose, OrbitCamera, framing_pose, front_of
from s2a.scene.geometry.mesh_ops import painted
from s2a.scene.geometry.render import render
from s2a.scene.scene import Mesh

RED, BLUE, WHITE = (255, 0, 0), (0, 0, 255), (255, 255, 255)
LOOK = replace(
    load(OrbitCamera, "camera/above"),
    width=60,
    height=40,
    samples=1,
    fov=2.0 * float(np.arctan(0.5)),
    backface_culling=False,
)
"""At a distance of d, the picture is d high and 1.5 d wide."""
FROM_X = CameraPose(eye=(4.0, 0.0, 0.0), target=(0.0, 0.0, 0.0))
"""The picture's right is +y, its up +z; at x = 0 a pixel is 0.1 m."""


def square(x: float, half: float, color: tuple[int, int, int], faces: list[list[int]] | None = None) -> Mesh:
    """Return a square at x about the x axis; it faces +x."""
    corners = [(x, -half, -half), (x, half, -half), (x, half, half), (x, -half, half)]
    return painted(Mesh(np.array(corners), np.array(faces or [[0, 1, 2], [0, 2, 3]])), color)


def mostly(picture: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    """Return where a picture has a saturated colour, however brightly lit."""
    strong = np.array(color) == 255
    return (picture[..., strong].min(axis=-1) > 60) & (picture[..., ~strong].max(axis=-1, initial=0) < 10)


def test_a_square_covers_the_pixels_that_projection_says() -> None:
    expected = np.zeros((40, 60), dtype=bool)
    expected[20 - 5 : 20 + 5, 30 - 5 : 30 + 5] = True
    picture = render([square(0.0, 0.5, RED)], FROM_X, LOOK)
    assert np.array_equal(mostly(picture, RED), expected)
    assert (picture[~expected] == 255).all()


def test_right_and_up_are_not_mirrored() -> None:
    moved = square(0.0, 0.5, RED)
    moved = Mesh(moved.vertices + np.array([0.0, 2.0, 1.0], np.float32), moved.faces, moved.colors)
    rows, columns = np.nonzero(mostly(render([moved], FROM_X, LOOK), RED))
    assert (rows.min(), rows.max() + 1) == (5, 15)
    assert (columns.min(), columns.max() + 1) == (45, 55)


def test_the_nearer_hides_the_farther_in_any_order() -> None:
    near, far = square(2.0, 0.25, BLUE), square(0.0, 1.0, RED)
    for meshes in ([near, far], [far, near]):
        picture = render(meshes, FROM_X, LOOK)
        # At half the distance 0.25 m look like 0.5 m.
        assert mostly(picture, BLUE).sum() == 10 * 10
        assert mostly(picture, BLUE)[15:25, 25:35].all()


def test_a_wall_seen_from_behind_is_left_out_only_where_asked() -> None:
    wall, behind = square(2.0, 1.0, BLUE, [[0, 2, 1], [0, 3, 2]]), square(0.0, 0.5, RED)
    assert mostly(render([wall, behind], FROM_X, LOOK), BLUE)[20, 30]
    picture = render([wall, behind], FROM_X, replace(LOOK, backface_culling=True))
    assert mostly(picture, RED).sum() == 10 * 10
    assert not mostly(picture, BLUE).any()


def test_a_roof_throws_a_shadow_and_the_sun_sees_through_a_ceiling() -> None:
    floor = square(0.0, 2.0, WHITE)
    turn = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]], np.float32)
    floor = Mesh(floor.vertices @ turn.T, floor.faces, floor.colors)
    above = Mesh(floor.vertices + np.array([0, 0, 1], np.float32), floor.faces, floor.colors)
    ceiling = Mesh(above.vertices, above.faces[:, ::-1], above.colors)
    view = CameraPose(eye=(3.0, 0.0, 0.5), target=(0.0, 0.0, 0.0))
    camera = replace(LOOK, backface_culling=True)
    alone, shaded, open_above = (
        render(m, view, camera)[20, 30].astype(int) for m in ([floor], [floor, above], [floor, ceiling])
    )
    assert (shaded < alone - 20).all()
    assert np.array_equal(open_above, alone)


def test_several_samples_blend_at_edges_only() -> None:
    square_of_half_pixels = square(0.0, 0.55, RED)
    coarse = render([square_of_half_pixels], FROM_X, LOOK)
    fine = render([square_of_half_pixels], FROM_X, replace(LOOK, samples=2))
    assert np.array_equal(fine[16:24, 26:34], coarse[16:24, 26:34])
    edge = fine[14, 26:34].astype(int)
    assert ((edge[:, 1] > 60) & (edge[:, 1] < 250)).all()


def test_nothing_to_see_is_white() -> None:
    empty = Mesh(np.zeros((0, 3)), np.zeros((0, 3)))
    assert (render([empty], FROM_X, LOOK) == 255).all()
    assert (render([], FROM_X, LOOK) == 255).all()


@pytest.mark.parametrize("azimuth", [0.0, 1.0, -2.5])
@pytest.mark.parametrize("elevation", [0.0, 0.7, np.pi / 2])
def test_a_frame_touches_what_it_shows_without_cutting_it(azimuth: float, elevation: float) -> None:
    points = np.random.default_rng(3).uniform((-3, 0, 0), (1, 2, 1), (60, 3))
    camera = replace(LOOK, azimuth=azimuth, elevation=elevation, margin=1.0)
    view = framing_pose(points, np.array([0.6, 0.8, 0.0]), camera)
    forward = np.subtract(view.target, view.eye)
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, (0, 0, 1)) if elevation < 1.5 else np.array([1.0, 0.0, 0.0])
    right /= np.linalg.norm(right)
    offset = points - view.eye
    across = (
        np.stack([offset @ right / 0.75, offset @ np.cross(right, forward) / 0.5], axis=1) / (offset @ forward)[:, None]
    )
    assert np.abs(across).max() == pytest.approx(1.0, abs=1e-6)


def test_scanned_surfaces_have_a_front_and_closed_ones_have_none() -> None:
    assert np.allclose(front_of([square(0.0, 0.5, RED)]), (1, 0, 0))
    assert front_of([box((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))]) is None
    assert front_of([]) is None


def test_view_writes_pictures_of_scans_and_of_stages(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder, stage = tiny_scan.write(tmp_path / "scan"), write_cabinet(tmp_path / "sim.usd")
    small = ["camera.width=48", "camera.height=32"]
    asked = [(folder, []), (folder, ["part=door_3", "camera=near"]), (stage, []), (stage, ["colliders=true"])]
    asked += [(stage, ["part=room_3"])]  # has colliders, but no surface of its own
    for number, (path, rest) in enumerate(asked):
        out = tmp_path / "pictures" / f"{number}.png"
        assert main(["view", f"path={path}", f"image={out}", *small, *rest]) == 0
        picture = np.array(Image.open(out))
        assert picture.shape == (32, 48, 3)
        assert 0.02 < (picture != 255).any(axis=2).mean()
    surfaces, colliders = (np.array(Image.open(tmp_path / f"pictures/{number}.png")) for number in (2, 3))
    assert (surfaces != colliders).any()
    assert "48 x 32 pixels" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("rest", "said"),
    [
        (["part=drawer_9"], "'drawer_9' has no surface"),
        (["colliders=true"], "has no colliders"),
    ],
)
def test_view_says_what_it_cannot_draw(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], rest: list[str], said: str
) -> None:
    folder, out = tiny_scan.write(tmp_path / "scan"), tmp_path / "x.png"
    assert main(["view", f"path={folder}", f"image={out}", *rest]) == 2
    assert said in capsys.readouterr().err
    assert not out.exists()
