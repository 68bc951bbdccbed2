from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest
from pxr import Gf, Sdf, Usd, UsdGeom, UsdPhysics
from usd_room import DIRTY, box, room, unit

from s2a.scene.articulation import displace
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import geometric, joints
from s2a.scene.usd.stage import problems


@pytest.fixture(scope="module", params=["geometric.usd", "geometric.usda"])
def written(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("geometric") / request.param
    geometric.write(room(), path)
    return path


@pytest.fixture
def stage(written: Path) -> Usd.Stage:
    return Usd.Stage.Open(str(written))


def one_part(part: Part, name: str = "x") -> Scene:
    return Scene(name, {"thing_1": part})


def test_reading_gives_back_the_scene_exactly(written: Path) -> None:
    assert geometric.read(written) == room()


def test_parts_come_back_in_their_order(written: Path) -> None:
    assert list(geometric.read(written).parts) == list(room().parts)


def test_every_colour_survives(tmp_path: Path) -> None:
    levels = np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    scene = one_part(Part("ramp", Mesh(np.random.default_rng(0).normal(size=(256, 3)), [[0, 1, 2]], levels)))
    geometric.write(scene, tmp_path / "ramp.usda")
    assert geometric.read(tmp_path / "ramp.usda") == scene


def test_random_joints_come_back_to_the_last_bit(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    parts = {
        f"part_{i}": Part(
            "part",
            box((0, 0, 0), (1, 1, 1)),
            motion=Joint(
                ("prismatic", "revolute")[i % 2], unit(*rng.normal(size=3)), tuple(rng.normal(size=3)), (0, 1)
            ),
        )
        for i in range(100)
    }
    geometric.write(Scene("random", parts), tmp_path / "random.usda")
    assert geometric.read(tmp_path / "random.usda").parts == parts


def test_all_validators_of_usd_pass(written: Path) -> None:
    assert problems(written) == []


def test_validators_find_nested_gprims(tmp_path: Path) -> None:
    path = tmp_path / "nested.usda"
    geometric.write(room(), path)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Cube.Define(stage, "/scene/wall_1/cube")
    stage.Save()
    assert any("EncapsulationChecker" in problem for problem in problems(path))


def test_no_body_lies_below_another_and_none_holds_nested_gprims(stage: Usd.Stage) -> None:
    for prim in stage.Traverse():
        above = [prim.GetParent()]
        while above[-1].GetPath() != "/":
            above.append(above[-1].GetParent())
        if prim.HasAPI(UsdPhysics.RigidBodyAPI):
            assert prim.GetParent().GetPath() == "/scene"
        if prim.IsA(UsdGeom.Gprim):
            assert not any(ancestor.IsA(UsdGeom.Gprim) for ancestor in above)


def test_only_jointed_parts_their_cabinets_and_free_things_are_bodies(stage: Usd.Stage) -> None:
    bodies = {prim.GetName() for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.RigidBodyAPI)}
    assert bodies == {"cabinet_3", "drawer_7", "flap_10", "door_20", "door_20_anchor", "door_21", "cup_22"}


def test_a_chain_of_handles_belongs_to_the_body_that_moves_it(stage: Usd.Stage) -> None:
    handle = stage.GetPrimAtPath("/scene/drawer_7/handle_9")
    assert handle.IsA(UsdGeom.Mesh)
    assert handle.GetAttribute("s2a:parent").Get() == "handle_base_8"
    assert stage.GetPrimAtPath("/scene/drawer_7/handle_base_8").GetAttribute("s2a:parent").Get() == "drawer_7"


def test_a_jointed_part_in_a_jointed_part_moves_against_it(stage: Usd.Stage) -> None:
    joint = UsdPhysics.Joint(stage.GetPrimAtPath("/scene/joints/flap_10"))
    assert joint.GetBody0Rel().GetTargets() == ["/scene/drawer_7"]
    assert joint.GetBody1Rel().GetTargets() == ["/scene/flap_10"]


def test_a_jointed_part_without_parent_moves_against_an_anchor_fixed_to_the_world(stage: Usd.Stage) -> None:
    hinge = UsdPhysics.Joint(stage.GetPrimAtPath("/scene/joints/door_20"))
    assert hinge.GetBody0Rel().GetTargets() == ["/scene/door_20_anchor"]
    weld = UsdPhysics.FixedJoint(stage.GetPrimAtPath("/scene/joints/door_20_anchor"))
    assert weld.GetBody0Rel().GetTargets() == ["/scene"]  # no body, so a place: where the room is put
    assert weld.GetBody1Rel().GetTargets() == ["/scene/door_20_anchor"]


def test_every_joint_is_whole_where_another_stage_puts_the_room(stage: Usd.Stage) -> None:
    house = Usd.Stage.CreateInMemory()
    room = UsdGeom.Xform.Define(house, "/house/room")
    room.AddTranslateOp().Set((10, 0, 0))
    room.GetPrim().GetReferences().AddReference(stage.GetRootLayer().identifier)
    places, joints = UsdGeom.XformCache(), [UsdPhysics.Joint(p) for p in house.Traverse() if p.IsA(UsdPhysics.Joint)]
    assert joints
    for joint in joints:
        ends = []
        for body, point in (
            (joint.GetBody0Rel(), joint.GetLocalPos0Attr()),
            (joint.GetBody1Rel(), joint.GetLocalPos1Attr()),
        ):
            (path,) = body.GetTargets()
            ends.append(places.GetLocalToWorldTransform(house.GetPrimAtPath(path)).Transform(Gf.Vec3d(point.Get())))
        assert (ends[0] - ends[1]).GetLength() < 1e-5 and ends[0][0] > 5


def test_articulations_start_at_what_is_fixed_to_the_world(stage: Usd.Stage) -> None:
    roots = {prim.GetName() for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.ArticulationRootAPI)}
    assert {"cabinet_3", "door_20_anchor"} <= roots
    assert roots.isdisjoint({"drawer_7", "flap_10", "door_20", "door_21"})


