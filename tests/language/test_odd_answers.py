"""Answers of an endpoint and recordings with something odd in them: each is used, goes back, or is one line."""

from __future__ import annotations

import json
import random
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from mutations import mutated_json

from s2a.core.config import compose, load
from s2a.core.errors import InputError
from s2a.language.ask import Answer, Request, UsageLog
from s2a.language.client import Chat, LlmConfig, choose, gist, key
from s2a.language.insert.plan import Plan, Size, fit_scale, plan, size
from s2a.language.insert.rules import rules
from s2a.scene.scene import Mesh, Part, Scene

ROOM = Scene("room", {i: Part(i[:-2], Mesh([], [])) for i in ("desk_1", "shelf_2", "keyboard_3")})
FACTS: dict[str, Any] = {"label": "mug", "sides": [11.0, 8.0, 9.5], "format": "obj", "up": None, "wish": ""}
FACTS |= {"room": [{"id": "desk_1"}], "feet": {"+z": 0.5}, "hollow": {"+z": 0.7}, "slices": {"x": [0.5]}}
SIDES = {"label": "mug", "sides": [11.0, 8.0, 9.5], "height": 9.5, "longest": 11.0, "stated": None}
SIDES |= {"support": {"part": "desk", "room": 0.5, "widest": 1.2}, "neighbours": []}
CHOICE = {"target": "desk_1", "surface": "horizontal", "relation": "on", "height": 0.7, "reason": "there"}
PLAN = {"up": "+z", "front": "-y", "near": "keyboard_3", "choices": [CHOICE, {**CHOICE, "target": "shelf_2"}]}
SIZE = {"noun": "mug", "height": [0.08, 0.12], "longest": [0.09, 0.14], "unit": "cm", "reason": "a mug"}
SNIPPETS = tuple(
    b'{ } [ ] " : , \\ \\u0000 \\ud800 null true NaN Infinity -1e999 1e308 99999999999999999999 +z desk_1 on 0.7 '
    b"choices message content usage prompt_tokens height target ``` \xff \x00 \x1b".split(b" ")
)
CONFIG = load(LlmConfig, compose("insert", ["llm=chat"])["llm"])


def body(content: str) -> dict[str, Any]:
    choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": content}}
    return {"choices": [choice], "usage": {"prompt_tokens": 100, "completion_tokens": 20, "total_tokens": 120}}


def response(answer: dict[str, Any], dice: random.Random) -> bytes:
    """Return a response with something odd in the answer, around it, or both."""
    inner = mutated_json(answer, SNIPPETS, dice).decode(errors="replace") if dice.random() < 0.7 else json.dumps(answer)
    return mutated_json(body(inner), SNIPPETS, dice) if dice.random() < 0.5 else json.dumps(body(inner)).encode()


def written(found: Plan | Size, usage: UsageLog) -> None:
    """Check that what was accepted can be used and written."""
    text = json.dumps([vars(found), usage.entries, usage.total()], default=vars, allow_nan=False)
    assert text.encode()
    if isinstance(found, Size):
        assert fit_scale(found, 9.5, 11.0, None).scale > 0.0


def asked(model: Any, question: str, dice: random.Random) -> bool:
    """Ask; return whether the answer was used."""
    usage = UsageLog((2.5, 10.0))
    try:
        found: Plan | Size = (
            plan(model, ROOM, FACTS, "{}", 1, usage) if question == "plan" else size(model, SIDES, 1, usage)
        )
    except InputError as error:
        assert "\n" not in str(error) and len(str(error)) < 1500 and str(error).encode()
        return False
    written(found, usage)
    return True


