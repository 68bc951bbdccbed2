"""`s2a collect` and `s2a replay`: demonstrations of the planner that can be played again."""

from __future__ import annotations

import importlib
import json
import re
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import warp as wp
from cabinet import write_cabinet
from gymnasium.error import ResetNeeded

from s2a import robot
from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.learn.collect.episodes import REPLAY
from s2a.tasks import pool

ROOT = Path(__file__).parents[2]
QUICK = ["device=cpu", "num_envs=2", "every=20", "views.width=32", "views.height=32"]


@pytest.fixture(scope="module")
def collected(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    folder = tmp_path_factory.mktemp("collect")
    stage, out = write_cabinet(folder / "sim.usda"), folder / "set"
    assert cli.main(["collect", f"stage={stage}", "episodes=1", f"out={out}", *QUICK]) == 0
    assert cli.main(["collect", f"stage={stage}", "episodes=3", f"out={out}", *QUICK]) == 0  # goes on
    return stage, out


def test_kept_episodes_hold_what_the_robot_did(collected: tuple[Path, Path]) -> None:
    _, out = collected
    info = json.loads((out / "meta/info.json").read_text())
    assert (info["total_episodes"], info["fps"], info["robot_type"]) == (3, 3, "panda")
    spec = robot.load("panda")
    assert info["features"]["observation.state"]["names"] == list(spec.recorded[1:])
    for i in range(3):
        table = pq.read_table(out / f"data/chunk-000/file-00{i}.parquet").to_pydict()
        state, action = np.array(table["observation.state"]), np.array(table["action"])
        assert state.shape == (24, 16) and action.shape == (24, 9)
        assert np.abs(state[0, :7] - np.array(spec.start)[:7]).max() <= 0.13, "it begins near home"
        assert np.abs(state[-1, :7] - action[-1, :7]).max() < 0.1, "the arm is where it is asked to be"
        assert 0.2 < table["observation.part"][-1] < 0.32 and table["observation.part"][0] == 0.0
        assert (out / f"depth/wrist/episode_00000{i}.mkv").is_file()
    starts = [np.load(out / REPLAY.format(index=i))["start.joint_q"] for i in range(3)]
    assert not np.allclose(starts[0], starts[1]) and not np.allclose(starts[1], starts[2]), "none is there twice"
    assert not list(out.glob(".unfinished*"))


@pytest.mark.slow
def test_kept_episodes_succeed_when_played_again(
    collected: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    stage, out = collected
    assert cli.main(["replay", f"stage={stage}", f"dataset={out}", "num_envs=2", "device=cpu"]) == 0
    assert "3 of 3 episodes succeed when played again" in capsys.readouterr().out


@pytest.mark.parametrize("library", ["pandas", "lerobot"])
def test_the_snippets_that_read_demonstrations_run(
    library: str, collected: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip(library)
    page = (ROOT / "docs/demonstrations.md").read_text()
    (text,) = (each for each in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if f" {library}" in each)
    values: dict[str, Any] = {}
    exec(text.replace("demo/demos", str(collected[1])), values)
    out = capsys.readouterr().out
    if library == "pandas":
        assert out.count("(24, 9) opened by") == 3
        assert values["depth"].shape == (24, 32, 32) and values["depth"].dtype == np.uint16
        assert 500 < np.median(values["depth"]) < 6000, "millimetres"
    else:
        assert out.startswith("72 torch.Size([9]) torch.Size([3, 32, 32])")


@pytest.fixture
def lerobot_rooms(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    monkeypatch.syspath_prepend(ROOT / "tools/lerobot_env_s2a")
    return importlib.import_module("lerobot_env_s2a")


@pytest.mark.slow
def test_recorded_actions_open_the_drawer_in_the_environment_for_lerobot(
    collected: tuple[Path, Path], lerobot_rooms: ModuleType
) -> None:
    stage, out = collected
    ((env,),) = (each.envs for each in lerobot_rooms.vectors(str(stage), 1, keys=QUICK[2:])["s2a"].values())
    table = pq.read_table(out / "data/chunk-000/file-000.parquet").to_pydict()
    seen, _ = env.reset(seed=5)
    assert env.observation_space.contains(seen) and env.task_description == "open the drawer"
    for action in [*table["action"], table["action"][-1]]:
        before = seen
        seen, reward, terminated, truncated, info = env.step(np.array(action))
        if terminated or truncated:
            break
        assert env.observation_space.contains(seen) and not info["is_success"] and reward == 0.0
    assert info["is_success"] and reward == 1.0 and seen is before
    assert np.abs(seen["agent_pos"][:7] - table["observation.state"][-1][:7]).max() < 0.02
    # what the robot's hand sees changes, and an arm that is not moved opens nothing
    start, _ = env.reset(seed=5)
    assert np.abs(start["pixels"]["wrist"].astype(int) - seen["pixels"]["wrist"]).max() > 20
    still, ended = start["agent_pos"][:9], False
    while not ended:
        *_, terminated, truncated, info = env.step(still)
        ended = terminated or truncated
    assert truncated and not info["is_success"]


@pytest.mark.slow
def test_unseeded_episodes_in_the_environment_for_lerobot_differ(
    tmp_path: Path, lerobot_rooms: ModuleType, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(wp.config, "log_level", wp.LOG_INFO)
    folder = tmp_path / "seed=1,a (1) ${x}"
    folder.mkdir()
    given = SimpleNamespace(room=str(write_cabinet(folder / "sim.usda")), size=32, keys=["every=20"])
    ((both,),) = (each.values() for each in lerobot_rooms.make_env(2, cfg=given).values())
    assert wp.config.log_level == wp.LOG_WARNING, "it would print every kernel that it loads"
    for early in (both.envs[0].render, lambda: both.envs[0].step(both.envs[0].action_space.low)):
        with pytest.raises(ResetNeeded, match="call reset first"):
            early()
    starts = [both.reset(seed=seed)[0]["agent_pos"] for seed in (None, None, [3, 3])]
    assert both.envs[0].render().shape == (32, 32, 3)
    unseeded = np.concatenate(starts[:2])
    assert len(np.unique(unseeded, axis=0)) == 4 and np.array_equal(*starts[2])


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"keys": ["++num_envs=2"]}, "keys has 'num_envs', which an argument of the environment"),
        ({"keys": ["views.width=64"], "size": 32}, "keys has 'views.width', which"),
        ({"part": "15"}, "part=15 chooses from a room"),
        ({"count": 33}, "2 parts of .* x 33 worlds are more than 64 at once; give a smaller batch"),
    ],
)
def test_what_an_environment_for_lerobot_cannot_be_is_one_line(
    given: dict[str, Any], why: str, tmp_path: Path, lerobot_rooms: ModuleType
) -> None:
    index = tmp_path / "pool.json"
    pool.write(index, [pool.PoolPart("sim.usd", part, "prismatic", "added", "") for part in ("a", "b")], {}, {})
    with pytest.raises(InputError, match=why):
        lerobot_rooms.vectors(**{"room": str(index), "count": 1, **given})


def test_an_episode_that_fails_when_played_again_is_named(
    collected: tuple[Path, Path], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    stage, out = collected
    file = out / REPLAY.format(index=1)
    kept = file.read_bytes()
    with np.load(file) as found:
        content = dict(found)
    np.savez(file, **{**content, "actions": 0.0 * content["actions"]})
    assert cli.main(["replay", f"stage={stage}", f"dataset={out}", "device=cpu"]) == 0
    told = capsys.readouterr().out
    file.write_bytes(kept)
    assert "2 of 3 episodes succeed" in told and "episode 1 does not" in told


@pytest.mark.slow
def test_what_never_succeeds_ends_in_one_line(
    collected: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    keys = [
        f"stage={collected[0]}",
        "episodes=1",
        f"out={tmp_path / 'none'}",
        *QUICK,
        "task.episode_steps=3",
        "every=1",
    ]
    assert cli.main(["collect", *keys]) == 2
    error = capsys.readouterr().err
    assert "none of 10 episodes succeeded; measure the part with s2a evaluate" in error
    assert "an episode of 3 steps cuts the plan off; give task.episode_steps=" in error


def test_a_folder_that_is_no_dataset_is_one_line(
    collected: tuple[Path, Path], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["replay", f"stage={collected[0]}", f"dataset={tmp_path}"]) == 2
    assert "not a dataset of s2a collect" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("keys", "why"),
    [
        (["views.width=33"], "images of 33 x 32 pixels cannot be a video; give even numbers"),
        (["every=7"], "key 'every' is 7, and 60 control steps a second are no whole number of frames"),
        (["task.start_noise=0.1"], "was collected with another world; choose another out"),
        (["views.jitter=0.5"], "was collected with another views"),
    ],
)
def test_what_cannot_be_collected_is_one_line_and_leaves_the_dataset_alone(
    keys: list[str], why: str, collected: tuple[Path, Path], capsys: pytest.CaptureFixture[str]
) -> None:
    stage, out = collected
    before = {file: file.read_bytes() for file in out.rglob("*") if file.is_file()}
    assert cli.main(["collect", f"stage={stage}", "episodes=4", f"out={out}", *QUICK, *keys]) == 2
    assert why in capsys.readouterr().err
    assert {file: file.read_bytes() for file in out.rglob("*") if file.is_file()} == before


def test_a_damaged_episode_is_one_line(collected: tuple[Path, Path], capsys: pytest.CaptureFixture[str]) -> None:
    stage, out = collected
    file = out / REPLAY.format(index=2)
    kept = file.read_bytes()
    file.write_bytes(kept[:200])
    assert cli.main(["replay", f"stage={stage}", f"dataset={out}", "device=cpu"]) == 2
    file.write_bytes(kept)
    assert "episode_000002.npz: cannot be read" in capsys.readouterr().err