def test_physics_limits_are_degrees_for_hinges_and_metres_for_slides(stage: Usd.Stage) -> None:
    hinge = UsdPhysics.RevoluteJoint(stage.GetPrimAtPath("/scene/joints/flap_10"))
    slide = UsdPhysics.PrismaticJoint(stage.GetPrimAtPath("/scene/joints/drawer_7"))
    assert (hinge.GetLowerLimitAttr().Get(), hinge.GetUpperLimitAttr().Get()) == (0.0, 90.0)
    assert slide.GetUpperLimitAttr().Get() == pytest.approx(0.4, abs=1e-7)


def test_the_grasp_point_is_a_site_at_the_mean_of_the_handle(stage: Usd.Stage) -> None:
    site = stage.GetPrimAtPath("/scene/drawer_7/grasp")
    assert "NewtonSiteAPI" in site.GetAppliedSchemas()
    place = UsdGeom.Xformable(site).ComputeLocalToWorldTransform(Usd.TimeCode.Default()).ExtractTranslation()
    assert np.allclose(place, (1.3, 1.0, 0.5), atol=1e-6)


def test_a_part_without_surface_has_no_grasp_point(stage: Usd.Stage) -> None:
    assert not stage.GetPrimAtPath("/scene/door_21/grasp")


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-9, 1e-7, 1e-5, 3e-4, 1e-3, 1.0])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_joint_frame_turns_x_to_the_axis_within_a_millionth(tilt: float, sign: float) -> None:
    for axis in ((sign * math.cos(tilt), math.sin(tilt), 0.0), (sign * math.cos(tilt), 0.0, -math.sin(tilt))):
        turned = Gf.Quatd(joints.frame(axis)).Transform(Gf.Vec3d(1.0, 0.0, 0.0))
        assert np.abs(np.array(turned) - axis).max() < 1e-6


def test_joint_frames_agree_with_the_exact_attributes(stage: Usd.Stage) -> None:
    for part_id in room().movable:
        prim = UsdPhysics.Joint(stage.GetPrimAtPath(f"/scene/joints/{part_id}"))
        for frame, place in (
            (prim.GetLocalRot0Attr(), prim.GetLocalPos0Attr()),
            (prim.GetLocalRot1Attr(), prim.GetLocalPos1Attr()),
        ):
            axis = Gf.Quatd(frame.Get()).Transform(Gf.Vec3d(1.0, 0.0, 0.0))
            assert np.allclose(axis, room().joint(part_id).axis, atol=1e-6)
            assert np.allclose(place.Get(), room().joint(part_id).origin, atol=1e-6)


def test_extents_are_authored_and_scans_show_both_sides(stage: Usd.Stage) -> None:
    wall = UsdGeom.Mesh(stage.GetPrimAtPath("/scene/wall_1"))
    assert np.allclose(wall.GetExtentAttr().Get(), [(-2, 1.95, 0), (2, 2.05, 2)])
    assert wall.GetDoubleSidedAttr().Get()


def test_a_transform_that_an_editor_gave_a_mesh_is_applied(tmp_path: Path) -> None:
    path = tmp_path / "moved.usda"
    geometric.write(room(), path)
    stage = Usd.Stage.Open(str(path))
    UsdGeom.Xformable(stage.GetPrimAtPath("/scene/wall_1")).AddTranslateOp().Set(Gf.Vec3d(0.0, 0.0, 5.0))
    stage.Save()
    moved = geometric.read(path).part("wall_1").mesh
    assert np.allclose(moved.vertices, room().part("wall_1").mesh.vertices + (0, 0, 5))


def overlaid(folder: Path, prim: str, matrix: Gf.Matrix4d) -> Path:
    """Write the room, and over it a layer that transforms one prim, as an editor writes it."""
    geometric.write(room(), folder / "room.usd")
    layer = Usd.Stage.CreateNew(str(folder / "over.usda"))
    layer.GetRootLayer().subLayerPaths.append("room.usd")
    UsdGeom.SetStageMetersPerUnit(layer, 1.0)
    UsdGeom.SetStageUpAxis(layer, UsdGeom.Tokens.z)
    layer.SetDefaultPrim(layer.GetPrimAtPath("/scene"))
    UsdGeom.Xformable(layer.GetPrimAtPath(prim)).AddTransformOp().Set(matrix)
    layer.GetRootLayer().Save()
    return folder / "over.usda"