def fuzz_endpoint(monkeypatch: pytest.MonkeyPatch, count: int, seed: int) -> int:
    """Return how many of the odd responses were used."""
    monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
    monkeypatch.setenv("OPENAI_BASE_URL", "http://127.0.0.1:9")
    model, dice, used = Chat(CONFIG), random.Random(seed), 0
    sent: list[bytes] = []

    def send(request: Request, more: dict[str, Any]) -> bytes:
        for _, text in request.messages:
            text.encode()
        return sent[0]

    monkeypatch.setattr(model, "_send", send)
    for number in range(count):
        question = ("plan", "scale")[number % 2]
        sent[:] = [response(PLAN if question == "plan" else SIZE, dice)]
        used += asked(model, question, dice)
    return used


def fuzz_recording(folder: Path, count: int, seed: int) -> int:
    """Return how many of the odd recordings were used."""
    path, dice, used = folder / "answers.json", random.Random(seed), 0
    kept: dict[str, Any] = {}
    requests: list[Request] = []

    def record(answer: dict[str, Any]) -> Any:
        def model(request: Request) -> Answer:
            requests.append(request)
            about = {"step": request.step, "prompt": "x", "about": "mug", "gist": gist(request), "model": "gpt-4o"}
            kept[key(request)] = {
                **about, "prompt_tokens": 9, "completion_tokens": 9, "answer": json.dumps(answer)
            }  # fmt: skip
            return Answer(json.dumps(answer), "gpt-4o")

        return model

    plan(record(PLAN), ROOM, FACTS, "{}", 0, UsageLog((0.0, 0.0)))
    size(record(SIZE), SIDES, 0, UsageLog((0.0, 0.0)))
    for number in range(count):
        path.write_bytes(mutated_json(kept, SNIPPETS, dice))
        config = replace(CONFIG, kind="replay", answers=path)
        try:
            model = choose(config, None, rules)
        except InputError as error:
            assert "\n" not in str(error) and len(str(error)) < 1500
        else:
            used += asked(model, ("plan", "scale")[number % 2], dice)
    return used


def test_an_odd_response_is_used_or_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    assert 0 < fuzz_endpoint(monkeypatch, 400, 0) < 400


def test_an_odd_recording_is_used_or_one_line(tmp_path: Path) -> None:
    assert 0 < fuzz_recording(tmp_path, 400, 0) < 400


@pytest.mark.slow
def test_of_5000_odd_responses_each_is_used_or_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    print(f"responses used: {fuzz_endpoint(monkeypatch, 5000, 1)} of 5000")


@pytest.mark.slow
def test_of_5000_odd_recordings_each_is_used_or_one_line(tmp_path: Path) -> None:
    print(f"recordings used: {fuzz_recording(tmp_path, 5000, 1)} of 5000")


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("answer", 5),
        ("answer", None),
        ("gist", []),
        ("prompt_tokens", "x"),
        ("prompt_tokens", 10**400),
        ("completion_tokens", True),
        ("completion_tokens", -1),
        ("model", {}),
    ],
)
def test_a_recording_with_a_value_of_another_type_is_refused(tmp_path: Path, name: str, value: object) -> None:
    entry = {"step": "plan", "prompt": "", "about": "", "gist": "", "model": "", "answer": ""}
    text = json.dumps({"k": {**entry, "prompt_tokens": 1, "completion_tokens": 1, name: value}})
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match="not a recording, or a damaged one"):
        choose(replace(CONFIG, kind="replay", answers=tmp_path / "a.json"), None, rules)


@pytest.mark.parametrize(
    "usage", [[], "x", None, {"prompt_tokens": 10**400}, {"prompt_tokens": True}, {"completion_tokens": -5}]
)
def test_tokens_that_cannot_be_are_estimated(monkeypatch: pytest.MonkeyPatch, usage: object) -> None:
    monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
    model, log = Chat(CONFIG), UsageLog((2.5, 10.0))
    monkeypatch.setattr(model, "_send", lambda *_: json.dumps({**body(json.dumps(PLAN)), "usage": usage}).encode())
    plan(model, ROOM, FACTS, "{}", 0, log)
    assert 1000 < log.total()["prompt_tokens"] < 10000 and 10 < log.total()["completion_tokens"] < 1000
