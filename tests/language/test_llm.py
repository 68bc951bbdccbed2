"""What a model says over the network, and what of it is believed."""

from __future__ import annotations

import json
import re
from collections.abc import Iterator
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from fake_llm import Endpoint, Said, endpoint, failure, message

from s2a.core.config import compose, load
from s2a.core.errors import InputError
from s2a.language.ask import Model, Request, UsageLog, ValidationFeedback, ask, parse
from s2a.language.client import LlmConfig, choose, kind_of
from s2a.language.insert import prompts
from s2a.language.insert.plan import FailedPlan, Plan, checked, plan, size
from s2a.language.insert.rules import rules
from s2a.scene.scene import Mesh, Part, Scene

ROOM = Scene("room", {i: Part(i[:-2], Mesh([], [])) for i in ("desk_1", "shelf_2", "keyboard_3")})
FACTS = {"label": "mug", "sides": [11.0, 8.0, 9.5], "format": "obj", "up": None, "wish": "", "room": [{"id": "desk_1"}]}
FACTS |= {
    "feet": {"+z": 0.5, "+x": 0.0},
    "hollow": {"+z": 0.7, "-z": 0.0},
    "slices": {"x": [0.5], "y": [0.5], "z": [0.9]},
}
SIDES = {"label": "mug", "sides": [11.0, 8.0, 9.5], "height": 9.5, "longest": 11.0, "stated": None}
SIDES |= {
    "support": {"part": "desk", "room": 0.5, "widest": 1.2},
    "neighbours": [{"label": "mug", "size": [0.11, 0.08, 0.1]}],
}
PLAN: dict[str, Any] = {"up": "+z", "front": "-y", "near": None, "choices": []}
PLAN["choices"] = [{"target": "desk_1", "surface": "horizontal", "relation": "on", "height": None, "reason": "there"}]
SIZE = {"noun": "mug", "height": [0.08, 0.12], "longest": [0.09, 0.14], "unit": "cm", "reason": "a mug"}


@cache
def composed(*options: str) -> dict[str, Any]:
    """Return the settings of a model; composing them takes half a second."""
    return compose("insert", options)["llm"]


def llm(kind: str, **changes: Any) -> LlmConfig:
    return load(LlmConfig, {**composed(f"llm={kind}"), **changes})


def words(value: object) -> Said:
    return message(value if isinstance(value, str) else json.dumps(value))


@contextmanager
def chat(monkeypatch: pytest.MonkeyPatch, *replies: Any, **changes: Any) -> Iterator[tuple[Model, Endpoint]]:
    """Yield a model that asks an endpoint, and the endpoint."""
    with endpoint(*replies) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        yield choose(llm("chat", **{"attempts": 1, "timeout": 2.0, **changes}), None, rules), there


def asked(model: Model) -> Plan:
    return plan(model, ROOM, FACTS, "{}", 2, UsageLog((2.5, 10.0)))


@pytest.mark.slow
def test_an_answer_is_believed_and_its_tokens_are_counted(monkeypatch):
    usage = UsageLog((2.5, 10.0))
    with chat(monkeypatch, words(PLAN)) as (model, there):
        found = plan(model, ROOM, FACTS, "the lines", 2, usage)
    assert found.choices[0].target == "desk_1"
    total = usage.total()
    assert (total["calls"], total["prompt_tokens"], total["completion_tokens"]) == (1, 100, 20)
    assert total["dollars"] == pytest.approx((100 * 2.5 + 20 * 10) / 1e6)
    (request,) = there.asked
    assert request["temperature"] == 0.0
    assert request["messages"][0] == {"role": "system", "content": prompts.PLAN}
    question = request["messages"][1]["content"]
    assert "the lines" in question
    assert '"feet":{"+z":0.5},"hollow":{"+z":0.7}' in question
    required = ["up", "front", "near", "choices", "place", "declined"]
    assert request["response_format"]["json_schema"]["schema"]["required"] == required


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ({"relation": "beside", "of": ["desk_1"]}, "place 'beside' of 1 things; possible: left, right"),
        ({"relation": "between", "of": ["desk_1"]}, "'between' of two"),
        ({"relation": "left", "of": ["piano_9"]}, "no 'piano_9' in the room"),
    ],
)
def test_a_place_that_cannot_be_goes_back(place, said):
    with pytest.raises(ValidationFeedback, match=said):
        checked(parse(json.dumps({**PLAN, "place": [place]}), Plan), ROOM)
    good = {"relation": "between", "of": ["desk_1", "keyboard_3"]}
    assert checked(parse(json.dumps({**PLAN, "place": [good]}), Plan), ROOM).place[0].of == ("desk_1", "keyboard_3")


