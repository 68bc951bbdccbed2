from __future__ import annotations

import math
import re
from pathlib import Path

import numpy as np
import pytest
from pxr import Usd, UsdGeom
from usd_room import box, room

from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.upright_box import silhouette, upright_box
from s2a.scene.usd import descriptive
from s2a.scene.usd.stage import problems


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("descriptive") / "descriptive.usda"
    descriptive.write(room(), path)
    return path


@pytest.fixture
def stage(written: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(written))


def turned(mesh: Mesh, yaw: float) -> Mesh:
    """Turn a mesh about the vertical through zero."""
    c, s = math.cos(yaw), math.sin(yaw)
    return Mesh(mesh.vertices.astype(float) @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]).T, mesh.faces)


def own_text(path: Path, part_id: str) -> str:
    """Return the lines that describe a part, without those of what is inside it."""
    after = path.read_text().split(f'def Xform "{part_id}"')[1]
    return f'def Xform "{part_id}"' + re.split(r"def Xform|}", after)[0] + "}"


def test_all_validators_of_usd_pass(written: Path) -> None:
    assert problems(written) == []


def test_there_is_no_geometry(stage: Usd.Stage) -> None:
    assert {prim.GetTypeName() for prim in stage.Traverse()} == {"Xform"}
    assert not any(
        attribute.GetTypeName().isArray
        for prim in stage.Traverse()
        for attribute in prim.GetAttributes()
        if attribute.IsAuthored()
    )


def test_a_part_takes_400_characters_at_most_and_a_jointed_one_650(written: Path) -> None:
    assert len(written.read_text()) / len(room().parts) <= 400
    assert all(len(own_text(written, part_id)) <= 650 for part_id in room().movable)


def test_parts_nest_as_they_belong_together(stage: Usd.Stage) -> None:
    for part_id, part in room().parts.items():
        prim = stage.GetPrimAtPath(descriptive.prim_path(room(), part_id))
        assert prim.GetAttribute("s2a:label").Get() == part.label
        assert prim.GetParent().GetName() == (part.parent or "scene")


def test_joints_are_told_with_kind_axis_origin_limits_and_what_they_move_against(stage: Usd.Stage) -> None:
    flap = stage.GetPrimAtPath("/scene/cabinet_3/drawer_7/flap_10")
    values = {
        name: flap.GetAttribute(f"s2a:{name}").Get() for name in ("motion", "axis", "origin", "limits", "against")
    }
    assert values == {
        "motion": "revolute",
        "axis": (0.0001, -1.0, 0.0002),
        "origin": (1.26, 1.0, 0.55),
        "limits": (0.0, 1.571),
        "against": "drawer_7",
    }


def test_flags_are_written_only_where_they_are_true(stage: Usd.Stage) -> None:
    flagged = {
        name: {prim.GetName() for prim in stage.Traverse() if prim.GetAttribute(f"s2a:{name}").Get()}
        for name in ("movable", "graspable")
    }
    assert flagged["movable"] == {*room().movable, "cup_22"}
    assert flagged["graspable"] == {"handle_9", "flap_10"}


def test_a_box_goes_around_a_part_and_all_inside_it(stage: Usd.Stage) -> None:
    # Front 1.25 to 1.27, handle up to 1.305; front 0.4 to 0.6, flap up to 0.605.
    drawer = stage.GetPrimAtPath("/scene/cabinet_3/drawer_7")
    assert np.allclose(drawer.GetAttribute("s2a:size").Get(), (0.055, 0.4, 0.205), atol=1e-3)
    assert np.allclose(drawer.GetAttribute("s2a:center").Get(), (1.2775, 1.0, 0.5025), atol=1e-3)


@pytest.mark.parametrize("yaw", np.radians([-44.0, -20.0, 0.5, 10.0, 30.0]))
def test_the_box_of_a_turned_box_is_the_box(yaw: float) -> None:
    found = upright_box(turned(box((1.0, 2.0, 0.5), (0.6, 0.3, 1.0)), yaw).vertices)
    middle = turned(Mesh([[1.0, 2.0, 0.5]], np.zeros((0, 3))), yaw).vertices[0]
    assert found.yaw == pytest.approx(yaw, abs=1e-5) or abs(math.degrees(yaw)) < 1.0
    if found.yaw:
        assert np.allclose(found.size, (0.6, 0.3, 1.0), atol=1e-5)
    assert np.allclose(found.center, middle, atol=1e-5)


def test_the_box_of_a_silhouette_is_the_box_of_all_points() -> None:
    points = np.random.default_rng(3).normal(size=(5000, 3)) @ np.array(
        [[2.0, 1.0, 0.3], [0.1, 0.5, 0.2], [0, 0.1, 1.0]]
    )
    few = silhouette(points)
    assert len(few) < 100
    assert upright_box(few) == upright_box(points)


def test_round_things_are_not_turned() -> None:
    angles = np.linspace(0.0, 2.0 * math.pi, 200)
    ring = np.stack([np.cos(angles), np.sin(angles), angles], axis=1)
    assert upright_box(ring).yaw == 0.0


@pytest.mark.parametrize("points", [[[1, 2, 3]], [[0, 0, 0], [1, 1, 0]], [[0, 0, 0], [1, 1, 0], [2, 2, 5]]])
def test_points_on_a_line_have_an_upright_box(points: list[list[float]]) -> None:
    found = upright_box(np.array(points, dtype=np.float32))
    assert np.allclose(found.size, np.ptp(points, axis=0), atol=1e-6)


