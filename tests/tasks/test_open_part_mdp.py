"""The decision process of opening against the reference's own numbers and plain torch, on slides and hinges."""

from __future__ import annotations

import numpy as np
import pytest
import torch
import warp as wp
from cabinet import write_cabinet
from part_worlds import (
    RADIUS,
    contacts,
    counts,
    grasped,
    hinge,
    hold_still,
    make_env,
    open_to,
    opening_forces,
    opens_backwards,
    term,
)
from scipy.spatial.transform import Rotation
from settings import load

from s2a.sim.world import SimStage, read_stage
from s2a.tasks.env import VecEnv

WORLDS = 64


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> VecEnv:
    """The reference's layout: handle frame at (0.3515, 0.01, 0.7172) m, the robot's base 1 m in front of the cabinet."""
    stage = write_cabinet(
        tmp_path_factory.mktemp("reference") / "sim.usda", grasp=(0.3515, 0.01, 0.7172), base=(1.0, 0.0, 0.0)
    )
    return hold_still(make_env(stage, start_noise=0.0))  # the state stays at the reset, whose numbers are known


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    """A hand-made cabinet with a drawer of 0.4 m."""
    return read_stage(write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda"))


def test_reward_terms_at_the_reset_equal_the_reference(reference: VecEnv) -> None:
    reference.reset_all()
    reference.step(torch.zeros(2, 9))
    # From forward kinematics of the panda URDF at IsaacLab's start position: its point of the hand at (0.7844, 0.0823,
    # 0.8199) m, so 0.4507 m away; alignment 0.437 forward, 0.991 up; left finger above, right finger 0.042 m too high.
    assert float(term(reference, "distance")[0]) == pytest.approx(0.691, abs=1e-3)
    assert float(term(reference, "rotation")[0]) == pytest.approx(0.587, abs=1e-3)
    assert float(term(reference, "finger")[0]) == pytest.approx(-0.042, abs=1e-3)
    assert all(float(term(reference, name)[0]) == 0.0 for name in ("opening", "bonus", "action"))
    assert float(reference.reward[0]) == pytest.approx(1.5 * 0.691 + 1.5 * 0.587 - 2.0 * 0.042, abs=3e-3)


def test_the_vector_to_the_handle_is_seen_in_the_robot_base_frame(reference: VecEnv) -> None:
    # World (0.3515, 0.01, 0.7172) - (0.7844, 0.0823, 0.8199) m; the base is turned by 180 degrees about z.
    assert reference.observation[0, 18:21].tolist() == pytest.approx([0.4329, 0.0723, -0.1027], abs=2e-4)


def test_actions_cost_their_squares_clamped(reference: VecEnv) -> None:
    reference.reset_all()
    reference.step(torch.full((2, 9), -3.0))
    assert float(term(reference, "action")[0]) == 9.0


def test_an_opening_gives_its_bonuses_and_ends_the_episode(reference: VecEnv) -> None:
    reference.reset_all()
    open_to(reference, torch.tensor([0.395, 0.25]))
    assert term(reference, "bonus").tolist() == [3.0, 2.0]
    assert reference.done.tolist() == [1, 0]
    assert reference.time_out.tolist() == [0, 0]
    assert float(reference.sim.joint_q[0, 9]) == 0.0, "an ended world starts again"
    assert float(reference.sim.joint_q[1, 9]) == 0.25
    known = counts(reference)
    assert known["episodes"] == known["success"] == known["final_success"] == 1.0
    assert known["handle_success"] == known["grasp_success"] == 0.0, "no finger touched the handle"


def frames(poses: torch.Tensor, point: tuple[float, ...], turn: Rotation) -> tuple[torch.Tensor, torch.Tensor]:
    """Return origins [world 3] and axes [world 3 axis] of a frame fixed to bodies, scipy doing the turning."""
    rotation = Rotation.from_quat(poses[:, 3:].numpy())
    return poses[:, :3] + torch.tensor(rotation.apply(point)), torch.tensor((rotation * turn).as_matrix())


TOOL = (-0.04 * 0.5**0.5, 0.04 * 0.5**0.5, 0.1654 - 0.107)
"""The reference's point of the hand in the hand's frame [m]: (0, 0.04, 0.1654) in link 7, against which that lies 0.107 m ahead
and is turned by -45 degrees about z."""


def scatter(env: VecEnv, size: float, generator: torch.Generator) -> None:
    """Put all bodies anywhere within `size` [m] and turn them at random."""
    q = env.sim.body_q
    q[:, :, :3] = torch.rand(q[:, :, :3].shape, generator=generator) * size
    quaternions = torch.randn(q[:, :, 3:].shape, generator=generator)
    q[:, :, 3:] = quaternions / quaternions.norm(dim=-1, keepdim=True)


@pytest.mark.parametrize(
    ("change", "lever"),
    [(lambda stage: stage, 1.0), (opens_backwards, -1.0), (hinge, RADIUS)],
    ids=["slide", "backwards", "hinge"],
)
def test_reward_terms_equal_a_plain_reference_on_random_states(stage: SimStage, change, lever: float) -> None:  # noqa: ANN001
    env = hold_still(make_env(change(stage), WORLDS))
    sim, generator = env.sim, torch.Generator().manual_seed(0)
    scatter(env, 0.4, generator)
    sim.joint_q[:, 9] = torch.rand(WORLDS, generator=generator) * 0.38 / lever
    pressed = torch.rand(WORLDS, 2, generator=generator) * 3.0
    contacts(env)["on_region"].copy_(pressed)
    normal = torch.randn(WORLDS, 2, 3, generator=generator) * 2.0
    contacts(env)["normal"].copy_(normal)
    body_q, opening = sim.body_q.double().clone(), sim.joint_q[:, 9].double() * lever
    action = torch.randn(WORLDS, 9, generator=generator)
    speed = torch.randn(WORLDS, 7, generator=generator)
    sim.joint_qd[:, :7] = speed
    wp.to_torch(env.state.torque)[:, :7] = 9.0 * torch.randn(WORLDS, 7, generator=generator)
    env.step(action)

    hand, hand_axes = frames(body_q[:, sim.body("panda_hand")], TOOL, Rotation.identity())
    point, axes = frames(
        body_q[:, sim.body("drawer_2")], tuple(sim.stage.grasp[:3]), Rotation.from_quat(sim.stage.grasp[3:])
    )
    left, right = (body_q[:, sim.body(f"panda_{side}finger"), :3] - point for side in ("left", "right"))
    away, up = (hand - point).norm(dim=1), axes[:, :, 1]
    near = (1.0 / (1.0 + away**2)) ** 2
    dots = [(hand_axes[:, :, i] * axes[:, :, i]).sum(dim=1) for i in (2, 1)]
    travel = min(1.0, max(map(abs, sim.stage.joint.limits)) * abs(lever) / 0.4)
    grip = (pressed.min(dim=1).values >= 1.0).double()
    pinch = grip * (torch.cosine_similarity(normal[:, 0], normal[:, 1], dim=1) < -0.5)
    expected = {
        "distance": torch.where(away <= 0.02, 2.0 * near, near),
        "rotation": 0.5 * sum(d.sign() * d**2 for d in dots),
        "opening": opening,
        "finger": (left * up).sum(dim=1).clamp(max=0.0) + (-(right * up).sum(dim=1)).clamp(max=0.0),
        "bonus": sum((opening > travel * x).double() for x in (0.01, 0.2, 0.35)),
        "action": (action.clamp(-1.0, 1.0) ** 2).sum(dim=1).double(),
        "grip": grip,
        "pinch": pinch,
        "grasped_opening": pinch * opening,
        "grasped_path": pinch * ((opening.clamp(travel * 0.01, travel * 0.2) - travel * 0.01) / (travel * 0.19)) ** 2,
        "closing": torch.zeros(WORLDS).double(),
        "joint_speed": speed.square().sum(dim=1).double(),
        "torque": wp.to_torch(env.state.torque)[:, :7].double().square().sum(dim=1),
        "contact_force": torch.zeros(WORLDS).double(),
    }
    assert set(expected) == set(env.task.REWARDS) and 0.2 < grip.mean() < 0.8
    assert 3.0 <= pinch.sum() < grip.sum()
    for name, values in expected.items():
        assert torch.allclose(term(env, name).double(), values, atol=1e-5), name
    total = sum(weight * expected[name] for name, weight in load(dict, "reward/paper").items())
    assert torch.allclose(env.reward.double(), total, atol=1e-4)
    assert torch.equal(env.done == 1, opening > travel * 0.39)


def test_the_observation_equals_a_plain_reference_on_random_states(stage: SimStage) -> None:
    turn = Rotation.from_euler("xyz", [0.1, -0.2, 2.0])
    stage = SimStage(**{**vars(stage), "base": np.array([0.1, 0.2, 0.3, *turn.as_quat()])})
    env = hold_still(make_env(stage, WORLDS, termination_opening=1e9))
    sim, generator = env.sim, torch.Generator().manual_seed(1)
    scatter(env, 8.0, generator)
    sim.joint_q[:] = torch.randn(sim.joint_q.shape, generator=generator) * 3.0
    sim.joint_qd[:] = torch.randn(sim.joint_qd.shape, generator=generator) * 30.0
    env.step(torch.zeros(WORLDS, 9))
    poses = sim.body_q.double()
    hand, _ = frames(poses[:, sim.body("panda_hand")], TOOL, Rotation.identity())
    point, _ = frames(poses[:, sim.body("drawer_2")], tuple(sim.stage.grasp[:3]), Rotation.identity())
    lower, upper = (torch.tensor(x.numpy()[:9]) for x in (sim.model.joint_limit_lower, sim.model.joint_limit_upper))
    expected = torch.cat(
        [
            2.0 * (sim.joint_q[:, :9] - lower) / (upper - lower) - 1.0,
            0.1 * sim.joint_qd[:, :9],
            torch.tensor(turn.inv().apply((point - hand).numpy())),
            sim.joint_q[:, 9:10],
            sim.joint_qd[:, 9:10],
        ],
        dim=1,
    )
    assert (expected.abs() > 5.0).any(dim=0).sum() > 15  # the limit of 5 is met in most columns
    assert torch.allclose(env.observation.double(), expected.double().clamp(-5.0, 5.0), atol=1e-5)


@pytest.mark.slow
def test_the_same_seed_gives_the_same_trajectory_and_another_seed_another(stage: SimStage) -> None:
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
    assert first.shape == (20, 2, 23 + 2 + 14)
    assert first[:, :, 24].sum() == 2.0
    assert torch.equal(first, run(0))
    assert not torch.equal(first[0, 1], run(1)[0, 1])  # world 1 began where its seed says


def test_a_grasp_is_paid_for_what_it_opened_until_it_closes_again(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 4, episode_steps=9))
    # Both fingers in 3 of the 4 steps, both in 1 of them, the right finger alone in all, both in all but from one side.
    held = torch.tensor([[3.0, 1.0, 0.0, 4.0]]).T > torch.arange(4.0)
    left = torch.tensor([1.0, 1.0, 1.0, -1.0])
    contacts(env)["normal"][:, 0, 2], contacts(env)["normal"][:, 1, 2] = left, -1.0
    for step, opening in enumerate((0.05, 0.10, 0.15, 0.25)):
        pressed = torch.stack([held[:, step], torch.ones(4)], dim=1) * 2.0
        open_to(env, opening, lambda pressed=pressed: contacts(env)["on_region"].copy_(pressed))
    assert term(env, "grip").tolist() == [0.0, 0.0, 0.0, 1.0] and not term(env, "pinch").any()
    assert term(env, "grasped_opening").tolist() == pytest.approx([0.15, 0.05, 0.0, 0.0], abs=1e-6)
    open_to(env, 0.10)
    assert term(env, "grasped_opening").tolist() == pytest.approx([0.10, 0.05, 0.0, 0.0], abs=1e-6)


