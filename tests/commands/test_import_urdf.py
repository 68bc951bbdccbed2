"""`s2a import scan=... predictions=object.urdf box=...`: the links of one object become parts of the scan where it stands."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import trimesh
from trimesh.transformations import rotation_matrix

from s2a.commands import cli
from s2a.scan import urdf_object

CENTER, SIZE, YAW = np.array([2.0, 1.0, 0.45]), np.array([0.6, 0.8, 0.9]), math.pi / 2
BOX = f"box=[{','.join(f'{x:g}' for x in (*CENTER, *SIZE))},{YAW:.6f}]"
URDF = """<robot name="cabinet">
  <link name="body"><visual><origin xyz="-0.05 0 0.5"/><geometry><box size="0.9 1 1"/></geometry></visual></link>
  <link name="drawer"><visual><origin xyz="0.025 0 0"/><geometry><box size="0.05 1 0.5"/></geometry></visual></link>
  <link name="handle"><visual><geometry><box size="0.1 0.2 0.05"/></geometry></visual></link>
  <link name="door"><visual><origin xyz="0.025 0.5 0.25"/><geometry><box size="0.05 1 0.5"/></geometry></visual></link>
  <joint name="slide" type="prismatic"><parent link="body"/><child link="drawer"/><origin xyz="0.4 0 0.75"/>
    <axis xyz="1 0 0"/><limit lower="0" upper="0.5"/></joint>
  <joint name="grip" type="fixed"><parent link="drawer"/><child link="handle"/><origin xyz="0.1 0 0"/></joint>
  <joint name="hinge" type="revolute"><parent link="body"/><child link="door"/><origin xyz="0.4 -0.5 0"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="1.2"/></joint>
</robot>"""


@pytest.fixture
def scan(tmp_path: Path) -> Path:
    """Write a scan: the cabinet, 0.6 m deep, turned by a quarter, and another box a metre away."""
    solids = [((-0.05, 0, 0), (0.9, 1, 1)), ((0.425, 0, 0.25), (0.05, 1, 0.5)), ((0.5, 0, 0.25), (0.1, 0.2, 0.05))]
    solids.append(((0.425, 0, -0.25), (0.05, 1, 0.5)))
    scale = SIZE / (1.05, 1.0, 1.0)  # from -0.5 to 0.55 m
    pieces = []
    for center, size in solids:
        piece = trimesh.creation.box(size).subdivide().subdivide().subdivide().subdivide()
        piece.apply_translation(np.array(center) - (0.025, 0.0, 0.0))
        piece.vertices *= scale
        piece.apply_transform(rotation_matrix(YAW, (0, 0, 1)))
        piece.apply_translation(CENTER)
        pieces.append(piece)
    pieces.append(trimesh.creation.box((0.5, 0.5, 0.5)).apply_translation((0.0, 0.0, 0.25)))
    (tmp_path / "scan").mkdir()
    trimesh.util.concatenate(pieces).export(tmp_path / "scan/mesh_aligned_0.05.ply")
    return tmp_path / "scan"


def imported(scan: Path, urdf: str, *keys: str) -> int:
    file = scan.parent / "object.urdf"
    file.write_text(urdf)
    return cli.main(["import", f"scan={scan}", f"predictions={file}", f"out={scan.parent / 'out'}", *(keys or (BOX,))])


def written(scan: Path, kind: str, key: str) -> list[dict]:
    (path,) = (scan.parent / "out").glob(f"*_{kind}.json")
    return json.loads(path.read_text())["data"][key]


def test_links_become_parts_where_the_object_stands(scan: Path) -> None:
    assert imported(scan, URDF) == 0
    slide, hinge = sorted(written(scan, "artic", "articulations"), key=lambda each: each["type"], reverse=True)
    assert (slide["type"], hinge["type"]) == ("translation", "rotation")
    np.testing.assert_allclose(slide["axis"], (0, 1, 0), atol=1e-5)  # x of the object, turned by a quarter
    assert slide["rangeMax"] == pytest.approx(0.5 * 0.6 / 1.05, rel=1e-5) and hinge["rangeMax"] == 1.2
    np.testing.assert_allclose(hinge["axis"], (0, 0, 1), atol=1e-5)
    # The hinge: 0.375 of 1.05 ahead of the middle, at the side y = -0.5 of the object.
    np.testing.assert_allclose(hinge["origin"], (2.0 + 0.4, 1.0 + 0.375 * 0.6 / 1.05, 0.0), atol=1e-5)
    mesh = trimesh.load(scan / "mesh_aligned_0.05.ply", process=False)
    parts = {
        each["label"].partition(".")[0]: np.array(each["triIndices"]) for each in written(scan, "parts", "annotations")
    }
    assert set(parts) == {"drawer", "door", "handle"}
    assert mesh.triangles_center[parts["drawer"]][:, 2].min() > 0.43
    assert mesh.triangles_center[parts["door"]][:, 2].max() < 0.47
    assert mesh.triangles_center[parts["handle"]][:, 1].max() > 1.0 + 0.29  # it stands out farthest
    every = np.concatenate(list(parts.values()))
    assert len(np.unique(every)) == len(every)
    assert np.linalg.norm(mesh.triangles_center[every] - CENTER, axis=1).max() < np.linalg.norm(SIZE)


@pytest.mark.parametrize("turned", range(4))
def test_a_part_of_the_scan_gives_the_box_and_the_quarter_turn(
    turned: int, scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whichever way the scan is turned, the drawer slides to where the scanned handle stands out."""
    file = scan / "mesh_aligned_0.05.ply"
    mesh = trimesh.load(file, process=False)
    mesh.apply_transform(rotation_matrix(turned * math.pi / 2, (0, 0, 1)))
    mesh.export(file)
    last = len(mesh.vertices) - 8  # the other box
    (scan / "segments.json").write_text(json.dumps({"segIndices": list(range(len(mesh.vertices)))}))
    group = {"id": 1, "objectId": 1, "label": "cabinet", "segments": list(range(last))}
    (scan / "segments_anno.json").write_text(json.dumps({"segGroups": [group]}))
    assert imported(scan, URDF, "object=cabinet_1") == 0
    assert "in the box of cabinet_1, [" in capsys.readouterr().out
    (slide,) = (each for each in written(scan, "artic", "articulations") if each["type"] == "translation")
    along = rotation_matrix(turned * math.pi / 2, (0, 0, 1))[:3, :3] @ (0, 1, 0)
    np.testing.assert_allclose(slide["axis"], along, atol=1e-5)
    assert slide["rangeMax"] == pytest.approx(0.5 * 0.6 / 1.05, rel=1e-4)
    assert imported(scan, URDF, "object=cabinet_2") == 2
    assert "'cabinet_2' is not in scene 'scan'; did you mean: cabinet_1" in capsys.readouterr().err


