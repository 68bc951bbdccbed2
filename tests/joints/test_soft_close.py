"""A soft close and breakaway: found in recordings, not invented, and simulated as identified."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import converted
import numpy as np
import pytest
from converted import HINGE, PART, SLIDE, write_room
from pulled_bodies import DOOR, DRAWER
from recorded_pulls import HAND, RATE, STEP, Truth, hand_path, record

from s2a.joints.commands.identify import write_layer
from s2a.joints.dynamics import PARAMETERS
from s2a.joints.identify import identify
from s2a.joints.pull import Noise, Pull
from s2a.joints.pulled import Moving, moving
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import Simulation
from s2a.sim.world import axis_of, read_stage

NOISE, SILENT = Noise(0.001, 0.5), Noise(0.0, 0.0)
TRUTH = Truth(mass=0.8, damping=5.0, friction=2.0, breakaway=2.0, spring=5.0, pull_in=8.0, closing=50.0)
NEAR = 0.03
"""[m] Where the hand begins, and comes back to: within the reach, and off the stop, which recordings here do not have."""
SECONDS, SEED = 3.0, 99


def simulated(layer: Path) -> np.ndarray:
    """Return the opening [m] of a stage's part that the hand of `record` pulls, at the times of that recording."""
    stage = read_stage(layer, PART)
    config = replace(converted.settings(), load_static_colliders=False)
    sim = Simulation(stage, config, 1, with_robot=False)
    coord, dof = axis_of(sim.world, PART, stage.joint.kind)
    lever, steps = stage.lever_arm, iter(range(10**6))
    goals = hand_path(np.random.default_rng(SEED), SECONDS, min(0.9 * stage.travel, 0.4), NEAR)

    def pull() -> None:
        goal = goals[min(round(next(steps) * config.dt / STEP), len(goals) - 1)]
        q, qd = sim.state.joint_q.numpy()[coord], sim.state.joint_qd.numpy()[dof]
        force = sim.control.joint_f.numpy()  # which begins each step as the soft close's own
        force[dof] += (HAND[0] * (goal - q * lever) - HAND[1] * qd * lever) * lever
        sim.control.joint_f.assign(force)

    start = sim.state.joint_q.numpy()
    start[coord] = NEAR / lever
    sim.state.joint_q.assign(start)
    sim.before_substep.append(pull)
    seen = []
    for _ in range(round(SECONDS / (config.dt * config.substeps))):
        seen.append(float(sim.state.joint_q.numpy()[coord]) * lever)
        sim.step()
    every = round(1.0 / RATE / STEP) * STEP
    times = np.arange(0.0, SECONDS - config.dt * config.substeps, every)
    return np.interp(times, np.arange(len(seen)) * config.dt * config.substeps, seen)


@pytest.mark.slow
@pytest.mark.parametrize("joint", [SLIDE, HINGE], ids=["drawer", "door"])
def test_the_simulation_of_what_was_identified_predicts_another_pull(tmp_path: Path, joint: Joint) -> None:
    stage, layer = write_room(tmp_path / "room.usd", joint), tmp_path / "identified.usda"
    body = moving(sim_stage.read(stage), PART)
    pulls = [record(body, TRUTH, NOISE, seed, SECONDS, NEAR) for seed in range(4)]
    (found,) = identify([body], [pulls], NOISE)
    for name in ("pull_in", "closing"):
        i = PARAMETERS.index(name)
        assert found.determined[i] and found.values[i] == pytest.approx(getattr(TRUTH, name), rel=0.25), name
    write_layer(stage, layer, layer, PART, found, body)
    true = record(body, TRUTH, SILENT, SEED, SECONDS, NEAR).opening
    predicted = simulated(layer)
    count = min(len(true), len(predicted))
    assert np.abs(true[:count] - predicted[:count]).max() < 0.003
    write_layer(stage, layer, layer, PART, replace(found, values=found.values * [1, 1, 1, 0, 1, 0, 0]), body)
    assert np.abs(true[:count] - simulated(layer)[:count]).max() > 0.006, "without both, the pull is another one"


@pytest.mark.slow
@pytest.mark.parametrize("body", [DRAWER, DOOR], ids=["drawer", "door"])
def test_what_recordings_do_not_tell_is_undetermined(body: Moving) -> None:
    """A hand that only opens feels no damping of closing, which the true joint has."""
    pulls = [rising(record(body, TRUTH, NOISE, seed, SECONDS, NEAR)) for seed in range(4)]
    (found,) = identify([body], [pulls], NOISE)
    closing = PARAMETERS.index("closing")
    assert not found.determined[closing] and found.values[closing] == 0.0
    assert found.determined[PARAMETERS.index("pull_in")]


def rising(pull: Pull) -> Pull:
    """Return the first opening of a pull, from where it is shut most."""
    smooth = np.convolve(pull.opening, np.ones(9) / 9, "valid")
    low = 20 + int(np.argmin(smooth[20:60]))
    top = low + int(np.argmax(np.diff(smooth[low:]) < -1e-3))
    return replace(pull, opening=pull.opening[low + 4 : top + 4], force=pull.force[low + 4 : top + 4])
