"""What is measured of a policy, and by whom worlds are acted in."""

from __future__ import annotations

import json
from pathlib import Path
from types import SimpleNamespace

import pytest
import torch
from cabinet import write_cabinet

from s2a.commands import cli, report
from s2a.commands import evaluate as verb
from s2a.core import config
from s2a.core.errors import InputError
from s2a.learn.evaluate import baseline, rate
from s2a.scene.usd.stamp import layer_hash
from s2a.tasks.open_part import OpenPart
from s2a.view import states


def settings(*keys: str) -> verb.Config:
    """Return the verb's settings with some keys given."""
    return config.load(verb.Config, config.compose("evaluate", keys))


DRAWN = ["joint friction", "joint damping", "mass", "contact friction"]
"""What the worlds of an evaluation differ in by default, beside their start."""


@pytest.mark.parametrize(
    ("keys", "differ"),
    [
        (["task=open_part"], ["start", *DRAWN]),
        (["task=open_part", "sim=varied"], ["start", *DRAWN, "gains"]),
        (["task=close_part", "sim=planner", "task.start_noise=0"], []),
        (["task=open_part", "sim=planner", "task.grasp_turn=[0,2]"], ["start", "observed grasp"]),
        (["task=pick_place"], ["start", "mass", "contact friction"]),
        (["task=pick_place", "sim=pick_place"], ["start"]),
        (["task=pick_place", "sim=pick_place", "task.start_noise=0"], []),
        (["task=put_in", "sim=put_in", "task.start_noise=0", "task.start_turn=0.2"], ["start"]),
    ],
)
def test_what_worlds_differ_in_is_known_for_each_task(keys: list[str], differ: list[str]) -> None:
    asked = settings("stage=room.usd", "out=x.json", *keys)
    assert verb.variation(asked.task, asked.sim) == differ


def test_a_robot_that_drives_is_not_put_at_the_origin(tmp_path: Path) -> None:
    stage = write_cabinet(tmp_path / "sim.usda")
    with pytest.raises(InputError, match="'panda_mobile' has a driving base.* robot=panda"):
        settings(f"stage={stage}", "out=x.json", "robot=panda_mobile").read_stages()


def test_another_seed_draws_other_worlds() -> None:
    first, other = (settings("stage=room.usd", "out=x.json", f"seed={seed}").sim.vary for seed in (3, 4))
    assert first and other and (first.seed, other.seed) == (3, 4)


def test_an_agent_that_does_nothing_opens_nothing_and_says_so(tmp_path: Path) -> None:
    stage = write_cabinet(tmp_path / "sim.usda")
    keys = (f"stage={stage}", f"out={tmp_path / 'zero.json'}", "agent=zero", "num_envs=3", "task.episode_steps=5")
    said = verb.run(settings(*keys, "device=cpu"))
    metrics = json.loads((tmp_path / "zero.json").read_text())
    assert metrics["episodes"] == 3
    assert (metrics["stage"], metrics["policy"]) == ("sim.usda", "zero")
    assert (metrics["part"], metrics["robot"], metrics["task"]) == ("drawer_2", "panda", "open_part")
    assert metrics["episode_steps"] == metrics["settings"]["task"]["episode_steps"] == 5
    assert metrics["sha256"] == layer_hash(stage) and Path(metrics["path"]) == stage.absolute()
    differ = ", ".join(["start", *DRAWN])
    assert metrics["variation"] == ["start", *DRAWN] and f"3 episodes of 5 steps; worlds differ in: {differ}" in said
    names = list(OpenPart.RESULTS.rates)
    assert {"grasp_success", "open_30cm", "final_open_95pct"} <= set(names)
    for name in names:
        # Wilson's interval of 0 of 3: z^2 / (3 + z^2) = 3.84 / 6.84.
        assert metrics[name] == {"rate": 0.0, "low": 0.0, "high": pytest.approx(0.5615, abs=1e-4)}, name
    assert metrics["opening"]["mean"] == pytest.approx(0.0, abs=1e-4)
    assert metrics["invalid"] == metrics["row_overflow"] == metrics["contact_overflow"] == 0
    assert metrics["metrics_version"] == OpenPart.RESULTS.version and metrics["thresholds"]["success"] == pytest.approx(
        0.2
    )
    assert "off_handle_success" in said and "0.0%" in said and "grasped_fraction" in said


@pytest.mark.slow
def test_states_are_those_of_each_world_and_can_be_played(tmp_path: Path) -> None:
    stage, file = write_cabinet(tmp_path / "sim.usda"), tmp_path / "states.npz"
    keys = (f"stage={stage}", f"out={tmp_path / 'random.json'}", "agent=random", "num_envs=3", "task.episode_steps=6")
    verb.run(settings(*keys, "device=cpu", f"states={file}"))
    report.refuse_another_run(tmp_path / "random.json", file)
    other = tmp_path / "other.json"
    verb.run(
        settings(f"stage={stage}", f"out={other}", "agent=zero", "num_envs=2", "task.episode_steps=6", "device=cpu")
    )
    with pytest.raises(InputError, match="belongs to another run than .*other.json: other number of worlds"):
        report.refuse_another_run(other, file)
    seen = states.read_played(file, stage, 1, 4)
    assert seen.names == ["world 1", "world 2"] and seen.rate == pytest.approx(60.0)
    assert len({len(each) for each in seen.joints}) == 1 and seen.joints[0].shape[1] == 9
    # Random actions, and starts that noise makes differ: no two worlds are alike, and each moves.
    assert abs(seen.joints[0] - seen.joints[1]).max() > 1e-3
    assert all(abs(each[-1] - each[0]).max() > 1e-3 for each in seen.joints)


