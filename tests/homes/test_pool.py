"""A pool: an index of parts of many rooms, on which one policy is trained."""

from __future__ import annotations

import json
import os
from dataclasses import asdict
from pathlib import Path

import pytest
import tiny_scan
import torch
from cabinet import HANDLE, write_cabinet

from s2a.commands import cli
from s2a.core import config
from s2a.core.errors import InputError
from s2a.homes.commands.pool import Config, HomeJob, PoolJob, is_taken, rooms_of
from s2a.learn import rooms
from s2a.scene.scene import Joint
from s2a.tasks import pool

HINGE = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0] - 0.02, 0.37, 0.7), (0.0, 1.2))
SMALL = ["device=cpu", "num_envs=4", "ppo.iterations=1", "ppo.num_steps_per_env=4", "ppo.num_mini_batches=1"]


@pytest.fixture
def index(tmp_path: Path) -> Path:
    entries = []
    for name, joint in (("slide", None), ("hinge", HINGE)):
        write_cabinet(tmp_path / f"{name}.usda", joint=joint)
        kind = "revolute" if joint else "prismatic"
        entries.append(pool.PoolPart(f"{name}.usda", "drawer_2", kind, "bar", f"{name}.npz"))
    pool.write(tmp_path / "pool.json", entries, {"slide/door_3": "no base pose is free"}, {"first": 0})
    return tmp_path / "pool.json"


def test_an_index_is_read_as_it_was_written(index: Path) -> None:
    assert [(entry.room, entry.kind) for entry in pool.read(index)] == [
        ("slide.usda", "prismatic"),
        ("hinge.usda", "revolute"),
    ]
    assert [stage.joint.kind for stage in pool.stages(index, "panda")] == ["prismatic", "revolute"]


@pytest.mark.parametrize("text", ["", "{}", '{"parts": [{"room": "a.usd"}]}', '{"parts": []}', "[]"])
def test_other_files_are_refused(text: str, tmp_path: Path) -> None:
    (tmp_path / "pool.json").write_text(text)
    with pytest.raises(InputError, match=r"pool\.json"):
        pool.read(tmp_path / "pool.json")