def test_the_way_is_paid_where_it_was_grasped_the_first_time(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 3, episode_steps=20, bonus_openings=(0.01, 0.2, 0.35)))
    scale = wp.to_torch(env.task.world.scale)[0].item()
    contacts(env)["normal"][:, 0, 2], contacts(env)["normal"][:, 1, 2] = 1.0, -1.0

    def openings(*steps: tuple[float, list[bool]]) -> list[float]:
        for opening, held in steps:
            pressed = 2.0 * torch.tensor(held).float()[:, None].expand(3, 2)
            open_to(env, scale * opening, lambda pressed=pressed: contacts(env)["on_region"].copy_(pressed))
        return term(env, "grasped_path").tolist()

    yes, no = True, False
    # The first centimetre counts for nothing; of the 19 that follow, grasped: all ten, the last five, none.
    assert openings((0.01, [yes, no, no])) == [0.0, 0.0, 0.0]
    paid = openings((0.06, [yes, no, no]), (0.11, [yes, yes, no]))
    assert paid == pytest.approx([(10 / 19) ** 2, (5 / 19) ** 2, 0.0], abs=1e-5)
    # Who pushed it, closes it and opens it again in a grasp, gets nothing for it; closing takes nothing away.
    again = openings((0.02, [yes, yes, yes]), (0.11, [yes, yes, yes]))
    assert again == pytest.approx(paid, abs=1e-5) and term(env, "grasped_opening")[2] > 0.08 * scale
    told = env.task.world.grasped.numpy()[:, 3] / (0.2 * scale)
    assert told == pytest.approx([0.5, 0.25, 0.0], abs=1e-5)
    # Beyond 20 cm nothing counts.
    end = openings((0.25, [yes, yes, yes]), (0.3, [yes, yes, yes]))
    assert end == pytest.approx([1.0, (14 / 19) ** 2, (9 / 19) ** 2], abs=1e-5)


