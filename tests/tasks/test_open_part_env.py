"""The decision process against the reference's own numbers, and the environment's bookkeeping."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from cabinet import free_cube, write_cabinet
from settings import load

from s2a.env.vec_env import OpenDrawerEnv
from s2a.errors import InputError
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks.open_part.config import COUNTS, OBSERVATIONS, REWARD_TERMS, OpenDrawerConfig


def make_env(stage: Path, worlds: int = 2, seed: int = 0, also: tuple[str, ...] = (), **task: object) -> OpenDrawerEnv:
    """Return an environment of the reference's settings, some of the task's changed."""
    sim = Simulation(read_stage(stage, also=also), load(SimConfig, "sim/paper"), worlds)
    return OpenDrawerEnv(sim, load(OpenDrawerConfig, "task/open_drawer", **task), load(dict, "reward/paper"), seed)


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> OpenDrawerEnv:
    """The reference's layout: handle frame at (0.3515, 0.01, 0.7172) m, the robot's base 1 m in front of the cabinet."""
    stage = write_cabinet(
        tmp_path_factory.mktemp("reference") / "sim.usda", grasp=(0.3515, 0.01, 0.7172), base=(1.0, 0.0, 0.0)
    )
    env = make_env(stage, start_noise=0.0)
    env.sim.step = lambda: None  # the state stays at the reset, whose numbers are known
    return env


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A hand-made cabinet."""
    return write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda")


def test_reward_terms_at_the_reset_equal_the_reference(reference: OpenDrawerEnv) -> None:
    reference.step(torch.zeros(2, 9))
    terms = dict(zip(REWARD_TERMS, reference.terms[0].tolist(), strict=True))
    # From forward kinematics of the panda URDF at IsaacLab's start position: hand frame (0.7844, 0.0823, 0.8199) m, so
    # 0.4507 m away; alignment 0.437 forward, 0.991 up; left finger above, right finger 0.042 m too high.
    assert terms["distance"] == pytest.approx(0.691, abs=1e-3)
    assert terms["rotation"] == pytest.approx(0.587, abs=1e-3)
    assert terms["finger"] == pytest.approx(-0.042, abs=1e-3)
    assert terms["opening"] == terms["bonus"] == terms["action"] == 0.0
    assert float(reference.reward[0]) == pytest.approx(1.5 * 0.691 + 1.5 * 0.587 - 2.0 * 0.042, abs=3e-3)


def test_the_way_to_the_handle_is_seen_in_the_robot_base_frame(reference: OpenDrawerEnv) -> None:
    # World (0.3515, 0.01, 0.7172) - (0.7844, 0.0823, 0.8199) m; the base is turned by 180 degrees about z.
    assert reference.observation[0, 18:21].tolist() == pytest.approx([0.4329, 0.0723, -0.1027], abs=2e-4)


def test_actions_are_clamped_and_integrated(reference: OpenDrawerEnv) -> None:
    reference.reset_all()
    before = reference.sim.joint_target_q[:, :9].clone()
    reference.step(torch.full((2, 9), -3.0))
    moved = reference.sim.joint_target_q[0, :9] - before[0]
    assert moved[:7].tolist() == pytest.approx([-0.125] * 7, abs=1e-6)  # 7.5 rad/s for 1/60 s
    assert moved[7:].tolist() == pytest.approx([-0.0125] * 2, abs=1e-6)
    assert float(reference.terms[0, REWARD_TERMS.index("action")]) == 9.0


def test_an_opening_gives_its_bonuses_and_ends_the_episode(reference: OpenDrawerEnv) -> None:
    reference.reset_all()
    reference.sim.joint_q[0, 9], reference.sim.joint_q[1, 9] = 0.395, 0.25
    reference.step(torch.zeros(2, 9))
    assert reference.terms[:, REWARD_TERMS.index("bonus")].tolist() == [3.0, 2.0]
    assert reference.done.tolist() == [1, 0]
    assert reference.time_out.tolist() == [0, 0]
    assert float(reference.sim.joint_q[0, 9]) == 0.0, "an ended world starts again"
    assert float(reference.sim.joint_q[1, 9]) == 0.25
    counts = dict(zip(COUNTS, reference.counts.tolist(), strict=True))
    assert counts["episodes"] == counts["success"] == counts["final_success"] == 1.0
    assert counts["handle_success"] == 0.0, "no finger touched the handle"


def test_a_world_that_is_not_finite_is_reset_and_counted(reference: OpenDrawerEnv) -> None:
    reference.reset_all()
    reference.sim.joint_qd[1, 3] = torch.nan
    reference.step(torch.zeros(2, 9))
    assert reference.done.tolist() == [0, 1]
    assert float(reference.reward[1]) == 0.0
    assert float(reference.counts[COUNTS.index("invalid")]) == 1.0
    assert torch.isfinite(reference.observation).all()


