"""The task's kernels against plain torch, on parts that slide and turn either way, and the bookkeeping of episodes."""

from __future__ import annotations

import itertools
from copy import copy
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
import warp as wp
from cabinet import HANDLE, write_cabinet
from scipy.spatial.transform import Rotation
from settings import load

from s2a.env.vec_env import OpenDrawerEnv
from s2a.evaluate import evaluate, warn_of_trouble
from s2a.planner.motion import Planner, PlannerConfig
from s2a.scene import Joint
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.open_part.config import COUNTS, RESULTS, REWARD_TERMS, TROUBLES, OpenDrawerConfig

WORLDS = 64
RADIUS = 0.3
"""From the hinge to the handle [m], where a test makes the stage a hinge's."""


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    """A hand-made cabinet with a drawer of 0.4 m."""
    return read_stage(write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda"))


def make_env(stage: SimStage, worlds: int = 2, still: bool = True, sim: str = "sim/paper", **task: object):  # noqa: ANN202
    """Return worlds of a stage; where they are `still`, physics leaves the state as the test puts it."""
    env = OpenDrawerEnv(
        Simulation(stage, load(SimConfig, sim), worlds),
        load(OpenDrawerConfig, "task/open_drawer", **task),
        load(dict, "reward/paper"),
        0,
    )
    if still:
        env.sim.step = lambda: None
    return env


def column(env: OpenDrawerEnv, name: str) -> list[float]:
    """Return a column of how the last finished episodes went."""
    return env.result[:, RESULTS.index(name)].tolist()


def opens_backwards(stage: SimStage) -> SimStage:
    """Return a stage whose joint opens towards its lower limit."""
    return replace(stage, joint=replace(stage.joint, limits=(-0.4, 0.0)))


def hinge(stage: SimStage) -> SimStage:
    """Return a stage that says of itself it is a hinge, RADIUS beside the handle."""
    origin = HANDLE + [0.0, RADIUS, 0.0]
    return replace(stage, joint=Joint("revolute", (0.0, 0.0, 1.0), tuple(origin), (-0.5, 1.2)))


def frames(poses: torch.Tensor, point: tuple[float, ...], turn: Rotation) -> tuple[torch.Tensor, torch.Tensor]:
    """Return origins [world 3] and axes [world 3 axis] of a frame fixed to bodies, scipy doing the turning."""
    rotation = Rotation.from_quat(poses[:, 3:].numpy())
    return poses[:, :3] + torch.tensor(rotation.apply(point)), torch.tensor((rotation * turn).as_matrix())


@pytest.mark.parametrize(
    ("change", "lever"), [(replace, 1.0), (opens_backwards, -1.0), (hinge, RADIUS)], ids=["slide", "backwards", "hinge"]
)
def test_reward_terms_equal_a_plain_reference_on_random_states(stage: SimStage, change, lever: float) -> None:  # noqa: ANN001
    env = make_env(change(stage), WORLDS)
    sim, generator = env.sim, torch.Generator().manual_seed(0)
    sim.body_q[:, :, :3] = torch.rand(sim.body_q[:, :, :3].shape, generator=generator) * 0.4
    quaternions = torch.randn(sim.body_q[:, :, 3:].shape, generator=generator)
    sim.body_q[:, :, 3:] = quaternions / quaternions.norm(dim=-1, keepdim=True)
    sim.joint_q[:, 9] = torch.rand(WORLDS, generator=generator) * 0.38 / lever
    body_q, opening = sim.body_q.double().clone(), sim.joint_q[:, 9].double() * lever
    action = torch.randn(WORLDS, 9, generator=generator)
    env.step(action)

    hand, hand_axes = frames(
        body_q[:, sim.body("panda_link7")], (0.0, 0.04, 0.1654), Rotation.from_euler("z", -45, degrees=True)
    )
    point, axes = frames(
        body_q[:, sim.body("drawer_2")], tuple(sim.stage.grasp[:3]), Rotation.from_quat(sim.stage.grasp[3:])
    )
    left, right = (body_q[:, sim.body(f"panda_{side}finger"), :3] - point for side in ("left", "right"))
    way, up = (hand - point).norm(dim=1), axes[:, :, 1]
    near = (1.0 / (1.0 + way**2)) ** 2
    dots = [(hand_axes[:, :, i] * axes[:, :, i]).sum(dim=1) for i in (2, 1)]
    travel = min(1.0, max(map(abs, sim.stage.joint.limits)) * abs(lever) / 0.4)
    expected = {
        "distance": torch.where(way <= 0.02, 2.0 * near, near),
        "rotation": 0.5 * sum(d.sign() * d**2 for d in dots),
        "opening": opening,
        "finger": (left * up).sum(dim=1).clamp(max=0.0) + (-(right * up).sum(dim=1)).clamp(max=0.0),
        "bonus": sum((opening > travel * x).double() for x in (0.01, 0.2, 0.35)),
        "action": (action.clamp(-1.0, 1.0) ** 2).sum(dim=1).double(),
        "grip": torch.zeros(WORLDS).double(),
        "led_opening": torch.zeros(WORLDS).double(),
        "closing": torch.zeros(WORLDS).double(),
    }
    for i, name in enumerate(REWARD_TERMS):
        assert torch.allclose(env.terms[:, i].double(), expected[name], atol=1e-5), name
    weights = load(dict, "reward/paper")
    total = sum(weights[name] * value for name, value in expected.items())
    assert torch.allclose(env.reward.double(), total, atol=1e-4)
    assert torch.equal(env.done == 1, opening > travel * 0.39)


def test_the_observation_equals_a_plain_reference_on_random_states(stage: SimStage) -> None:
    turn = Rotation.from_euler("xyz", [0.1, -0.2, 2.0])
    env = make_env(replace(stage, base=np.array([0.1, 0.2, 0.3, *turn.as_quat()])), WORLDS, end_opening=1e9)
    sim, generator = env.sim, torch.Generator().manual_seed(1)
    sim.body_q[:, :, :3] = torch.rand(sim.body_q[:, :, :3].shape, generator=generator) * 8.0
    quaternions = torch.randn(sim.body_q[:, :, 3:].shape, generator=generator)
    sim.body_q[:, :, 3:] = quaternions / quaternions.norm(dim=-1, keepdim=True)
    sim.joint_q[:] = torch.randn(sim.joint_q.shape, generator=generator) * 3.0
    sim.joint_qd[:] = torch.randn(sim.joint_qd.shape, generator=generator) * 30.0
    env.step(torch.zeros(WORLDS, 9))
    poses = sim.body_q.double()
    hand, _ = frames(poses[:, sim.body("panda_link7")], (0.0, 0.04, 0.1654), Rotation.identity())
    # The hand's point is given in a frame that stands turned, but not moved, against link 7's.
    point, _ = frames(poses[:, sim.body("drawer_2")], tuple(sim.stage.grasp[:3]), Rotation.identity())
    lower, upper = (torch.tensor(x.numpy()[:9]) for x in (sim.model.joint_limit_lower, sim.model.joint_limit_upper))
    way = torch.tensor(turn.inv().apply((point - hand).numpy()))
    expected = torch.cat(
        [
            2.0 * (sim.joint_q[:, :9] - lower) / (upper - lower) - 1.0,
            0.1 * sim.joint_qd[:, :9],
            way,
            sim.joint_q[:, 9:10],
            sim.joint_qd[:, 9:10],
        ],
        dim=1,
    )
    assert (expected.abs() > 5.0).any(dim=0).sum() > 15  # the limit of 5 is met in most columns
    assert torch.allclose(env.observation.double(), expected.double().clamp(-5.0, 5.0), atol=1e-5)


def test_forces_are_felt_within_five_millimetres_of_the_region_as_a_plain_reference_says(stage: SimStage) -> None:
    env, count = make_env(stage, 3), 400
    rng = np.random.default_rng(0)
    region = trimesh.Trimesh(env._region.points.numpy(), env._region.indices.numpy().reshape(-1, 3), process=False)
    places = trimesh.sample.sample_surface(region, count, seed=0)[0] + rng.uniform(-0.01, 0.01, (count, 3))
    poses = np.hstack([rng.uniform(-1.0, 1.0, (3, 3)), Rotation.random(3, rng=rng).as_quat()]).astype(np.float32)
    wp.to_torch(env.sim.before.body_q).view(3, -1, 7)[:, env.sim.body("drawer_2")] = torch.tensor(poses)
    kinds = np.array([0, 1, 2, -1])  # left finger, right finger, part, anything else
    pairs, worlds = rng.integers(0, 4, (count, 2)), rng.integers(0, 3, count)
    points = poses[worlds, :3] + Rotation.from_quat(poses[worlds, 3:]).apply(places)
    rows, forces = rng.integers(-1, 50, (count, 4)), rng.uniform(0.0, 3.0, (3, 50))
    data = vars(env.sim.solver.mjw_data)
    contact, efc = copy(data["contact"]), copy(data["efc"])
    contact.geom, contact.worldid = wp.array(pairs, dtype=wp.vec2i), wp.array(worlds, dtype=int)
    contact.pos, contact.efc_address = wp.array(points, dtype=wp.vec3), wp.array(rows, dtype=int)
    efc.force, env._geom_kind = wp.array(forces, dtype=float), wp.array(kinds, dtype=int)
    last = count - 10  # what lies behind the last contact is of an earlier step
    data.update(contact=contact, efc=efc, nacon=wp.array([last], dtype=int), naconmax=count)
    env.feel()
    expected = np.zeros((2, 3, 2))
    pairs_of = np.repeat(places, len(region.faces), axis=0)  # every place with every triangle
    nearest = trimesh.triangles.closest_point(np.tile(region.triangles, (count, 1, 1)), pairs_of)
    far = np.linalg.norm(nearest - pairs_of, axis=1).reshape(count, -1).min(axis=1)
    for i in range(last):
        fingers = [kind for kind in kinds[pairs[i]] if kind in (0, 1)]
        if rows[i, 0] >= 0 and 2 in kinds[pairs[i]] and fingers:
            felt = expected[int(far[i] > 0.005), worlds[i]]
            felt[fingers[0]] = max(felt[fingers[0]], forces[worlds[i], rows[i, 0]])
    assert (expected > 0.0).all() and 0.2 < (far > 0.005).mean() < 0.8
    assert np.allclose([env.touch.numpy(), env.elsewhere.numpy()], expected, atol=1e-5)


def test_a_shorter_way_scales_the_openings_that_count(stage: SimStage) -> None:
    # 1.2 rad at 0.3 m is 0.36 m of way: success at 0.9 x 0.2 m, which is 0.6 rad.
    env = make_env(hinge(stage), 2, episode_steps=2)
    assert env.openings == pytest.approx({"success": 0.18, "wide": 0.27, "static": 0.27, "full": 0.342})
    env.sim.joint_q[:, 9] = torch.tensor([0.59, 0.61])
    env.step(torch.zeros(2, 9))
    assert column(env, "success") == [0.0, 1.0]
    assert column(env, "opening") == pytest.approx([0.59 * RADIUS, 0.61 * RADIUS])


def test_further_openings_are_counted_at_any_time_and_at_the_end(stage: SimStage) -> None:
    # A way of 0.36 m: wide is 0.9 x 0.30 m = 0.9 rad, static 0.75 x 1.2 rad = 0.9 rad, full 0.95 x 1.2 rad = 1.14 rad.
    env = make_env(hinge(stage), 4, episode_steps=3, end_opening=9.0)
    env.sim.joint_q[:, 9] = torch.tensor([0.89, 0.91, 0.91, 1.15])
    env.sim.joint_qd[:, 9] = torch.tensor([0.0, 0.32, 0.34, 0.0])  # 0.1 m/s is 0.333 rad/s at 0.3 m
    env.step(torch.zeros(4, 9))
    env.sim.joint_q[3, 9] = 0.1
    env.step(torch.zeros(4, 9))
    assert column(env, "wide") == [0.0, 1.0, 1.0, 1.0] and column(env, "final_wide") == [0.0, 1.0, 1.0, 0.0]
    assert column(env, "static") == [0.0, 1.0, 0.0, 1.0] and column(env, "final_static") == [0.0, 1.0, 0.0, 0.0]
    assert column(env, "full") == [0.0, 0.0, 0.0, 1.0] and column(env, "final_full") == [0.0, 0.0, 0.0, 0.0]


def test_an_episode_that_began_midway_is_not_counted_the_next_one_is(stage: SimStage) -> None:
    env = make_env(stage, 2, episode_steps=4)
    env.episode_step[0], env.midway[0] = 2, 1
    for expected in (0.0, 0.0, 1.0, 2.0):
        env.step(torch.zeros(2, 9))
        assert float(env.counts[COUNTS.index("episodes")]) == expected


def test_an_episode_is_cut_after_one_step_less_than_its_length_and_that_is_a_time_out(stage: SimStage) -> None:
    env = make_env(stage, 2, episode_steps=6)
    for step in range(1, 6):
        if step == 5:
            env.sim.joint_q[1, 9] = 0.395  # ends by itself in the step in which it would be cut
        env.step(torch.zeros(2, 9))
        assert env.done.tolist() == ([1, 1] if step == 5 else [0, 0])
    assert env.time_out.tolist() == [1, 0]
    assert env.episode_step.tolist() == [0, 0]
    env.step(torch.zeros(2, 9))
    assert env.done.tolist() == env.time_out.tolist() == [0, 0]


def test_an_opening_that_is_not_finite_is_no_success(stage: SimStage) -> None:
    env = make_env(stage, 2)
    env.sim.joint_q[0, 9] = torch.inf
    env.step(torch.zeros(2, 9))
    assert dict(zip(COUNTS, env.counts.tolist(), strict=True)) == {
        **dict.fromkeys(COUNTS, 0.0),
        "episodes": 1.0,
        "invalid": 1.0,
    }
    assert env.result[0].tolist() == [float(name == "invalid") for name in RESULTS]


def test_what_opens_before_physics_goes_wrong_is_no_success_and_is_counted_midway_too(stage: SimStage) -> None:
    env = make_env(stage, 2, end_opening=9.0)
    env.midway[1] = 1
    env.sim.joint_q[:, 9] = 0.39
    env.step(torch.zeros(2, 9))
    env.sim.joint_qd[:, 3] = torch.nan
    env.step(torch.zeros(2, 9))
    known = dict(zip(RESULTS, env.result[0].tolist(), strict=True))
    assert known.pop("opening") == pytest.approx(0.39) and known.pop("invalid") == 1.0
    assert set(known.values()) == {0.0}
    counts = dict(zip(COUNTS, env.counts.tolist(), strict=True))
    assert (counts["episodes"], counts["invalid"]) == (1.0, 2.0)


@pytest.mark.parametrize(
    ("capacity", "expected", "key"),
    [({"njmax": 5}, ("row_overflow", 1.0), "sim.njmax"), ({"naconmax": 2}, ("contact_overflow", 2.0), "sim.nconmax")],
)
def test_an_overflow_is_counted_in_the_episodes_that_it_concerns(
    stage: SimStage, capacity: dict[str, int], expected: tuple[str, float], key: str, caplog: pytest.LogCaptureFixture
) -> None:
    env = make_env(stage, still=False, sim="sim/planner", start_noise=0.0, episode_steps=6)
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
    counts = dict(zip(COUNTS, env.counts.tolist(), strict=True))
    assert {name: counts[name] for name in TROUBLES} == {**dict.fromkeys(TROUBLES, 0.0), expected[0]: expected[1]}
    for _ in range(5):
        env.step(torch.zeros(2, 9))
    assert env.counts[COUNTS.index(expected[0])] == expected[1], "the next episodes, at the start position, have none"
    warn_of_trouble(counts, env)
    assert [key in message for message in caplog.messages] == [True]
    caplog.clear()
    warn_of_trouble({**counts, "episodes": 1e6}, env)
    assert caplog.messages == []


def test_the_handle_counts_if_held_for_half_of_the_way(stage: SimStage) -> None:
    env = make_env(stage, 3, episode_steps=9)
    touch = wp.to_torch(env._touch)
    # Both fingers in 3 of the 4 steps on the way, both in 1 of them, the right finger alone in all.
    held = torch.tensor([[3.0, 1.0, 0.0]]).T > torch.arange(4.0)
    for step, opening in enumerate((0.05, 0.10, 0.15, 0.25)):
        env.sim.joint_q[:, 9] = opening
        env.sim.step = lambda step=step: touch.copy_(torch.stack([held[:, step], torch.ones(3)], dim=1) * 2.0)
        env.step(torch.zeros(3, 9))
    assert env.terms[:, REWARD_TERMS.index("grip")].tolist() == [0.0, 0.0, 0.0]
    assert env.terms[:, REWARD_TERMS.index("led_opening")].tolist() == pytest.approx([0.15, 0.05, 0.0], abs=1e-3)
    env.sim.joint_q[:, 9] = 0.10  # what closes again is led no longer
    env.step(torch.zeros(3, 9))
    assert env.terms[:, REWARD_TERMS.index("led_opening")].tolist() == pytest.approx([0.10, 0.05, 0.0], abs=1e-3)
    while not env.done.any():
        env.step(torch.zeros(3, 9))
    assert column(env, "success") == [1.0, 1.0, 1.0]
    assert column(env, "handle_success") == [1.0, 0.0, 0.0]
    assert column(env, "hook_success") == [0.0, 1.0, 1.0]


def test_a_success_with_fingers_beside_the_handle_alone_is_counted_apart(stage: SimStage) -> None:
    env = make_env(stage, 4, episode_steps=9)
    touch, elsewhere = wp.to_torch(env._touch), wp.to_torch(env._elsewhere)
    # A finger presses on the front in worlds 0 to 2: alone for 2 of 4 steps, alone for 1, with the other on the handle.
    beside = torch.tensor([[2.0, 1.0, 4.0, 0.0]]).T > torch.arange(4.0)
    for step, opening in enumerate((0.05, 0.10, 0.15, 0.25)):
        env.sim.joint_q[:, 9] = opening

        def press(step: int = step) -> None:
            elsewhere[:, 1] = beside[:, step] * 1.5
            touch[2, 0] = 1.5

        env.sim.step = press
        env.step(torch.zeros(4, 9))
    while not env.done.any():
        env.step(torch.zeros(4, 9))
    assert column(env, "success") == [1.0] * 4
    assert column(env, "side_success") == [1.0, 0.0, 0.0, 0.0]
    assert column(env, "handle_success") == [0.0] * 4


@pytest.mark.parametrize("cone", ["elliptic", pytest.param("pyramidal", marks=pytest.mark.slow)])
def test_a_grip_is_felt_on_the_region_and_not_beside_it(stage: SimStage, cone: str) -> None:
    sim = Simulation(stage, load(SimConfig, "sim/planner", cone=cone), 2)
    env = OpenDrawerEnv(sim, load(OpenDrawerConfig, "task/open_drawer"), load(dict, "reward/paper"), 0)
    planner = Planner(env, load(PlannerConfig, "policy/planner"))
    for _ in range(240):  # the fingers close at 3.6 s = step 216
        env.step(planner(env.observation.clone()))
    # The fingers press with stiffness 2000 N/m over half the bar's thickness, 11.9 mm.
    assert env.touch.flatten().tolist() == pytest.approx([23.8] * 4, rel=0.2)
    assert env.terms[:, REWARD_TERMS.index("grip")].tolist() == [1.0, 1.0]
    felt, keep = [], sim.after_substep

    def watch() -> None:
        keep()
        felt.append(env.touch.clone())

    sim.after_substep = watch
    env.step(planner(env.observation.clone()))
    assert len(felt) == 4 and felt[0].min() > 0.0  # every physics step is felt, and the largest force is kept
    assert all((later >= earlier).all() for earlier, later in itertools.pairwise(felt))
    assert torch.equal(env.touch, felt[-1])
    sim.after_substep = keep
    # Contacts lie where the part was before the physics step, not where that took it.
    env.touch.zero_()
    wp.to_torch(sim.state.body_q).view(2, -1, 7)[:, sim.body("drawer_2"), 0] += 0.05
    env.feel()
    assert env.touch.min() > 0.0
    wp.to_torch(sim.state.body_q).view(2, -1, 7)[:, sim.body("drawer_2"), 0] -= 0.05
    env._region.points = wp.array(env._region.points.numpy() + [0.0, 0.0, 0.04], dtype=wp.vec3)
    env.step(planner(env.observation.clone()))
    assert env.touch.tolist() == [[0.0, 0.0], [0.0, 0.0]]
    assert env.elsewhere.flatten().tolist() == pytest.approx([23.8] * 4, rel=0.2)


def test_closing_counts_around_the_grasp_point_alone(stage: SimStage) -> None:
    env = make_env(stage, 3, hand_point=(0.0, 0.0, 0.2104))
    sim, up = env.sim, torch.tensor(Rotation.from_quat(stage.grasp[3:]).as_matrix()[:, 1]).float()
    point = torch.tensor(stage.grasp[:3]).float()
    sim.body_q[:] = 0.0
    sim.body_q[..., 6] = 1.0
    # The hand at the grasp point, the left finger above and the right below it; in world 1 both above, in world 2 all 3 cm off.
    away = torch.tensor([0.0, 0.0, 0.03])[:, None] * up
    sim.body_q[:, sim.body("panda_link7"), :3] = point - torch.tensor([0.0, 0.0, 0.2104]) + away
    sim.body_q[:, sim.body("panda_leftfinger"), :3] = point + 0.04 * up + away
    sim.body_q[:, sim.body("panda_rightfinger"), :3] = point + torch.tensor([-0.04, 0.01, -0.04])[:, None] * up + away
    sim.joint_q[:, 7:9] = torch.tensor([0.03, 0.01])
    sim.body_q[:, sim.body("drawer_2"), 6] = 1.0
    env.step(torch.zeros(3, 9))
    assert env.terms[:, REWARD_TERMS.index("closing")].tolist() == pytest.approx([0.04, 0.0, 0.0])


@pytest.mark.slow
def test_openings_without_the_region_in_the_fingers_use_no_handle(stage: SimStage) -> None:
    env = make_env(stage, 2, still=False, sim="sim/planner")
    env._region.points = wp.array(env._region.points.numpy() + [0.0, 0.0, 0.04], dtype=wp.vec3)
    result = evaluate(env, Planner(env, load(PlannerConfig, "policy/planner")))
    assert result["success"]["rate"] == 1.0
    assert result["handle_success"]["rate"] == 0.0
    assert result["side_success"]["rate"] == 1.0
    assert result["invalid"] == 0
