"""Worlds that differ by drawn factors: each value is multiplied in the solver, within its limits, and moves its own world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
from cabinet import write_cabinet
from settings import load

from s2a.scene.usd import sim_stage
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.solver import Variation
from s2a.sim.world import SimStage, read_stage

WORLDS = 64
NONE = (1.0, 1.0)
STILL = Variation(NONE, NONE, NONE, NONE, NONE, seed=1)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    path = write_cabinet(tmp_path_factory.mktemp("cabinet") / "slide.usda")
    room = sim_stage.read(path)
    slide = replace(room.articulations["drawer_2"], friction=2.0)
    sim_stage.write(replace(room, articulations={"drawer_2": slide}), path)
    return read_stage(path)


def simulation(stage: SimStage, settings: Variation | None, num_envs: int = WORLDS) -> Simulation:
    return Simulation(stage, replace(load(SimConfig, "sim/real"), vary=settings), num_envs)


DRAWER = 9
"""The drawer's velocity in a world."""


def ratio(stage: SimStage, settings: Variation, name: str, *index: object) -> np.ndarray:
    """Return by what a field of MuJoCo's model differs from that of worlds without variation, shape [world]."""
    varied, plain = (simulation(stage, each) for each in (settings, None))
    return np.squeeze(
        getattr(varied.solver.mjw_model, name).numpy()[(slice(None), *index)]
        / getattr(plain.solver.mjw_model, name).numpy()[(slice(None), *index)]
    )


@pytest.mark.parametrize(
    ("key", "field", "index"),
    [
        ("joint_friction", "dof_frictionloss", (DRAWER,)),
        ("mass", "body_mass", (-1,)),
        ("mass", "body_inertia", (-1, 0)),
        ("contact_friction", "geom_friction", (0, 0)),
        ("gains", "actuator_gainprm", (0, 0)),
    ],
)
def test_a_factor_reaches_the_solver_within_its_limits(
    key: str, field: str, index: tuple[int, ...], stage: SimStage
) -> None:
    found = ratio(stage, replace(STILL, **{key: (0.5, 2.0)}), field, *index)
    assert found.shape == (WORLDS,)
    assert found.min() >= 0.5 - 1e-6 and found.max() <= 2.0 + 1e-5
    assert found.min() < 0.6 and found.max() > 1.7
    # As many halve as double: the logarithm is even.
    assert np.log(found).mean() == pytest.approx(0.0, abs=3 * np.log(2.0) / np.sqrt(3 * WORLDS))


def test_factors_of_one_change_nothing(stage: SimStage) -> None:
    one, none = simulation(stage, STILL, 2), simulation(stage, None, 2)
    for sim in (one, none):
        sim.joint_qd[:, 9] = 0.3
        for _ in range(5):
            sim.step()
    assert (one.joint_q == none.joint_q).all()


def test_a_part_with_more_friction_coasts_less(stage: SimStage) -> None:
    sim = simulation(stage, replace(STILL, joint_friction=(0.25, 4.0)), 8)
    friction = sim.model.joint_friction.numpy().reshape(8, -1)[:, 9]
    sim.joint_qd[:, 9] = 0.3
    for _ in range(20):
        sim.step()
    coasted = sim.joint_q[:, 9]
    assert (torch.diff(coasted[torch.tensor(np.argsort(friction))]) < 0.0).all()
