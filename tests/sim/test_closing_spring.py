"""The spring that closes a part: as strong at the grasp point of a hinge as at a slide's, whatever the lever arm."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import converted
import mujoco
import pytest
from converted import HINGE, PART, SLIDE, write_room
from settings import load

from s2a.commands import convert
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.sim.solver import SimConfig
from s2a.sim.world import JointConfig, build_world, joint_index, read_stage

K = 10.0


def stiffness(path: Path, joint: Joint, config: JointConfig, x: float = 0.0) -> tuple[float, float]:
    """Return the simulated joint's stiffness of a part whose grasp point is moved by x [m], and its lever arm."""
    room = sim_stage.read(write_room(path, joint))
    part = room.articulations[PART]
    point = (part.grasp.point[0] + x, *part.grasp.point[1:])
    moved = {**room.articulations, PART: replace(part, grasp=replace(part.grasp, point=point))}
    sim_stage.write(replace(room, articulations=moved), path)
    stage = read_stage(path, PART)
    builder = build_world(stage, config, 1 / 240)
    return float(builder.joint_target_ke[builder.joint_qd_start[joint_index(builder, PART)]]), stage.lever_arm


@pytest.mark.parametrize("x", [0.0, 0.3])
def test_the_force_at_the_grasp_point_is_the_same_on_every_lever_arm(tmp_path: Path, x: float) -> None:
    per_rad, arm = stiffness(tmp_path / "room.usd", HINGE, JointConfig(K, 1.0, "grasp"), x)
    # At q = s / L the moment per_rad q acts with per_rad q / L = k s at the grasp point.
    path = 0.2
    assert per_rad * (path / arm) / arm == pytest.approx(K * path, rel=1e-6)
    assert stiffness(tmp_path / "room.usd", HINGE, JointConfig(K, 1.0, "joint"), x)[0] == K


def test_a_slide_is_what_it_was(tmp_path: Path) -> None:
    assert stiffness(tmp_path / "room.usd", SLIDE, JointConfig(K, 1.0, "grasp"))[0] == K
    assert load(SimConfig, "sim/paper").joint == JointConfig(10.0, 1.0, "grasp")
    assert load(SimConfig, "sim/planner").joint == load(SimConfig, "sim/real").joint == JointConfig(10.0, 1.0, "grasp")


def test_plain_mujoco_gets_the_same_spring(tmp_path: Path) -> None:
    path = write_room(tmp_path / "room.usd", HINGE)
    config = replace(converted.settings(), joint=JointConfig(K, 1.0, "grasp"))
    convert.run(convert.Config(path, tmp_path / "out", "mjcf", "all", config))
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "out" / "room.xml"))
    assert model.jnt_stiffness[model.joint(PART).id] == pytest.approx(
        K * read_stage(path, PART).lever_arm ** 2, rel=1e-4
    )