def test_a_critic_is_told_how_far_the_part_was_grasped(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 2, describe_part=True, bonus_openings=(0.01, 0.2, 0.35)))
    scale = wp.to_torch(env.task.world.scale)[0].item()
    contacts(env)["normal"][:, 0, 2], contacts(env)["normal"][:, 1, 2] = 1.0, -1.0
    for opening, held in ((0.06, [2.0, 0.0]), (0.11, [2.0, 2.0])):
        pressed = torch.tensor(held)[:, None].expand(2, 2)
        open_to(env, scale * opening, lambda pressed=pressed: contacts(env)["on_region"].copy_(pressed))
    assert env.privileged.shape == (2, 18)
    # In second bonus openings, of 0.2 m: of the opening, and of the way from the first centimetre.
    assert env.privileged[:, 16].tolist() == pytest.approx([0.11 / 0.2, 0.05 / 0.2], abs=1e-5)
    assert env.privileged[:, 17].tolist() == pytest.approx([0.10 / 0.2, 0.05 / 0.2], abs=1e-5)


def test_a_firmer_grasp_is_paid_more_up_to_the_firm_angle(stage: SimStage) -> None:
    angle = torch.tensor([110.0, 121.0, 135.0, 150.0, 180.0]).deg2rad()
    for firm, paid in ((120.0, [0.0, 1.0, 1.0, 1.0, 1.0]), (150.0, [0.0, 0.0411, 0.5658, 1.0, 1.0])):
        env = hold_still(make_env(stage, 5, firm_angle=firm))
        contacts(env)["normal"][:, 0] = 3.0 * torch.stack([angle.cos(), angle.sin(), 0.0 * angle], dim=1)
        contacts(env)["normal"][:, 1] = torch.tensor([2.0, 0.0, 0.0])
        open_to(env, 0.1, lambda env=env: contacts(env)["on_region"].fill_(2.0))
        # (cos 120 - cos angle) / (cos 120 - cos 150), by hand: 0.01504 / 0.36603, 0.20711 / 0.36603
        assert term(env, "pinch").tolist() == pytest.approx(paid, abs=2e-4)
        assert term(env, "grasped_opening").tolist() == pytest.approx([0.1 * each for each in paid], abs=2e-5)