def test_a_part_without_surface_has_no_box(stage: Usd.Stage) -> None:
    assert not stage.GetPrimAtPath("/scene/書_24").GetAttribute("s2a:size").IsAuthored()


def test_numbers_are_rounded_to_the_millimetre(tmp_path: Path) -> None:
    scene = Scene("x", {"thing_1": Part("thing", box((1 / 3, 2 / 3, 1 / 7), (0.1, 0.1, 0.1)))})
    descriptive.write(scene, tmp_path / "x.usda")
    assert "(0.333, 0.667, 0.143)" in (tmp_path / "x.usda").read_text()


def test_a_viewer_finds_metres_and_z_up(stage: Usd.Stage) -> None:
    assert UsdGeom.GetStageMetersPerUnit(stage) == 1.0
    assert UsdGeom.GetStageUpAxis(stage) == "Z"


def test_objects_say_what_carries_holds_and_touches_them(tmp_path: Path) -> None:
    def part(label: str, low: tuple[float, float, float], size: tuple[float, float, float]) -> Part:
        mesh = box(tuple(np.add(low, np.array(size) / 2)), size)
        return Part(label, mesh)

    sides = [
        ((0.0, 0.0), (0.3, 0.01)),
        ((0.0, 0.29), (0.3, 0.01)),
        ((0.0, 0.0), (0.01, 0.3)),
        ((0.29, 0.0), (0.01, 0.3)),
    ]
    tray = merge([
        box((0.65, 0.25, 0.755), (0.3, 0.3, 0.01)),
        *(box((0.5 + x + wide[0] / 2, 0.1 + y + wide[1] / 2, 0.81), (*wide, 0.1)) for (x, y), wide in sides),
    ])  # fmt: skip
    parts = {
        "floor_1": part("floor", (-2, -2, -0.02), (4, 4, 0.02)),
        "wall_2": part("wall", (-2, 0.82, 0), (4, 0.05, 2.4)),
        "desk_3": part("desk", (-0.2, 0.0, 0.0), (1.4, 0.8, 0.75)),
        "tray_4": Part("tray", tray),
        "mug_5": part("mug", (0.6, 0.2, 0.762), (0.08, 0.08, 0.1)),
        "lamp_6": part("lamp", (0.3, 0.3, 0.751), (0.1, 0.1, 0.4)),
        "clock_7": part("clock", (1.5, 0.8, 1.5), (0.2, 0.02, 0.2)),
    }
    descriptive.write(Scene("room", parts), tmp_path / "d.usda")
    said = descriptive.read(tmp_path / "d.usda")
    assert [said[i].on for i in ("desk_3", "tray_4", "mug_5", "lamp_6", "clock_7")] == [
        "floor_1",
        "desk_3",
        "tray_4",
        "desk_3",
        None,
    ]
    assert [i for i, one in said.items() if one.inside] == ["mug_5"]
    assert said["desk_3"].touches == said["clock_7"].touches == ("wall_2",)
    assert said["lamp_6"].beside == ("tray_4",)
    assert said["mug_5"].touches == ()


def test_small_things_in_a_large_shelf_and_at_a_large_wall_are_related_to_it() -> None:
    boards = merge([box((2.0, 1.0, z), (4.0, 2.0, 0.02)) for z in (0.5, 1.0)])
    parts = {
        "shelf_1": Part("shelf", boards),
        "cube_2": Part("cube", box((0.04, 0.04, 0.535), (0.05, 0.05, 0.05))),  # in a corner: no board all around it
        "cube_3": Part("cube", box((0.04, 0.04, 1.035), (0.05, 0.05, 0.05))),
        "wall_4": Part("wall", box((2.0, 2.06, 1.5), (12.0, 0.1, 3.0))),
        "cube_5": Part("cube", box((1.0, 1.97, 1.035), (0.05, 0.05, 0.05))),
        "cube_6": Part("cube", box((1.0, 1.8, 1.035), (0.05, 0.05, 0.05))),
    }
    related = descriptive.relations(Scene("room", parts))
    assert {i: one.inside for i, one in related.items() if one.on == "shelf_1"} == {
        "cube_2": "shelf_1",
        "cube_3": None,
        "cube_5": None,
        "cube_6": None,
    }
    assert [i for i, one in related.items() if i != "shelf_1" and one.touches] == ["cube_5"]


def test_a_front_touches_the_furniture_around_it_and_no_neighbour() -> None:
    """A wall cabinet's door above a refrigerator, whose goods rise in front of its lowest tenth."""
    hinge = Joint("revolute", (0.0, 0.0, 1.0), (0.0, 0.2, 2.0), (0.0, 1.5))
    parts = {
        "door_1": Part("door", box((0.0, 0.0, 2.0), (0.02, 0.4, 0.5)), motion=hinge),
        "cabinet_2": Part("cabinet", merge([box((0.05, y, 2.0), (0.1, 0.02, 0.56)) for y in (-0.22, 0.22)])),
        "refrigerator_3": Part("refrigerator", box((0.3, 0.0, 0.9), (0.58, 0.8, 1.8))),
    }
    related = descriptive.relations(Scene("room", parts))
    assert related["door_1"].touches == ("cabinet_2",)
