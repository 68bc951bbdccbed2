"""The machinery below the tables of experiments/."""

from __future__ import annotations

import json
import math
import os
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import write_cabinet
from curves import as_run, fractions, plot
from ingredients import BEST, CHANGES
from multirun import Row, collect, jobs
from outcome import half_after, logged, percent, write
from PIL import Image
from ratings import table as ratings
from ratings import verdicts
from real_captures import line_of, row_of
from real_fronts import misfit, opened, outcome, outcomes
from reward_ablation import COLUMNS, move_grasp, table, table_rows
from scipy.spatial.transform import Rotation
from side_by_side import gpu_slots, run

from s2a.commands import train
from s2a.core import config
from s2a.sim.world import read_stage
from s2a.tasks.open_part import OpenPart

ROOT = Path(__file__).parents[2]

ROWS = [row.overrides for row in table_rows(1)] + [(BEST, *overrides) for _, overrides in CHANGES.values()]


def _sleep(seconds: float, log: Path, code: int = 0) -> tuple[list[str], Path]:
    return [sys.executable, "-c", f"import time; time.sleep({seconds}); raise SystemExit({code})"], log


@pytest.mark.slow
def test_train_understands_every_row_and_no_change_of_the_recipe_changes_nothing() -> None:
    told = ("stage=sim.usd", "out=run")
    read = [config.load(train.Config, config.compose("train", [*row, *told])) for row in dict.fromkeys(ROWS)]
    assert len(set(map(str, read))) == 2 + len(CHANGES)  # IsaacLab's weights, the paper's own, best and its changes


def test_every_row_gets_its_first_seed_before_any_gets_its_second(tmp_path: Path) -> None:
    rows = [Row("a", "a.usd", (), 2, "A"), Row("b", "b.usd", (), 1, "B"), Row("c", "c.usd", (), 2, "C")]
    assert [job.folder.name for job in jobs(rows, tmp_path)] == ["a-0", "b-0", "c-0", "a-1", "c-1"]


def test_what_was_measured_before_the_run_went_on_is_measured_again_and_says_its_own_steps(tmp_path: Path) -> None:
    [job] = jobs([Row("a", "a.usd", (), 1, "A")], tmp_path)
    run = job.folder / "run"
    run.mkdir(parents=True)
    (run / "settings.json").write_text(json.dumps({"num_envs": 4, "ppo": {"num_steps_per_env": 8}}))
    assert job.evaluated and collect(job, 2) is None  # there is nothing to evaluate yet
    torch.save({}, run / "model_1.pt")
    assert not job.evaluated
    job.measured.write_text(json.dumps({"policy": "run/model_1.pt", "success": {}}))
    assert not job.evaluated  # by an earlier version, which did not count all that is counted now
    job.measured.write_text(json.dumps({"policy": "run/model_1.pt", "metrics_version": OpenPart.RESULTS.version}))
    assert job.evaluated
    torch.save({}, run / "model_3.pt")
    for file in (job.measured, *run.iterdir()):  # as in a folder that was copied from another machine
        os.utime(file, (1e9, 1e9))
    assert not job.evaluated
    cut = collect(job, 4)
    assert cut and (cut["env_steps"], cut["finished"]) == (2 * 4 * 8, False)


def test_commands_run_side_by_side_and_those_that_fail_are_told(tmp_path: Path) -> None:
    commands = [_sleep(1.0, tmp_path / f"{code}.txt", code) for code in (0, 3)]
    start = time.monotonic()
    assert run([*commands, *commands], ["", "", "", ""], start + 60.0) == [tmp_path / "3.txt"] * 2
    assert time.monotonic() - start < 3.5  # one after the other they would take four seconds


@pytest.mark.slow
def test_what_runs_when_time_is_up_is_interrupted_and_the_rest_never_starts(tmp_path: Path) -> None:
    commands = [_sleep(60.0, tmp_path / "first.txt"), _sleep(0.0, tmp_path / "second.txt")]
    start = time.monotonic()
    assert run(commands, [""], start + 1.0) == []
    assert time.monotonic() - start < 15.0
    assert not (tmp_path / "second.txt").exists()


