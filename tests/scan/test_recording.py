"""Recordings in every layout hold the same frames; damaged ones are one line."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import astuple
from pathlib import Path

import numpy as np
import PIL.Image
import pytest
import recordings
from few import few

from s2a.core.errors import InputError
from s2a.scan import orthophoto, recording, recording_formats
from s2a.scene.geometry.depth_fusion import DepthFusion, Image, measured_points
from s2a.scene.scene import Mesh

WRITERS: dict[str, Callable[[Path, int], Path]] = {
    "7-Scenes": recordings.seven_scenes,
    "ScanNet": recordings.scannet,
    "nerfstudio": recordings.nerfstudio,
    "ARKitScenes": recordings.arkitscenes,
    "Stray Scanner": recordings.stray,
    "Polycam": recordings.polycam,
    "Record3D": recordings.record3d,
}
LOST = {"ScanNet": 1, "ARKitScenes": 24}


@pytest.mark.parametrize("kind", few(WRITERS, 4))
def test_every_layout_gives_the_same_cameras_depth_and_colours(tmp_path: Path, kind: str) -> None:
    walk = recording_formats.read(WRITERS[kind](tmp_path / "walk", 24))
    used = [index for index in range(24) if kind != "ScanNet" or index != 2]
    assert (walk.kind, len(walk.frames), walk.lost) == (kind, len(used), LOST.get(kind, 0))
    assert walk.frames[0].depth_camera == recording.Intrinsics(
        *map(pytest.approx, (recordings.FOCAL, recordings.FOCAL, recordings.WIDTH / 2, recordings.HEIGHT / 2))
    )
    world = recordings.Y_UP if walk.gravity == "y" else np.eye(4)
    for index, (frame, depth, color) in zip(used, recording.images(walk, 1, 9.0), strict=True):
        pose = recordings.poses(24)[index]
        assert frame.pose == pytest.approx(world @ pose, abs=1e-6)
        seen = depth > 0
        assert np.abs(depth - recordings.image(pose)[0])[seen].max() < 6e-4
        assert seen.mean() == pytest.approx(1 - 400 / seen.size if frame.confidence else 1.0)
        assert color is not None
        truth = recordings.image(pose, color.shape[0] // depth.shape[0])[1]
        assert np.abs(color.astype(int) - truth).mean() < 4
    assert walk.up is None if walk.gravity else walk.up == pytest.approx([0, 0, 1], abs=1e-6)
    assert recording.check(walk) is None


@pytest.mark.parametrize("kind", few(WRITERS))
def test_the_fused_surface_is_the_room(tmp_path: Path, kind: str) -> None:
    surface = fused(recording_formats.read(WRITERS[kind](tmp_path / "walk", 36)))
    points = surface.vertices
    if kind in ("Stray Scanner", "Polycam", "Record3D"):
        points = points @ recordings.Y_UP[:3, :3]
    off = np.minimum(np.abs(points), np.abs(points - recordings.SIZE)).min(axis=1)
    assert np.sqrt(np.mean(off**2)) < 0.008 and len(points) > 5000
    inner = (points[:, :2] > 0.2).all(axis=1) & (points[:, :2] < recordings.SIZE[:2] - 0.2).all(axis=1)
    assert surface.colors is not None
    assert surface.colors[inner & (points[:, 2] < 0.05)].mean(axis=0) == pytest.approx(recordings.RED, abs=8)


def fused(walk: recording.RgbdRecording) -> Mesh:
    move = None if walk.registered else walk.color_from_depth
    frames = [
        Image(depth, color, frame.pose, astuple(frame.depth_camera), astuple(frame.color_camera), move)
        for frame, depth, color in recording.images(walk, 1, 9.0)
    ]
    fusion = DepthFusion(measured_points(frames, 4), 0.03, 0.12)
    for frame in frames:
        fusion.add(frame)
    return fusion.surface(0.3)


def test_a_r3d_file_is_read_as_what_it_unpacks_to(tmp_path: Path) -> None:
    walk = recording_formats.read(recordings.r3d(tmp_path / "walk.r3d", 4))
    folder = recording_formats.read(tmp_path / "walk")
    for (one, depth, color), (two, same, paint) in zip(
        recording.images(walk, 1, 9.0), recording.images(folder, 1, 9.0), strict=True
    ):
        assert np.array_equal(one.pose, two.pose) and np.array_equal(depth, same)
        assert color is not None and paint is not None and np.array_equal(color, paint)


@pytest.mark.slow
def test_colour_of_a_camera_of_its_own_falls_where_it_was_seen(tmp_path: Path) -> None:
    """Colour images 15 cm beside the depth camera: the border of the floor's red lies at the walls only if that is told."""
    folder, offset = recordings.seven_scenes(tmp_path / "walk", 36), 0.15
    for index, pose in enumerate(recordings.poses(36)):
        color = recordings.image(pose, 1, offset)[1]
        PIL.Image.fromarray(color).save(folder / f"frame-{index:06d}.color.png")
    camera = (recordings.FOCAL, recordings.FOCAL, recordings.WIDTH / 2, recordings.HEIGHT / 2, -offset, 0.0, 0.0)
    wrong = [spill(fused(recording_formats.read(folder, given))) for given in (None, camera)]
    assert wrong[1] < 0.02 and wrong[0] > 3 * wrong[1]