def test_an_endpoint_without_structured_output_is_asked_in_plain_words_from_then_on(monkeypatch):
    refused = failure(400, "response_format is not supported")
    with chat(monkeypatch, refused, words(f"Sure! ```json\n{json.dumps(PLAN)}\n```")) as (model, there):
        assert asked(model).up == "+z"
        assert asked(model).up == "+z"
    assert ["response_format" in request for request in there.asked] == [True, False, False]


def test_an_overloaded_endpoint_is_asked_again(monkeypatch):
    with chat(monkeypatch, failure(503, "overloaded"), words(PLAN)) as (model, there):
        assert asked(model).up == "+z"
    assert len(there.asked) == 2


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        (failure(401, "wrong key"), "wrong key.*OPENAI_API_KEY"),
        (failure(404, "no such model"), "no such model.*llm.model"),
        (failure(500, "broken"), "broken"),
        (Said(b"<html>hello</html>"), "no chat completion.*OPENAI_BASE_URL"),
        (Said(b'{"choices": []}'), "no chat completion"),
        (Said(b"[" * 100_000), "no chat completion"),
        (Said(b'{"choices": [{"message": null}]}'), "no chat completion"),
        (Said(b'{"choices": [{"message": "on the desk"}]}'), "no chat completion"),
        (Said(b'{"choices": {"0": 1}}'), "no chat completion"),
        (Said(b" " * 40, trickle=0.05), "did not end its answer in time; raise llm.timeout"),
        (Said(b" " * 40, trickle=0.05, status=500), "did not end its answer in time|timed out"),
        (words("x" * 10_000_000), "more than 2000000 bytes"),
        (Said(b"", wait=3.0), "timed out|[Tt]imeout"),
        (Said(b'{"choices": [', promised=100), "fake|failed"),
    ],
)
def test_what_an_endpoint_can_do_wrong_ends_in_one_line(monkeypatch, reply, said):
    with (
        chat(monkeypatch, reply, timeout=0.3, attempts=0) as (model, _),
        pytest.raises(InputError, match=said) as error,
    ):
        asked(model)
    assert "secret-key" not in str(error.value)


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        (words("I would put it on the desk."), "not one JSON object"),
        (words("{" * 5000), "not one JSON object"),
        (words('{"up":' * 50000 + "}" * 50000), "not one JSON object"),
        (message(None, content_note="I cannot help with that."), "not one JSON object"),
        (words({**PLAN, "up": "z"}), "possible: .*\\+z"),
        (words({**PLAN, "front": "+z"}), "lies along up"),
        (words({**PLAN, "choices": []}), "0 choices"),
        (words({**PLAN, "choices": PLAN["choices"] * 4}), "4 choices"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "target": "desk_7"}]}), "no 'desk_7'.*desk_1.*All ids"),
        (words({**PLAN, "near": "lamp"}), "no 'lamp' in the room"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "surface": "vertical"}]}), "hanging|hangs"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "surface": "top"}]}), "does not fit the schema"),
        (words({"oben": "+z", "vorne": "-y", "nahe": None, "plaetze": []}), "does not fit the schema"),
        (words({**PLAN, "choices": "desk_1"}), "does not fit the schema"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "height": float("nan")}]}), "no finite number"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "height": 10**400}]}), "does not fit the schema"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "height": -1e300}]}), "height is -1e\\+300"),
        (words({**PLAN, "choices": [{**PLAN["choices"][0], "reason": "\ud800"}]}), "not one JSON object"),
        (words("\ud800"), "not one JSON object"),
    ],
)
def test_a_plan_that_cannot_be_used_goes_back_twice_and_then_ends_in_one_line(monkeypatch, reply, said):
    with chat(monkeypatch, reply) as (model, there), pytest.raises(InputError, match="in 3 tries") as error:
        asked(model)
    assert re.search(said, there.asked[1]["messages"][-1]["content"])
    assert [len(request["messages"]) for request in there.asked] == [2, 4, 6]
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 700


