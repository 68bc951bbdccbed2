"""Parts with breakaway or a soft close: what holds them, and how they shut."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import converted
import numpy as np
import pytest
from converted import HINGE, PART, SLIDE, write_room

from s2a.core.errors import InputError
from s2a.scene.articulation import lever_arm
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.scene.usd.joints import Resistance, SoftClose
from s2a.scene.usd.stage import open_stage, write_attribute
from s2a.sim.simulation import Simulation
from s2a.sim.world import axis_of, read_stage

FRICTION, BREAKAWAY = 1.5, 3.0
"""[N] At the grasp point, in motion, and how much more at rest."""
SOFT = SoftClose(force=6.0, damping=60.0, reach=0.04)
"""At the grasp point."""
MIRRORED = Joint("prismatic", (-1.0, 0.0, 0.0), SLIDE.origin, (-0.4, 0.0))
"""A drawer whose coordinate falls as it opens."""
JOINTS = pytest.mark.parametrize("joint", [SLIDE, HINGE, MIRRORED], ids=["drawer", "door", "mirrored"])


def part(path: Path, joint: Joint, breakaway: float = 0.0, soft: SoftClose | None = None) -> Path:
    """Write a room whose part has this at its grasp point, without damping and spring."""
    room = sim_stage.read(write_room(path, joint))
    own = room.articulations[PART]
    arm = lever_arm(joint, np.array(own.grasp.point))
    close = soft and SoftClose(soft.force * arm, soft.damping * arm**2, soft.reach / arm)
    resistance = Resistance(0.0, 0.0, breakaway * arm, close)
    own = replace(own, friction=FRICTION * arm, resistance=resistance)
    sim_stage.write(replace(room, articulations={PART: own}), path)
    return path


def moved(paths: list[Path], opening: float, force: float, seconds: float) -> tuple[np.ndarray, np.ndarray]:
    """Return opening [m] and speed [m/s] of parts that start open and at rest, shape [step world], under a force [N]."""
    stages = [read_stage(path, PART) for path in paths]
    config = replace(converted.settings(), load_static_colliders=False)
    sim = Simulation(stages, config, len(stages), with_robot=False)
    places = [axis_of(sim.world, PART, stage.joint.kind) for stage in stages]
    arms = np.array([stage.lever_arm * np.sign(sum(stage.joint.limits)) for stage in stages])
    coords, dofs = sim.model.joint_coord_count // len(stages), sim.model.joint_dof_count // len(stages)
    at = np.array([i * coords + q for i, (q, _) in enumerate(places)])
    by = np.array([i * dofs + v for i, (_, v) in enumerate(places)])
    # A push is Python between the physics steps, which no graph holds
    step = sim.step if force else sim.capture(sim.step)
    start = sim.state.joint_q.numpy()
    start[at] = opening / arms
    sim.state.joint_q.assign(start)
    sim.state.joint_qd.zero_()

    def push() -> None:
        total = sim.control.joint_f.numpy()
        owned = np.array([stage.room.articulations[PART].resistance.breakaway > 0.0 for stage in stages])
        total[by] = np.where(owned, total[by], 0.0) + force * arms
        sim.control.joint_f.assign(total)

    if force:
        sim.before_substep.append(push)
    seen = []
    for _ in range(round(seconds / config.dt / config.substeps)):
        step()
        seen.append((sim.state.joint_q.numpy()[at] * arms, sim.state.joint_qd.numpy()[by] * arms))
    return np.array(seen)[:, 0], np.array(seen)[:, 1]


@pytest.mark.slow
@JOINTS
def test_breakaway_holds_a_part_that_dry_friction_in_motion_would_not(tmp_path: Path, joint: Joint) -> None:
    with_it, without = part(tmp_path / "a.usd", joint, BREAKAWAY), part(tmp_path / "b.usd", joint)
    held = moved([with_it, without], 0.1, 0.5 * BREAKAWAY + FRICTION, 0.5)[0][-1] - 0.1
    assert abs(held[0]) < 1e-3 and held[1] > 0.02
    assert moved([with_it], 0.1, 1.3 * BREAKAWAY + FRICTION, 0.5)[0][-1, 0] - 0.1 > 0.02


def test_in_motion_breakaway_is_gone(tmp_path: Path) -> None:
    """Well above STRIBECK both parts lose the same speed to a force that overcomes neither."""
    paths = [part(tmp_path / "a.usd", SLIDE, BREAKAWAY), part(tmp_path / "b.usd", SLIDE)]
    force = 3.0 * (FRICTION + BREAKAWAY)
    speeds = moved(paths, 0.0, force, 0.4)[1]
    fast = speeds[:, 0] > 0.2
    gained = np.diff(speeds[fast], axis=0)
    assert len(gained) > 5 and gained[:, 0] == pytest.approx(gained[:, 1], rel=0.02)


@JOINTS
def test_a_soft_close_draws_a_part_in_slowly(tmp_path: Path, joint: Joint) -> None:
    with_it, without = part(tmp_path / "a.usd", joint, soft=SOFT), part(tmp_path / "b.usd", joint)
    opening, speed = moved([with_it, without], 0.025, 0.0, 2.0)
    assert abs(opening[-1, 0]) < 1e-3 and abs(speed[-1, 0]) < 1e-3
    # Force and damping are in balance at (6 - 1.5) / 60 m/s, which a part that starts at rest does not exceed.
    assert -(SOFT.force - FRICTION) / SOFT.damping * 1.02 < speed[:, 0].min() < -0.01
    assert opening[:, 1] == pytest.approx(0.025, abs=1e-3)


def test_beyond_its_reach_a_soft_close_does_nothing(tmp_path: Path) -> None:
    opening, _ = moved([part(tmp_path / "a.usd", SLIDE, soft=SOFT)], 0.06, 0.0, 1.0)
    assert opening[-1, 0] == pytest.approx(0.06, abs=1e-3)


def test_worlds_of_slides_and_hinges_each_have_their_own(tmp_path: Path) -> None:
    """In a batch of both kinds, two joints and one that has nothing of this (which alone moves a door by 0.25 mm)."""
    paths = [part(tmp_path / "a.usd", SLIDE, soft=SOFT), part(tmp_path / "b.usd", HINGE, soft=SOFT)]
    paths.append(part(tmp_path / "c.usd", HINGE))
    together = moved(paths, 0.03, 0.0, 1.0)[0]
    alone = np.column_stack([moved([path], 0.03, 0.0, 1.0)[0] for path in paths])
    assert together == pytest.approx(alone, abs=5e-4)
    assert (np.ptp(together, axis=0) > 0.02).tolist() == [True, True, False]


def test_nothing_is_launched_where_no_stage_has_it(tmp_path: Path) -> None:
    plain = read_stage(part(tmp_path / "a.usd", SLIDE), PART)
    assert Simulation(plain, converted.settings(), 1, with_robot=False).before_substep == []


def test_a_file_keeps_it_and_half_a_soft_close_is_refused(tmp_path: Path) -> None:
    path = part(tmp_path / "room.usda", HINGE, BREAKAWAY, SOFT)
    found = sim_stage.read(path)
    sim_stage.write(found, tmp_path / "again.usda")
    again = sim_stage.read(tmp_path / "again.usda")
    assert again.articulations == found.articulations and found.articulations[PART].resistance.soft_close is not None
    stage = open_stage(path)
    joint = stage.GetPrimAtPath(f"/scene/joints/{PART}")
    joint.RemoveProperty("s2a:softClose:reach")
    stage.GetRootLayer().Save()
    with pytest.raises(InputError, match="without s2a:softClose:reach"):
        sim_stage.read(path)
    write_attribute(joint, "softClose:reach", joint.GetAttribute("s2a:softClose:force").GetTypeName(), -1.0)
    stage.GetRootLayer().Save()
    with pytest.raises(InputError, match="expected 0 or more"):
        sim_stage.read(path)
