"""From a pool with visuals to a policy with depth cameras, and what is done with it."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import write_cabinet

from s2a import robot
from s2a.commands import cli
from s2a.learn.perception.follow import read_network
from s2a.motion.trajectory import Demonstration
from s2a.scene.usd import sim_stage
from s2a.tasks import pool

SMALL = ["network.batch=4", "network.capacity=64", "network.updates=1", "device=cpu"]


@pytest.fixture
def index(tmp_path: Path) -> Path:
    still = Demonstration(np.tile(np.array(robot.load("panda").start), (2, 1)), np.zeros((2, 10)), 1)
    entries = []
    for name in ("one_7", "two_107"):
        write_cabinet(tmp_path / f"{name}.usda")
        pool.save_motion(still, tmp_path / f"{name}.npz")
        entries.append(pool.PoolPart(f"{name}.usda", "drawer_2", "prismatic", "bar", f"{name}.npz"))
    pool.write(tmp_path / "pool.json", entries, {}, {"first": 0})
    return tmp_path / "pool.json"


@pytest.mark.slow
def test_a_policy_is_trained_on_some_rooms_measured_on_others_and_used(index: Path, tmp_path: Path) -> None:
    out = tmp_path / "perception"
    train = [
        "perceive",
        f"stage={index}",
        f"out={out}",
        *SMALL,
        r"held_out=_1\d\d",
        "frames=8",
        "num_envs=16",
        "steps=24",
    ]
    assert cli.main(train) == 0
    report = json.loads((out / "metrics.json").read_text())
    assert [row["room"] for row in report["parts"]] == ["two_107.usda"] and report["parts"][0]["episodes"] == 8
    assert set(report["rates"]) == {"success", "grasp_success"} and report["losses"][-1]["point"] > 0.0
    assert {path.name for path in out.iterdir()} == {
        "policy.depth",
        "policy_estimate.onnx",
        "policy_act.onnx",
        "metrics.json",
    }
    before = read_network(out / "policy.depth").view.clone()
    further = [
        "perceive",
        f"stage={index}",
        f"out={out}",
        *SMALL,
        f"init={out / 'policy.depth'}",
        "num_envs=2",
        "steps=6",
    ]
    assert cli.main([*further, "frames=0"]) == 0
    assert torch.equal(read_network(out / "policy.depth").view, before), "measured alone, it stays as it is"
    short = ["device=cpu", "sim=real"]
    bench = ["bench", f"stage={index}", f"policy={out / 'policy.depth'}", "episodes=1", "steps=12", *short]
    assert cli.main([*bench, f"out={tmp_path / 'bench.json'}"]) == 0
    assert json.loads((tmp_path / "bench.json").read_text())["policy"] == "policy"
    room = ["evaluate", f"stage={index.parent / 'one_7.usda'}", "policy=pretrained_depth", "num_envs=2", "device=cpu"]
    assert cli.main([*room, f"out={tmp_path / 'room.json'}", "export=true", f"images={tmp_path / 'images'}"]) == 0
    assert json.loads((tmp_path / "room.json").read_text())["policy"] == "pretrained_depth"
    assert (tmp_path / "room_estimate.onnx").is_file() and (tmp_path / "images/seen_7.png").is_file()


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        (["held_out=.*"], "leaves no room to train on"),
        (["held_out=["], "no regular expression"),
        (["frames=0"], "no policy to measure"),
        (["num_envs=1"], "has 2 parts"),
        (["init=nobody.depth"], "no such file"),
    ],
)
def test_keys_that_contradict_are_refused_before_anything_is_built(
    keys: list[str], why: str, index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["perceive", f"stage={index}", f"out={tmp_path / 'out'}", *SMALL, *keys]) == 2
    assert why in capsys.readouterr().err and not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_room_without_visuals_is_refused(index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sim_stage.visuals_file(index.parent / "one_7.usda").unlink()
    keys = [*SMALL, f"out={tmp_path / 'out'}", "num_envs=2", "frames=1"]
    assert cli.main(["perceive", f"stage={index}", *keys]) == 2
    assert "the visuals are missing" in capsys.readouterr().err