def test_closing_counts_around_the_grasp_point_alone(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 3, tcp_offset=(0.0, 0.0, 0.0)))
    sim, up = env.sim, torch.tensor(Rotation.from_quat(stage.grasp[3:]).as_matrix()[:, 1]).float()
    point = torch.tensor(stage.grasp[:3]).float()
    sim.body_q[:] = 0.0
    sim.body_q[..., 6] = 1.0
    # The tool at the grasp point, the left finger above and the right below it; in world 1 both above, in world 2 all 3 cm off.
    away = torch.tensor([0.0, 0.0, 0.03])[:, None] * up
    sim.body_q[:, sim.body("panda_hand"), :3] = point - torch.tensor([0.0, 0.0, 0.1034]) + away
    sim.body_q[:, sim.body("panda_leftfinger"), :3] = point + 0.04 * up + away
    sim.body_q[:, sim.body("panda_rightfinger"), :3] = point + torch.tensor([-0.04, 0.01, -0.04])[:, None] * up + away
    sim.joint_q[:, 7:9] = torch.tensor([0.03, 0.01])
    env.step(torch.zeros(3, 9))
    assert term(env, "closing").tolist() == pytest.approx([0.04, 0.0, 0.0])


def wrench(force: tuple[float, float, float], at: np.ndarray) -> torch.Tensor:
    """Return a force [N] at a point as a wrench about the world's origin."""
    return torch.tensor(np.concatenate([force, np.cross(at, force)]), dtype=torch.float32)


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (lambda stage: stage, [7.0, -7.0, 7.0, 0.0]),  # the drawer opens towards +x, wherever one pulls
        (opens_backwards, [-7.0, 7.0, -7.0, 0.0]),
        # The hinge stands upright at y = 0.3 m from the handle: half-way, a force is worth half; towards the hinge nothing.
        (hinge, [7.0, -7.0, 3.5, 0.0]),
        (lambda stage: hinge(stage, (-1.2, 0.5)), [-7.0, 7.0, -3.5, 0.0]),
    ],
    ids=["slide", "backwards", "hinge", "hinge backwards"],
)
def test_a_pull_opens_where_it_turns_or_draws_the_part_its_way(stage: SimStage, change, expected: list[float]) -> None:  # noqa: ANN001
    env = hold_still(make_env(change(stage), 4))
    handle = stage.grasp[:3]
    forces = [((7.0, 0.0, 3.0), handle), ((-7.0, 0.0, 0.0), handle)]
    forces += [((7.0, 0.0, 0.0), handle + [0.0, RADIUS / 2, 0.0]), ((0.0, 7.0, 0.0), handle)]
    for i in range(2):
        contacts(env)["pull"][:, i] = torch.stack([wrench(*each) for each in forces]) * (1.0 - 3.0 * i)
    assert opening_forces(env)[:, 0].tolist() == pytest.approx(expected, abs=1e-4)
    assert opening_forces(env)[:, 1].tolist() == pytest.approx([-2.0 * x for x in expected], abs=1e-4)


