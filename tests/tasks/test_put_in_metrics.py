"""What counts as put into a part: a cube that is carried in and shut up does; nine ways to cheat do not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
import warp as wp
from drawer_room import FLOOR, START, drawer_room
from settings import load

from s2a import tasks
from s2a.motion.pick_plan import PickPlan
from s2a.motion.places import Inside, inside_of
from s2a.motion.put_in import PutPlan, PutStage
from s2a.scene.scene import Joint
from s2a.sim.simulation import SimConfig, Simulation
from s2a.tasks.env import VecEnv
from s2a.tasks.put_in import PutInConfig, PutInMetrics

OPEN = 0.3
GOAL = np.array([0.45, 0.0, FLOOR + 0.02, 0, 0, 0, 1.0])
"""In the open drawer."""


def put_stage(path: Path) -> PutStage:
    """Return a cube on a cabinet, its drawer, and a robot that is too far to touch them."""
    room = drawer_room(path)
    empty = np.zeros((1, 7))
    pick = PickPlan(np.array([3.0, 0, 0, 0, 0, 1.0, 0]), 0.0, *6 * (empty,), None, np.eye(4), 0.08)
    inside = inside_of(room, "drawer_2", OPEN, GOAL[:3] - [0, 0, 0.02])
    assert isinstance(inside, Inside)
    put = PutPlan(pick, GOAL, inside, empty, empty, (0, 0), empty, empty, empty)
    return PutStage(
        path=path, target="cube_9", joint=Joint("prismatic", (1.0, 0.0, 0.0), tuple(START[:3]), (0.0, 1.0)), base=pick.base,
        grasp=START, grasp_size=np.full(3, 0.04), region=room.free["cube_9"].colliders[0].mesh, also=("drawer_2", "cube_10"),
        room=room, start=START, goal=GOAL, plan=pick, part="drawer_2", opened=OPEN, put=put,
    )  # fmt: skip


@pytest.fixture(scope="module")
def env(tmp_path_factory: pytest.TempPathFactory) -> VecEnv:
    """One world whose physics is what a test says."""
    stage = put_stage(tmp_path_factory.mktemp("put") / "sim.usda")
    sim = Simulation(stage, load(SimConfig, "sim/put_in"), 1)
    config = load(PutInConfig, "task/put_in", episode_steps=500)
    env = tasks.make_env(sim, config, load(PutInMetrics, "metrics/put_in"), {}, 0, graph=False)
    env.task.sensor.update = lambda: None
    sim.step = lambda: [watch() for watch in sim.after_substep]
    return env


class Script:
    """Moves cubes and drawer of a world as a test says, with the contacts it says."""

    def __init__(self, env: VecEnv) -> None:
        self.env, task = env, env.task
        self.pose = wp.to_torch(env.sim.state.body_q).view(-1, 7)
        self.coords = wp.to_torch(env.sim.state.joint_q).view(1, -1)
        wp.to_torch(env.sim.state.body_qd).zero_()
        contacts = task.world.contacts
        self.normal, self.force = wp.to_torch(contacts.normal), wp.to_torch(contacts.on_region)
        self.cube, self.other, self.part = (env.sim.body(i) for i in ("cube_9", "cube_10", "drawer_2"))
        self.feel(0.0)
        env.reset_all()
        self.step(40)

    def feel(self, left: float, right: float | None = None) -> None:
        """Set the forces of both fingers, opposed [N]."""
        right = left if right is None else right
        self.force[0] = torch.tensor([left, right])
        self.normal[0, 0], self.normal[0, 1] = torch.tensor([0.0, left, 0.0]), torch.tensor([0.0, -right, 0.0])

    def step(self, count: int = 1) -> None:
        """Do control steps in which nothing moves."""
        for _ in range(count):
            self.env.step(torch.zeros(1, self.env.num_actions))
            if self.env.done[0]:
                return

    def move(self, *points: tuple[float, float, float]) -> None:
        """Move the cube on straight lines, 10 mm a control step."""
        for end in points:
            start = self.pose[self.cube, :3].numpy().copy()
            for fraction in np.linspace(0.0, 1.0, max(2, int(np.linalg.norm(end - start) / 0.01)))[1:]:
                self.pose[self.cube, :3] = torch.tensor(start + fraction * (end - start), dtype=torch.float32)
                self.step()

    def slide(self, to: float, *, loaded: bool = False) -> None:
        """Move the drawer, 10 mm a control step, with the cube in it or not."""
        start = float(self.coords[0, self.env.task.world.place.coord])
        cube = float(self.pose[self.cube, 0])
        for q in np.linspace(start, to, max(2, int(abs(to - start) / 0.01)))[1:]:
            self.coords[0, self.env.task.world.place.coord] = q
            self.pose[self.part, 0] = q
            if loaded:
                self.pose[self.cube, 0] = cube + q - start
            self.step()

    def result(self) -> dict[str, float]:
        """Let the episode end, and return its result by column."""
        while not self.env.done[0]:
            self.step()
        return dict(zip(self.env.columns, self.env.result[0].tolist(), strict=True))


UP, OVER, DOWN = (0.2, 0.1, 0.93), (0.45, 0.0, 0.93), tuple(GOAL[:3])


def carry(script: Script) -> None:
    """Open, pinch, carry in, let go."""
    script.slide(OPEN)
    script.feel(20.0)
    script.move(UP, OVER, DOWN)
    script.feel(0.0)
    script.step(3)


def put(script: Script) -> None:
    """Open, carry in, shut."""
    carry(script)
    script.slide(0.0, loaded=True)


def leave_open(script: Script) -> None:
    """Carry it in, and leave the drawer open."""
    carry(script)


def leave_ajar(script: Script) -> None:
    """Carry it in, and shut the drawer but for 30 of 400 mm."""
    carry(script)
    script.slide(0.03, loaded=True)


def drop(script: Script) -> None:
    """Let go of it 0.2 m above the drawer."""
    script.slide(OPEN)
    script.feel(20.0)
    script.move(UP, OVER)
    script.feel(0.0)
    script.move(DOWN)
    script.slide(0.0, loaded=True)


def on_front(script: Script) -> None:
    """Leave it on top of the drawer's front."""
    script.slide(OPEN)
    script.feel(20.0)
    script.move(UP, (0.615, 0.0, 0.93), (0.615, 0.0, 0.799))
    script.feel(0.0)
    script.slide(0.0, loaded=True)