def test_an_id_that_is_not_there_goes_back_with_those_that_are(monkeypatch):
    wrong = {**PLAN, "choices": [{**PLAN["choices"][0], "target": "desk_7"}]}
    with chat(monkeypatch, words(wrong), words(PLAN)) as (model, there):
        assert asked(model).choices[0].target == "desk_1"
    assert "desk_1, shelf_2, keyboard_3" in there.asked[1]["messages"][-1]["content"]


def test_a_plan_without_room_goes_back_with_the_reason(monkeypatch):
    with chat(monkeypatch, words(PLAN)) as (model, there):
        first = asked(model)
        plan(
            model,
            ROOM,
            FACTS,
            "{}",
            2,
            UsageLog((0.0, 0.0)),
            FailedPlan(first, "on desk_1: it is too small", unstable=False),
        )
    answer, reason = there.asked[1]["messages"][-2:]
    assert json.loads(answer["content"]) == PLAN
    assert reason["content"].startswith("on desk_1: it is too small")


@pytest.mark.parametrize(
    ("answer", "said"),
    [
        ({**SIZE, "height": [80.0, 120.0], "longest": [90.0, 140.0]}, "in metres"),
        ({**SIZE, "height": [0.12, 0.08]}, "least and largest in metres"),
        ({**SIZE, "height": [float("nan"), 0.1]}, "no finite number"),
        ({**SIZE, "height": [0.01, 1.0], "longest": [0.01, 1.0]}, "says too little"),
        ({**SIZE, "height": [0.3, 0.4]}, "more than the longest side"),
        ({**SIZE, "height": [0.6, 0.9], "longest": [0.6, 0.9]}, "leaves 0.5 m of height"),
        ({**SIZE, "height": [0.4, 0.49], "longest": [0.4, 0.6]}, "A mug in this room is 0.11 m long"),
        ({**SIZE, "unit": "Zoll"}, "does not fit the schema"),
    ],
)
def test_a_size_that_cannot_be_is_asked_about(monkeypatch, answer, said):
    with chat(monkeypatch, words(answer), words(SIZE)) as (model, there):
        found = size(model, SIDES, 2, UsageLog((0.0, 0.0)))
    assert found.height == (0.08, 0.12)
    assert said in there.asked[1]["messages"][-1]["content"]


def test_a_doubted_size_that_is_said_again_is_meant(monkeypatch):
    large = {**SIZE, "height": [0.6, 0.9], "longest": [0.6, 0.9]}
    with chat(monkeypatch, words(large)) as (model, there):
        assert size(model, SIDES, 2, UsageLog((0.0, 0.0))).height == (0.6, 0.9)
    assert len(there.asked) == 2


def test_whole_numbers_are_numbers_and_keys_that_nobody_asked_for_are_left_out():
    text = json.dumps({**PLAN, "mood": "good", "choices": [{**PLAN["choices"][0], "height": 1}]})
    assert checked(parse(text, Plan), ROOM).choices[0].height == 1.0


def test_without_a_key_there_are_rules_and_chat_says_what_is_missing(monkeypatch):
    monkeypatch.delenv("OPENAI_API_KEY", raising=False)
    auto = llm("auto")
    assert kind_of(auto) == "rules"
    with pytest.raises(InputError, match="OPENAI_API_KEY"):
        choose(llm("chat"), None, rules)
    monkeypatch.setenv("OPENAI_API_KEY", "any")
    assert kind_of(auto) == "chat"


def recording(monkeypatch: pytest.MonkeyPatch, path: Path) -> None:
    """Record one plan."""
    with endpoint(words(PLAN)) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        asked(choose(llm("chat"), path, rules))


def replay(path: Path) -> Model:
    return choose(llm("replay", answers=path), None, rules)


def test_a_recording_answers_the_same_question_and_holds_no_key(monkeypatch, tmp_path):
    recording(monkeypatch, tmp_path / "answers.json")
    usage = UsageLog((2.5, 10.0))
    assert plan(replay(tmp_path / "answers.json"), ROOM, FACTS, "{}", 2, usage).up == "+z"
    assert usage.entries[0]["prompt_tokens"] == 100
    assert (usage.total()["calls"], usage.total()["replayed"], usage.total()["dollars"]) == (0, 1, 0.0)
    assert "secret-key" not in (tmp_path / "answers.json").read_text()


