"""Recordings in every layout hold the same frames; damaged ones are one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import recordings

from s2a.core.errors import InputError
from s2a.scan import recording

WRITERS: dict[str, Callable[[Path, int], Path]] = {
    "7-Scenes": recordings.seven_scenes,
    "ScanNet": recordings.scannet,
    "nerfstudio": recordings.nerfstudio,
}


@pytest.mark.parametrize("kind", WRITERS)
def test_every_layout_gives_the_same_cameras_and_depth(tmp_path: Path, kind: str) -> None:
    walk = recording.read(WRITERS[kind](tmp_path / "walk", 4))
    used = [0, 1, 3] if kind == "ScanNet" else [0, 1, 2, 3]
    assert (walk.kind, len(walk.frames), walk.lost) == (kind, len(used), 4 - len(used))
    assert (walk.depth_camera.fx, walk.depth_camera.cy) == (recordings.FOCAL, recordings.HEIGHT / 2)
    for index, (frame, depth, color) in zip(used, recording.images(walk, 1, 9.0), strict=True):
        pose = recordings.poses(4)[index]
        assert frame.pose == pytest.approx(pose, abs=1e-9)
        assert depth == pytest.approx(recordings.image(pose)[0], abs=6e-4)
        assert color is not None and color.shape == (*depth.shape, 3)
    assert walk.up == pytest.approx([0, 0, 1], abs=1e-6)


def test_depth_beyond_what_is_believed_is_none(tmp_path: Path) -> None:
    walk = recording.read(recordings.seven_scenes(tmp_path / "walk", 2))
    _, depth, _ = next(recording.images(walk, 1, 1.5))
    assert depth.max() < 1.5 and (depth == 0).any()


def test_keyframes_are_sharp_and_spread(tmp_path: Path) -> None:
    walk = recording.read(recordings.seven_scenes(tmp_path / "walk", 12))
    sharp = np.arange(12.0)
    sharp[5] = np.nan
    chosen = recording.keyframes(walk, sharp, spread=9.0, turn=45.0)
    assert 11 in chosen and 5 not in chosen and 4 <= len(chosen) <= 8
    recording.write_keyframes(tmp_path, walk, chosen, np.eye(4))
    written = json.loads((tmp_path / "keyframes" / "keyframes.json").read_text())
    assert [frame["image"] for frame in written["frames"]] == [f"frame-{index:06d}.color.png" for index in chosen]


def lose_pose(folder: Path) -> None:
    (folder / "frame-000001.pose.txt").unlink()


def stretch_pose(folder: Path) -> None:
    np.savetxt(folder / "frame-000001.pose.txt", 2 * np.eye(4))


def cut_pose(folder: Path) -> None:
    np.savetxt(folder / "frame-000001.pose.txt", np.eye(3))


def garble_camera(folder: Path) -> None:
    (folder / "camera-intrinsics.txt").write_text("five hundred")


def cut_depth(folder: Path) -> None:
    path = folder / "frame-000001.depth.png"
    path.write_bytes(path.read_bytes()[:100])


def color_as_depth(folder: Path) -> None:
    (folder / "frame-000001.depth.png").write_bytes((folder / "frame-000001.color.png").read_bytes())


def lose_all(folder: Path) -> None:
    for path in folder.glob("*.pose.txt"):
        np.savetxt(path, np.full((4, 4), -np.inf))


@pytest.mark.parametrize(
    ("damage", "word"),
    [
        (lose_pose, "is missing"),
        (stretch_pose, "no rotation"),
        (cut_pose, "3 x 3 numbers"),
        (garble_camera, "holds no matrix"),
        (cut_depth, "damaged"),
        (color_as_depth, "no 16 bit depth"),
        (lose_all, "0 frames have a valid pose"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, damage: Callable[[Path], None], word: str) -> None:
    folder = recordings.seven_scenes(tmp_path / "walk", 3)
    damage(folder)
    with pytest.raises(InputError, match=word) as error:
        list(recording.images(recording.read(folder), 1, 9.0))
    assert "\n" not in str(error.value)


def test_an_unknown_folder_names_the_layouts(tmp_path: Path) -> None:
    assert not recording.recognise(tmp_path)
    with pytest.raises(InputError, match=r"possible: .*7-Scenes.*ScanNet.*nerfstudio"):
        recording.read(tmp_path)
