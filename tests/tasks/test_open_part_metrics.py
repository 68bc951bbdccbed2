"""How an episode of opening is judged: how far, what moved the part over which of the opening, and what physics spoilt."""

from __future__ import annotations

import pytest
import torch
from cabinet import write_cabinet
from part_worlds import RADIUS, column, contacts, counts, hinge, hold_still, make_env, metric_settings, open_to
from settings import load

from s2a.learn.evaluate import evaluate, warn_of_errors
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.env import VecEnv
from s2a.tasks.open_part import OpenPart
from s2a.tasks.state import ERRORS

WAYS = (
    "grasp_success",
    "handle_success",
    "single_finger_success",
    "off_handle_success",
    "body_success",
    "grasped_fraction",
)


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    """A hand-made cabinet with a drawer of 0.4 m."""
    return read_stage(write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda"))


def test_a_shorter_travel_scales_the_openings_that_count(stage: SimStage) -> None:
    # 1.2 rad at 0.3 m is a travel of 0.36 m: success at 0.9 x 0.2 m, which is 0.6 rad.
    env = hold_still(make_env(hinge(stage), 2, episode_steps=2))
    assert env.task.thresholds == pytest.approx(
        {"success": 0.18, "open_30cm": 0.27, "open_75pct_static": 0.27, "open_95pct": 0.342}
    )
    open_to(env, torch.tensor([0.59, 0.61]))
    assert column(env, "success") == [0.0, 1.0]
    assert column(env, "opening") == pytest.approx([0.59 * RADIUS, 0.61 * RADIUS])


def test_wider_openings_are_counted_at_any_time_and_at_the_end(stage: SimStage) -> None:
    # A travel of 0.36 m: wide is 0.9 x 0.30 m = 0.9 rad, static 0.75 x 1.2 rad = 0.9 rad, full 0.95 x 1.2 rad = 1.14 rad.
    env = hold_still(make_env(hinge(stage), 4, episode_steps=3, termination_opening=9.0))
    env.sim.joint_qd[:, 9] = torch.tensor([0.0, 0.32, 0.34, 0.0])  # 0.1 m/s is 0.333 rad/s at 0.3 m
    open_to(env, torch.tensor([0.89, 0.91, 0.91, 1.15]))
    open_to(env, torch.tensor([0.89, 0.91, 0.91, 0.1]))
    assert column(env, "open_30cm") == [0.0, 1.0, 1.0, 1.0]
    assert column(env, "final_open_30cm") == [0.0, 1.0, 1.0, 0.0]
    assert column(env, "open_75pct_static") == [0.0, 1.0, 0.0, 1.0]
    assert column(env, "final_open_75pct_static") == [0.0, 1.0, 0.0, 0.0]
    assert column(env, "open_95pct") == [0.0, 0.0, 0.0, 1.0]
    assert column(env, "final_open_95pct") == [0.0, 0.0, 0.0, 0.0]


PATH = (0.05, 0.10, 0.15, 0.25)
"""Openings of an episode [m]. Success is at 0.20 m, from a tenth of which gains count: 0.03, 0.05, 0.05 and 0.05 m of 0.18."""


def judged(stage: SimStage, num_envs: int, feel, path: tuple[float, ...] = PATH) -> VecEnv:  # noqa: ANN001
    """Return worlds after an episode on a path; `feel` (contacts, step) says by what the part is held on each of its steps."""
    env = hold_still(make_env(stage, num_envs, episode_steps=len(path) + 2))
    found = contacts(env)
    for step, opening in enumerate(path):

        def press(step: int = step) -> None:
            for array in found.values():
                array.zero_()
            feel(found, step)

        open_to(env, opening, press)
    assert not env.done.any()
    open_to(env, path[-1])
    assert env.done.all() and column(env, "success") == [1.0] * num_envs
    return env


def pinch(found: dict[str, torch.Tensor], world: int, opposed: bool = True) -> None:
    """Let both fingers press on the region with 5 N, from opposed sides or from the same."""
    found["on_region"][world] = 5.0
    found["normal"][world] = torch.tensor([[0.0, 0.0, -5.0], [0.0, 0.0, 5.0 if opposed else -5.0]])


def test_what_moved_the_part_over_enough_of_the_gained_opening_counts(stage: SimStage) -> None:
    def feel(found: dict[str, torch.Tensor], step: int) -> None:
        if step >= 1:
            pinch(found, 0)  # over 0.15 m of 0.18
        if step <= 2:
            pinch(found, 1)  # over 0.13 m: enough for a contact, not for a grasp
        pinch(found, 2, opposed=False)
        if step >= 2:
            found["on_region"][3, 1] = 1.5  # one finger over 0.10 m
        found["off_region"][4, 0] = 1.5 * (step >= 2)
        found["off_region"][5, 0] = 1.5  # beside the region over all of it, but with a finger on it over 0.10 m
        found["on_region"][5, 1] = 1.5 * (step >= 2)
        found["on_region"][6] = 0.99  # too little

    env = judged(stage, 7, feel)
    found = {name: column(env, name) for name in WAYS}
    assert found["grasp_success"] == [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    assert found["handle_success"] == [1.0, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    assert found["single_finger_success"] == [0.0, 0.0, 0.0, 1.0, 0.0, 1.0, 0.0]
    assert found["off_handle_success"] == [0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0]
    assert found["body_success"] == [0.0] * 7
    assert found["grasped_fraction"] == pytest.approx([0.15 / 0.18, 0.13 / 0.18, 0, 0, 0, 0, 0], abs=1e-5)


def test_slow_first_centimetres_do_not_outvote_a_fling(stage: SimStage) -> None:
    # Grasped in 16 of 17 steps, in which it gains 0.03 m of 0.18; then flung.
    slow = tuple(0.003 * step for step in range(1, 17))

    def feel(found: dict[str, torch.Tensor], step: int) -> None:
        if step < len(slow):
            pinch(found, 0)

    env = judged(stage, 1, feel, (*slow, 0.25))
    assert [column(env, name) for name in WAYS[:-1]] == [[0.0]] * 5
    assert column(env, "grasped_fraction") == pytest.approx([0.028 / 0.18], abs=1e-4)


def test_what_is_gained_twice_or_beyond_the_success_counts_once_or_not_at_all(stage: SimStage) -> None:
    # It falls back to 0.05 m and is drawn open again, grasped, to 0.15 m, from where it is hooked to 0.19 m; what is
    # grasped from there on adds 0.01 m. Of 0.18 m, 0.09 m were grasped.
    path, holds = (0.06, 0.10, 0.05, 0.10, 0.15, 0.19, 0.38), (0, 1, 1, 1, 1, 0, 1)

    def feel(found: dict[str, torch.Tensor], step: int) -> None:
        if holds[step]:
            pinch(found, 0)

    env = judged(stage, 1, feel, path)
    assert column(env, "grasped_fraction") == pytest.approx([(0.04 + 0.05 + 0.01) / 0.18], abs=1e-5)


def test_other_links_that_push_the_part_are_told_and_what_they_push_harder_is_not_grasped(stage: SimStage) -> None:
    def feel(found: dict[str, torch.Tensor], step: int) -> None:
        for world, (fingers, others) in enumerate([(10.0, 0.0), (10.0, 4.0), (10.0, 20.0), (0.0, 20.0)]):
            if fingers:
                pinch(found, world)
            found["other_links"][world] = others
            found["pull"][world, 0, 0], found["pull"][world, 1, 0] = fingers, others

    env = judged(stage, 4, feel)
    assert column(env, "body_success") == [0.0, 1.0, 1.0, 1.0]
    assert column(env, "grasp_success") == [1.0, 1.0, 0.0, 0.0]
    assert column(env, "handle_success") == [1.0, 1.0, 1.0, 0.0]


def test_a_part_without_a_gain_is_held_by_nothing(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 1, episode_steps=3))
    for _ in range(2):
        open_to(env, 0.01, lambda: pinch(contacts(env), 0))  # less than a tenth of the success
    assert env.done.all()
    assert [column(env, name) for name in ("success", *WAYS)] == [[0.0]] * 7


def test_an_opening_that_is_not_finite_is_no_success(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 2))
    open_to(env, torch.tensor([torch.inf, 0.0]))
    assert counts(env) == {**dict.fromkeys(counts(env), 0.0), "episodes": 1.0, "invalid": 1.0}


def test_what_opens_before_physics_goes_wrong_is_no_success_and_is_counted_in_any_episode(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 2, termination_opening=9.0))
    env.uncounted[1] = 1
    open_to(env, 0.39, lambda: pinch(contacts(env), 0))
    env.sim.joint_qd[:, 3] = torch.nan
    env.step(torch.zeros(2, 9))
    known = dict(zip(env.columns, env.result[0].tolist(), strict=True))
    assert known.pop("opening") == pytest.approx(0.39) and known.pop("invalid") == 1.0
    assert known.pop("grasped_fraction") == pytest.approx(1.0)
    assert set(known.values()) == {0.0}
    assert (counts(env)["episodes"], counts(env)["invalid"]) == (1.0, 2.0)