def test_a_recording_says_why_it_has_no_answer(monkeypatch, tmp_path):
    recording(monkeypatch, tmp_path / "answers.json")
    model = replay(tmp_path / "answers.json")
    with pytest.raises(InputError, match="'mug' in this room: the room or the object has changed"):
        plan(model, ROOM, {**FACTS, "room": [{"id": "sofa_4"}]}, '{"id":"sofa_4"}', 2, UsageLog((0.0, 0.0)))
    with pytest.raises(InputError, match="no answer to step 'plan' for 'vase'; record it"):
        plan(model, ROOM, {**FACTS, "label": "vase"}, "{}", 2, UsageLog((0.0, 0.0)))
    monkeypatch.setattr(prompts, "PLAN", prompts.PLAN + " Be brief.")
    with pytest.raises(InputError, match="its prompt has changed since the recording"):
        plan(model, ROOM, FACTS, "{}", 2, UsageLog((0.0, 0.0)))


def test_a_recording_answers_in_the_same_room_measured_anew_and_says_so(monkeypatch, tmp_path):
    recording(monkeypatch, tmp_path / "answers.json")
    usage = UsageLog((0.0, 0.0))
    assert plan(replay(tmp_path / "answers.json"), ROOM, FACTS, '{"size":0.76}', 2, usage).up == "+z"
    assert "measures" in usage.entries[0]["note"]


def test_recording_asks_anew_and_a_question_of_the_same_run_once(monkeypatch, tmp_path):
    recording(monkeypatch, tmp_path / "answers.json")
    with chat(monkeypatch, words({**PLAN, "up": "-z"})) as (_, there):
        model, usage = choose(llm("chat"), tmp_path / "answers.json", rules), UsageLog((2.5, 10.0))
        assert asked(model).up == "-z"
        assert plan(model, ROOM, FACTS, "{}", 2, usage).up == "-z"
    assert len(there.asked) == 1
    assert usage.total()["dollars"] == 0.0
    assert asked(replay(tmp_path / "answers.json")).up == "-z"


def test_tokens_that_an_endpoint_does_not_count_are_estimated(monkeypatch):
    reply = message(json.dumps(PLAN))
    silent = Said(reply.body.replace(b'"prompt_tokens": 100, "completion_tokens": 20', b'"prompt_tokens": 0'))
    usage = UsageLog((2.5, 10.0))
    with chat(monkeypatch, silent) as (model, _):
        plan(model, ROOM, FACTS, "the lines", 2, usage)
    assert usage.total()["prompt_tokens"] == pytest.approx(len(prompts.PLAN) / 3.5, rel=0.2)
    assert usage.total()["completion_tokens"] == pytest.approx(len(json.dumps(PLAN)) / 3.5, abs=1)


def script(x: str, y: str) -> Request:
    return Request("script", "Write a script.", (("user", f"translate {x} {y} scale 0.01"),), None, {"label": "mug"})


def test_a_recorded_script_fits_another_pose_however_many_zeros_the_model_wrote(monkeypatch, tmp_path):
    with chat(monkeypatch, words("move(1.25, -0.76543); scale(0.01)")) as (_, there):
        model = choose(llm("chat"), tmp_path / "a.json", rules)
        ask(model, script("1.25000", "-0.76543"), str, 0, UsageLog((0.0, 0.0)))
    assert len(there.asked) == 1
    again = replay(tmp_path / "a.json")(script("1.31000", "1.31000"))
    assert again.text == "move(1.31000, 1.31000); scale(0.01)"
    assert not again.note


@pytest.mark.parametrize("text", ["", "[]", '{"a": {}}', "\x00"])
def test_a_damaged_recording_is_refused(tmp_path, text):
    (tmp_path / "a.json").write_text(text)
    with pytest.raises(InputError, match="not a recording"):
        replay(tmp_path / "a.json")


def unsupported(status: int, words: str, *names: str) -> Any:
    """Refuse a request that has one of the options, or a message of the role system; answer any other."""

    def reply(request: dict[str, Any]) -> Said:
        roles = [message["role"] for message in request["messages"]]
        return failure(status, words) if set(names).intersection([*request, *roles]) else message(json.dumps(PLAN))

    return reply


