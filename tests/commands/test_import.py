"""`s2a import mesh=...`: every format gives the same scan, faces keep their order, bad files are one line."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import textured_room
import trimesh
from PIL import Image

from s2a.commands import cli
from s2a.scan import ply


def imported(tmp_path: Path, mesh: Path, *more: str) -> ply.ScanMesh:
    assert cli.main(["import", f"mesh={mesh}", f"out={tmp_path / 'scan'}", *more]) == 0
    return ply.read(tmp_path / "scan" / "mesh_aligned_0.05.ply")


def refused(capsys: pytest.CaptureFixture[str], tmp_path: Path, mesh: Path, *words: str) -> None:
    assert cli.main(["import", f"mesh={mesh}", f"out={tmp_path / 'scan'}"]) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1 and all(word in message for word in words), message
    assert not (tmp_path / "scan").exists()


WRITERS: dict[str, Callable[[Path], Path]] = {
    "room.glb": textured_room.glb,
    "room.obj": lambda path: textured_room.obj(path, scale=100),
    "room.usdz": textured_room.usdz,
    "z_up.usdz": lambda path: textured_room.usdz(path, unit=0.001, up="Z"),
}


@pytest.mark.parametrize("name", WRITERS)
def test_every_format_gives_the_same_surface_in_the_same_order(tmp_path: Path, name: str) -> None:
    scan = imported(tmp_path, WRITERS[name](tmp_path / name), "texel=9")
    vertices, faces = textured_room.room()
    assert len(scan.vertices) == len(vertices)  # three vertices a face have become one a position
    assert np.abs(scan.vertices[scan.faces] - vertices[faces]).max() < 1e-4
    assert not (tmp_path / "scan" / "source_faces.npy").exists()


@pytest.mark.parametrize("name", WRITERS)
def test_a_texture_becomes_colours_and_split_faces_keep_their_source(tmp_path: Path, name: str) -> None:
    scan = imported(tmp_path, WRITERS[name](tmp_path / name), "texel=0.1")
    vertices, faces = textured_room.room()
    source = np.load(tmp_path / "scan" / "source_faces.npy")
    assert (np.diff(source) >= 0).all() and set(source) == set(range(len(faces)))
    areas = np.linalg.norm(np.cross(*np.diff(scan.vertices[scan.faces], axis=1).swapaxes(0, 1)), axis=1) / 2
    whole = np.linalg.norm(np.cross(*np.diff(vertices[faces], axis=1).swapaxes(0, 1)), axis=1) / 2
    assert np.bincount(source, areas) == pytest.approx(whole, abs=1e-5)
    x = scan.vertices[:, 0]
    assert scan.colors is not None
    assert (scan.colors[(x > 0.15) & (x < 1.9), 2] > 250).all() and (
        scan.colors[(x < -0.15) & (x > -1.9), 0] > 250
    ).all()


def test_split_faces_leave_no_gaps(tmp_path: Path) -> None:
    scan = imported(tmp_path, textured_room.glb(tmp_path / "room.glb"), "texel=0.07")
    edges = np.sort(np.concatenate([scan.faces[:, pair] for pair in ((0, 1), (1, 2), (2, 0))]), axis=1)
    assert (np.unique(edges, axis=0, return_counts=True)[1] == 2).all()  # the room and the table are closed


def test_the_record_maps_the_file_to_the_scan(tmp_path: Path) -> None:
    vertices, faces = textured_room.room()
    moved = trimesh.Trimesh(100 * textured_room.y_up(vertices) + [0, 40, 0], faces, process=False)
    moved.export(tmp_path / "room.ply")
    scan = imported(tmp_path, tmp_path / "room.ply")
    record = json.loads((tmp_path / "scan" / "import.json").read_text())
    matrix = np.array(record["matrix"])
    assert (record["up"], record["metres_per_unit"]) == ("y", 0.01)
    assert moved.vertices[faces] @ matrix[:3, :3].T + matrix[:3, 3] == pytest.approx(
        scan.vertices[scan.faces], abs=1e-5
    )
    assert scan.vertices[:, 2].min() == pytest.approx(0, abs=1e-5)


@pytest.mark.parametrize("up", ["x", "y", "z", "-x", "-y", "-z"])
def test_the_floor_tells_what_is_up(tmp_path: Path, up: str) -> None:
    vertices, faces = textured_room.room()
    axis = "xyz".index(up[-1])
    order = [(2 - axis + k) % 3 for k in range(3)]  # a cyclic change of axes is a rotation
    turned = vertices[:, order]
    if up[0] == "-":
        turned = turned * np.where(np.arange(3) == (axis + 2) % 3, 1, -1)
    trimesh.Trimesh(turned, faces, process=False).export(tmp_path / "room.ply")
    scan = imported(tmp_path, tmp_path / "room.ply")
    assert json.loads((tmp_path / "scan" / "import.json").read_text())["up"] == up
    assert np.ptp(scan.vertices, axis=0)[2] == pytest.approx(2.5)
    area = np.linalg.det(scan.vertices[scan.faces]).sum()
    assert area == pytest.approx(np.linalg.det(vertices[faces]).sum(), rel=1e-4)  # no mirror image


def test_a_stated_unit_that_cannot_be_is_refused_and_one_given_is_taken(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = textured_room.glb(tmp_path / "room.glb", scale=100)
    refused(capsys, tmp_path, path, "250 m high", "give unit=cm")
    assert np.ptp(imported(tmp_path, path, "unit=cm").vertices, axis=0) == pytest.approx(textured_room.SIZE, abs=1e-3)


def test_a_box_alone_has_no_up_axis(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    trimesh.creation.box((2, 2, 2)).export(tmp_path / "box.ply")
    refused(capsys, tmp_path, tmp_path / "box.ply", "up axis cannot be determined", "give up=y or up=z")


@pytest.mark.parametrize("part", [{"texture": False}, {"library": False}])
def test_a_missing_texture_or_library_is_a_warning_and_grey(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], part: dict[str, bool]
) -> None:
    scan = imported(tmp_path, textured_room.obj(tmp_path / "room.obj", **part))
    assert "missing" in capsys.readouterr().err
    assert scan.colors is not None and (scan.colors == 170).all()


def draco(path: Path) -> None:
    header = json.dumps({"asset": {"version": "2.0"}, "extensionsRequired": ["KHR_draco_mesh_compression"]}).encode()
    header += b" " * (-len(header) % 4)
    path.write_bytes(struct.pack("<4sIIII", b"glTF", 2, 20 + len(header), len(header), 0x4E4F534A) + header)


def truncated(path: Path) -> None:
    data = textured_room.glb(path).read_bytes()
    path.write_bytes(data[: len(data) // 2])


def nan(path: Path) -> None:
    path.write_text("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n")


def one_point(path: Path) -> None:
    path.write_text("v 1 1 1\nv 1 1 1\nv 1 1 1\nf 1 2 3\n")


DAMAGED: dict[str, tuple[Callable[[Path], object], str]] = {
    "draco.glb": (draco, "compressed with Draco"),
    "half.glb": (truncated, "truncated"),
    "empty.glb": (Path.touch, "is empty"),
    "empty.usdz": (lambda path: path.write_bytes(b"x"), "not a USD file"),
    "noise.glb": (lambda path: path.write_bytes(b"no GLB at all, only text"), "not a GLB file"),
    "noise.gltf": (lambda path: path.write_text("{"), "no glTF"),
    "noise.ply": (lambda path: path.write_text("ply\nrubbish"), "damaged"),
    "points.ply": (lambda path: trimesh.PointCloud(np.eye(3)).export(path), "holds no faces"),
    "points.obj": (lambda path: path.write_text("v 0 0 0\n"), "holds no faces"),
    "beyond.obj": (lambda path: path.write_text("v 0 0 0\nf 1 2 3\n"), "line 2"),
    "nan.obj": (nan, "not finite"),
    "point.obj": (one_point, "in one point"),
    "room.fbx": (Path.touch, "possible: .glb"),
}


@pytest.mark.parametrize("name", DAMAGED)
def test_bad_files_are_one_line(tmp_path: Path, capsys: pytest.CaptureFixture[str], name: str) -> None:
    write, word = DAMAGED[name]
    write(tmp_path / name)
    refused(capsys, tmp_path, tmp_path / name, word)


def test_degenerate_faces_keep_their_numbers_and_far_rooms_come_near(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vertices, faces = textured_room.room()
    vertices = vertices + [4.5e5, 5.4e6, 0]
    lines = (
        [f"v {x} {y} {z}" for x, y, z in vertices] + ["f 1 1 2"] + ["f {} {} {}".format(*face) for face in faces + 1]
    )
    (tmp_path / "far.obj").write_text("\n".join(lines))
    scan = imported(tmp_path, tmp_path / "far.obj", "up=z")
    assert "1 faces have no area" in capsys.readouterr().err
    assert len(scan.faces) == 1 + len(faces) and np.abs(scan.vertices).max() < 5
    assert np.ptp(scan.vertices, axis=0) == pytest.approx(textured_room.SIZE, abs=1e-3)


def test_export_reads_what_import_wrote(tmp_path: Path) -> None:
    imported(tmp_path, textured_room.glb(tmp_path / "room.glb"))
    assert cli.main(["export", f"scan={tmp_path / 'scan'}", f"out={tmp_path / 'usd'}"]) == 0


def test_a_foreign_folder_is_kept(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "scan").mkdir()
    (tmp_path / "scan" / "thesis.tex").touch()
    assert cli.main(["import", f"mesh={textured_room.glb(tmp_path / 'room.glb')}", f"out={tmp_path / 'scan'}"]) == 2
    assert (tmp_path / "scan" / "thesis.tex").exists()


def test_keys_that_do_not_go_together_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["import", f"scan={tmp_path}", f"out={tmp_path / 'out'}"]) == 2
    assert "give mesh=FILE" in capsys.readouterr().err


@pytest.mark.slow
def test_an_image_shows_the_room_and_its_axes(tmp_path: Path) -> None:
    imported(tmp_path, textured_room.glb(tmp_path / "room.glb"), f"image={tmp_path / 'room.png'}")
    with Image.open(tmp_path / "room.png") as image:
        pixels = np.asarray(image).astype(int)
    for channel in range(3):  # x red, y green, z blue
        others = [other for other in range(3) if other != channel]
        assert (pixels[..., channel] - pixels[..., others].max(axis=-1) > 80).sum() > 500


def test_a_vector_says_what_is_up_and_the_line_says_what_was_done(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vertices, faces = textured_room.room()
    tilt = trimesh.transformations.rotation_matrix(np.radians(127), (1, 0, 0))[:3, :3]
    trimesh.Trimesh(vertices @ tilt.T, faces, process=False).export(tmp_path / "room.obj")
    scan = imported(tmp_path, tmp_path / "room.obj", "up=[0,-0.8,-0.6]")
    assert "up: (0.00, -0.80, -0.60), levelled by 36.9 deg; as given; unit m" in capsys.readouterr().out
    assert scan.vertices[:, 2].min() == pytest.approx(0, abs=0.01)
    assert np.ptp(scan.vertices, axis=0)[2] == pytest.approx(2.5, abs=0.01)