@pytest.mark.parametrize(("allowed", "slots"), [("3", ["3", "3"]), ("1,2", ["1", "2", "1", "2"]), ("", ["", ""])])
def test_commands_see_the_gpus_that_the_caller_may_see(
    allowed: str, slots: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", allowed)
    assert gpu_slots(2) == slots


def test_the_grasp_point_moves_along_its_own_axes_and_its_region_stays(tmp_path: Path) -> None:
    write_cabinet(tmp_path / "sim.usda")
    target = read_stage(tmp_path / "sim.usda").target
    move_grasp(tmp_path / "sim.usda", target, (0.0, 0.002, 0.01), tmp_path / "moved.usda")
    before, after = read_stage(tmp_path / "sim.usda"), read_stage(tmp_path / "moved.usda")
    moved = Rotation.from_quat(before.grasp[3:]).inv().apply(after.grasp[:3] - before.grasp[:3])
    assert np.allclose(moved, (0.0, 0.002, 0.01), atol=1e-7)
    assert np.array_equal(before.grasp[3:], after.grasp[3:])
    assert np.array_equal(before.grasp_size, after.grasp_size)


def test_a_row_tells_its_seeds_apart_and_says_which_was_cut() -> None:
    rate = {name: {"rate": 0.997} for name in COLUMNS}
    runs = [
        {"row": "twin_paper", "env_steps": 98304000, "finished": True, "evaluation": rate},
        {"row": "twin_paper", "env_steps": 4096000, "finished": False, "evaluation": rate},
    ]
    lines = table(table_rows(3), runs)
    assert f"{'| 99.7 / 99.7 % ' * len(COLUMNS)}| 98.3 / 4.1 (cut) |" in lines[2]
    assert all("not run" in line for line in lines[3:])
    assert len(lines) == 2 + 11


def test_results_are_json_with_a_run_a_line(tmp_path: Path) -> None:
    results = {"scan": "virtual", "runs": [{"row": "a", "curve": {"success": [None, 0.5]}}, {"row": "b"}]}
    write(results, tmp_path / "results.json", ["| table |"])
    assert json.loads((tmp_path / "results.json").read_text()) == results
    assert percent([]) == "not run"


def test_the_log_of_one_run_is_drawn_over_its_environment_steps() -> None:
    rows = [{"iteration": 4, "success": 0.0}, {"iteration": 9, "success": 1.0, "handle_success": 0.5}]
    run = as_run({"curve": rows, "env_steps": 1600, "num_envs": 4, "seed": 7, "seconds": 90, "device": "CPU"})
    assert run["about"] == "4 worlds, seed 7, 1.5 minutes on CPU"
    assert run["curve"]["env_steps"] == [800, 1600]  # 160 an iteration
    assert run["curve"]["success"] == [0.0, 1.0] and run["curve"]["handle_success"] == [None, 0.5]
    assert logged(run["curve"], "handle_success")[1:] == [0.5] and logged(run["curve"], "grasp_success") == []


def test_half_of_the_episodes_must_open_and_by_the_handle() -> None:
    curve = {"env_steps": [4e6, 8e6, 12e6], "handle_success": [None, 0.4, 0.56]}
    assert half_after(curve) == "12"
    assert half_after({name: values[:2] for name, values in curve.items()}) == "not yet"


def test_a_row_is_a_panel_and_a_seed_a_line_whatever_was_not_logged(tmp_path: Path) -> None:
    curve = {
        "env_steps": [100, 200],
        "success": [None, 0.5],
        "final_success": [],
        "handle_success": [None, 0.5],
    }
    opened, final, handle, grasp = fractions(curve)
    assert math.isnan(opened[0]) and opened[1] == 50.0 and final == grasp == [] and handle[1] == 50.0
    plot([{"about": f"row {i // 2}", "curve": curve} for i in range(10)], tmp_path / "curves.png")
    assert Image.open(tmp_path / "curves.png").height > 500  # two lines of panels; one is 341


@pytest.mark.slow
def test_the_table_is_trained_evaluated_kept_and_written_without_what_was_not_asked_for(tmp_path: Path) -> None:
    stages, runs, out = tmp_path / "stages", tmp_path / "runs", tmp_path / "table.json"
    stages.mkdir()
    for name in ("geometric", "one_hull", "handle", "coacd", "twin", "moved", "drawer", "door"):
        write_cabinet(stages / f"{name}.usda").rename(stages / f"{name}.usd")
    command = [sys.executable, ROOT / "experiments/reward_ablation.py", stages, "--runs", runs, "--out", out]
    command += ["--images", tmp_path, "--seeds", "1", "--num-envs", "4", "--episodes", "4"]
    command += ["--side-by-side", "2", "--only", "twin_paper", "scan_best"]
    command += ["--set", "ppo.num_steps_per_env=8", "task.episode_steps=20"]
    for asked, finished in ((64, True), (96, False)):
        command += ["--env-steps", str(asked), "--best-steps", str(asked)]
        if not finished:  # longer runs are asked for, and there is no time for them
            command += ["--minutes", "0"]
        begun = {file: file.stat().st_mtime_ns for file in runs.glob("*/run/model_1.pt")}
        subprocess.run(command, check=True)
        assert all(file.stat().st_mtime_ns == then for file, then in begun.items())
        done = json.loads(out.read_text())["runs"]
        assert [(one["row"], one["env_steps"], one["finished"]) for one in done] == [
            ("twin_paper", 64, finished),
            ("scan_best", 64, finished),
        ]
        assert done[1]["settings"]["ppo"]["reward_scale"] == 0.05
        assert done[0]["evaluation"]["episodes"] == 4
        assert done[0]["curve"]["env_steps"] == [32, 64]
    assert all((tmp_path / f"{name}.png").stat().st_size > 10_000 for name in ("ablation", "best"))
    assert sum("not run" in line for line in out.with_suffix(".md").read_text().splitlines()) == 11 - 2


def test_ratings_count_what_both_accept_and_how_they_agree_beyond_chance(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(
        "kitchen,mug_A,yes,\nkitchen,mug_B,no,size\nkitchen,pan_A,yes,\nkitchen,pan_B,no,place\n"
    )
    (tmp_path / "b.csv").write_text(
        "kitchen,mug_A,yes,\nkitchen,mug_B,no,size\nkitchen,pan_A,no,size\nkitchen,pan_B,no,size\n"
    )
    key = {"kitchen": {"mug_A": "ours", "mug_B": "paper", "pan_A": "ours", "pan_B": "paper"}}
    lines = ratings(key, verdicts(sorted(tmp_path.glob("*.csv"))))
    assert "| kitchen | ours | 2 | 1 | 2 |" in lines and "| all | paper | 2 | 0 | 0 |" in lines
    # They agree on 3 of 4; by chance on (2/4 x 1/4) + (2/4 x 3/4) = 1/2.
    assert lines[-1] == "The two agree on 75 % of 4 images, Cohen's kappa 0.50."


def test_a_capture_is_a_row_of_counts_and_one_that_failed_has_none() -> None:
    rates = {
        "a": {"success": 1.0, "grasp_success": 0.0, "certified": True},
        "b": {"success": 0.5, "grasp_success": 1.0},
    }
    room = {
        "name": "flat",
        "source": "flat",
        "failed": "",
        "verdicts": rates,
        "parts": [{}, {}],
        "left_out": {"c": "far"},
    }
    row = row_of({**room, "seconds": {"import": 2.0, "plan": 58.0}})
    assert line_of(row) == "| flat | 3 | 2 | 1 | 2 | 1 | 2.0 | 1.0 |" and row["left_out"] == ["far"]
    failed = row_of({**room, "failed": "import: flat: no up", "verdicts": {}, "seconds": {}})
    assert line_of(failed) == "| flat | fails |  |  |  |  |  | 0.0 |" and failed["failed"] == "import: no up"


def test_fronts_of_a_room_that_failed_count_as_not_opened(tmp_path: Path) -> None:
    index, bench = tmp_path / "pool.json", tmp_path / "bench.json"
    verdict = {"name": "redkitchen", "source": str(tmp_path), "failed": "import: no up axis", "left_out": {}}
    index.write_text(json.dumps({"verdicts": [verdict]}))
    bench.write_text(json.dumps({"parts": []}))
    rows = list(outcomes(index, bench))
    assert [sum(row["truth"] == annotator for row in rows) for annotator in "AB"] == [9, 11]
    assert opened(rows) == {"fronts": 20, "opened": 0.0, "grasped": 0.0, "outcomes": {"no proposal": 20}}


def test_a_front_is_opened_from_half_of_its_episodes_on() -> None:
    assert [outcome(rate, "") for rate in (1.0, 0.5, 0.4375)] == ["opened", "opened", "opened less than half"]
    reasons = ("check slide_axis: 13 deg", "no base pose is free: 0.5 m before", "s2a prepare leaves it out", "its arm")
    assert [outcome(None, reason) for reason in reasons] == ["contradicted", "no base", "not prepared", "no plan"]
    rows = [{"outcome": "opened", "grasp_success": rate} for rate in (0.0, 1.0)]
    figures = opened([*rows, {"outcome": "no base"}, {"outcome": "wrong hinge", "grasp_success": 1.0}])
    assert figures["opened"] == 0.5 and figures["grasped"] == 0.25


def test_a_front_with_its_hinge_on_the_wrong_side_is_not_opened() -> None:
    truth = ("hinge", "left")
    assert misfit(truth, ("hinge", "right")) == "wrong hinge" and misfit(truth, ("slide", None)) == "wrong kind"
    assert not misfit(truth, truth) and not misfit(("hinge", None), truth) and not misfit(truth, ("hinge", None))
