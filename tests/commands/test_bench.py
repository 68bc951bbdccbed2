"""`s2a bench`: a policy on the parts of a pool, in batches, by one protocol."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import torch
from cabinet import HANDLE, write_cabinet
from settings import load

from s2a import robot
from s2a.commands import bench, cli
from s2a.core import config
from s2a.learn.evaluate import overstated
from s2a.motion.open import demonstration, opening_path
from s2a.motion.trajectory import Demonstration, PlannerConfig
from s2a.scene.scene import Joint
from s2a.sim.simulation import SimConfig, Simulation
from s2a.sim.world import read_stage
from s2a.tasks import pool

HINGE = Joint("revolute", (0.0, 0.0, 1.0), (HANDLE[0] - 0.02, 0.37, 0.7), (0.0, 1.2))
QUICK = ["device=cpu", "episodes=2", "steps=3"]


@pytest.fixture(scope="module")
def index(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("pool")
    still = Demonstration(np.tile(load_home(), (2, 1)), np.zeros((2, 10)), 1)
    entries = []
    for name, joint in (("a_0", None), ("b_0", HINGE), ("b_1", None)):
        write_cabinet(folder / f"{name}.usda", joint=joint)
        pool.save_motion(still, folder / f"{name}.npz")
        kind = "revolute" if joint else "prismatic"
        entries.append(pool.PoolPart(f"{name}.usda", "drawer_2", kind, "bar", f"{name}.npz"))
    pool.write(folder / "pool.json", entries, {}, {})
    return folder / "pool.json"


def load_home() -> np.ndarray:
    """Return the Panda's joints at home, fingers open."""
    return np.array(robot.load("panda").start)


@pytest.mark.slow
def test_every_part_has_its_episodes_however_they_are_batched(index: Path, tmp_path: Path) -> None:
    found = []
    for num_envs in (2, 4, 100):
        out = tmp_path / f"{num_envs}.json"
        assert cli.main(["bench", f"stage={index}", "policy=random", f"num_envs={num_envs}", f"out={out}", *QUICK]) == 0
        found.append(json.loads(out.read_text()))
    for result in found:
        assert [(part["room"], part["episodes"]) for part in result["parts"]] == [
            ("a_0.usda", 2),
            ("b_0.usda", 2),
            ("b_1.usda", 2),
        ]
        assert result["over_parts"]["all"]["success"]["rate"] == 0.0
        assert {name: row["parts"] for name, row in result["over_parts"]["room"].items()} == {"a": 1, "b": 2}
        assert (result["policy"], result["episodes_a_part"], result["steps"]) == ("random", 2, 3)