def test_a_mesh_beside_the_urdf_is_read(scan: Path) -> None:
    trimesh.creation.box((0.05, 1.0, 0.5)).export(scan.parent / "front.obj")
    urdf = URDF.replace('<box size="0.05 1 0.5"/>', '<mesh filename="package://front.obj"/>')
    assert imported(scan, urdf) == 0 and len(written(scan, "artic", "articulations")) == 2


def test_a_link_whose_surface_has_no_area_gets_no_face_of_another(scan: Path) -> None:
    assert imported(scan, URDF.replace('<box size="0.9 1 1"/>', '<box size="0 0 0"/>')) == 0
    assert len(written(scan, "artic", "articulations")) == 2


BOMB = '<!DOCTYPE r [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;">]>' + URDF
LOOP = URDF.replace('<parent link="body"/><child link="drawer"/>', '<parent link="handle"/><child link="drawer"/>')


@pytest.mark.parametrize(
    ("urdf", "problem"),
    [
        (URDF.replace("prismatic", "fixed").replace("revolute", "fixed"), "no joint moves"),
        (URDF.replace("prismatic", "floating"), "'floating'; possible"),
        (BOMB, "entities"),
        (LOOP, "in a loop"),
        (URDF.replace('<child link="handle"/>', '<child link="door"/>'), "no tree"),
        (URDF.replace('<child link="handle"/>', '<child link="knob"/>'), "'knob', which does not exist"),
        (URDF.replace('<box size="0.05 1 0.5"/>', '<mesh filename="none.obj"/>'), "none.obj' does not exist"),
        (
            URDF.replace('<box size="0.05 1 0.5"/>', '<mesh filename="../../etc/a.obj"/>'),
            "outside of the URDF's folder",
        ),
        (URDF.replace('size="0.9 1 1"', 'size="0.9 nan 1"'), "3 finite numbers"),
        (URDF.replace('size="0.9 1 1"', 'size="0.9 1e200 1"'), "up to 1e+06"),
        (URDF.replace('xyz="1 0 0"', 'xyz="0 0 0"'), "axis of length 0"),
        (URDF.replace('lower="0" upper="0.5"', 'lower="1" upper="0.5"'), "swap them"),
        (URDF[:400], "not XML"),
        ("<sdf/>", "expected <robot>"),
        ("", "not XML"),
    ],
)
def test_a_damaged_urdf_is_one_line(urdf: str, problem: str, scan: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    assert imported(scan, urdf) == 2
    error = capsys.readouterr().err
    assert problem in error and error.count("\n") == 1 and "bug" not in error and not (scan.parent / "out").exists()


def test_a_huge_urdf_is_not_read(
    scan: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(urdf_object, "MAX_BYTES", 100)
    assert imported(scan, URDF) == 2 and "no URDF of one object" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("keys", "problem"),
    [
        (("min_score=0.5",), "needs box="),
        (("box=[0,0,0,1,0,1,0]",), "extents above 0"),
        ((BOX, "object=cabinet_1"), "both given"),
        (("box=[9,9,9,1,1,1,0]",), "no face of the scan lies near"),
    ],
)
def test_a_box_that_serves_not_is_one_line(
    keys: tuple[str, ...], problem: str, scan: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert imported(scan, URDF, *keys) == 2
    error = capsys.readouterr().err
    assert problem in error and error.count("\n") == 1