def test_an_action_that_is_no_number_ends_that_worlds_episode_as_invalid(stage: Path) -> None:
    pair, single = make_env(stage, worlds=2), make_env(stage, worlds=2)
    action = torch.rand(2, 9, generator=torch.Generator().manual_seed(1)) * 2.0 - 1.0
    for step in range(4):
        given = action.clone()
        given[0, 3] = torch.nan if step == 1 else given[0, 3]
        pair.step(given)
        single.step(action)
        assert pair.done.tolist() == [int(step == 1), 0]
        assert torch.equal(pair.observation[1], single.observation[1])
    assert float(pair.counts[COUNTS.index("invalid")]) == 1.0
    assert torch.isfinite(pair.observation).all() and torch.isfinite(pair.sim.joint_target_q).all()


def test_a_reset_touches_no_other_world(stage: Path) -> None:
    pair, single = make_env(stage, worlds=2), make_env(stage, worlds=2)
    action = torch.rand(2, 9, generator=torch.Generator().manual_seed(1)) * 2.0 - 1.0
    for step in range(6):
        if step == 3:
            pair.sim.joint_q[0, 9] = 0.395  # ends world 0's episode here, and not in the other environment
        pair.step(action)
        single.step(action)
        assert torch.equal(pair.observation[1], single.observation[1])
    assert not torch.equal(pair.observation[0], single.observation[0])


def test_what_lies_free_is_put_back_where_it_was_scanned(tmp_path: Path) -> None:
    path = write_cabinet(tmp_path / "sim.usda", free=[free_cube("cube_3", (1.0, 2.0, 0.5))])
    env = make_env(path, also=("cube_3",), episode_steps=5)
    pose = env.sim.body_q[:, env.sim.body("cube_3")]
    heights = []
    for _ in range(4):  # it falls, until the episode ends in the fourth step
        env.step(torch.zeros(2, 9))
        heights.append(float(pose[0, 2]))
    assert 0.499 > heights[0] > heights[1] > heights[2]
    assert pose.tolist() == [pytest.approx([1.0, 2.0, 0.5, 0.0, 0.0, 0.0, 1.0], abs=1e-6)] * 2
    assert float(env.sim.joint_qd[:, 10:].abs().max()) == 0.0


def test_the_same_seed_gives_the_same_trajectory_and_another_seed_another(stage: Path) -> None:
    def run(seed: int) -> torch.Tensor:
        env, actions = make_env(stage, seed=seed, episode_steps=16), torch.Generator().manual_seed(0)
        # The arm of world 0 lies on the floor, which is contact; both worlds are reset on the way.
        env.sim.joint_q[0, :9] = torch.tensor([0.0, 1.7, 0.0, -1.4, 0.0, 1.6, 0.8, 0.035, 0.035])
        env.sim.joint_target_q[0, :9] = env.sim.joint_q[0, :9]
        seen = []
        for _ in range(20):
            env.step(torch.rand(2, 9, generator=actions) * 2.0 - 1.0)
            seen.append(torch.cat([env.observation, env.reward[:, None], env.done[:, None], env.terms], dim=1))
        return torch.stack(seen)

    first = run(0)
    assert first.shape == (20, 2, OBSERVATIONS + 2 + len(REWARD_TERMS))
    assert first[:, :, OBSERVATIONS + 1].sum() == 2.0
    assert torch.equal(first, run(0))
    assert not torch.equal(first[0, 1], run(1)[0, 1])  # world 1 began where its seed says


def test_an_unknown_reward_term_names_the_known_ones(stage: Path) -> None:
    sim = Simulation(read_stage(stage), load(SimConfig, "sim/paper"), 1)
    weights = {**load(dict, "reward/paper"), "fingers": 1.0}
    with pytest.raises(InputError, match="'fingers' does not exist; known: distance, rotation, opening, finger"):
        OpenDrawerEnv(sim, load(OpenDrawerConfig, "task/open_drawer"), weights, 0)


def test_a_share_of_the_episodes_starts_on_the_way_ahead(stage: Path) -> None:
    sim = Simulation(read_stage(stage), load(SimConfig, "sim/paper"), 256)
    start = torch.tensor(sim.robot.start)
    first, last = start.clone(), start.clone()
    first[0], last[0] = start[0] - 1.0, start[0] - 1.5
    last[7:] = 0.0
    task = load(OpenDrawerConfig, "task/open_drawer", start_noise=0.0)
    motion = torch.stack([first, first, first, last]).tolist()
    env = OpenDrawerEnv(sim, task, load(dict, "reward/paper"), 0, ahead=(motion, 0.5))
    q, target = env.sim.joint_q[:, :9], env.sim.joint_target_q[:, :9]
    moved = (start - q)[:, 0]
    shares = [(moved.abs() < 1e-6), (moved > 1e-6) & (moved < 1.0 - 1e-6), moved > 1.4]
    # Half start as ever, a quarter on the way, an eighth and a quarter of another eighth at the end: 4 standard deviations.
    assert [int(s.sum()) for s in shares] == pytest.approx([128, 64, 40], abs=32)
    assert torch.allclose(q[:, 1:7], start[1:7].expand(256, 6))
    closing = shares[2]
    assert torch.allclose(q[closing][:, 7:], torch.tensor(0.04)) and torch.all(target[closing][:, 7:] == 0.0)
    assert torch.equal(q[~closing & (moved < 0.99)], target[~closing & (moved < 0.99)])
