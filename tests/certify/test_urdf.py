"""A room as URDF: Newton's importer reads back the joints, limits, masses and shapes of the stage, in the scene's frame."""

from __future__ import annotations

import xml.etree.ElementTree as ElementTree
from pathlib import Path

import converted
import newton
import numpy as np
import pytest
from converted import CABINET, CUBE, FRICTION, HINGE, LID, LID_HINGE, PART, SLIDE, write_room
from scipy.spatial.transform import Rotation

from s2a.certify.convert import FILES, PAIRS, write_urdf
from s2a.certify.links import ALL, read_links
from s2a.scene.articulation import displace
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom, in_scene
from s2a.sim.world import body_index, joint_index

JOINTS = pytest.mark.parametrize("joint", [SLIDE, HINGE], ids=["slide", "hinge"])


def convert(stage: Path, folder: Path, damping: float = 2.5, parts: str | tuple[str, ...] = ALL) -> newton.ModelBuilder:
    folder.mkdir()
    settings = converted.settings(damping=damping)
    write_urdf(read_links(stage, parts, settings), settings, folder)
    return imported(folder / FILES["urdf"])


def imported(path: Path) -> newton.ModelBuilder:
    builder = newton.ModelBuilder()
    builder.add_urdf(str(path), floating=False, collapse_fixed_joints=False)
    return builder


def pose(builder: newton.ModelBuilder, link: str, moved: dict[str, float]) -> tuple[Rotation, np.ndarray]:
    """Return the orientation and the position [m] of a link in the scene for coordinates by joint."""
    model = builder.finalize(device="cpu")
    coordinates = model.joint_q.numpy()
    for joint, q in moved.items():
        coordinates[builder.joint_q_start[joint_index(builder, joint)]] = q
    state = model.state()
    state.joint_q.assign(coordinates)
    newton.eval_fk(model, state.joint_q, state.joint_qd, state)
    *position, x, y, z, w = state.body_q.numpy()[body_index(builder, link)].astype(float)
    return Rotation.from_quat((x, y, z, w)), np.array(position)


def colliders(builder: newton.ModelBuilder, link: str, moved: dict[str, float]) -> np.ndarray:
    """Return the vertices of a link's hulls in the scene [m], shape [vertex 3], sorted."""
    turn, position = pose(builder, link, moved)
    found = []
    for shape, body in enumerate(builder.shape_body):
        if body == body_index(builder, link) and builder.shape_flags[shape] & newton.ShapeFlags.COLLIDE_SHAPES:
            found.append(turn.apply(builder.shape_source[shape].vertices) + position)
    return unique(np.concatenate(found))


def unique(points: np.ndarray) -> np.ndarray:
    return np.unique(points.astype(float).round(4), axis=0)


def hulls(room: SimRoom, body: str) -> np.ndarray:
    found = (room.bodies | room.free)[body]
    return np.concatenate([in_scene(found, collider.mesh) for collider in found.colliders])


@JOINTS
def test_joints_limits_and_masses_are_those_of_the_stage(joint: Joint, tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", joint)
    room, builder = sim_stage.read(stage), convert(stage, tmp_path / "out")
    dof = builder.joint_qd_start[joint_index(builder, PART)]
    limits = builder.joint_limit_lower[dof], builder.joint_limit_upper[dof]
    assert limits == pytest.approx(joint.limits)
    assert builder.joint_damping[dof] == pytest.approx(2.5) and builder.joint_friction[dof] == pytest.approx(FRICTION)
    for name, body in room.bodies.items():
        index = body_index(builder, name)
        turn, position = pose(builder, name, {})
        assert builder.body_mass[index] == pytest.approx(body.mass.mass)
        assert turn.apply(builder.body_com[index]) + position == pytest.approx(body.mass.center, abs=1e-6)
        found = turn.as_matrix() @ np.array(builder.body_inertia[index]).reshape(3, 3) @ turn.as_matrix().T
        assert found == pytest.approx(converted.inertia(body.mass), abs=1e-5)


@JOINTS
def test_every_point_moves_as_the_joint_says(joint: Joint, tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", joint)
    room, builder = sim_stage.read(stage), convert(stage, tmp_path / "out")
    for q in (0.0, 0.2, joint.limits[1]):
        expected = unique(displace(hulls(room, PART), joint, q))
        assert colliders(builder, PART, {PART: q}) == pytest.approx(expected, abs=2e-4)
        assert colliders(builder, CABINET, {PART: q}) == pytest.approx(unique(hulls(room, CABINET)), abs=2e-4)


def test_a_free_object_is_a_file_of_its_own_and_a_frame_in_the_room(tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", free=True)
    room, builder = sim_stage.read(stage), convert(stage, tmp_path / "out")
    turn, position = pose(builder, CUBE, {})
    cube = imported(tmp_path / "out" / f"{CUBE}.urdf")
    assert cube.body_mass[0] == pytest.approx(room.free[CUBE].mass.mass)
    [shape] = [i for i, flags in enumerate(cube.shape_flags) if flags & newton.ShapeFlags.COLLIDE_SHAPES]
    points = turn.apply(cube.shape_source[shape].vertices) + position
    assert unique(points) == pytest.approx(unique(hulls(room, CUBE)), abs=2e-4)


def test_a_lid_on_a_drawer_moves_with_it(tmp_path: Path) -> None:
    stage = write_room(tmp_path / "room.usd", HINGE, lid=True)
    room, builder = sim_stage.read(stage), convert(stage, tmp_path / "out")
    expected = displace(displace(hulls(room, LID), LID_HINGE, 0.5), HINGE, 0.4)
    assert colliders(builder, LID, {LID: 0.5, PART: 0.4}) == pytest.approx(unique(expected), abs=2e-4)


def test_pairs_that_overlap_or_that_a_joint_connects_do_not_collide(tmp_path: Path) -> None:
    convert(write_room(tmp_path / "room.usd", lid=True), tmp_path / "out")
    tags = [tag.attrib for tag in ElementTree.parse(tmp_path / "out" / PAIRS).getroot()]
    assert tags == [
        {"link1": CABINET, "link2": PART, "reason": "Adjacent"},
        {"link1": CABINET, "link2": LID, "reason": "Default"},
        {"link1": PART, "link2": LID, "reason": "Adjacent"},
    ]