def turned(degrees: float, shift: tuple[float, float, float]) -> Gf.Matrix4d:
    return Gf.Matrix4d(Gf.Rotation((0, 0, 1), degrees), Gf.Vec3d(*shift))


def assert_moves_along(found: Scene, part_ids: Iterable[str], matrix: Gf.Matrix4d) -> None:
    """Assert that jointed parts move as they did, seen from what the matrix made of the room."""
    whole = np.array(matrix)
    for part_id in part_ids:
        joint, points = room().joint(part_id), room().parts[part_id].mesh.vertices.astype(float)
        points = np.concatenate([points, np.eye(3)])  # a part without surface has a joint all the same
        for q in joint.limits:
            there = displace(points, joint, q) @ whole[:3, :3] + whole[3, :3]
            again = displace(points @ whole[:3, :3] + whole[3, :3], found.joint(part_id), q)
            assert np.allclose(again, there, atol=1e-9)
        assert found.joint(part_id).limits == joint.limits


@pytest.mark.parametrize("matrix", [turned(90, (0, 0, 0)), turned(-37, (3, -2, 0.5))])
def test_a_transform_of_the_whole_room_takes_joints_and_grasps_along(tmp_path: Path, matrix: Gf.Matrix4d) -> None:
    found = geometric.read(overlaid(tmp_path, "/scene", matrix))
    whole = np.array(matrix)
    assert_moves_along(found, room().movable, matrix)
    assert np.allclose(found.joint("drawer_7").axis, np.array(room().joint("drawer_7").axis) @ whole[:3, :3])
    assert np.allclose(found.grasp_point("drawer_7"), room().grasp_point("drawer_7") @ whole[:3, :3] + whole[3, :3])


@pytest.mark.parametrize("matrix", [turned(0, (0.1, 0.2, 0.3)), turned(90, (0, 0, 0))])
def test_a_transform_of_one_body_takes_its_joint_along_and_no_other(tmp_path: Path, matrix: Gf.Matrix4d) -> None:
    found = geometric.read(overlaid(tmp_path, "/scene/door_20", matrix))
    assert_moves_along(found, ["door_20"], matrix)
    others = [i for i in room().movable if i != "door_20"]
    assert [found.joint(i) for i in others] == [room().joint(i) for i in others]


def test_a_transform_of_the_cabinet_leaves_what_stands_beside_it(tmp_path: Path) -> None:
    found = geometric.read(overlaid(tmp_path, "/scene/cabinet_3", turned(0, (1, 0, 0))))
    assert found.parts["drawer_7"] == room().parts["drawer_7"]


def test_an_orientation_in_single_precision_is_rigid_enough(tmp_path: Path) -> None:
    half = math.radians(33.3) / 2
    matrix = Gf.Matrix4d(Gf.Matrix3d(Gf.Quatf(math.cos(half), 0, 0, math.sin(half))), Gf.Vec3d(0))
    found = geometric.read(overlaid(tmp_path, "/scene", matrix))
    assert math.hypot(*found.joint("drawer_7").axis) == pytest.approx(1.0, abs=1e-12)


def test_a_part_that_somebody_added_follows_after_those_of_the_scan(tmp_path: Path) -> None:
    path = tmp_path / "added.usda"
    geometric.write(room(), path)
    stage = Usd.Stage.Open(str(path))
    Sdf.CopySpec(stage.GetRootLayer(), "/scene/wall_1", stage.GetRootLayer(), "/scene/added_1")
    added = stage.GetPrimAtPath("/scene/added_1")
    added.GetAttribute("s2a:partId").Set("added_1")
    added.RemoveProperty("s2a:order")
    stage.Save()
    assert list(geometric.read(path).parts) == [*room().parts, "added_1"]


def test_a_file_that_was_written_anew_is_read_anew(tmp_path: Path) -> None:
    path = tmp_path / "geometric.usd"
    geometric.write(room(), path)
    held = Usd.Stage.Open(str(path))
    other = one_part(Part("other", box((0, 0, 0), (1, 1, 1))))
    geometric.write(other, tmp_path / "other.usd")
    (tmp_path / "other.usd").replace(path)
    assert geometric.read(path) == other
    assert held


def test_dirty_labels_are_part_of_the_room(written: Path) -> None:
    # The round trip above would say nothing about labels if the room had only clean ones.
    assert geometric.read(written).part("picture_2").label == DIRTY


def test_a_scene_without_parts_is_written_and_read(tmp_path: Path) -> None:
    empty = dataclasses.replace(room(), parts={})
    geometric.write(empty, tmp_path / "empty.usd")
    assert geometric.read(tmp_path / "empty.usd") == empty
    assert problems(tmp_path / "empty.usd") == []
