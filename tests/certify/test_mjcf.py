"""A room as MJCF: plain MuJoCo reads it, and it moves there as mechanics says and as the stage says."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import converted
import mujoco
import numpy as np
import pytest
from converted import CABINET, CUBE, FRICTION, HINGE, LID, PART, SLIDE, write_room
from scipy.spatial.transform import Rotation

from s2a.certify.convert import FILES, write_mjcf
from s2a.certify.links import ALL, read_links
from s2a.scene.articulation import displace
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import in_scene
from s2a.sim.solver import SimConfig

JOINTS = pytest.mark.parametrize("joint", [SLIDE, HINGE], ids=["slide", "hinge"])


def convert(stage: Path, folder: Path, settings: SimConfig, parts: str | tuple[str, ...] = ALL) -> mujoco.MjModel:
    folder.mkdir()
    write_mjcf(read_links(stage, parts, settings), settings, folder)
    return mujoco.MjModel.from_xml_path(str(folder / FILES["mjcf"]))


def pushed(model: mujoco.MjModel, force: float, seconds: float) -> float:
    """Return the coordinate of the part [m or rad] after a constant force or torque on its joint."""
    data, joint = mujoco.MjData(model), model.joint(PART)
    for _ in range(round(seconds / model.opt.timestep)):
        data.qfrc_applied[joint.dofadr[0]] = force
        mujoco.mj_step(model, data)
    return float(data.qpos[joint.qposadr[0]])


@JOINTS
def test_joint_limits_masses_and_inertias_are_those_of_the_stage(joint: Joint, tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", joint, free=True)
    room, model = sim_stage.read(stage), convert(stage, tmp_path / "out", converted.settings())
    assert model.nq == 1 + 7 and model.opt.timestep == pytest.approx(1 / 240)
    assert model.jnt_range[model.joint(PART).id] == pytest.approx(joint.limits, abs=1e-5)
    assert model.dof_frictionloss[model.joint(PART).dofadr] == pytest.approx([FRICTION])
    for name, body in (room.bodies | room.free).items():
        assert model.body(name).mass[0] == pytest.approx(body.mass.mass, rel=1e-5)
        w, *xyz = model.body(name).iquat
        turn = Rotation.from_quat((*xyz, w)).as_matrix()
        found = turn @ np.diag(model.body(name).inertia) @ turn.T
        assert found == pytest.approx(converted.inertia(body.mass), abs=1e-4)


@JOINTS
def test_the_handle_moves_as_the_joint_says(joint: Joint, tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", joint)
    grasp = np.array([sim_stage.read(stage).articulations[PART].grasp.point])
    model = convert(stage, tmp_path / "out", converted.settings())
    data = mujoco.MjData(model)
    for q in (0.0, 0.13, joint.limits[1]):
        data.qpos[0] = q
        mujoco.mj_kinematics(model, data)
        assert data.site(f"{PART}_grasp").xpos == pytest.approx(displace(grasp, joint, q)[0], abs=1e-5)


def test_a_pushed_drawer_is_where_mechanics_says(tmp_path: Path) -> None:
    force, damping, mass, seconds = 6.0, 8.0, 5.32, 0.8
    model = convert(write_room(tmp_path / "room.usd"), tmp_path / "out", converted.settings(damping=damping))
    # m x'' = F - f - c x' from rest: speed v (1 - exp(-t / tau)) with v = (F - f) / c, tau = m / c.
    tau, final = mass / damping, (force - FRICTION) / damping
    expected = final * (seconds - tau * (1.0 - math.exp(-seconds / tau)))
    assert pushed(model, force, seconds) == pytest.approx(expected, rel=0.01)
    assert abs(pushed(model, 0.95 * FRICTION, seconds)) < 1e-4  # dry friction holds it


def test_a_pushed_door_is_where_mechanics_says(tmp_path: Path) -> None:
    torque, damping, seconds = 4.0, 1.5, 0.8
    stage = write_room(tmp_path / "room.usd", HINGE)
    mass = sim_stage.read(stage).bodies[PART].mass
    # About the upright axis through (0.32, 0.36): the moment about the centre of mass, and Steiner's part.
    arm = math.hypot(mass.center[0] - 0.32, mass.center[1] - 0.36)
    inertia = converted.inertia(mass)[2, 2] + mass.mass * arm**2
    tau, final = inertia / damping, (torque - FRICTION) / damping
    expected = final * (seconds - tau * (1.0 - math.exp(-seconds / tau)))
    model = convert(stage, tmp_path / "out", converted.settings(damping=damping))
    assert 0.1 < expected < 1.4
    assert pushed(model, torque, seconds) == pytest.approx(expected, rel=0.01)


def test_a_spring_swings_the_drawer(tmp_path: Path) -> None:
    force, stiffness, mass = 4.0, 20.0, 5.32
    model = convert(write_room(tmp_path / "room.usd"), tmp_path / "out", converted.settings(stiffness=stiffness))
    # m x'' = F - f - k x from rest turns back at 2 (F - f) / k, half a period of 2 pi sqrt(m / k) later.
    half = math.pi * math.sqrt(mass / stiffness)
    assert pushed(model, force, half) == pytest.approx(2.0 * (force - FRICTION) / stiffness, rel=0.01)


def test_what_a_robot_brings_along_collides_with_everything_and_the_drawer_not_with_its_cabinet(tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd")
    convert(stage, tmp_path / "out", converted.settings())
    spec = mujoco.MjSpec.from_file(str(tmp_path / "out" / FILES["mjcf"]))
    grasp = sim_stage.read(stage).articulations[PART].grasp.point
    for place in (grasp, (0.28, 0.3715, 0.4), (1.0, 1.0, 0.01)):  # the handle, a side of the cabinet, the floor
        ball = spec.worldbody.add_body(pos=place)
        ball.add_freejoint()
        ball.add_geom(size=[0.02, 0.0, 0.0], contype=0, conaffinity=1)
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    pairs = {frozenset(model.body(model.geom_bodyid[g]).name for g in contact.geom) for contact in data.contact}
    assert pairs == {frozenset({"", PART}), frozenset({"", CABINET}), frozenset({"", "world"})}
    assert model.geom_friction[model.geom(f"{PART}_hull_00").id, 0] == pytest.approx(1.0)


def test_surfaces_and_hulls_lie_where_they_were_scanned(tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", HINGE, free=True)
    room, model = sim_stage.read(stage), convert(stage, tmp_path / "out", converted.settings())
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    for name, body in (room.bodies | room.free).items():
        seen = np.sort(_vertices(model, data, f"{name}_visual"), axis=0)
        assert seen == pytest.approx(np.sort(np.unique(in_scene(body, body.visual), axis=0), axis=0), abs=1e-5)
        hull = body.colliders[0].mesh
        lowest = _vertices(model, data, f"{name}_hull_00").min(axis=0)
        assert lowest == pytest.approx(in_scene(body, hull).min(axis=0), abs=1e-5)
    assert model.ntex == len(room.bodies) + len(room.free) + 1


def test_a_surface_of_one_triangle_or_without_area_is_left_out(tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd")
    room = sim_stage.read(stage)
    triangle = Mesh(np.eye(3), [[0, 1, 2]])
    line = Mesh(np.outer(np.arange(4), [1.0, 0.0, 0.0]), [[0, 1, 2], [1, 2, 3]])
    bodies = {CABINET: replace(room.bodies[CABINET], visual=triangle), PART: replace(room.bodies[PART], visual=line)}
    sim_stage.write(replace(room, bodies=bodies), stage)
    model = convert(stage, tmp_path / "out", converted.settings())
    assert [model.tex(i).name for i in range(model.ntex)] == ["static_visual"]


def _vertices(model: mujoco.MjModel, data: mujoco.MjData, geom: str) -> np.ndarray:
    """Return where the different vertices of a mesh are in the scene [m], shape [vertex 3]."""
    index = model.geom(geom).id
    mesh = model.geom_dataid[index]
    first = model.mesh_vertadr[mesh]
    points = model.mesh_vert[first : first + model.mesh_vertnum[mesh]] @ data.geom_xmat[index].reshape(3, 3).T
    return np.unique((points + data.geom_xpos[index]).round(6), axis=0)


def test_parts_that_are_not_named_are_frozen_onto_what_carries_them(tmp_path: Path) -> None:
    stage, settings = write_room(tmp_path / "room.usd", lid=True, free=True), converted.settings()
    whole, drawer, lid = (convert(stage, tmp_path / i, settings, (i,)) for i in (ALL, PART, LID))
    assert whole.nv == 2 + 6 and whole.body(LID).parentid[0] == whole.body(PART).id
    assert drawer.nv == 1 and lid.nv == 1
    assert owners(drawer, LID) == owners(drawer, PART) == {PART}  # hull and surface
    assert owners(lid, PART) == {CABINET} and owners(lid, LID) == {LID}
    assert owners(lid, CUBE) == {"world"}


def owners(model: mujoco.MjModel, part: str) -> set[str]:
    """Return the bodies that have the hulls and the surface of a part."""
    names = [model.geom(i).name for i in range(model.ngeom)]
    return {model.body(model.geom_bodyid[i]).name for i, name in enumerate(names) if name.startswith(f"{part}_")}


def test_what_overlaps_somewhere_does_not_collide(tmp_path: Path) -> None:
    model = convert(write_room(tmp_path / "room.usd", lid=True), tmp_path / "out", converted.settings())
    pairs = {frozenset((int(s) >> 16, int(s) & 0xFFFF)) for s in model.exclude_signature}
    names = {frozenset(model.body(i).name for i in pair) for pair in pairs}
    assert names == {frozenset((CABINET, PART)), frozenset((PART, LID)), frozenset((CABINET, LID))}
