"""A task of one's own, docs/examples/open_and_hold.py, in the environment and in every command that takes a task."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import satellites
import torch
import warp as wp
from cabinet import write_cabinet
from settings import load

from s2a import robot, tasks
from s2a.commands import cli, train
from s2a.core import config
from s2a.core.errors import InputError
from s2a.motion.trajectory import Demonstration
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks import pool
from s2a.tasks.env import VecEnv
from s2a.tasks.open_part import OpenPart

EXAMPLE = Path(__file__).parents[2] / "docs/examples/open_and_hold.py"
SLIDE = ("device=cpu", "sim.joint.stiffness=0", "sim.joint.damping=20")


def settings(*keys: str) -> train.Config:
    values = config.compose("train", [f"task={EXAMPLE}", f"reward={EXAMPLE.stem}", "stage=x", "out=y", *keys])
    return config.load(train.Config, values)


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_cabinet(tmp_path_factory.mktemp("room") / "a_0.usda")


@pytest.fixture(scope="module")
def env(room: Path) -> VecEnv:
    """Three worlds in which a test moves the drawer and presses the fingers on its handle."""
    given = settings("task.hold_time=0.05")
    sim = Simulation(read_stage(room), load(SimConfig, "sim/paper"), 3)
    env = tasks.make_env(sim, given.task, given.metrics, given.reward, 0, graph=False)
    env.task.sensor.update = lambda: None
    sim.step = lambda: [watch() for watch in sim.after_substep]
    return env


def test_it_is_one_short_file_whose_rewards_are_those_of_another_task() -> None:
    task = tasks.task(str(EXAMPLE))
    assert len(EXAMPLE.read_text().splitlines()) <= 100
    shared = {name for name, term in task.REWARDS.items() if OpenPart.REWARDS.get(name) is term}
    assert shared == {"distance", "pinch", "opening", "action"}


def test_a_part_counts_as_held_after_its_time_open_in_a_grasp(env: VecEnv) -> None:
    """Three control steps of 1/60 s are 0.05 s: grasped for three, grasped for two, open for all without a grasp."""
    contacts = env.task.world.contacts
    normal, pressed = wp.to_torch(contacts.normal), wp.to_torch(contacts.on_region)
    normal[:, 0, 2], normal[:, 1, 2] = 2.0, -2.0
    env.sim.joint_q[:, env.sim.layout.part_coord] = 0.25
    ended = []
    for held in ([1, 1, 0], [1, 0, 0], [1, 1, 0]):
        pressed[:] = 2.0 * torch.tensor(held)[:, None]
        env.step(torch.zeros(3, 9))
        ended.append(env.done.tolist())
        assert env.terms[:, list(env.task.REWARDS).index("holding")].tolist() == held
    assert ended == [[0, 0, 0], [0, 0, 0], [1, 0, 0]]
    assert env.result[0, env.columns.index("success")] == 1.0
    assert float(env.counts[1 + env.columns.index("success")]) == float(env.counts[0]) == 1.0


def test_the_observation_is_named_column_by_column(env: VecEnv) -> None:
    columns = env.task.columns
    assert list(columns) == ["joint_positions", "joint_velocities", "to_grasp", "coordinate", "velocity"]
    assert [columns[name].stop - columns[name].start for name in columns] == [9, 9, 3, 1, 1]
    assert env.observation.shape[1] == env.task.observations == 23


def test_a_sentence_asks_for_it(room: Path, tmp_path: Path) -> None:
    satellites.need("do")
    out = tmp_path / "do.json"
    keys = [f"stage={room}", f"out={out}", f"tasks=[{EXAMPLE}]", "llm=rules", "plan_only=true"]
    assert cli.main(["do", "hold open the drawer, then close it", *keys]) == 0
    plan = json.loads(out.read_text())["plans"][0]["skills"]
    assert [(each["skill"], each["part"]) for each in plan] == [("open_and_hold", "drawer_2"), ("close", "drawer_2")]


def test_it_can_be_benched(room: Path, tmp_path: Path) -> None:
    home = np.array(robot.load("panda").start)
    motion = Demonstration(np.tile(home, (2, 1)), np.zeros((2, 10)), 1)
    pool.save_motion(motion, room.with_name("a_0.npz"))
    index = room.with_name("pool.json")
    pool.write(index, [pool.PoolPart("a_0.usda", "drawer_2", "prismatic", "bar", "a_0.npz")], {}, {})
    keys = [f"stage={index}", f"task={EXAMPLE}", "policy=random", f"out={tmp_path / 'o.json'}"]
    assert cli.main(["bench", *keys, "device=cpu", "episodes=2", "steps=3"]) == 0
    assert json.loads((tmp_path / "o.json").read_text())["over_parts"]["all"]["success"]["rate"] == 0.0


@pytest.mark.slow
def test_the_planner_does_it_and_it_can_be_collected_and_played_again(room: Path, tmp_path: Path) -> None:
    keys = [f"stage={room}", f"task={EXAMPLE}", "part=drawer_2", *SLIDE]
    assert cli.main(["evaluate", *keys, f"out={tmp_path / 'm.json'}", "num_envs=2"]) == 0
    assert json.loads((tmp_path / "m.json").read_text())["success"]["rate"] == 1.0
    small = ["views.width=32", "views.height=32", "every=20", "num_envs=2", "episodes=2"]
    assert cli.main(["collect", *keys, f"out={tmp_path / 'set'}", *small]) == 0
    assert json.loads((tmp_path / "set/meta/s2a.json").read_text())["instruction"] == "open the drawer and hold it open"
    assert cli.main(["replay", f"stage={room}", f"dataset={tmp_path / 'set'}", "device=cpu"]) == 0


@pytest.mark.slow
def test_it_is_done_as_a_sentence_says(room: Path, tmp_path: Path) -> None:
    satellites.need("do")
    out = tmp_path / "do.json"
    keys = [f"stage={room}", f"out={out}", f"tasks=[{EXAMPLE}]", "llm=rules", *SLIDE]
    assert cli.main(["do", "hold open the drawer", *keys]) == 0
    (held,) = json.loads(out.read_text())["skills"]
    assert held["success"] and held["ended"]["joints"]["drawer_2"] > 0.2


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({}, "no such file; a task is FILE.py with FILE.yaml beside it"),
        ({"mine.py": ""}, "mine.yaml: no such file"),
        ({"mine.py": "", "mine.yaml": "task: {}"}, "expected the keys task and metrics"),
        ({"mine.py": "", "mine.yaml": "task: {}\nmetrics: {}"}, "no TASK; give it a subclass"),
    ],
)
def test_what_is_no_task_is_refused_in_one_line(files: dict[str, str], message: str, tmp_path: Path) -> None:
    for name, text in files.items():
        (tmp_path / name).write_text(text)
    with pytest.raises(InputError, match=message):
        values = config.compose("train", [f"task={tmp_path / 'mine.py'}", "stage=x", "out=y"])
        config.load(train.Config, values)