def spill(surface: Mesh) -> float:
    """Return the share of vertices off the floor's edge whose colour is that of the other side."""
    points, colors = surface.vertices, surface.colors
    assert colors is not None
    red = colors[:, 0].astype(int) - colors[:, 1] > 80
    low = points[:, 2] < 0.03
    wall = ~low & (points[:, 2] > 0.05) & (points[:, 2] < 0.3)
    edge = np.minimum(points, recordings.SIZE - points)[:, :2].min(axis=1)
    floor = low & (edge > 0.05) & (edge < 0.3)
    return float((red[wall].sum() + (~red[floor]).sum()) / (wall.sum() + floor.sum()))


def test_the_colour_camera_of_scannet_is_where_its_extrinsics_say(tmp_path: Path) -> None:
    folder = recordings.scannet(tmp_path / "walk", 3)
    beside = np.eye(4)
    beside[0, 3] = 0.04
    np.savetxt(folder / "intrinsic" / "extrinsic_depth.txt", np.eye(4))
    np.savetxt(folder / "intrinsic" / "extrinsic_color.txt", np.eye(4))
    assert recording_formats.read(folder).registered
    np.savetxt(folder / "intrinsic" / "extrinsic_color.txt", beside)
    assert recording_formats.read(folder).color_from_depth[:3, 3] == pytest.approx([-0.04, 0, 0])


def test_the_kinect_of_7_scenes_is_not_registered(tmp_path: Path) -> None:
    folder = tmp_path / "walk"
    folder.mkdir()
    for index in range(2):
        PIL.Image.fromarray(np.full((480, 640), 2000, np.uint16)).save(folder / f"frame-{index:06d}.depth.png")
        PIL.Image.fromarray(np.zeros((480, 640, 3), np.uint8)).save(folder / f"frame-{index:06d}.color.png")
        np.savetxt(folder / f"frame-{index:06d}.pose.txt", np.eye(4))
    walk = recording_formats.read(folder)
    assert not walk.registered and walk.frames[0].color_camera.fx == 525 and walk.frames[0].depth_camera.fx == 585
    assert recording_formats.read(folder, (585, 585, 320, 240, 0, 0, 0)).registered


def test_colour_that_is_registered_after_all_is_a_doubt(tmp_path: Path) -> None:
    folder = recordings.seven_scenes(tmp_path / "walk", 36)
    camera = (
        1.3 * recordings.FOCAL,
        1.3 * recordings.FOCAL,
        recordings.WIDTH / 2,
        recordings.HEIGHT / 2,
        0.0,
        0.1,
        0.0,
    )
    assert "color_camera=[120,120,80,60,0,0,0]" in (recording.check_color(recording_formats.read(folder, camera)) or "")
    for index, pose in enumerate(recordings.poses(36)):
        PIL.Image.fromarray(recordings.image(pose, 1, 0.3)[1]).save(folder / f"frame-{index:06d}.color.png")
    right = (recordings.FOCAL, recordings.FOCAL, recordings.WIDTH / 2, recordings.HEIGHT / 2, -0.3, 0.0, 0.0)
    assert recording.check_color(recording_formats.read(folder, right)) is None


def change_poses(folder: Path, change: Callable[[np.ndarray], np.ndarray]) -> None:
    for path in folder.glob("*.pose.txt"):
        np.savetxt(path, change(np.loadtxt(path)))


def scaled(pose: np.ndarray, scale: float) -> np.ndarray:
    moved = pose.copy()
    moved[:3, 3] *= scale
    return moved