HABITS = {
    "max_tokens": (400, "Unsupported parameter: 'max_tokens' is not supported. Use 'max_completion_tokens' instead."),
    "temperature": (400, "Unsupported value: 'temperature' does not support 0.0 with this model. Only 1 is supported."),
    "system": (400, "Unsupported value: 'messages[0].role' does not support 'system' with this model."),
    "response_format": (500, "response_format type must be one of text or json_object, but got: json_schema"),
}


@pytest.mark.parametrize(
    ("name", "status", "words"),
    [
        *((name, *habit) for name, habit in HABITS.items()),
        ("system", 400, "System role not supported"),
        ("system", 400, "Developer instruction is not enabled for models/gemma-3"),
        ("system", 400, "Conversation roles must alternate user/assistant/user/assistant/..."),
        ("response_format", 404, "No endpoints found that can handle the requested parameters"),
        ("response_format", 422, "extra fields not permitted"),
        ("temperature", 422, "temperature: extra fields not permitted"),
        ("max_tokens", 400, "Unrecognized request argument supplied: max_tokens"),
    ],
)
def test_what_an_endpoint_refuses_is_left_out_from_then_on(monkeypatch, name, status, words):
    with chat(monkeypatch, unsupported(status, words, name), attempts=0) as (model, there):
        assert asked(model).up == "+z" and asked(model).up == "+z"
    assert len(there.asked) == 3, "one refusal, then two answers"
    last = there.asked[-1]
    assert prompts.PLAN in last["messages"][0]["content"], "the instructions are there in any case"
    assert ("max_tokens" in last or "max_completion_tokens" in last) and (
        name == "temperature" or last["temperature"] == 0
    )
    assert ("response_format" in last) == (name != "response_format")


def test_an_endpoint_that_refuses_everything_in_turn_is_asked_in_plain_words(monkeypatch):
    replies = [unsupported(*HABITS[name], name) for name in HABITS]

    def reply(request: dict[str, Any]) -> Said:
        refusals = [each(request) for each in replies]
        return next((said for said in refusals if said.status != 200), message(json.dumps(PLAN)))

    with chat(monkeypatch, reply, attempts=0) as (model, there):
        assert asked(model).up == "+z"
    assert len(there.asked) == 1 + len(HABITS) and there.asked[-1]["max_completion_tokens"] == 2000


@pytest.mark.parametrize(
    ("reason", "content", "said"),
    [
        ("length", "", r"cut at llm.max_tokens=2000 tokens.*raise it"),
        ("length", '{"up": "+z", "front"', r"cut at llm.max_tokens=2000"),
        ("max_tokens", None, r"cut at llm.max_tokens=2000"),
        ("content_filter", "", "filter; word prompt and label otherwise"),
        ("SAFETY", None, "filter; word prompt"),
    ],
)
def test_an_answer_that_was_cut_is_paid_once_and_the_line_names_what_to_change(monkeypatch, reason, content, said):
    body = json.loads(message(content).body)
    body["choices"][0]["finish_reason"] = reason
    with (
        chat(monkeypatch, Said(json.dumps(body).encode())) as (model, there),
        pytest.raises(InputError, match=said) as error,
    ):
        asked(model)
    assert len(there.asked) == 1 and "\n" not in str(error.value)


def test_a_whole_answer_in_parts_or_at_the_limit_is_used(monkeypatch):
    body = json.loads(message(json.dumps(PLAN)).body)
    body["choices"][0]["finish_reason"] = "length"
    parts = [{"type": "thinking", "thinking": "hmm"}, {"type": "text", "text": json.dumps(PLAN)}]
    with chat(monkeypatch, Said(json.dumps(body).encode()), message(parts)) as (model, there):  # type: ignore[arg-type]
        assert asked(model).up == asked(model).up == "+z"


@pytest.mark.parametrize(
    ("reply", "said"),
    [
        (failure(400, "The response was filtered due to the content management policy"), "filter refuses the question"),
        (failure(400, "This model's maximum context length is 4096 tokens"), "lower llm.max_tokens"),
        (Said(b'{"error": {"message": "no credits", "code": 402}}'), "no credits.*llm.model"),
    ],
)
def test_an_endpoints_refusal_ends_in_a_line_with_its_own_remedy(monkeypatch, reply, said):
    with chat(monkeypatch, reply, attempts=0) as (model, there), pytest.raises(InputError, match=said):
        asked(model)
    assert len(there.asked) <= 2
