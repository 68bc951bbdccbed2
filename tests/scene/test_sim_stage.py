"""What Newton makes of a simulation-ready file."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import newton
import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from only_part import cabinet, moving, part
from pxr import Usd, UsdPhysics
from scanned_drawers import scanned_drawer
from scipy.spatial.transform import Rotation
from settings import load

from s2a.core.errors import InputError
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.scene import Part
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.scene.usd.stage import problems


@pytest.fixture(scope="module")
def scene() -> SimRoom:
    return prepare(clean_cabinet_room(yaw=0.7), "drawer_7", load(PrepareConfig, "prepare/handle"))


@pytest.fixture(scope="module")
def path(scene: SimRoom, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = Path(tmp_path_factory.mktemp("simready") / "sim.usd")
    sim_stage.write(scene, path)
    return path


def newton_builder(path: Path) -> newton.ModelBuilder:
    builder = newton.ModelBuilder()
    newton.solvers.SolverMuJoCo.register_custom_attributes(builder)
    builder.rigid_gap = 0.01
    builder.add_usd(str(path))
    return builder


def test_the_stage_passes_usds_own_rules(path: Path) -> None:
    assert problems(path) == []


def test_newton_has_a_fixed_cabinet_and_a_target_that_slides(path: Path, scene: SimRoom) -> None:
    builder = newton_builder(path)
    assert builder.body_label == ["/scene/cabinet_3", "/scene/drawer_7"]
    assert builder.joint_label == ["/scene/joints/cabinet_3", "/scene/joints/drawer_7"]
    assert builder.joint_type == [newton.JointType.FIXED, newton.JointType.PRISMATIC]
    assert builder.joint_parent == [-1, 0]
    assert (builder.joint_limit_lower[0], builder.joint_limit_upper[0]) == pytest.approx((0.0, 0.4))
    assert builder.body_mass[1] == pytest.approx(moving(scene).mass.mass)
    assert list(builder.body_com[1]) == pytest.approx(moving(scene).mass.center, abs=1e-5)
    assert builder.joint_friction[0] == pytest.approx(part(scene).friction) and builder.joint_friction[0] > 1.5


def test_newton_takes_every_piece_as_a_convex_mesh_with_friction_one(path: Path, scene: SimRoom) -> None:
    builder = newton_builder(path)
    pieces = [i for i, label in enumerate(builder.shape_label) if "/colliders/" in label]
    expected = len(moving(scene).colliders) + len(cabinet(scene).colliders) + len(scene.static_colliders)
    assert len(pieces) == expected
    assert {builder.shape_type[i] for i in pieces} == {newton.GeoType.CONVEX_MESH}
    assert {builder.shape_material_mu[i] for i in pieces} == {1.0}
    others = set(range(builder.shape_count)) - set(pieces)
    assert not any(builder.shape_flags[i] & newton.ShapeFlags.COLLIDE_SHAPES for i in others)


@pytest.mark.parametrize("tilt", [0.0, 0.0087])
def test_nothing_moves_on_its_own(tilt: float, tmp_path: Path) -> None:
    room = scanned_drawer()
    mesh, joint = room.parts["drawer_7"].mesh, room.joint("drawer_7")
    joint = replace(joint, axis=(float(np.cos(tilt)), 0.0, -float(np.sin(tilt))))
    tilted = replace(room, parts={**room.parts, "drawer_7": Part("drawer", mesh, "cabinet_3", joint)})
    scene = prepare(tilted, "drawer_7", load(PrepareConfig, "prepare/handle"))
    sim_stage.write(scene, tmp_path / "sim.usd")
    model = newton_builder(tmp_path / "sim.usd").finalize()
    solver = newton.solvers.SolverMuJoCo(model, use_mujoco_cpu=True)
    state, other, control = model.state(), model.state(), model.control()
    for _ in range(240):
        solver.step(state, other, control, None, 1.0 / 240.0)
        state, other = other, state
    assert np.abs(state.joint_q.numpy()).max() < 1e-3
    assert np.abs(state.body_q.numpy() - model.body_q.numpy()).max() < 1e-3


def test_exact_joint_values_stand_beside_the_float_frames(path: Path) -> None:
    joint = clean_cabinet_room(yaw=0.7).joint("drawer_7")
    stage = Usd.Stage.Open(str(path))
    prim = stage.GetPrimAtPath("/scene/joints/drawer_7")
    assert tuple(prim.GetAttribute("s2a:axis").Get()) == joint.axis
    assert tuple(prim.GetAttribute("s2a:origin").Get()) == joint.origin
    assert tuple(prim.GetAttribute("s2a:limits").Get()) == joint.limits


def test_a_written_room_reads_back_equal(path: Path, scene: SimRoom) -> None:
    assert sim_stage.read(path) == scene
    assert np.array_equal(sim_stage.read(path).static_face_part, scene.static_face_part)


def test_physics_is_read_without_the_file_of_the_visuals(path: Path, scene: SimRoom, tmp_path: Path) -> None:
    alone = tmp_path / path.name
    shutil.copy(path, alone)
    found = sim_stage.read(alone, visuals=False)
    assert found.articulations == scene.articulations and found.static_colliders == scene.static_colliders
    assert not any(len(body.visual.faces) for body in found.bodies.values())
    assert alone.stat().st_size < 300_000
    with pytest.raises(InputError, match="visuals are missing"):
        sim_stage.read(alone)


@pytest.mark.parametrize("name", ["a" * 250 + ".usda", "é" * 125 + ".usda", "room.usda"])
def test_a_name_as_long_as_a_file_system_takes_has_its_visuals_beside_it(
    name: str, scene: SimRoom, tmp_path: Path
) -> None:
    sim_stage.write(scene, tmp_path / name)
    assert len(list(tmp_path.iterdir())) == 2 and sim_stage.visuals_file(tmp_path / name).is_file()
    assert sim_stage.read(tmp_path / name) == scene


def test_a_free_object_keeps_a_pose_of_its_own(scene: SimRoom, tmp_path: Path) -> None:
    body = replace(moving(scene), id="cup_20", position=(5.1, -2.3, 0.7), orientation=(0.0, 0.0, 0.6, 0.8), completed=0)
    room = replace(scene, free={"cup_20": body})
    sim_stage.write(room, tmp_path / "room.usd")
    assert sim_stage.read(tmp_path / "room.usd") == room
    expected = Rotation.from_quat(body.orientation).apply(body.visual.vertices) + body.position
    assert in_scene(body, body.visual) == pytest.approx(expected, abs=1e-9)


def test_every_piece_says_which_part_it_stands_for(path: Path) -> None:
    stage = Usd.Stage.Open(str(path))
    parts = set(clean_cabinet_room().parts)
    pieces = [prim for prim in stage.Traverse() if prim.HasAPI(UsdPhysics.CollisionAPI)]
    assert pieces
    assert all(prim.GetAttribute("s2a:part").Get() in parts for prim in pieces)
    static = [prim for prim in pieces if str(prim.GetPath()).startswith("/scene/static")]
    assert all(prim.GetName().startswith(prim.GetAttribute("s2a:part").Get() + "_0") for prim in static)