WRONG: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str]] = {
    "opengl": (lambda pose: pose @ recordings.FLIP, "look along -z"),
    "inverse": (np.linalg.inv, "world to camera"),
    "millimetres": (lambda pose: scaled(pose, 1000.0), r"different units.*times 0\.001"),
    "turned": (lambda pose: pose @ np.array([[0, -1.0, 0, 0], [1, 0, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "turned by"),
}


@pytest.mark.parametrize("name", WRONG)
def test_frames_that_contradict_each_other_are_refused(tmp_path: Path, name: str) -> None:
    change, words = WRONG[name]
    folder = recordings.seven_scenes(tmp_path / "walk", 72)
    change_poses(folder, change)
    with pytest.raises(InputError, match=words) as error:
        recording.check(recording_formats.read(folder))
    assert "\n" not in str(error.value)


@pytest.mark.slow
def test_depth_in_another_unit_is_refused(tmp_path: Path) -> None:
    folder = recordings.seven_scenes(tmp_path / "walk", 72)
    for path in folder.glob("*.depth.png"):
        depth = np.asarray(PIL.Image.open(path)).astype(int) * 5
        PIL.Image.fromarray(depth.astype(np.uint16)).save(path)
    with pytest.raises(InputError, match=r"different units.*times (4\.|5)"):
        recording.check(recording_formats.read(folder))


def test_frames_that_do_not_overlap_are_a_doubt(tmp_path: Path) -> None:
    walk = recording_formats.read(recordings.seven_scenes(tmp_path / "walk", 3))
    assert "not checked" in (recording.check(walk) or "")


def test_depth_beyond_what_is_believed_is_none(tmp_path: Path) -> None:
    walk = recording_formats.read(recordings.seven_scenes(tmp_path / "walk", 2))
    _, depth, _ = next(recording.images(walk, 1, 1.5))
    assert depth.max() < 1.5 and (depth == 0).any()


def test_keyframes_are_sharp_and_spread(tmp_path: Path) -> None:
    walk = recording_formats.read(recordings.seven_scenes(tmp_path / "walk", 12))
    sharp = np.arange(12.0)
    sharp[5] = np.nan
    chosen = recording.keyframes(walk, sharp, spread=9.0, turn=45.0)
    assert 11 in chosen and 5 not in chosen and 4 <= len(chosen) <= 8
    recording.write_keyframes(tmp_path, walk, chosen, np.eye(4), sharp)
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
        (color_as_depth, "not a 16 bit depth"),
        (lose_all, "0 frames have a valid pose"),
    ],
)
def test_damage_is_one_line(tmp_path: Path, damage: Callable[[Path], None], word: str) -> None:
    folder = recordings.seven_scenes(tmp_path / "walk", 3)
    damage(folder)
    with pytest.raises(InputError, match=word) as error:
        list(recording.images(recording_formats.read(folder), 1, 9.0))
    assert "\n" not in str(error.value)


def test_an_unknown_folder_names_the_layouts(tmp_path: Path) -> None:
    assert not recording_formats.recognise(tmp_path)
    with pytest.raises(InputError, match=r"possible: .*7-Scenes.*ScanNet.*nerfstudio"):
        recording_formats.read(tmp_path)


def cut(name: str) -> Callable[[Path], None]:
    """Return what cuts a file of a recording short."""

    def damage(folder: Path) -> None:
        path = folder / name
        path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])

    return damage


def garble(folder: Path) -> None:
    path = folder / "odometry.csv"
    path.write_text(path.read_text().replace("000002", "two"))


def remove(name: str) -> Callable[[Path], None]:
    return lambda folder: (folder / name).unlink()


def replace(name: str, text: str) -> Callable[[Path], object]:
    return lambda folder: (folder / name).write_text(text)


def test_colour_images_of_two_sizes_go_with_their_own_cameras(tmp_path: Path) -> None:
    folder = recordings.nerfstudio(tmp_path / "walk", 4)
    data = json.loads((folder / "transforms.json").read_text())
    with PIL.Image.open(folder / "image_2.png") as picture:
        picture.resize((4 * recordings.WIDTH, 4 * recordings.HEIGHT)).save(folder / "image_2.png")
    keys = ("fl_x", "fl_y", "cx", "cy", "w", "h")
    data["frames"][2] |= {key: 4 * data[key] for key in keys}
    (folder / "transforms.json").write_text(json.dumps(data))
    assert len(recording_formats.read(folder).frames) == 4
    del data["frames"][2]["cx"]
    (folder / "transforms.json").write_text(json.dumps(data))
    with pytest.raises(InputError, match="depth_2.png: .*do not go with a depth camera"):
        recording_formats.read(folder)


LENS = "lowres_wide_intrinsics/41048190_3414.300.pincam"  # Of the third frame


