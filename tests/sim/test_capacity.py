"""Room for contacts: pairs of bounding boxes along a part's path, counted by hand."""

from __future__ import annotations

from pathlib import Path

import newton
import numpy as np
import pytest
import warp as wp
from cabinet import write_cabinet
from settings import load

from s2a.sim.simulation import SimConfig, Simulation, boxes, most_pairs
from s2a.sim.world import read_stage


def model() -> newton.Model:
    """Return two worlds: a block that slides along x, alone in one; in the other three fixed blocks lie on its path."""
    builder = newton.ModelBuilder()
    for fixed in ((), (1.0, 1.05, 2.0)):
        world = newton.ModelBuilder()
        body = world.add_link()
        for y in (0.0, 0.3):
            world.add_shape_box(
                body, xform=wp.transform(wp.vec3(0.0, y, 0.0), wp.quat_identity()), hx=0.1, hy=0.1, hz=0.1
            )
        joint = world.add_joint_prismatic(parent=-1, child=body, axis=(1.0, 0.0, 0.0), limit_lower=0.0, limit_upper=2.0)
        world.add_articulation([joint])
        for x in fixed:
            world.add_shape_box(
                -1, xform=wp.transform(wp.vec3(x, 0.0, 0.0), wp.quat_identity()), hx=0.1, hy=0.1, hz=0.1
            )
        builder.add_world(world)
    return builder.finalize(device="cpu")


def poses(*places: float) -> list[np.ndarray]:
    """Return the poses of both blocks at places on x [m]."""
    return [np.array([[x, 0, 0, 0, 0, 0, 1.0]] * 2) for x in places]


def test_pairs_are_counted_in_the_worst_pose_of_the_worst_world() -> None:
    # At 1.0 the first box of the block overlaps two fixed ones; its second, 0.3 m beside, and the end of the path none and one.
    assert most_pairs(model(), poses(0.0, 0.5, 1.0, 2.0), 2) == 2
    assert most_pairs(model(), poses(0.0, 2.0), 2) == 1
    assert most_pairs(model(), poses(0.0, 0.5), 2) == 0


def test_only_the_first_worlds_are_looked_at_and_what_never_moves_has_no_pairs() -> None:
    assert most_pairs(model(), poses(0.0, 1.0), 1) == 0
    assert most_pairs(model(), poses(1.0, 1.0), 2) == 0


def test_boxes_of_a_live_room_hold_whatever_its_shapes_can_reach() -> None:
    path, places = model(), poses(0.0, 1.0, 2.0)
    sliding, fixed = boxes(path, np.array([2, 4]), places)  # the second world's block, and the first one on its path
    assert sliding.tolist() == pytest.approx(np.array([[-0.15, -0.15, -0.15], [2.15, 0.15, 0.15]]))
    assert fixed.tolist() == pytest.approx(np.array([[0.85, -0.15, -0.15], [1.15, 0.15, 0.15]]))


def test_counting_leaves_the_worlds_at_their_start(tmp_path: Path) -> None:
    stage = read_stage(write_cabinet(tmp_path / "sim.usda"))
    for stages, num_envs in ((stage, 2), ([stage, stage], 1)):
        sim = Simulation(stages, load(SimConfig, "sim/paper"), num_envs)
        assert sim.joint_q[:, sim.layout.part_coord].abs().max() == 0.0
        assert (sim.joint_q == sim.joint_q[0]).all()
