"""Pulls by gradient: optima that are known by hand, the gradient, and what the planner makes of a law."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import write_cabinet
from part_worlds import make_env
from pulled_bodies import DOOR, DRAWER, LID
from settings import load

from s2a.core.errors import InputError
from s2a.joints.pull_optimize import Optimum, PullConfig, PullLoss, optimize
from s2a.joints.pulled import Arm, Moving, Pulled, pulled
from s2a.learn.evaluate import evaluate
from s2a.motion import trajectory
from s2a.motion.open import opening_path, planned_path
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig, PullLaw, eased
from s2a.scene.scene import Joint

GOAL, SECONDS = 0.3, 1.0
FREE = (1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Dynamics of a mass that nothing resists."""


def arm(stiffness: float = 2000.0, damping: float = 400.0, mass: float = 5.0) -> Arm:
    """Return an arm that is alike along its path, faster than any pull here asks for."""
    rows = [np.full(3, x) for x in (stiffness, damping, mass)]
    return Arm(np.linspace(0.0, GOAL, 3), *rows, speed=20.0, acceleration=2000.0)


def settings(**changes: float) -> PullConfig:
    """Return a pull of given time in which nothing counts but its end and what is asked for."""
    only = {"time": 0.0, "energy": 0.0, "peak": 0.0, "min_seconds": SECONDS, "max_seconds": SECONDS, "beyond": 0.3}
    return load(PullConfig, "pull/default", **{**only, "rounds": 60, **changes})


def at_end(found: Optimum) -> tuple[float, float]:
    """Return what an optimum misses of its goal [m], and its speed there [m/s]."""
    end = round(SECONDS * 60)
    return found.opening[end] - GOAL, found.speed[end]


@pytest.mark.slow
def test_the_gentlest_pull_of_a_mass_is_full_force_and_full_brake() -> None:
    target = Pulled(DRAWER, FREE, arm(stiffness=20000.0, damping=400.0, mass=0.1))
    (found,), _ = optimize([target], settings(peak=1.0, rounds=150))
    bound = 4.0 * DRAWER.inertia * GOAL / SECONDS**2
    # The spline and the arm round the corners of a bang-bang force; the cubic, next best in common use, has 1.5 times the bound.
    assert bound * 0.97 < np.abs(found.force).max() < 1.2 * bound
    assert np.abs(at_end(found)).max() < 0.002
    middle = np.argmin(np.abs(found.opening - GOAL / 2))
    assert middle / 60 == pytest.approx(SECONDS / 2, abs=0.05)


@pytest.mark.slow
def test_the_least_work_against_damping_is_done_at_constant_speed() -> None:
    damping, light = 30.0, replace(DRAWER, mass=replace(DRAWER.mass, mass=0.3))
    target = Pulled(light, (1.0, damping, 0.0, 0.0, 0.0, 0.0, 0.0), arm(mass=0.1))
    (found,), _ = optimize([target], settings(energy=10.0, knots=32))
    work = np.maximum(found.force * found.speed, 0.0).sum() / 60
    bound = damping * GOAL**2 / SECONDS
    speeds = np.gradient(eased(np.linspace(0.0, 1.0, 1001)), 0.001)
    assert (speeds**2).mean() > 1.15, "the planner's ease does so much more"
    assert 0.97 * bound < work < 1.1 * bound
    assert np.abs(at_end(found)).max() < 0.002


@pytest.mark.slow
def test_a_pull_ends_where_the_arm_would_sag() -> None:
    target = Pulled(DRAWER, (1.0, 1.0, 0.0, 0.0, 20.0, 0.0, 0.0), arm())
    (found,), _ = optimize([target], settings())
    # A spring of 20 N/m at 0.3 m bends an arm of 2000 N/m by 3 mm.
    assert found.law.path[-1] == pytest.approx(GOAL + 0.003, abs=0.0005)
    assert found.opening[-1] == pytest.approx(GOAL, abs=0.0005)


@pytest.mark.slow
@pytest.mark.parametrize("body", [DRAWER, DOOR], ids=["drawer", "door"])
def test_a_part_is_closed_and_at_rest_when_the_set_point_stands(body: Moving) -> None:
    """With a soft close, which pulls the last centimetres, and without; nothing slams."""
    plain, soft = (1.3, 4.0, 2.0, 0.5, 0.0, 0.0, 0.0), (1.3, 4.0, 2.0, 0.5, 0.0, 8.0, 60.0)
    targets = [Pulled(body, dynamics, arm(), closing=True) for dynamics in (plain, soft)]
    seconds = 2.0
    found, _ = optimize(targets, settings(peak=0.1, energy=1.0, beyond=0.03), np.full(2, seconds))
    for each in found:
        end = round(seconds * 60)
        assert abs(each.opening[end] - GOAL) < 0.002 and abs(each.speed[end]) < 0.01
        assert each.speed[each.opening > GOAL - 0.001].max(initial=0.0) < 0.03


