"""`s2a do` as a stranger types it: one line and exit code 2 for what cannot be done, and nothing written."""

from __future__ import annotations

import json
import random
from pathlib import Path

import pytest
import torch
from drawer_room import drawer_room
from mutations import mutated_json
from settings import skills

from s2a import api
from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.language.ask import Answer, UsageLog
from s2a.language.do.plan import plan
from s2a.language.do.run import RoomContext


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("room") / "room.usda"
    drawer_room(path)
    return path


def s2a(*arguments: str) -> int:
    return cli.main(["do", *arguments])


@pytest.mark.parametrize(
    ("words", "tells"),
    [
        (["open the fridge"], "'open the fridge' is unknown"),
        (["wash the cube"], "no skill for 'wash'"),
        (["put the cube into the drawer"], "is ambiguous"),
        (["close the drawer"], "shut already"),
        (["do not open the drawer"], "'not'"),
        (["x" * 10_000], "10000 characters"),
        (["open the drawer; rm -rf / $(reboot)"], "impossible"),
        (["open ../../etc/passwd"], "unknown"),
        (["open", "the", "drawer"], "quotation marks"),
        ([""], "empty"),
        ([], "give a sentence, such as"),
        (["sentense=open"], "sentense"),
        (["open the drawer", "scene=nowhere.usda"], "no such file"),
        (["open the drawer", "llm=replay"], "llm.answers=FILE"),
    ],
)
def test_what_cannot_be_done(
    words: list[str], tells: str, stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "do.json"
    out.write_text("earlier")
    assert s2a(*words, f"stage={stage}", f"out={out}", *([] if "llm=replay" in words else ["llm=rules"])) == 2
    error = capsys.readouterr().err
    assert tells in error
    assert len([line for line in error.splitlines() if line.startswith("s2a:")]) == 1
    assert out.read_text() == "earlier"
    assert list(tmp_path.iterdir()) == [out]


@pytest.mark.parametrize("words", [["open the drawer"], ["sentence=open the drawer"]])
def test_a_plan_alone(words: list[str], stage: Path, tmp_path: Path) -> None:
    out = tmp_path / "do.json"
    assert s2a(*words, f"stage={stage}", f"out={out}", "llm=rules", "plan_only=true") == 0
    record = json.loads(out.read_text())
    assert record["sentence"] == "open the drawer"
    assert [skill["part"] for skill in record["plans"][0]["skills"]] == ["drawer_2"]
    assert (record["skills"], record["done"], record["total"]["calls"]) == ([], False, 1)


def test_a_sentence_with_an_equals_sign_is_a_sentence(
    stage: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert s2a("open the safe=drawer", f"stage={stage}", f"out={tmp_path / 'do.json'}", "llm=rules") == 2
    assert "'open the safe=drawer' is unknown" in capsys.readouterr().err


def test_odd_answers_are_used_or_go_back(stage: Path) -> None:
    """Damaged answers of a model give a plan of ids of the room, or an InputError."""
    from s2a.language.do import facts as fact
    from s2a.language.do.run import Checker
    from s2a.scene.usd import sim_stage

    room = sim_stage.read(stage, visuals=False)
    context = RoomContext(room, None, "panda", 0.3, skills())
    facts = fact.gather(room, None, {}, "panda")
    check = Checker(context, room, facts)
    skill = {"skill": "open", "part": "drawer_2", "object": None, "support": None}
    answer = {"skills": [skill], "refusal": None, "reason": "", "options": []}
    words = b'{ } [ ] " : , \\u0000 \\ud800 null true NaN 1e999 put_in drawer_2 cube_9 impossible skills part'.split(
        b" "
    )
    dice = random.Random(0)
    used = 0
    for _ in range(300):
        text = mutated_json(answer, words, dice).decode(errors="replace")
        try:
            found = plan(
                lambda _, text=text: Answer(text, "odd"),
                "open it",
                facts,
                check,
                0,
                UsageLog((0.0, 0.0)),
                context.skills,
            )
        except InputError:
            continue
        used += 1
        assert all(i is None or i in facts for s in found.skills for i in (s.part, s.object, s.support))
        json.dumps(found.reason, ensure_ascii=False).encode()
    assert 0 < used < 300


SLIDE = ("device=cpu", "sim.joint.damping=20")
"""The hand-made drawer has no friction: as it is let go it would roll."""


@pytest.mark.slow
def test_a_drawer_is_opened_and_closed(stage: Path, tmp_path: Path) -> None:
    out = tmp_path / "do.json"
    assert s2a("open the drawer, then close it", f"stage={stage}", f"out={out}", "llm=rules", *SLIDE) == 0
    opened, closed = json.loads(out.read_text())["skills"]
    assert opened["began"]["joints"] == {"drawer_2": 0.0}
    assert opened["ended"]["joints"]["drawer_2"] > 0.25
    assert abs(closed["began"]["joints"]["drawer_2"] - opened["ended"]["joints"]["drawer_2"]) < 0.001
    assert abs(closed["ended"]["joints"]["drawer_2"]) < 0.01


class Still(torch.nn.Module):
    """A network that never moves."""

    def forward(self, observation: torch.Tensor) -> torch.Tensor:
        return 0.0 * observation[:, :9]


@pytest.mark.slow
def test_a_policy_does_the_skills_of_its_task_in_its_own_world(stage: Path, tmp_path: Path) -> None:
    env = api.make("open_part", stage, num_envs=2, device="cpu", overrides=["sim=real"])
    policy = api.export_policy(Still(), tmp_path / "still.onnx", env)
    out, short = tmp_path / "do.json", "skills.open.task.episode_steps=20"
    assert (
        s2a("open the drawer", f"stage={stage}", f"out={out}", "llm=rules", f"policy={policy}", short, "device=cpu")
        == 1
    )
    (skill,) = json.loads(out.read_text())["skills"]
    assert skill["policy"] == "still.onnx" and skill["metrics"]["opening"] < 0.01 and "retreat" not in skill
    assert "opening 0" in skill["reason"] and len(skill["reason"]) < 250
