"""From frames of a pool to a network, and to a policy that is told what the network makes of them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import write_cabinet
from settings import load

from s2a.commands import cli
from s2a.learn.perception import depth_camera
from s2a.learn.perception.depth_camera import DepthCameraConfig, VisibleRoom
from s2a.learn.perception.network import read_estimates
from s2a.scene.usd import sim_stage
from s2a.sim.world import read_stage
from s2a.tasks import pool
from s2a.tasks.mdp.seen import NUMBERS

SMALL = ["network.steps=4", "network.batch=4", "network.points=64", "network.width=16", "folds=2", "device=cpu"]


@pytest.fixture
def index(tmp_path: Path) -> Path:
    entries = []
    camera = load(DepthCameraConfig, "depth_camera/default", points=128)
    for name in ("one", "two"):
        path = write_cabinet(tmp_path / f"{name}.usda")
        depth_camera.save(
            depth_camera.take(VisibleRoom(sim_stage.read(path)), read_stage(path), camera, 2, 0),
            tmp_path / f"{name}.npz",
        )
        entries.append(pool.PoolPart(f"{name}.usda", "drawer_2", "prismatic", "bar", "none.npz", f"{name}.npz"))
    pool.write(tmp_path / "pool.json", entries, {}, {"first": 0})
    return tmp_path / "pool.json"


def test_a_network_is_trained_and_every_part_is_estimated_by_one_that_did_not_see_its_room(
    index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "perception"
    assert cli.main(["perceive", f"stage={index}", f"out={out}", *SMALL]) == 0
    estimates = read_estimates(out / "estimates.npz")
    assert {name: each.shape for name, each in estimates.items()} == {
        "one.usda/drawer_2": (2, NUMBERS),
        "two.usda/drawer_2": (2, NUMBERS),
    }
    report = json.loads((out / "errors.json").read_text())
    assert set(report["errors"]) >= {"grasp point [m]", "axis [degree]", "wrong kind"}
    assert report["errors"]["grasp point [m]"]["median"] > 0.0 and len(report["curve"]) == 4
    assert "grasp point [m]" in capsys.readouterr().out

    run = ["train", f"stage={index}", "task.describe_part=true", f"perception={out / 'estimates.npz'}", "device=cpu"]
    run += [
        "num_envs=4",
        "ppo.iterations=1",
        "ppo.num_steps_per_env=4",
        "ppo.num_mini_batches=1",
        f"out={tmp_path / 'run'}",
    ]
    assert cli.main(run) == 0
    room = [
        "evaluate",
        f"stage={index.parent / 'one.usda'}",
        "agent=zero",
        "num_envs=2",
        "device=cpu",
        "task.episode_steps=4",
    ]
    assert cli.main([*room, "task.describe_part=true", "perception=pretrained", f"out={tmp_path / 'room.json'}"]) == 0
    assert json.loads((tmp_path / "room.json").read_text())["perception"] == "pretrained"


def test_a_pool_without_frames_is_refused(index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    entries = [replace(entry, frames="") for entry in pool.read(index)]
    pool.write(index, entries, {}, {"first": 0})
    assert cli.main(["perceive", f"stage={index}", f"out={tmp_path / 'perception'}", *SMALL]) == 2
    assert "make the pool with frames=8" in capsys.readouterr().err
    assert not (tmp_path / "perception").exists()


def test_more_folds_than_rooms_are_refused(index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["perceive", f"stage={index}", f"out={tmp_path / 'perception'}", *SMALL, "folds=3"]) == 2
    assert "has 2 rooms" in capsys.readouterr().err


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 no archive"])
def test_damaged_frames_are_refused(
    content: bytes, index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "one.npz").write_bytes(content)
    assert cli.main(["perceive", f"stage={index}", f"out={tmp_path / 'perception'}", *SMALL]) == 2
    assert "not frames of s2a pool" in capsys.readouterr().err


def test_estimates_of_another_pool_are_refused(index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.savez_compressed(tmp_path / "other.npz", **{"three.usda/drawer_2": np.zeros((1, NUMBERS))})
    run = ["train", f"stage={index}", f"perception={tmp_path / 'other.npz'}", "device=cpu", f"out={tmp_path / 'run'}"]
    assert cli.main(run) == 2
    assert "of another pool" in capsys.readouterr().err
    room = ["evaluate", f"stage={index.parent / 'one.usda'}", f"perception={tmp_path / 'other.npz'}"]
    assert cli.main([*room, "agent=zero", "device=cpu", f"out={tmp_path / 'room.json'}"]) == 2
    assert "of the parts of a pool" in capsys.readouterr().err