CASES = [(DRAWER, False), (DOOR, False), (LID, False), (DRAWER, True), (DOOR, True)]


@pytest.mark.slow
def test_gradients_are_those_of_central_differences() -> None:
    dynamics = (1.3, 4.0, 2.0, 0.5, 10.0, 3.0, 20.0)
    targets = [Pulled(body, dynamics, arm(), closing=closing) for body, closing in CASES]
    config = settings(time=1.0, energy=1.0, peak=0.1, min_seconds=0.8, max_seconds=1.6)
    loss = PullLoss(targets, replace(config, end=0.05, end_speed=0.2))
    x = loss.start()
    x[[closing for _, closing in CASES], 1:] *= 0.97  # off the stop, where the loss has a kink
    gradients, differences = loss(x)[1], np.zeros_like(x)
    for k in range(loss.variables):
        ahead, behind = x.copy(), x.copy()
        ahead[:, k] += 0.001
        behind[:, k] -= 0.001
        differences[:, k] = (loss.costs(ahead) - loss.costs(behind)) / 0.002
    for case, found, expected in zip(CASES, gradients, differences, strict=True):
        assert found @ expected / np.linalg.norm(found) / np.linalg.norm(expected) > 0.999, case
        assert found == pytest.approx(expected, abs=0.02 * np.abs(expected).max()), case


@pytest.mark.slow
def test_the_planner_brings_the_part_to_its_goal_with_a_law(tmp_path: Path) -> None:
    env = make_env(write_cabinet(tmp_path / "sim.usda"), 2, sim="sim/planner", start_noise=0.0)
    own = load(PlannerConfig, "planner/default")
    target = pulled(env.sim, *planned_path(env.sim, own, opening_path))
    (found,), _ = optimize([target], settings(peak=0.1, energy=1.0, min_seconds=2.0, max_seconds=2.0, beyond=0.03))
    trajectory.write(found.law, tmp_path / "law.json")
    result = evaluate(env, Planner(env, replace(own, pull_law=tmp_path / "law.json")))
    assert result["grasp_success"]["rate"] == 1.0
    assert result["opening"]["min"] == pytest.approx(GOAL, abs=0.003)
    assert result["opening"]["max"] == pytest.approx(GOAL, abs=0.003)


def test_a_law_for_another_pull_is_refused(tmp_path: Path) -> None:
    env = make_env(write_cabinet(tmp_path / "sim.usda"), 1, sim="sim/planner")
    trajectory.write(PullLaw(2.0, (0.0, 0.1, 0.2), 0.2), tmp_path / "law.json")
    with pytest.raises(InputError, match="a law for a pull of 0.200 m; this one is 0.300 m long"):
        Planner(env, load(PlannerConfig, "planner/default", pull_law=tmp_path / "law.json"))


@pytest.mark.parametrize("text", ["", "[]", '{"seconds": 1}', '{"seconds": 0, "path": [0, 1, 1], "goal": 1}'])
def test_a_file_that_is_no_law_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / "law.json").write_text(text)
    with pytest.raises(InputError, match="not a pull law"):
        trajectory.read(tmp_path / "law.json")


def test_a_law_is_read_as_written_and_rests_at_its_ends(tmp_path: Path) -> None:
    law = PullLaw(1.5, (0.0, 0.02, 0.15, 0.31, 0.3), 0.3)
    trajectory.write(law, tmp_path / "law.json")
    assert trajectory.read(tmp_path / "law.json") == law
    ends = law.progress(np.array([-1.0, 0.0, 1e-4, 1.0 - 1e-4, 1.0, 2.0]))
    assert ends == pytest.approx([0.0, 0.0, 0.0, 1.0, 1.0, 1.0], abs=1e-6)


def test_a_slide_with_gravity_rests_on_its_stop_before_the_pull() -> None:
    tilted = replace(DRAWER, joint=Joint("prismatic", (0.8, 0.0, 0.6), (0.0, 0.0, 0.0), (0.0, 0.4)))
    loss = PullLoss([Pulled(tilted, FREE, arm())], settings())
    x = np.zeros((1, loss.variables))
    opening, _, _ = loss.motions(x)
    # 35 N on a stop of 20 N/mm.
    assert -0.004 < opening.min() <= opening.max() <= 0.0
