"""What the environment does whatever the task is: acts, sums the reward, ends, counts and resets episodes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import free_cube, write_cabinet
from lift_task import Lift
from part_worlds import counts
from settings import load

from s2a.core.errors import InputError
from s2a.learn.evaluate import evaluate
from s2a.motion.trajectory import Demonstration
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.env import DemoStarts, VecEnv


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    """A hand-made cabinet."""
    return read_stage(write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda"))


def make_env(stage: SimStage, num_envs: int = 2, seed: int = 0, weight: float = 2.0, **task: object) -> VecEnv:
    """Return worlds in which the arm shall raise its first joint."""
    sim = Simulation(stage, load(SimConfig, "sim/planner"), num_envs)
    return VecEnv(sim, Lift(sim, **task), {"height": weight}, seed, graph=False)


def still(env: VecEnv) -> VecEnv:
    """Let physics leave the state as the test puts it."""
    env.sim.step = lambda: None
    return env


@pytest.mark.slow
def test_any_task_is_run_counted_and_evaluated_by_its_own_columns(stage: SimStage) -> None:
    env = make_env(stage, start_noise=0.0, episode_steps=30)
    assert env.columns == ("lifted", "highest", "invalid", "row_overflow", "contact_overflow")
    up = torch.zeros(2, 9)
    up[0, 0] = 0.2  # 0.025 rad a step: above 0.3 rad after some twelve steps; world 1 stays
    result = evaluate(env, lambda seen: up)
    assert (result["episodes"], result["metrics_version"], result["thresholds"]) == (2, 1, {"high": 0.3})
    assert result["lifted"]["rate"] == 0.5
    assert result["highest"]["max"] == pytest.approx(0.3, abs=0.05) and result["highest"]["min"] < 1e-3
    assert result["invalid"] == 0 and "rate" not in result["highest"]


def test_the_reward_is_the_weighted_sum_of_the_terms_as_observed_before_the_reset(stage: SimStage) -> None:
    env = still(make_env(stage, weight=3.0))
    env.sim.joint_q[:, 0] = env.sim.layout.home[0] + torch.tensor([0.2, 0.4])
    env.step(torch.zeros(2, 9))
    assert env.terms.flatten().tolist() == pytest.approx([0.2, 0.4], abs=1e-6)
    assert env.reward.tolist() == pytest.approx([0.6, 1.2], abs=1e-6)
    assert env.done.tolist() == [0, 1]
    assert abs(float(env.observation[1])) <= 0.125 + 1e-6, "the world that ended is seen at its new start"


def test_an_unknown_reward_term_names_the_known_ones(stage: SimStage) -> None:
    sim = Simulation(stage, load(SimConfig, "sim/planner"), 1)
    with pytest.raises(InputError, match="'heights' does not exist; possible: height"):
        VecEnv(sim, Lift(sim), {"height": 1.0, "heights": 1.0}, 0)


def test_actions_are_clamped_and_integrated_within_the_joint_limits(stage: SimStage) -> None:
    env = still(make_env(stage, start_noise=0.0))
    before = env.sim.joint_target_q[:, :9].clone()
    for _ in range(2):
        env.step(torch.full((2, 9), -3.0))
    moved = env.sim.joint_target_q[0, :9] - before[0]
    assert env.action_step.tolist() == pytest.approx([0.125] * 7 + [0.0125] * 2)  # 7.5 rad/s for 1/60 s
    assert moved[:3].tolist() == pytest.approx([-0.25] * 3, abs=1e-6)
    assert moved[7:].tolist() == pytest.approx([-0.025] * 2, abs=1e-6)
    for _ in range(2):
        env.step(torch.full((2, 9), -3.0))
    assert env.sim.joint_target_q[:, 7:9].tolist() == [[0.0, 0.0]] * 2, "the fingers' lower limit"


def test_a_world_that_is_not_finite_is_reset_and_counted(stage: SimStage) -> None:
    env = still(make_env(stage))
    env.sim.joint_qd[1, 3] = torch.nan
    env.step(torch.zeros(2, 9))
    assert env.done.tolist() == [0, 1]
    assert float(env.reward[1]) == 0.0 and float(env.terms[1]) == 0.0
    assert counts(env)["invalid"] == counts(env)["episodes"] == 1.0
    assert torch.isfinite(env.observation).all() and torch.isfinite(env.sim.joint_qd).all()


def test_an_action_that_is_no_number_ends_that_worlds_episode_as_invalid(stage: SimStage) -> None:
    pair, single = make_env(stage), make_env(stage)
    action = torch.rand(2, 9, generator=torch.Generator().manual_seed(1)) * 0.2 - 0.1
    for step in range(4):
        given = action.clone()
        given[0, 3] = torch.nan if step == 1 else given[0, 3]
        pair.step(given)
        single.step(action)
        assert pair.done.tolist() == [int(step == 1), 0]
        assert torch.equal(pair.sim.joint_q[1], single.sim.joint_q[1])
    assert counts(pair)["invalid"] == 1.0
    assert torch.isfinite(pair.observation).all() and torch.isfinite(pair.sim.joint_target_q).all()


@pytest.mark.slow
def test_a_reset_touches_no_other_world(stage: SimStage) -> None:
    pair, single = make_env(stage), make_env(stage)
    action = torch.rand(2, 9, generator=torch.Generator().manual_seed(1)) * 0.4 - 0.2
    for step in range(6):
        if step == 3:
            pair.sim.joint_q[0, 0] = 2.0  # ends world 0's episode here, and not in the other environment
        pair.step(action)
        single.step(action)
        for seen in ("observation", "reward", "done"):
            assert torch.equal(getattr(pair, seen)[1], getattr(single, seen)[1])
        assert torch.equal(pair.sim.joint_q[1], single.sim.joint_q[1])
    assert not torch.equal(pair.sim.joint_q[0], single.sim.joint_q[0])


def test_an_episode_is_cut_after_one_step_less_than_its_length_and_that_is_a_time_out(stage: SimStage) -> None:
    env = still(make_env(stage, start_noise=0.0, episode_steps=6))
    for step in range(1, 6):
        if step == 5:
            env.sim.joint_q[1, 0] += 0.4  # ends by itself in the step in which it would be cut
        env.step(torch.zeros(2, 9))
        assert env.done.tolist() == ([1, 1] if step == 5 else [0, 0])
    assert env.time_out.tolist() == [1, 0]
    assert env.episode_step.tolist() == [0, 0]
    env.step(torch.zeros(2, 9))
    assert env.done.tolist() == env.time_out.tolist() == [0, 0]


def test_an_uncounted_episode_is_not_counted_but_its_errors_are_and_the_next_one_is(stage: SimStage) -> None:
    env = still(make_env(stage, episode_steps=4))
    env.episode_step[0], env.uncounted[0] = 2, 1
    for expected in (0.0, 0.0, 1.0, 2.0):
        env.step(torch.zeros(2, 9))
        assert counts(env)["episodes"] == expected
    env.uncounted[:] = 1
    env.sim.joint_qd[:, 3] = torch.nan
    env.step(torch.zeros(2, 9))
    assert (counts(env)["episodes"], counts(env)["invalid"]) == (2.0, 2.0)


def test_what_lies_free_is_put_back_where_it_was_scanned(tmp_path: Path) -> None:
    cube = free_cube("cube_3", (1.0, 2.0, 0.5))
    stage = read_stage(write_cabinet(tmp_path / "sim.usda", free=[cube]), also=["cube_3"])
    env = make_env(stage, episode_steps=5)
    pose = env.sim.body_q[:, env.sim.body("cube_3")]
    heights = []
    for _ in range(4):  # it falls, until the episode ends in the fourth step
        env.step(torch.zeros(2, 9))
        heights.append(float(pose[0, 2]))
    assert 0.499 > heights[0] > heights[1] > heights[2]
    assert pose.tolist() == [pytest.approx([1.0, 2.0, 0.5, 0.0, 0.0, 0.0, 1.0], abs=1e-6)] * 2
    assert float(env.sim.joint_qd[:, 10:].abs().max()) == 0.0


def test_the_same_seed_gives_the_same_start_and_another_seed_another(stage: SimStage) -> None:
    starts = [make_env(stage, seed=seed).sim.joint_q.clone() for seed in (0, 0, 1)]
    assert torch.equal(starts[0], starts[1]) and not torch.equal(starts[0][0], starts[0][1])
    assert not torch.equal(starts[0][1], starts[2][1])


@pytest.mark.slow
def test_saved_worlds_go_on_exactly_and_those_of_another_number_or_task_are_refused(stage: SimStage) -> None:
    first, second = make_env(stage, seed=3, episode_steps=8), make_env(stage, seed=4, episode_steps=8)
    actions = torch.rand(16, 2, 9, generator=torch.Generator().manual_seed(0)) * 0.6 - 0.3
    # The arm of world 0 lies on the floor: contacts, which the solver begins with those of the step before.
    first.sim.joint_q[0, :9] = torch.tensor([0.0, 1.7, 0.0, -1.4, 0.0, 1.6, 0.8, 0.035, 0.035])
    first.sim.joint_target_q[0, :9] = first.sim.joint_q[0, :9]
    for action in actions[:4]:
        first.step(action)
    second.load_state_dict(first.state_dict())
    for action in actions[4:]:  # resets on the way
        first.step(action)
        second.step(action)
        later, same = first.state_dict(), second.state_dict()
        assert later.keys() == same.keys() and all(torch.equal(later[name], same[name]) for name in later)
    with pytest.raises(InputError, match=r"joint_q is \(20,\), expected \(30,\); use the same num_envs and task"):
        make_env(stage, num_envs=3).load_state_dict(later)
    with pytest.raises(InputError, match="task.own is missing"):
        second.load_state_dict({name: value for name, value in later.items() if name != "task.own"})


def test_a_fraction_of_the_episodes_starts_on_the_demonstration(stage: SimStage) -> None:
    sim = Simulation(stage, load(SimConfig, "sim/paper"), 256)
    start = torch.tensor(sim.robot.start)
    first, last = start.clone(), start.clone()
    first[0], last[0] = start[0] - 1.0, start[0] - 1.5
    last[7:] = 0.0
    targets = torch.stack([first, first, first, last]).numpy()
    positions = np.append(targets, np.zeros((4, 1)), axis=1)
    positions[:, 7:9] = 0.04
    demo = DemoStarts([Demonstration(targets, positions, 4)], 0.5, 0.0)
    env = VecEnv(sim, Lift(sim, start_noise=0.0), {}, 0, demo=demo)
    q, target = env.sim.joint_q[:, :9], env.sim.joint_target_q[:, :9]
    moved = (start - q)[:, 0]
    groups = [(moved.abs() < 1e-6), (moved > 1e-6) & (moved < 1.0 - 1e-6), moved > 1.4]
    # Half start as ever, a quarter on the path, an eighth and a quarter of another eighth at the end: 4 standard deviations.
    assert [int(group.sum()) for group in groups] == pytest.approx([128, 64, 40], abs=32)
    assert torch.allclose(q[:, 1:7], start[1:7].expand(256, 6))
    closing = groups[2]
    assert torch.allclose(q[closing][:, 7:], torch.tensor(0.04)) and torch.all(target[closing][:, 7:] == 0.0)
    assert torch.equal(q[~closing & (moved < 0.99)], target[~closing & (moved < 0.99)])


def test_a_fraction_of_these_starts_where_the_part_is_moved_and_is_not_counted(stage: SimStage) -> None:
    sim = Simulation(stage, load(SimConfig, "sim/paper"), 256)
    targets = np.tile(np.array(sim.robot.start, np.float32), (5, 1))
    targets[:, 0] -= 1.0 + 0.1 * np.arange(5)
    positions = np.append(targets, [[0.0], [0.0], [0.1], [0.2], [0.3]], axis=1)
    positions[:, 7:9] = 0.01
    env = VecEnv(
        sim, Lift(sim, start_noise=0.0), {}, 0, demo=DemoStarts([Demonstration(targets, positions, 2)], 1.0, 0.25)
    )
    part, q = env.sim.joint_q[:, env.sim.layout.part_coord], env.sim.joint_q
    moved = part > 0.05
    assert int(moved.sum()) == pytest.approx(64, abs=28)  # 4 standard deviations
    for opening in (0.1, 0.2, 0.3):
        there = (part - opening).abs() < 1e-6
        assert int(there.sum()) == pytest.approx(21, abs=18)
        arm = float(targets[round(opening * 10) + 1, 0])
        assert torch.allclose(q[there][:, 0], torch.tensor(arm)) and torch.allclose(
            q[there][:, 7:9], torch.tensor(0.01)
        )
    assert torch.equal(env.uncounted, moved.int()) and not part[~moved].any()
