"""An arm that keeps to its limits (sim=real), whatever it is asked for."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from cabinet import write_cabinet
from part_worlds import make_env
from settings import load

from s2a import robot
from s2a.learn.evaluate import baseline, evaluate
from s2a.motion.policy import Planner
from s2a.motion.trajectory import PlannerConfig
from s2a.sim.recorder import LimitUse
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import SimStage, read_stage
from s2a.tasks.env import VecEnv


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> SimStage:
    """A hand-made cabinet."""
    return read_stage(write_cabinet(tmp_path_factory.mktemp("cabinet") / "sim.usda"))


def without_physics(env: VecEnv) -> VecEnv:
    """Let something hold the arm: the controller moves its targets, and nothing else moves."""

    def step() -> None:
        for _ in range(env.sim.config.substeps):
            for move_targets in env.sim.before_substep:
                move_targets()

    env.sim.step = step
    return env


def test_targets_brake_before_an_arm_that_is_held_and_return_with_it(stage: SimStage) -> None:
    env = without_physics(make_env(stage, start_noise=0.0, sim="sim/real"))
    sim, limits, rate = env.sim, env.sim.config.limits, 60.0
    start, speed, last = sim.joint_q[:, :7].clone(), torch.zeros(2, 7), sim.joint_target_q[:, :7].clone()
    top, change = torch.tensor(sim.arm_limits.velocity), torch.tensor(sim.arm_limits.acceleration)
    for step in range(160):
        if step == 80:  # something pushes the arm back
            sim.joint_q[:, :7] -= 0.05
        env.step(torch.ones(2, 9))
        target = sim.joint_target_q[:, :7].clone()
        now = (target - last) * rate
        assert (now.abs() <= top * 1.001).all() and ((now - speed).abs() * rate <= change * 1.001).all(), step
        speed, last = now, target
        if step in (79, 159):
            ahead = target - sim.joint_q[:, :7]
            assert torch.allclose(ahead, torch.full_like(ahead, limits.window), atol=2e-3)
    assert torch.equal(sim.joint_q[:, :7], start - 0.05)


def test_both_fingers_follow_the_mean_of_their_actions_at_their_motors_speed(stage: SimStage) -> None:
    env = without_physics(make_env(stage, start_noise=0.0, sim="sim/real"))
    first = env.sim.joint_target_q[:, 7:9].clone()
    action = torch.zeros(2, 9)
    action[:, 7:] = torch.tensor([[-1.0, 1.0], [-1.0, -1.0]])
    for _ in range(12):
        env.step(action)
    moved = env.sim.joint_target_q[:, 7:9] - first
    assert moved[0].tolist() == [0.0, 0.0] and torch.equal(moved[:, 0], moved[:, 1])
    # 0.05 m/s for 0.2 s, less what a motor needs 0.05 s for.
    assert float(moved[1, 0]) == pytest.approx(-0.05 * (0.2 - 0.025), abs=2e-4)


@pytest.mark.slow
def test_extreme_actions_stay_within_every_limit_and_press_gently(stage: SimStage) -> None:
    env = make_env(stage, 12, episode_steps=300, sim="sim/real", graph=True)
    use, fingers_apart = LimitUse(env.sim), []

    def watch() -> None:
        use.watch(env.episode_step == 0)
        fingers_apart.append(float((env.sim.joint_q[:, 7] - env.sim.joint_q[:, 8]).abs().max()))

    result = evaluate(env, baseline("extreme", env, 0), watch)
    assert max(use.fractions().values()) <= 1.02, use.fractions()
    assert use.fractions()["position"] > 0.95, "some joint was driven to its end"
    assert result["contact_force"]["max"] < 300.0 and result["invalid"] == 0
    assert max(fingers_apart) < 1e-3, "one motor drives both"


def test_the_planner_waits_for_an_arm_that_is_held(stage: SimStage) -> None:
    env = without_physics(make_env(stage, start_noise=0.0, sim="sim/real"))
    planner = Planner(env, load(PlannerConfig, "planner/default"))
    ahead = []
    for _ in range(200):
        action = planner(env.observation)
        ahead.append(float(action[:, :7].abs().max()))
        env.step(action)
    window = env.sim.config.limits.window
    assert float((env.sim.joint_target_q[:, :7] - env.sim.joint_q[:, :7]).abs().max()) <= window + 1e-3
    # The trajectory passes what it waits for by less than one more step at full velocity.
    assert 3.0 < ahead[-1] < 4.0 and ahead[-1] == pytest.approx(ahead[-20], abs=0.05)


def test_without_drives_the_arm_is_the_planners(stage: SimStage) -> None:
    real = load(SimConfig, "sim/real")
    assert real.limits is not None
    ideal = replace(real, limits=replace(real.limits, drives=False))
    planner, ideal, real = (Simulation(stage, each, 1).world for each in (load(SimConfig, "sim/planner"), ideal, real))
    names = (
        "joint_armature",
        "joint_target_kd",
        "joint_target_mode",
        "joint_mimic_joint",
        "shape_collision_filter_pairs",
    )
    for name in names:
        assert getattr(ideal, name) == getattr(planner, name) != getattr(real, name), name


def test_fingers_may_be_coupled_without_the_drives(stage: SimStage) -> None:
    settings = (load(SimConfig, "sim/planner", coupled_fingers=True), load(SimConfig, "sim/real"))
    coupled, real = (Simulation(stage, each, 1).world for each in settings)
    assert coupled.joint_mimic_joint == real.joint_mimic_joint
    assert coupled.joint_armature != real.joint_armature


@pytest.mark.parametrize("sim", ["planner_varied", "pick_place"])
def test_fingers_that_turn_press_as_those_that_slide(sim: str) -> None:
    panda = robot.load("panda")
    # 0.05 m of a pad's path for a radian
    turning = replace(panda, gripper=replace(panda.gripper, finger_joint_open=0.8))
    gains = [load(SimConfig, f"sim/{sim}").gains_of(each).finger_stiffness for each in (panda, turning)]
    assert gains == pytest.approx([6000.0, 15.0])


@pytest.mark.parametrize("coupled", [True, False])
def test_coupled_fingers_start_alike(stage: SimStage, coupled: bool) -> None:
    """Noise that opens one and shuts the other would be undone in a step, at four times the motor's speed."""
    sim = Simulation(stage, load(SimConfig, "sim/planner", coupled_fingers=coupled), 16)
    env = make_env(stage, sim=sim, num_envs=16)
    left, right = env.sim.joint_q[:, 7], env.sim.joint_q[:, 8]
    assert bool((left - right).abs().max() < 1e-6) == coupled
    assert float(left.max() - left.min()) > 0.01


@pytest.mark.slow
def test_the_planner_takes_the_time_that_the_controller_leaves_it(
    stage: SimStage, caplog: pytest.LogCaptureFixture
) -> None:
    env = make_env(stage, sim="sim/real", episode_steps=1000)
    planner, use = Planner(env, load(PlannerConfig, "planner/default")), LimitUse(env.sim)
    result = evaluate(env, planner, lambda: use.watch(env.episode_step == 0))
    assert result["grasp_success"]["rate"] == 1.0
    assert use.fractions()["commanded_velocity"] <= env.sim.config.limits.velocity
    assert max(use.fractions().values()) <= 1.0, use.fractions()
    assert not caplog.records and not planner.cut.size
    short = make_env(stage, sim=env.sim, episode_steps=200)
    assert Planner(short, load(PlannerConfig, "planner/default")).cut.tolist() == [0]