@pytest.mark.parametrize(
    ("kind", "damage", "word"),
    [
        ("ARKitScenes", replace(LENS, "0 0 0 0 0 0"), "0 x 0 pixels"),
        ("ARKitScenes", replace(LENS, "256 192 0 nan 128 96"), "do not go with"),
        ("ARKitScenes", replace(LENS, ""), "expected 1 x 6"),
        ("ARKitScenes", cut("lowres_wide.traj"), "no table|expected 7"),
        ("ARKitScenes", remove("lowres_wide.traj"), "is missing"),
        ("ARKitScenes", remove("lowres_wide_intrinsics/41048190_3414.200.pincam"), "no camera of this time"),
        ("ARKitScenes", cut("lowres_depth/41048190_3414.300.png"), "damaged"),
        ("Stray Scanner", cut("rgb.mp4"), "damaged"),
        ("Stray Scanner", remove("rgb.mp4"), "is missing"),
        ("Stray Scanner", remove("depth/000001.png"), "1 of 4 depth images are missing"),
        ("Stray Scanner", cut("camera_matrix.csv"), "no matrix|numbers"),
        ("Stray Scanner", garble, "no table"),
        ("Polycam", cut("keyframes/cameras/9500000.json"), "no JSON"),
        ("Polycam", remove("keyframes/cameras/9500000.json"), "is missing"),
        ("Polycam", cut("keyframes/confidence/9500000.png"), "damaged"),
        ("Record3D", cut("metadata"), "no JSON"),
        ("Record3D", remove("rgbd/1.depth"), "numbers must be equal|is missing"),
        ("Record3D", cut("rgbd/1.conf"), "pyliblzfse|damaged|bytes"),
        ("nerfstudio", cut("transforms.json"), "no JSON"),
        ("nerfstudio", remove("depth_1.png"), "1 of 4 depth images are missing"),
        ("ScanNet", cut("intrinsic/intrinsic_depth.txt"), "numbers|no matrix"),
    ],
)
def test_damage_of_every_format_is_one_line(
    tmp_path: Path, kind: str, damage: Callable[[Path], object], word: str
) -> None:
    folder = WRITERS[kind](tmp_path / "walk", 4)
    damage(folder)
    with pytest.raises(InputError, match=word) as error:
        list(recording.images(recording_formats.read(folder), 1, 9.0))
    assert "\n" not in str(error.value)


def test_a_camera_of_another_size_is_refused(tmp_path: Path) -> None:
    folder = recordings.seven_scenes(tmp_path / "walk", 3)
    np.savetxt(folder / "camera-intrinsics.txt", [[1400, 0, 960], [0, 1400, 720], [0, 0, 1]])
    with pytest.raises(InputError, match="do not go with"):
        recording_formats.read(folder)


def test_distorted_images_are_refused(tmp_path: Path) -> None:
    folder = recordings.nerfstudio(tmp_path / "walk", 3)
    data = json.loads((folder / "transforms.json").read_text())
    (folder / "transforms.json").write_text(json.dumps({**data, "k1": 0.1}))
    with pytest.raises(InputError, match="undistort"):
        recording_formats.read(folder)


def test_exr_images_are_refused(tmp_path: Path) -> None:
    (tmp_path / "depth").mkdir()
    (tmp_path / "depth" / "0.exr").write_bytes(b"v/1")
    (tmp_path / "metadata.json").write_text("{}")
    with pytest.raises(InputError, match="EXR"):
        recording_formats.read(tmp_path)


def test_copied_keyframes_move_with_the_scan(tmp_path: Path) -> None:
    walk = recording_formats.read(recordings.stray(tmp_path / "walk", 6))
    for name in ("scan", "copy", "bare", "same"):
        (tmp_path / name).mkdir()
    to_scan = np.diag([2.0, 2.0, 2.0, 1.0])
    to_scan[:3, 3] = [1, 2, 3]
    recording.write_keyframes(tmp_path / "scan", walk, [1, 4], to_scan, np.ones(6))
    recording.copy_keyframes(tmp_path / "scan", tmp_path / "copy", np.array([0.5, 0.0, -1.0]))
    one, two = (orthophoto.read_keyframes(tmp_path / name) for name in ("scan", "copy"))
    for index, before, after in zip((1, 4), one, two, strict=True):
        pose = walk.frames[index].pose
        assert before.pose[:3, :3] == pytest.approx(pose[:3, :3]) and before.image.suffix == ".jpg"
        assert before.pose[:3, 3] == pytest.approx(2 * pose[:3, 3] + [1, 2, 3])
        assert after.pose - before.pose == pytest.approx(np.array([[0, 0, 0, 0.5], [0] * 4, [0, 0, 0, -1], [0] * 4]))
        truth = recordings.image(recordings.poses(6)[index], recordings.LARGE)[1]
        assert np.abs(np.asarray(PIL.Image.open(after.image)).astype(int) - truth).mean() < 5
    recording.copy_keyframes(tmp_path / "bare", tmp_path / "same")
    assert not list((tmp_path / "same").iterdir())
