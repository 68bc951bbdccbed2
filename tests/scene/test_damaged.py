"""What users see when a geometric stage is damaged, or cannot be written."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import pytest
from pxr import Gf, Sdf, Usd, UsdGeom
from usd_room import box, room

from s2a.core.errors import InputError
from s2a.scene.scene import Part, Scene
from s2a.scene.usd import geometric


def edited(tmp_path: Path, edit: str, by: str) -> Path:
    """Write the room as text and replace one piece of it."""
    path = tmp_path / "edited.usda"
    geometric.write(room(), path)
    text = path.read_text()
    assert edit in text
    path.write_text(text.replace(edit, by))
    return path


@pytest.mark.parametrize(
    ("edit", "by", "says"),
    [
        ('s2a:flavour = "geometric"', 's2a:flavour = "other"', "flavour is 'other'"),
        ('s2a:motion = "prismatic"', 's2a:motion = "screw"', "possible: fixed, free, prismatic, revolute"),
        (
            'def PhysicsPrismaticJoint "drawer_7"',
            'def PhysicsPrismaticJoint "gone"',
            "/scene/joints/drawer_7 is missing",
        ),
        ('def PhysicsPrismaticJoint "drawer_7"', 'def PhysicsSphericalJoint "drawer_7"', "PhysicsSphericalJoint"),
        ("double2 s2a:limits = (-0.01, 0.4)", "double2 s2a:other = (-0.01, 0.4)", "no s2a:limits"),
        ("double2 s2a:limits = (-0.01, 0.4)", "double2 s2a:limits = (0.5, 0.4)", "lower is above upper"),
        ("double3 s2a:axis = (-1, 0, 0)", "double3 s2a:axis = (-2, 0, 0)", "not of unit length"),
        ('s2a:parent = "drawer_7"', 's2a:parent = "drawer_70"', "drawer_70"),
        ("int s2a:order = 3", 'string s2a:order = "3"', "expected int"),
        ("metersPerUnit = 1", "metersPerUnit = 0.01", "metersPerUnit 0.01"),
        ('upAxis = "Z"', 'upAxis = "Y"', "upAxis Y"),
        ('defaultPrim = "scene"', 'defaultPrim = "world"', "default prim"),
        ("int[] faceVertexCounts = [3,", "int[] faceVertexCounts = [4,", "not triangles"),
        ("int[] faceVertexIndices = [1, 3, 0", "int[] faceVertexIndices = [1, 300, 0", "face indices"),
        ('def Mesh "visual"', 'def Mesh "other"', "no visual"),
        ("def Xform", "def Xf(orm", "damaged"),
    ],
)
def test_a_damaged_stage_is_told_of_in_one_line(tmp_path: Path, edit: str, by: str, says: str) -> None:
    path = edited(tmp_path, edit, by)
    with pytest.raises(InputError) as error:
        geometric.read(path)
    assert says in str(error.value)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    "rows",
    [
        [(2, 0, 0), (0, 2, 0), (0, 0, 2)],
        [(1, 0, 0), (0, 1.001, 0), (0, 0, 1)],
        [(1, 0, 0), (0.01, 1, 0), (0, 0, 1)],
        [(1, 0, 0), (0, -1, 0), (0, 0, 1)],
        [(1, 0, 0), (0, float("nan"), 0), (0, 0, 1)],
    ],
    ids=["larger", "stretched", "sheared", "mirrored", "not a number"],
)
@pytest.mark.parametrize("prim", ["/scene", "/scene/door_21"])
def test_a_body_whose_joint_cannot_follow_its_transform_is_refused(
    tmp_path: Path, rows: list[tuple[float, float, float]], prim: str
) -> None:
    path = tmp_path / "moved.usda"
    geometric.write(Scene("lone", {"door_21": replace(room().parts["door_21"], parent=None)}), path)
    stage = Usd.Stage.Open(str(path))
    matrix = Gf.Matrix4d(Gf.Matrix3d(*(x for row in rows for x in row)), Gf.Vec3d(0))
    UsdGeom.Xformable(stage.GetPrimAtPath(prim)).AddTransformOp().Set(matrix)
    stage.Save()
    with pytest.raises(InputError, match="/scene/door_21") as error:
        geometric.read(path)
    assert str(path) in str(error.value) and "\n" not in str(error.value)


def test_what_does_not_move_may_be_scaled(tmp_path: Path) -> None:
    path = tmp_path / "scaled.usda"
    geometric.write(room(), path)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Xformable(stage.GetPrimAtPath("/scene/wall_1")).AddScaleOp().Set(Gf.Vec3f(2.0))
    stage.Save()
    assert (geometric.read(path).part("wall_1").mesh.vertices == 2.0 * room().part("wall_1").mesh.vertices).all()


@pytest.mark.parametrize("prim", ["/scene/wall_1", "/scene/drawer_7"])
def test_a_part_that_an_editor_duplicated_is_refused_and_both_are_named(tmp_path: Path, prim: str) -> None:
    path = tmp_path / "twice.usda"
    geometric.write(room(), path)
    stage = Usd.Stage.Open(str(path))
    assert Sdf.CopySpec(stage.GetRootLayer(), prim, stage.GetRootLayer(), f"{prim}_copy")
    stage.Save()
    with pytest.raises(InputError) as error:
        geometric.read(path)
    assert all(word in str(error.value) for word in (str(path), f"{prim} ", f"{prim}_copy", "partId", "delete"))
    assert "\n" not in str(error.value)


def test_a_missing_or_truncated_file_is_told_of(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="no such file"):
        geometric.read(tmp_path / "none.usd")
    path = tmp_path / "cut.usd"
    geometric.write(room(), path)
    path.write_bytes(path.read_bytes()[:1000])
    with pytest.raises(InputError, match="damaged"):
        geometric.read(path)


@pytest.mark.parametrize("part_id", ["7_drawer", "a b", "joints", "door_20_anchor", ""])
def test_an_id_that_cannot_name_a_prim_is_refused(tmp_path: Path, part_id: str) -> None:
    parts = room().parts
    scene = Scene("x", {**parts, part_id: Part("x", parts["wall_1"].mesh)})
    with pytest.raises(InputError, match="cannot name a prim"):
        geometric.write(scene, tmp_path / "x.usd")
    assert not (tmp_path / "x.usd").exists()


@pytest.mark.parametrize("label", ["zero\0byte", "half \ud800 letter"])
def test_a_text_that_usd_cannot_store_is_refused(tmp_path: Path, label: str) -> None:
    with pytest.raises(InputError, match="label"):
        geometric.write(Scene("x", {"thing_1": Part(label, box((0, 0, 0), (1, 1, 1)))}), tmp_path / "x.usd")


def test_another_ending_or_a_missing_folder_is_refused(tmp_path: Path) -> None:
    for path, says in ((tmp_path / "x.obj", "ending"), (Path("/dev/null/x.usd"), "cannot be written")):
        with pytest.raises(InputError, match=says):
            geometric.write(room(), path)


@pytest.mark.parametrize("mass", ["nan", "inf", "-inf", "-5", "0", "-0", "1e30", "1e308"])
def test_a_mass_that_no_part_has_is_one_line(tmp_path: Path, mass: str) -> None:
    path = edited(
        tmp_path,
        'custom uniform string s2a:partId = "drawer_7"',
        f'''custom uniform double s2a:mass = {mass}
        custom uniform string s2a:partId = "drawer_7"''',
    )
    with pytest.raises(InputError, match="s2a:mass is .* kg; expected above 0") as error:
        geometric.read(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("far", ["1e30", "-1e30", "1e8", "3.4e38"])
def test_a_point_far_from_any_room_is_one_line(tmp_path: Path, far: str) -> None:
    path = edited(tmp_path, "point3f[] points = [(-2, ", f"point3f[] points = [({far}, ")
    with pytest.raises(InputError, match="m from the origin; expected up to") as error:
        geometric.read(path)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("origin", ["(1e30, 0, 0)", "(nan, 0, 0)", "(0, -inf, 0)"])
def test_a_joint_far_from_any_room_is_one_line(tmp_path: Path, origin: str) -> None:
    path = tmp_path / "edited.usda"
    geometric.write(room(), path)
    path.write_text(
        re.sub(r"double3 s2a:origin = \([^)]*\)(?=\s+.*\n?)", f"double3 s2a:origin = {origin}", path.read_text())
    )
    with pytest.raises(InputError) as error:
        geometric.read(path)
    assert "\n" not in str(error.value)