def test_the_baselines_are_zero_and_uniform_and_the_seed_decides() -> None:
    env = SimpleNamespace(num_envs=1000, num_actions=9, observation=torch.zeros(1000, 23))
    assert not baseline("zero", env, 0)(env.observation).any()
    actions = baseline("random", env, 0)(env.observation)
    # Uniform in [-1, 1]: mean 0 and variance 1/3, of 9000 samples within five standard errors.
    assert float(actions.mean()) == pytest.approx(0.0, abs=5.0 * (1.0 / 3.0 / 9000) ** 0.5)
    assert float(actions.var()) == pytest.approx(1.0 / 3.0, abs=0.02)
    assert -1.0 <= float(actions.min()) and float(actions.max()) <= 1.0
    assert torch.equal(actions, baseline("random", env, 0)(env.observation))
    assert not torch.equal(actions, baseline("random", env, 1)(env.observation))


def test_the_extreme_agent_holds_its_signs_for_a_step_a_second_and_four() -> None:
    env = SimpleNamespace(num_envs=6, num_actions=40, observation=torch.zeros(6, 1), episode_step=torch.zeros(6).int())
    act, seen = baseline("extreme", env, 0), []
    for step in range(480):
        env.episode_step[:] = step
        seen.append(act(env.observation))
    actions = torch.stack(seen)
    assert (actions.abs() == 1.0).all() and (actions.mean(dim=(0, 2)).abs() < 0.3).all()
    changes = (actions.diff(dim=0) != 0.0).any(dim=2).sum(dim=0)
    assert changes.tolist() == [479, 7, 1] * 2


def test_an_unknown_agent_is_told_the_known_ones() -> None:
    with pytest.raises(InputError, match="'agent' is 'zeros'; expected one of: zero, random, extreme, or null"):
        settings("stage=x", "out=y", "agent=zeros")


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        (("export=true",), "no checkpoint to export"),
        (("agent=zero", "checkpoint=model_1.pt"), "only one can drive the robot"),
        ((f"images={__file__}",), "a file; give a folder"),
    ],
)
def test_keys_that_cannot_go_together_are_refused_before_anything_is_done(
    keys: tuple[str, ...], message: str, tmp_path: Path
) -> None:
    with pytest.raises(InputError, match=message):
        verb.run(settings("stage=nowhere.usd", f"out={tmp_path / 'x.json'}", *keys))
    assert list(tmp_path.iterdir()) == []


def test_the_album_ends_with_the_first_episode() -> None:
    env = SimpleNamespace(
        sim=SimpleNamespace(joint_q=torch.zeros(1, 10), layout=SimpleNamespace(part_coord=9)), done=torch.zeros(1)
    )
    album = verb.Album(env)
    for opening, done in ((0.0, 0), (0.1, 0), (0.3, 0), (0.2, 0), (0.0, 1), (0.39, 0)):
        env.sim.joint_q[0, 9], env.done[0] = opening, done
        album.watch()
    assert [round(float(pose[9]), 3) for pose in album._poses] == [0.0, 0.3]


def test_a_hostile_checkpoint_is_evaluated_by_nobody(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    class Hostile:
        def __reduce__(self) -> tuple:
            return (open, (str(tmp_path / "was_here"), "w"))

    run = tmp_path / "run"
    run.mkdir()
    torch.save({"actor_state_dict": {}, "iter": 1, "infos": Hostile()}, run / "model_1.pt")
    (run / "policy.json").write_text(json.dumps(config.compose("ppo/default")["ppo"]))
    stage = write_cabinet(tmp_path / "sim.usda")
    keys = [f"stage={stage}", f"out={tmp_path / 'x.json'}", f"checkpoint={run / 'model_1.pt'}", "num_envs=1"]
    assert cli.main(["evaluate", *keys, "device=cpu"]) == 2
    said = [line for line in capsys.readouterr().err.splitlines() if line.startswith("s2a: ")]
    assert len(said) == 1 and "model_1.pt: not a checkpoint of this policy" in said[0]
    assert not (tmp_path / "was_here").exists() and not (tmp_path / "x.json").exists()


def test_a_rate_has_a_wilson_interval() -> None:
    # Wilson's formula with z = 1.95996: (8 + z^2 / 2) / (10 + z^2) = 0.71674, half width 0.22658.
    assert rate(8.0, 10.0) == pytest.approx({"rate": 0.8, "low": 0.49016, "high": 0.94332}, abs=1e-5)
    assert rate(4.1, 4.1) == pytest.approx({"rate": 1.0, "low": 0.51011, "high": 1.0}, abs=1e-5)
