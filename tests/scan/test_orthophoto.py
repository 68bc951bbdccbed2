"""Orthophotos show a plane at its scale, from the views that see it."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import recordings

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.scan import orthophoto
from s2a.scene.scene import Mesh

SQUARE = 0.1


def board(y: np.ndarray, z: np.ndarray) -> np.ndarray:
    """Return the grey levels of the wall at x = 4 m: a chessboard of 10 cm, brighter to its left as seen from the room."""
    odd = (np.floor(y / SQUARE) + np.floor(z / SQUARE)) % 2
    return np.where(odd == 1, 60.0, 160.0) + 20.0 * y


def photo(
    folder: Path, name: str, eye: tuple[float, float, float], yaw: float, gain: float = 1.0
) -> orthophoto.Keyframe:
    """Return a photo of the wall from a camera at a place that looks along (cos yaw, sin yaw, 0)."""
    forward, right = np.array([np.cos(yaw), np.sin(yaw), 0.0]), np.array([np.sin(yaw), -np.cos(yaw), 0.0])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = np.stack([right, np.cross(forward, right), forward], axis=1), eye
    rows, columns = np.mgrid[0:480, 0:640]
    rays = np.stack([(columns - 320) / 500, (rows - 240) / 500, np.ones(rows.shape)], axis=-1) @ pose[:3, :3].T
    points = pose[:3, 3] + rays * ((4.0 - eye[0]) / rays[..., :1])
    grey = np.clip(gain * board(points[..., 1], points[..., 2]), 0, 255)
    PIL.Image.fromarray(np.repeat(grey[..., None], 3, axis=2).round().astype(np.uint8)).save(folder / name)
    return orthophoto.Keyframe(folder / name, orthophoto.Intrinsics(500, 500, 320, 240), pose, 1.0)


WALL = orthophoto.upright((4.0, 1.5, 1.2), np.pi, (1.6, 1.0))


def difference(result: orthophoto.Orthophoto, pixel: float) -> np.ndarray:
    """Return how far the levels are from the wall's, shape [row column], 0 at the squares' borders."""
    rows, columns = np.mgrid[0 : result.image.shape[0], 0 : result.image.shape[1]]
    places = WALL.points(rows, columns, pixel)
    border = np.abs((places[..., 1:] / SQUARE + 0.5) % 1 - 0.5).min(axis=-1) < 0.08
    off: np.ndarray = np.where(border, 0, np.abs(result.image[..., 0] - board(places[..., 1], places[..., 2])))
    return off


def test_a_slanted_photo_becomes_the_plane_at_its_scale(tmp_path: Path) -> None:
    frame = photo(tmp_path, "a.png", (2.4, 1.0, 1.5), 0.3)
    result = orthophoto.orthophoto([frame], WALL, None, 0.004)
    assert result.image.shape == (250, 400, 3) and result.used == ("a.png",)
    assert result.seen.mean() > 0.7 and difference(result, 0.004)[result.seen].max() < 12
    assert (result.image[~result.seen] == orthophoto.UNSEEN).all()


def test_what_stands_before_a_plane_is_seen_from_the_side(tmp_path: Path) -> None:
    frames = [photo(tmp_path, "a.png", (1.6, 1.5, 1.2), 0.0), photo(tmp_path, "b.png", (1.8, 0.6, 1.2), 0.4)]
    corners = np.array([[3.4, 1.4, 0.5], [3.4, 1.6, 0.5], [3.4, 1.6, 2.0], [3.4, 1.4, 2.0]])
    post = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]]))
    alone = orthophoto.orthophoto(frames[:1], WALL, post, 0.004)
    both = orthophoto.orthophoto(frames, WALL, post, 0.004)
    assert 0.1 < (~alone.seen).mean() < 0.3 and both.seen.mean() > 0.97 and both.used == ("a.png", "b.png")
    assert difference(both, 0.004)[both.seen].max() < 14


def test_brightness_is_matched(tmp_path: Path) -> None:
    frames = [photo(tmp_path, "a.png", (3.0, 1.1, 1.2), 0.0), photo(tmp_path, "b.png", (3.0, 1.9, 1.2), 0.0, 0.7)]
    result = orthophoto.orthophoto(frames, WALL, None, 0.004)
    assert len(result.used) == 2
    rows, columns = np.mgrid[0:250, 0:400]
    places = WALL.points(rows, columns, 0.004)
    ratio = result.image[..., 0] / board(places[..., 1], places[..., 2])
    halves = np.median(ratio[:, 20:150]), np.median(ratio[:, 250:380])
    assert halves[0] == pytest.approx(halves[1], rel=0.06)


def test_nothing_is_shown_from_behind(tmp_path: Path) -> None:
    frame = photo(tmp_path, "a.png", (2.4, 1.5, 1.2), 0.0)
    with pytest.raises(InputError, match="none of 1 photos"):
        orthophoto.orthophoto([frame], orthophoto.upright((4.0, 1.5, 1.2), 0.0, (1.0, 1.0)))


def test_the_rectangle_around_a_front_faces_as_its_faces_do() -> None:
    corners = np.array([[4.0, 1.0, 0.5], [4.0, 1.4, 0.5], [4.0, 1.4, 1.2], [4.0, 1.0, 1.2]])
    rectangle = orthophoto.around(Mesh(corners, np.array([[0, 2, 1], [0, 3, 2]])), 0.0)
    assert rectangle.center == pytest.approx([4.0, 1.2, 0.85]) and rectangle.size == pytest.approx((0.4, 0.7))
    assert rectangle.axes == pytest.approx(orthophoto.upright((0, 0, 0), np.pi, (1, 1)).axes, abs=1e-9)


@pytest.mark.slow
def test_a_user_sees_the_wall_of_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    walk, scan, image = recordings.seven_scenes(tmp_path / "walk", 36), tmp_path / "scan", tmp_path / "wall.png"
    options = ["voxel=0.03", "far=9", "up=z", "floor=false"]
    assert cli.main(["import", f"frames={walk}", f"out={scan}", *options]) == 0
    # The wall's foot: floor below, wall above.
    wall = "rectangle=[3.98,1.5,0.5,3.14159,1.6,0.8]"
    assert cli.main(["view", f"path={scan}", f"image={image}", "photo=0.01", wall]) == 0
    assert "160 x 80 pixels of 10 mm" in capsys.readouterr().out
    shown = np.asarray(PIL.Image.open(image)).astype(int)
    assert np.abs(shown - recordings.GREY).mean() < 10
    assert cli.main(["view", f"path={scan}", f"image={image}", "photo=0.01"]) == 2
    assert cli.main(["view", f"path={scan}", f"image={image}", wall]) == 2
    (scan / "keyframes" / "keyframes.json").write_text("{}")
    assert cli.main(["view", f"path={scan}", f"image={image}", "photo=0.01", wall]) == 2
    errors = [line for line in capsys.readouterr().err.splitlines() if "warning" not in line]
    assert len(errors) == 3 and "damaged" in errors[-1]