def press(env: VecEnv, world: int, angle: float, forces: tuple[float, float] = (5.0, 5.0)) -> None:
    """Let the fingers press on the region in directions an angle [degree] apart."""
    found, turn = contacts(env), np.radians(angle)
    found["on_region"][world] = torch.tensor(forces)
    found["normal"][world, 0] = forces[0] * torch.tensor([0.0, 0.0, -1.0])
    found["normal"][world, 1] = forces[1] * torch.tensor([0.0, float(np.sin(turn)), -float(np.cos(turn))])


def test_a_grasp_is_two_fingers_from_opposed_sides(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 6))
    for world, (angle, forces) in enumerate(
        [(180.0, (5.0, 5.0)), (125.0, (5.0, 1.0)), (115.0, (5.0, 5.0)), (0.0, (5.0, 5.0)), (180.0, (5.0, 0.9))]
    ):
        press(env, world, angle, forces)
    assert grasped(env) == [1, 1, 0, 0, 0, 0]
    wide = SimStage(**{**vars(stage), "grasp_size": np.array([0.2, 0.09, 0.02])})  # the gripper opens by 0.08 m
    env = hold_still(make_env(wide, 3))
    press(env, 0, 0.0, (1.5, 0.0))
    press(env, 1, 180.0, (0.5, 0.5))
    assert grasped(env) == [1, 0, 0], "what cannot be pinched is held by one finger"


def test_a_part_that_something_else_of_the_robot_moves_is_not_grasped(stage: SimStage) -> None:
    env = hold_still(make_env(stage, 5))
    # Along the opening [N]: of the fingers on the region, of all else.
    pulls = [(10.0, 0.0), (10.0, 9.0), (10.0, 11.0), (-3.0, 0.9), (10.0, -11.0)]
    for world, pair in enumerate(pulls):
        press(env, world, 180.0)
        for i, pull in enumerate(pair):
            contacts(env)["pull"][world, i] = wrench((pull, 0.0, 0.0), stage.grasp[:3])
    assert grasped(env) == [1, 1, 0, 1, 1]
    assert grasped(env, sense=-1.0) == [1, 1, 1, 1, 0], "while it closes, what pushes it shut counts"


def test_contact_forces_cost_what_is_above_a_gentle_one(stage: SimStage) -> None:
    env = hold_still(make_env(stage))
    env.task.sensor.update = lambda: wp.to_torch(env.task.sensor.found.peak).copy_(torch.tensor([59.0, 100.0]))
    env.step(torch.zeros(2, 9))
    assert term(env, "contact_force").tolist() == [0.0, 40.0]