@pytest.mark.slow
def test_one_policy_is_trained_on_slides_and_hinges(index: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    assert cli.main(["train", f"stage={index}", "task.describe_part=true", *SMALL, f"out={out}"]) == 0
    assert json.loads((out / "metrics.json").read_text())["env_steps"] == 16
    assert (out / "model_0.pt").is_file()


@pytest.mark.slow
def test_an_evaluation_tells_of_each_part(index: Path, tmp_path: Path) -> None:
    out = tmp_path / "zero.json"
    assert cli.main(["evaluate", f"stage={index}", "agent=zero", "num_envs=5", "device=cpu", f"out={out}"]) == 0
    found = json.loads(out.read_text())
    assert [(part["room"], part["kind"], part["episodes"]) for part in found["parts"]] == [
        ("slide.usda", "prismatic", 3),
        ("hinge.usda", "revolute", 2),
    ]
    assert (
        found["over_parts"]["all"]["parts"] == 2 and found["over_parts"]["kind"]["revolute"]["success"]["rate"] == 0.0
    )


@pytest.mark.slow
def test_a_run_begins_with_the_networks_of_another(index: Path, tmp_path: Path) -> None:
    keys = ["train", f"stage={index}", "+experiment=many", *SMALL, "demo_reset_fraction=0", "demo_moved_fraction=0"]
    keys.append("ppo.imitation_iterations=0")  # the pool has no motions
    assert cli.main([*keys, f"out={tmp_path / 'first'}"]) == 0
    init = tmp_path / "first/model_0.pt"
    rate = "ppo.learning_rate=1e-12"
    assert cli.main([*keys, f"out={tmp_path / 'second'}", f"init={init}", rate]) == 0
    first, second = (torch.load(tmp_path / f"{run}/model_0.pt", weights_only=True) for run in ("first", "second"))
    for name, weight in first["actor_state_dict"].items():
        if "mlp" in name:
            assert torch.allclose(weight, second["actor_state_dict"][name], atol=1e-3), name


@pytest.mark.parametrize(
    ("command", "keys", "says"),
    [
        ("train", ["part=drawer_2"], "leave them out"),
        ("train", ["demo_reset_fraction=0.5"], "not a motion of s2a pool"),
        ("evaluate", ["agent=zero", "num_envs=1"], "has 2 parts"),
        ("evaluate", ["agent=zero", "images=there"], "are for one room"),
        ("evaluate", ["agent=zero", "search_base=true"], "are for one room"),
        ("train", ["init=nowhere.pt"], "no networks that fit"),
    ],
)
def test_what_a_pool_cannot_do_is_said(
    command: str, keys: list[str], says: str, index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    small = SMALL if command == "train" else ["device=cpu"]
    assert cli.main([command, f"stage={index}", *small, *keys, f"out={tmp_path / 'out'}"]) == 2
    assert says in capsys.readouterr().err


def test_a_part_with_one_handle_that_is_left_out_is_not_taken() -> None:
    settings = config.load(Config, config.compose("pool", ["out=-", "leave_out=[edge]"]))
    taken = {"bar, knob": True, "bar, edge": False, "wedge": True, "edge, cup": False}
    assert {handle: is_taken(handle, settings) for handle in taken} == taken


def test_homes_are_added_to_the_seeds_of_each_kind_once() -> None:
    values = config.compose(
        "pool", ["out=-", "rooms=[study,office]", "count=1", "first=3", "homes=[study_22,office_3]"]
    )
    assert rooms_of(config.load(Config, values)) == [("study", 3), ("office", 3), ("study", 22)]


@pytest.mark.parametrize("split", ["train", "train_rare"])
def test_no_split_to_train_on_has_a_home_or_handle_of_the_test(split: str) -> None:
    settings = config.load(Config, config.compose("pool", ["out=-", f"+split={split}"]))
    rooms = rooms_of(settings)
    assert all(kind != "living_room" and seed < 60 for kind, seed in rooms) and "edge" in settings.leave_out
    assert len(rooms) == len(settings.rooms) * settings.count + len(settings.homes), "no home is named twice"


@pytest.mark.parametrize("home", ["attic_3", "study", "study_", "study_-1", "kitchen_2x"])
def test_a_home_that_is_none_is_refused(home: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["pool", f"homes=[{home}]", f"out={tmp_path}"]) == 2
    assert f"'{home}'" in capsys.readouterr().err and not list(tmp_path.iterdir())


def test_a_scan_and_a_home_of_one_name_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scan, out = tiny_scan.write(tmp_path / "hallway_0"), tmp_path / "pool"
    assert cli.main(["pool", "rooms=[]", "homes=[hallway_0]", f"scans=[{scan}]", f"out={out}"]) == 2
    assert f"virtual hallway, seed 0 and {scan} are both named 'hallway_0'" in capsys.readouterr().err
    assert not out.exists()


def test_a_scan_named_as_the_index_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    scan, out = tiny_scan.write(tmp_path / "pool"), tmp_path / "out"
    assert cli.main(["pool", "rooms=[]", f"scans=[{scan}]", f"out={out}"]) == 2
    assert "both named 'pool'" in capsys.readouterr().err


def test_a_scan_that_was_annotated_again_or_is_another_is_refused(tmp_path: Path) -> None:
    settings = config.load(Config, config.compose("pool", ["rooms=[]", "scans=[x]", f"out={tmp_path / 'pool'}"]))
    scan, other = tiny_scan.write(tmp_path / "hall"), tiny_scan.write(tmp_path / "other/hall")
    job = PoolJob(settings, "hall", scan)
    job.store({**job.row, "failed": ""})
    assert PoolJob(settings, "hall", scan).stored()["failed"] == ""
    with pytest.raises(InputError, match="the capture has changed"):
        PoolJob(settings, "hall", other).stored()
    file = next(path for path in scan.rglob("*") if path.is_file())
    os.utime(file, ns=(0, 0))
    with pytest.raises(InputError, match=r"delete that file$"):
        PoolJob(settings, "hall", scan).stored()


def test_a_room_of_an_earlier_pool_is_kept(tmp_path: Path) -> None:
    """Their rows have settings, parts, and what is left out by room and part."""
    settings = config.load(Config, config.compose("pool", ["rooms=[study]", "count=1", f"out={tmp_path}"]))
    job = HomeJob(settings, "study", 0)
    entry = asdict(pool.PoolPart("study_0.usd", "door_1", "revolute", "bar", "study_0_door_1.npz"))
    assert "capture" not in job.settings
    job.store({"settings": job.settings, "parts": [entry], "left_out": {"study_0/door_2": "no base"}})
    (row,) = rooms.make([job], tmp_path, 1)
    assert (row["name"], row["failed"], row["left_out"]) == ("study_0", "", {"door_2": "no base"})
    assert "1 parts of 1 rooms" in rooms.write_index(tmp_path, [row])


def test_a_pool_without_a_part_fails_with_a_reason_and_has_an_index_to_report(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    failed = rooms.empty("attic", "/captures/attic", "begin: no annotation")
    with pytest.raises(InputError, match=r"0 parts of 1 rooms.*attic: begin: no annotation.*s2a report path=") as error:
        rooms.write_index(tmp_path, [failed])
    assert "\n" not in str(error.value)
    assert cli.main(["report", f"path={tmp_path}/pool.json", f"out={tmp_path}/rooms.html"]) == 0
    assert "no annotation" in (tmp_path / "rooms.html").read_text()


@pytest.mark.slow
def test_a_room_becomes_a_pool_once(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    keys = ["pool", "rooms=[hallway]", "count=1", f"out={tmp_path}"]
    assert cli.main(keys) == 0
    entries = pool.read(tmp_path / "pool.json")
    assert entries and all((tmp_path / entry.motion).is_file() for entry in entries)
    before = (tmp_path / "hallway_0.usd").stat().st_mtime_ns
    assert cli.main(keys) == 0
    assert (tmp_path / "hallway_0.usd").stat().st_mtime_ns == before
    capsys.readouterr()
    assert cli.main([*keys, "annotator=hasty"]) == 2
    assert "made with other settings" in capsys.readouterr().err
    assert not (tmp_path / "hallway_0_visuals.usd").exists(), "no training loads visuals"
    run = ["train", f"stage={tmp_path / 'pool.json'}", "demo_reset_fraction=0.5", "demo_moved_fraction=0.3", *SMALL]
    assert cli.main([*run, f"out={tmp_path / 'run'}"]) == 0


@pytest.mark.slow
def test_annotated_scans_and_homes_become_one_pool_and_what_fails_is_a_row(tmp_path: Path) -> None:
    scan, out = tmp_path / "hall", tmp_path / "pool"
    assert cli.main(["sample", "room=hallway", "seed=0", "detail=demo", f"out={scan}"]) == 0
    (tmp_path / "attic").mkdir()
    assert cli.main(["pool", "rooms=[]", "homes=[hallway_0]", f"scans=[{scan},{tmp_path}/attic]", f"out={out}"]) == 0
    parts = {
        name: [p.part for p in pool.read(out / "pool.json") if p.room == f"{name}.usd"]
        for name in ("hallway_0", "hall")
    }
    assert parts["hall"] and parts["hall"] == parts["hallway_0"], "the scan of a home gives the parts of the home"
    rows = {row["name"]: row["failed"] for row in json.loads((out / "pool.json").read_text())["verdicts"]}
    assert rows["hall"] == rows["hallway_0"] == "" and rows["attic"]
