"""What counts as picked and placed: a carried cube does; seven ways to cheat do not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
import warp as wp
from cabinet import free_cube, write_cabinet
from settings import load

from s2a import tasks
from s2a.motion.pick import PickStage
from s2a.motion.pick_plan import PickPlan
from s2a.scene.scene import Joint
from s2a.scene.usd import sim_stage
from s2a.sim.simulation import SimConfig, Simulation
from s2a.tasks.env import VecEnv
from s2a.tasks.pick_place import PickPlaceConfig, PickPlaceMetrics

START, GOAL = np.array([0.2, 0.1, 0.827, 0, 0, 0, 1.0]), np.array([0.2, -0.2, 0.827, 0, 0, 0, 1.0])
STEPS = 60
"""A second of control steps."""


def pick_stage(path: Path) -> PickStage:
    """Return a cube on a cabinet, another cube beside it, and a robot that is too far to touch them."""
    cubes = [free_cube("cube_9", tuple(START[:3]), 0.05, 0.2), free_cube("cube_10", (0.0, 0.3, 0.827), 0.05, 0.2)]
    room = sim_stage.read(write_cabinet(path, free=cubes), visuals=False)
    empty = np.zeros((1, 7))
    plan = PickPlan(np.array([2.0, 0, 0, 0, 0, 1.0, 0]), 0.0, *6 * (empty,), None, np.eye(4), 0.08)
    return PickStage(
        path=path, target="cube_9", joint=Joint("prismatic", (1.0, 0.0, 0.0), tuple(START[:3]), (0.0, 1.0)), base=plan.base,
        grasp=START, grasp_size=np.full(3, 0.05), region=room.free["cube_9"].colliders[0].mesh, also=("cube_10",), room=room,
        start=START, goal=GOAL, plan=plan,
    )  # fmt: skip


@pytest.fixture(scope="module")
def env(tmp_path_factory: pytest.TempPathFactory) -> VecEnv:
    """One world whose physics is what a test says."""
    stage = pick_stage(tmp_path_factory.mktemp("pick") / "sim.usda")
    sim = Simulation(stage, load(SimConfig, "sim/pick_place"), 1)
    config = load(PickPlaceConfig, "task/pick_place", episode_steps=400)
    env = tasks.make_env(sim, config, load(PickPlaceMetrics, "metrics/pick_place"), {}, 0, graph=False)
    env.task.sensor.update = lambda: None
    sim.step = lambda: [watch() for watch in sim.after_substep]
    return env


class Script:
    """Moves the cubes of a world as a test says, with the contacts it says."""

    def __init__(self, env: VecEnv) -> None:
        self.env, task = env, env.task
        self.pose = wp.to_torch(env.sim.state.body_q).view(-1, 7)
        self.normal, self.force = (
            wp.to_torch(task.world.contacts.normal),
            wp.to_torch(task.world.contacts.on_region),
        )
        self.links = wp.to_torch(task.world.contacts.other_links)
        self.cube, self.other = env.sim.body("cube_9"), env.sim.body("cube_10")
        self.feel()
        env.reset_all()
        self.rest()

    def feel(self, left: float = 0.0, right: float = 0.0, opposed: bool = True, links: float = 0.0) -> None:
        """Set the forces of both fingers and of other links [N]."""
        self.force[0], self.links[0] = torch.tensor([left, right]), links
        self.normal[0, 0] = torch.tensor([0.0, left, 0.0])
        self.normal[0, 1] = torch.tensor([0.0, -right if opposed else right, 0.0])

    def step(self, count: int = 1) -> None:
        """Do control steps in which nothing moves."""
        for _ in range(count):
            self.env.step(torch.zeros(1, self.env.num_actions))
            if self.env.done[0]:
                return

    def rest(self, count: int = 40) -> None:
        """Let the episode settle."""
        self.step(count)

    def move(self, *points: tuple[float, float, float]) -> None:
        """Move the cube on straight lines, 10 mm a control step."""
        for end in points:
            start = self.pose[self.cube, :3].numpy().copy()
            for fraction in np.linspace(0.0, 1.0, max(2, int(np.linalg.norm(end - start) / 0.01)))[1:]:
                self.pose[self.cube, :3] = torch.tensor(start + fraction * (end - start), dtype=torch.float32)
                self.step()

    def result(self) -> dict[str, float]:
        """Let the episode end, and return its result by column."""
        while not self.env.done[0]:
            self.step()
        return dict(zip(self.env.columns, self.env.result[0].tolist(), strict=True))


UP, OVER, DOWN = (0.2, 0.1, 0.93), (0.2, -0.2, 0.93), tuple(GOAL[:3])


def carry(script: Script) -> None:
    """Pinch, lift, carry, put down, let go."""
    script.feel(20.0, 20.0)
    script.move(UP, OVER, DOWN)
    script.feel()


def push(script: Script) -> None:
    """Push it there with one finger."""
    script.feel(20.0, 0.0)
    script.move(DOWN)
    script.feel()


def shove(script: Script) -> None:
    """Push it there with both fingers side by side."""
    script.feel(20.0, 20.0, opposed=False)
    script.move(DOWN)
    script.feel()


def drop(script: Script) -> None:
    """Carry it above its place, and drop it from 10 cm."""
    script.feel(20.0, 20.0)
    script.move(UP, OVER)
    script.feel()
    script.move(DOWN)


def throw(script: Script) -> None:
    """Lift it, and throw it from where it was."""
    script.feel(20.0, 20.0)
    script.move(UP)
    script.feel()
    script.move(OVER, DOWN)


def hold(script: Script) -> None:
    """Carry it there, and keep it in the gripper."""
    script.feel(20.0, 20.0)
    script.move(UP, OVER, DOWN)


def teleport(script: Script) -> None:
    """Begin the episode with the object at its place."""
    script.pose[script.cube, :3] = torch.tensor(DOWN, dtype=torch.float32)


def tilt(script: Script) -> None:
    """Put it down turned by 15 degrees."""
    carry(script)
    script.pose[script.cube, 3:] = torch.tensor([0.0, 0.0, np.sin(np.radians(7.5)), np.cos(np.radians(7.5))])


def sweep(script: Script) -> None:
    """Carry it there, and move the other cube by 6 mm."""
    carry(script)
    script.pose[script.other, 0] += 0.006


CHEATS = (push, shove, drop, throw, hold, teleport, tilt, sweep)


def play(env: VecEnv, act: Callable[[Script], None]) -> dict[str, float]:
    """Return the result of an episode."""
    script = Script(env)
    act(script)
    return script.result()


def test_a_carried_cube_is_a_success(env: VecEnv) -> None:
    result = play(env, carry)
    assert result["success"] == 1.0, result
    assert result["carried_fraction"] == pytest.approx(1.0)
    assert result["position_error"] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize("cheat", CHEATS)
def test_a_cheat_is_none(env: VecEnv, cheat: Callable[[Script], None]) -> None:
    assert play(env, cheat)["success"] == 0.0


@pytest.mark.parametrize(
    ("cheat", "column"),
    [
        (push, "carried"),
        (shove, "carried"),
        (drop, "released_at_rest"),
        (throw, "released_at_rest"),
        (hold, "placed"),
        (teleport, "carried"),
        (tilt, "placed"),
        (sweep, "undisturbed"),
    ],
)
def test_the_columns_tell_what_was_wrong(env: VecEnv, cheat: Callable[[Script], None], column: str) -> None:
    assert play(env, cheat)[column] == 0.0


def test_the_other_cube_may_settle_at_first(env: VecEnv) -> None:
    script = Script(env)
    env.reset_all()
    script.pose[script.other, 2] -= 0.006
    script.rest()
    carry(script)
    assert script.result()["success"] == 1.0


def moving(script: Script, shift: float, turn: float) -> dict[str, float]:
    """Return the result where the cube, put down, moves [m/s] and turns [rad/s] to and fro, twice in three seconds."""
    carry(script)
    step, middle, angle = 0, script.pose[script.cube, :3].clone(), 0.0
    while not script.env.done[0]:
        sign = 1.0 if step // (3 * STEPS // 4) % 2 == 0 else -1.0
        middle[0], angle, step = middle[0] + sign * shift / STEPS, angle + sign * turn / STEPS, step + 1
        script.pose[script.cube, :3] = middle
        script.pose[script.cube, 3:] = torch.tensor([0.0, 0.0, np.sin(angle / 2), np.cos(angle / 2)])
        script.step()
    return script.result()


@pytest.mark.parametrize(("shift", "turn"), [(0.01, 0.0), (0.0, 0.1)])
def test_an_object_that_still_moves_is_not_placed(env: VecEnv, shift: float, turn: float) -> None:
    result = moving(Script(env), shift, turn)
    assert result["placed"] == 0.0
    assert result["position_error"] < env.task.config.position_tolerance
    assert result["angle_error"] < env.task.config.angle_tolerance


@pytest.mark.parametrize(("amplitude", "rests"), [(0.001, 1.0), (0.005, 0.0)])
def test_an_object_that_trembles_in_place_is_at_rest(env: VecEnv, amplitude: float, rests: float) -> None:
    script = Script(env)
    carry(script)
    sign = 1.0
    while not env.done[0]:  # at 6 and 30 cm/s
        script.pose[script.cube, 0] += sign * amplitude
        sign = -sign
        script.step()
    assert script.result()["placed"] == rests
