"""The whole line on a virtual office: every joint of the scan, in USD and in Newton, moves as annotated."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from settings import load

from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.scene import Joint, Scene
from s2a.scene.usd import descriptive, geometric, sim_stage
from s2a.scene.usd.stage import problems
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import JointConfig, joint_index, read_stage

PUSH = 30.0
"""[N] at the grasp point."""


@dataclass(frozen=True)
class Play:
    """How far a joint passes its limits, metres or radians: pressed at rest; met at 0.1 m/s."""

    lower: float
    upper: float
    met: float


def simulate(scene: Scene, part_id: str, folder: Path) -> Simulation:
    """Return one world of a prepared part, without the robot."""
    path = folder / f"{part_id}.usd"
    sim_stage.write(prepare(scene, part_id, load(PrepareConfig, "prepare")), path)
    assert problems(path) == []
    # The task's spring would hold a door against the push.
    config = replace(load(SimConfig, "sim/paper"), joint=JointConfig(stiffness=0.0, damping=1.0, spring="grasp"))
    return Simulation(read_stage(path), config, 1, with_robot=False)


def check_frames(joint: Joint, sim: Simulation) -> None:
    """Assert that Newton's axis, origin and limits are the annotation's."""
    world, index = sim.world, joint_index(sim.world, sim.stage.target)
    frame, axis = world.joint_X_p[index], world.joint_axis[world.joint_qd_start[index]]
    assert np.allclose(np.array(wp.quat_rotate(frame.q, wp.vec3(*axis))), joint.axis, atol=1e-4)
    off_axis = np.cross(np.array(frame.p) - joint.origin, joint.axis)
    assert np.linalg.norm(off_axis) < 1e-4
    assert np.allclose(sim.stage.joint.axis, joint.axis, atol=0.0), "the stage keeps the axis as doubles"
    dof = world.joint_qd_start[index]
    assert np.allclose([world.joint_limit_lower[dof], world.joint_limit_upper[dof]], joint.limits, atol=1e-5)


def play(joint: Joint, sim: Simulation) -> Play:
    """Push the part to both limits and let it meet the upper one."""
    force, lever = wp.to_torch(sim.control.joint_f), sim.stage.lever_arm
    rest = {}
    for sign in (-1.0, 1.0):
        force[0] = sign * PUSH * lever
        for _ in range(80):
            sim.step()
        rest[sign] = float(sim.joint_q[0, 0])
    force[0] = 0.0
    sim.joint_q[0, 0] = joint.limits[1] - 0.002 / lever
    sim.joint_qd[0, 0] = 0.1 / lever
    furthest = -np.inf
    for _ in range(30):
        sim.step()
        furthest = max(furthest, float(sim.joint_q[0, 0]))
    return Play(rest[-1.0] - joint.limits[0], rest[1.0] - joint.limits[1], furthest - joint.limits[1])


def check_joint(scene: Scene, part_id: str, folder: Path) -> None:
    """Assert that a part moves as annotated: frames within 1e-4, limits reached and kept."""
    joint, sim = scene.joint(part_id), simulate(scene, part_id, folder)
    check_frames(joint, sim)
    found = play(joint, sim)
    print(f"{part_id}: {found}")
    at_rest, in_motion = (5e-4, 3e-3) if joint.kind == "prismatic" else (np.radians(0.1), np.radians(1.0))
    assert abs(found.lower) < at_rest and abs(found.upper) < at_rest
    assert found.met < in_motion


@pytest.mark.slow
def test_a_drawer_and_a_door_of_the_office_move_as_annotated(office: Scene, tmp_path: Path) -> None:
    for part_id in ("drawer_15", "door_21"):
        check_joint(office, part_id, tmp_path)


@pytest.mark.slow
def test_every_joint_of_the_office_moves_as_annotated(office: Scene, tmp_path: Path) -> None:
    for part_id in office.movable:
        check_joint(office, part_id, tmp_path)


def test_both_flavours_of_the_office_follow_the_rules_of_usd(office: Scene, office_scan: Path, tmp_path: Path) -> None:
    descriptive.write(office, tmp_path / "descriptive.usda")
    geometric.write(office, tmp_path / "geometric.usd")
    assert problems(tmp_path / "descriptive.usda") == []
    assert problems(tmp_path / "geometric.usd") == []
    assert problems(office_scan / "truth/truth.usda") == []
    assert geometric.read(tmp_path / "geometric.usd") == office