def teleport(script: Script) -> None:
    """Appear in the shut drawer."""
    script.pose[script.cube, :3] = torch.tensor([GOAL[0] - OPEN, GOAL[1], GOAL[2]], dtype=torch.float32)


def through_the_top(script: Script) -> None:
    """Be carried into the shut drawer."""
    script.feel(20.0)
    script.move(UP, (GOAL[0] - OPEN, 0.0, 0.93), (GOAL[0] - OPEN, 0.0, GOAL[2]))
    script.feel(0.0)


def push(script: Script) -> None:
    """Push it in with one finger."""
    script.slide(OPEN)
    script.feel(20.0, 0.0)
    script.move((0.45, 0.1, 0.822), DOWN)
    script.feel(0.0)
    script.slide(0.0, loaded=True)


def hold(script: Script) -> None:
    """Keep it in the gripper."""
    script.slide(OPEN)
    script.feel(20.0)
    script.move(UP, OVER, DOWN)
    script.slide(0.0, loaded=True)


def sweep(script: Script) -> None:
    """Put it in, and move the other cube by 6 mm."""
    put(script)
    script.pose[script.other, 0] += 0.006


def shake(script: Script) -> None:
    """Let it slide by 3 cm in the drawer as that is shut."""
    carry(script)
    script.move((GOAL[0] - 0.03, *DOWN[1:]))
    script.slide(0.0, loaded=True)


CHEATS = {
    leave_open: "stored", leave_ajar: "stored", drop: "released_at_rest", on_front: "stored", teleport: "carried",
    through_the_top: "shut_with_it", push: "carried", hold: "stored", sweep: "undisturbed", shake: "released_at_rest",
}  # fmt: skip
"""What is done, and the column that says what was wrong."""


def play(env: VecEnv, act: Callable[[Script], None]) -> dict[str, float]:
    """Return the result of an episode."""
    script = Script(env)
    act(script)
    return script.result()


def test_a_cube_that_is_carried_in_and_shut_up_is_a_success(env: VecEnv) -> None:
    result = play(env, put)
    assert result["success"] == 1.0, result
    assert result["carried_fraction"] == pytest.approx(1.0)
    assert result["remaining"] == pytest.approx(0.0, abs=1e-6)
    assert result["position_error"] == pytest.approx(0.0, abs=1e-5)


@pytest.mark.parametrize(("cheat", "column"), CHEATS.items(), ids=[cheat.__name__ for cheat in CHEATS])
def test_a_cheat_fails_by_the_column_that_says_why(env: VecEnv, cheat: Callable[[Script], None], column: str) -> None:
    result = play(env, cheat)
    assert result["success"] == 0.0
    assert result[column] == 0.0


def test_an_episode_begins_without_what_was_before(env: VecEnv) -> None:
    play(env, put)
    result = play(env, lambda script: None)
    assert result["stored"] == result["carried"] == result["shut_with_it"] == 0.0
    assert result["released_at_rest"] == 1.0