@pytest.mark.parametrize(
    ("capacity", "expected", "key"),
    [({"njmax": 5}, ("row_overflow", 1.0), "sim.njmax"), ({"naconmax": 2}, ("contact_overflow", 2.0), "sim.nconmax")],
)
def test_an_overflow_is_counted_in_the_episodes_that_it_concerns(
    stage: SimStage, capacity: dict[str, int], expected: tuple[str, float], key: str, caplog: pytest.LogCaptureFixture
) -> None:
    env = make_env(stage, sim="sim/planner", start_noise=0.0, episode_steps=6)
    vars(env.sim.solver.mjw_data).update(capacity)  # less than there is; another size would compile other kernels
    # The arm of world 0 lies on the floor: up to 4 contacts, 7 rows. That of world 1 is free.
    env.sim.joint_q[0, :9] = torch.tensor([0.0, 1.7, 0.0, -1.4, 0.0, 1.6, 0.8, 0.035, 0.035])
    env.sim.joint_target_q[0, :9] = env.sim.joint_q[0, :9]
    ended = torch.zeros(2)
    for _ in range(4):
        env.step(torch.zeros(2, 9))
        ended += env.done
    assert ended.tolist() == [float("njmax" in capacity), 0.0]  # a world that drops rows; contacts are of no one world
    while not env.done[1]:
        env.step(torch.zeros(2, 9))
    known = counts(env)
    assert {name: known[name] for name in ERRORS} == {**dict.fromkeys(ERRORS, 0.0), expected[0]: expected[1]}
    for _ in range(5):
        env.step(torch.zeros(2, 9))
    assert counts(env)[expected[0]] == expected[1], "the next episodes, at the start position, have none"
    warn_of_errors(known, env)
    warned = [message for message in caplog.messages if "episodes" in message]
    assert [key in message for message in warned] == [True]
    caplog.clear()
    warn_of_errors({**known, "episodes": 1e6}, env)
    assert caplog.messages == []


@pytest.mark.slow
def test_the_planner_opens_by_a_grasp_and_the_thresholds_are_reported(stage: SimStage) -> None:
    env = make_env(stage, 2, sim="sim/planner")
    result = evaluate(env, Planner(env, load(PlannerConfig, "planner/default")))
    assert result["thresholds"] == pytest.approx(
        {"success": 0.2, "open_30cm": 0.3, "open_75pct_static": 0.3, "open_95pct": 0.38}
    )
    assert result["metrics_version"] == OpenPart.RESULTS.version and set(OpenPart.RESULTS.names) <= set(result)
    assert result["grasp_success"]["rate"] == result["handle_success"]["rate"] == 1.0
    assert result["single_finger_success"]["rate"] == result["off_handle_success"]["rate"] == 0.0
    assert result["body_success"]["rate"] == 0.0
    assert result["grasped_fraction"]["min"] > 0.95
    assert metric_settings().success_opening == result["thresholds"]["success"]
