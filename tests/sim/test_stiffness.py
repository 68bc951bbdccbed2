"""How hard the surface of what lies free is."""

from __future__ import annotations

import newton
import pytest
import warp as wp
from settings import load

from s2a.sim.solver import SimConfig, make_solver
from s2a.sim.world import SURFACE, empty_world, harden

FORCE = 40.0
"""[N] As fingers press."""


def sunk(mass: float, hard: bool) -> float:
    """Return how far a cube of 4 cm sinks into the ground that it is pressed on [m]."""
    config = load(SimConfig, "sim/pick_place", njmax=100, nconmax=50)
    builder = empty_world()
    builder.add_ground_plane()
    body = builder.add_body(xform=wp.transform((0.0, 0.0, 0.02), wp.quat_identity()))
    builder.add_shape_box(body, hx=0.02, hy=0.02, hz=0.02, cfg=newton.ModelBuilder.ShapeConfig(density=mass / 0.04**3))
    if hard:
        harden(builder, body, config.dt)
    model = builder.finalize(device="cpu")
    solver, now, after = make_solver(model, config), model.state(), model.state()
    now.body_f.fill_(wp.spatial_vector(0.0, 0.0, -FORCE, 0.0, 0.0, 0.0))
    for _ in range(240):
        solver.step(now, after, model.control(), None, config.dt)
        now.body_q, after.body_q = after.body_q, now.body_q
        now.body_qd, after.body_qd = after.body_qd, now.body_qd
        now.joint_q, after.joint_q = after.joint_q, now.joint_q
        now.joint_qd, after.joint_qd = after.joint_qd, now.joint_qd
    return 0.02 - float(now.body_q.numpy()[0, 2])


@pytest.mark.slow
@pytest.mark.parametrize("mass", [0.02, 0.1, 0.2])
def test_what_is_pressed_sinks_as_far_as_its_surface_is_stiff(mass: float) -> None:
    """Four corners share the force."""
    assert sunk(mass, hard=True) == pytest.approx(FORCE / 4 / SURFACE, rel=0.3)


@pytest.mark.slow
def test_by_default_a_light_thing_sinks_in_by_millimetres() -> None:
    assert sunk(0.02, hard=False) > 5.0 * sunk(0.02, hard=True)