@pytest.mark.slow
def test_a_result_stays_with_its_part(index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def counted(env: object, policy: object) -> dict[str, torch.Tensor]:
        stage = torch.tensor(env.sim.stage_of_env, dtype=torch.float)
        hinge = torch.tensor([each.joint.kind == "revolute" for each in env.sim.stages])[stage.long()].float()
        return {name: hinge for name in env.task.RESULTS.names}

    monkeypatch.setattr(bench, "run_episodes", counted)
    out = tmp_path / "o.json"
    assert cli.main(["bench", f"stage={index}", "policy=random", "num_envs=4", f"out={out}", *QUICK]) == 0
    assert [part["success"] for part in json.loads(out.read_text())["parts"]] == [0.0, 1.0, 0.0]


@pytest.mark.slow
def test_policies_see_the_grasp_as_far_off_as_asked(
    index: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    seen = []

    def watched(env: object, policy: object) -> dict[str, torch.Tensor]:
        env.reset_all()
        seen.append(env.task.seen_grasp())
        return {name: torch.zeros(env.num_envs) for name in env.task.RESULTS.names}

    monkeypatch.setattr(bench, "run_episodes", watched)
    out = f"out={tmp_path / 'o.json'}"
    asked = ["grasp_error=0.02", "grasp_turn=10"]
    assert cli.main(["bench", f"stage={index}", "policy=random", out, *asked, *QUICK]) == 0
    assert np.allclose(np.linalg.norm(seen[0][:, :3], axis=1), 0.02)
    assert np.allclose(2 * np.degrees(np.arccos(np.abs(seen[0][:, 6]))), 10.0, atol=0.01)
    assert cli.main(["bench", f"stage={index}", "policy=random", out, *QUICK]) == 0
    assert seen[1] is None


@pytest.mark.slow
def test_the_planner_opens_what_it_has_a_motion_for(tmp_path: Path) -> None:
    write_cabinet(tmp_path / "a_0.usda")
    sim = Simulation(read_stage(tmp_path / "a_0.usda"), load(SimConfig, "sim/varied"), 1)
    motion = demonstration(sim, load(PlannerConfig, "planner/default"), lambda stage, path: opening_path(stage, path))
    pool.save_motion(motion, tmp_path / "a.npz")
    pool.write(tmp_path / "pool.json", [pool.PoolPart("a_0.usda", "drawer_2", "prismatic", "bar", "a.npz")], {}, {})
    out = tmp_path / "planner.json"
    keys = [f"stage={tmp_path / 'pool.json'}", "policy=planner", "device=cpu", "episodes=2", f"out={out}"]
    assert cli.main(["bench", *keys]) == 0
    assert json.loads(out.read_text())["over_parts"]["all"]["grasp_success"]["rate"] == 1.0


@pytest.mark.parametrize(
    ("keys", "why"),
    [
        (["num_envs=1"], "a part has 2 episodes; give num_envs=2 or more"),
        (["policy=nobody.onnx"], "'nobody.onnx': no such file; give an .onnx that s2a train wrote, or pretrained"),
        (["policy=gone/model_3.pt"], "no world.json beside it; give a checkpoint in the folder of its run"),
        (["policy=pretrained", "sim=planner"], "trained on an arm with limits"),
        (["stage=nowhere.json"], "'nowhere.json' does not exist"),
    ],
)
def test_contradictions_are_one_line(
    keys: list[str], why: str, index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["bench", f"stage={index}", "policy=random", f"out={tmp_path / 'o.json'}", *QUICK, *keys]) == 2
    error = capsys.readouterr().err.strip()
    assert why in error and len(error.splitlines()) == 1
    assert not (tmp_path / "o.json").exists()


@pytest.mark.parametrize(("name", "seeds"), [("train", range(0, 60)), ("test", range(100, 120))])
def test_the_splits_keep_to_their_seeds(name: str, seeds: range) -> None:
    split = config.file(f"split/{name}")
    assert set(range(split["first"], split["first"] + split["count"])) <= set(seeds)
    assert ("living_room" in split["rooms"]) == (name == "test") and ("leave_out" in split) == (name == "train")


@pytest.mark.slow
def test_a_claim_is_verified_by_parts_that_nobody_foresees(
    index: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    claim, out = tmp_path / "claim.json", tmp_path / "verified.json"
    keys = [f"stage={index}", "policy=random", *QUICK]
    assert cli.main(["bench", *keys, f"out={claim}"]) == 0
    verify = ["bench", *keys, f"verify={claim}", f"out={out}"]
    assert cli.main(verify) == 0
    row = json.loads(out.read_text())
    assert row["doubts"] == [] and len(row["parts"]) == 3 and "confirmed by 3 drawn parts" in capsys.readouterr().out
    assert cli.main([*verify, "steps=4"]) == 2
    assert "another key 'steps': 3" in capsys.readouterr().err
    honest = json.loads(claim.read_text())
    claim.write_text(json.dumps(honest | {"parts": honest["parts"][:2]}))
    assert cli.main(verify) == 1 and "rows are not those of the 3 parts" in capsys.readouterr().out
    none = [row | {"episodes": 0, "success": 1.0} for row in honest["parts"]]
    claim.write_text(json.dumps(honest | {"parts": none}))
    assert cli.main(verify) == 1 and "a row is not of 2 episodes" in capsys.readouterr().out
    older = {key: value for key, value in honest["settings"].items() if key != "depth_camera"}
    claim.write_text(json.dumps(honest | {"settings": older}))
    assert cli.main(verify) == 2 and "another key 'depth_camera': None" in capsys.readouterr().err
    claim.write_text(json.dumps(honest | {"over_parts": {"all": {}}}))
    assert cli.main(verify) == 2 and "no results of s2a bench" in capsys.readouterr().err
    honest["over_parts"]["all"]["success"]["rate"] = 0.5
    claim.write_text(json.dumps(honest))
    assert cli.main(verify) == 1 and "means over all are not those of the rows" in capsys.readouterr().out


def _rows(rates: np.ndarray, episodes: int, random: np.random.Generator) -> list[dict]:
    hits = random.binomial(episodes, rates)
    return [{"room": f"r_{i}", "part": "p", "episodes": episodes, "success": k / episodes} for i, k in enumerate(hits)]


def test_honest_claims_pass_and_inflated_ones_do_not() -> None:
    random, honest, raised, chosen = np.random.default_rng(0), 0, 0, 0
    for _ in range(12):
        rates = random.beta(4.0, 0.3, 50)
        claim, again = _rows(rates, 64, random), _rows(rates, 64, random)
        honest += bool(overstated(claim, again, ["success"]))
        more = [row | {"success": min(1.0, row["success"] + 5 / 64)} for row in claim]
        raised += bool(overstated(more, again, ["success"]))
        weak = int(np.argmin(rates))
        claim[weak] |= {"success": 1.0}
        chosen += bool(overstated(claim, again, ["success"]))
    assert honest <= 1 and raised >= 11 and chosen >= 11, (honest, raised, chosen)
