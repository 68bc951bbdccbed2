"""What Newton makes of the geometric flavour."""

from __future__ import annotations

from pathlib import Path

import newton
import numpy as np
import pytest
import warp as wp
from usd_room import room

from s2a.scene.usd import geometric


@pytest.fixture(scope="module")
def builder(tmp_path_factory: pytest.TempPathFactory) -> newton.ModelBuilder:
    path = Path(tmp_path_factory.mktemp("newton") / "geometric.usd")
    geometric.write(room(), path)
    builder = newton.ModelBuilder()
    builder.add_usd(str(path))
    return builder


def test_newton_finds_axis_origin_and_limits_as_annotated(builder: newton.ModelBuilder) -> None:
    for part_id in room().movable:
        joint = room().joint(part_id)
        index = builder.joint_label.index(f"/scene/joints/{part_id}")
        parent = builder.body_q[builder.joint_parent[index]]
        frame = wp.transform_multiply(wp.transform(*parent), builder.joint_X_p[index])
        dof = builder.joint_qd_start[index]
        axis = wp.quat_rotate(wp.transform_get_rotation(frame), wp.vec3(*builder.joint_axis[dof]))
        assert np.abs(np.array(axis) - joint.axis).max() < 1e-4
        assert np.abs(np.array(wp.transform_get_translation(frame)) - joint.origin).max() < 1e-4
        limits = builder.joint_limit_lower[dof], builder.joint_limit_upper[dof]
        assert np.allclose(limits, joint.limits, atol=1e-6)


def test_newton_puts_every_joint_into_an_articulation(builder: newton.ModelBuilder) -> None:
    assert all(articulation >= 0 for articulation in builder.joint_articulation)


def test_newton_has_the_bodies_where_they_were_scanned(builder: newton.ModelBuilder) -> None:
    assert np.allclose(builder.body_q, [[0, 0, 0, 0, 0, 0, 1]] * builder.body_count, atol=1e-5)


def test_newton_reads_grasp_points_as_sites(builder: newton.ModelBuilder) -> None:
    index = builder.shape_label.index("/scene/drawer_7/grasp")
    assert builder.shape_flags[index] & newton.ShapeFlags.SITE
    assert builder.body_label[builder.shape_body[index]] == "/scene/drawer_7"
    assert np.allclose(builder.shape_transform[index][:3], (1.3, 1.0, 0.5), atol=1e-6)


def test_nothing_collides_in_the_geometric_flavour(builder: newton.ModelBuilder) -> None:
    assert not any(flags & newton.ShapeFlags.COLLIDE_SHAPES for flags in builder.shape_flags)
