"""Habits of real model servers: the question is answered or ends in one line, and no answer is paid in vain."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Any

import pytest
from fake_llm import Reply, Said, endpoint, failure, message

from s2a.core.config import compose, load
from s2a.core.errors import InputError
from s2a.language.ask import Request, UsageLog, ask, object_schema, parse
from s2a.language.client import Chat, LlmConfig

ANSWER = '{"shelf": "drawer", "count": 2}'
SCHEMA = object_schema(shelf={"type": "string"}, count={"type": "integer"})


@dataclass
class Wanted:
    shelf: str
    count: int


@dataclass(frozen=True)
class Habit:
    """What a server does.

    Attributes:
        replies: to the first request, to the second, and so on.
        outcome: words of the error; none where the question is answered.
        requests: number of all.
        paid: of them, those that were answered by the model.
    """

    replies: tuple[Reply | Said, ...]
    outcome: str = ""
    requests: int = 1
    paid: int = 1


def refusing(status: int, words: str, *names: str, **values: Any) -> Reply:
    """Refuse requests with an option of a name, a message of a role, or without a value; answer any other."""

    def reply(request: dict[str, Any]) -> Said:
        present = {*request, *(each["role"] for each in request["messages"])}
        lacks = any(request.get(name) != wanted for name, wanted in values.items())
        return failure(status, words) if present.intersection(names) or lacks else message(ANSWER)

    return reply


def with_choice(**changes: Any) -> Said:
    """Return a completion with other values in its only choice."""
    body = json.loads(message(ANSWER).body)
    body["choices"][0] |= changes
    return Said(json.dumps(body).encode())


def streamed(*deltas: dict[str, Any], **last: Any) -> Said:
    """Return a completion in parts of any kind, ended as Windows ends lines, and what comes after them."""
    lines = [json.dumps({"choices": [{"index": 0, "delta": delta}]}) for delta in deltas] + [json.dumps(last)] * bool(
        last
    )
    text = "".join(f"event: message\r\ndata: {line}\r\n\r\n" for line in [*lines, "[DONE]"])
    return Said(text.encode(), headers={"Content-Type": "text/event-stream"})


def call(arguments: str) -> dict[str, Any]:
    """Return a part of a tool's call."""
    return {"tool_calls": [{"index": 0, "function": {"arguments": arguments}}]}


def events(*parts: str, reason: str = "stop") -> Said:
    """Return a completion in parts."""
    chunks = [{"choices": [{"index": 0, "delta": {"content": part}, "finish_reason": None}]} for part in parts]
    chunks[0]["choices"][0]["delta"]["role"] = "assistant"  # type: ignore[index]
    chunks += [{"choices": [{"index": 0, "delta": {}, "finish_reason": reason}]}]
    chunks += [{"choices": [], "usage": {"prompt_tokens": 9, "completion_tokens": 3}}]
    lines = [": keep-alive", *(f"data: {json.dumps(chunk)}" for chunk in chunks), "data: [DONE]"]
    return Said("\n\n".join([*lines, ""]).encode(), headers={"Content-Type": "text/event-stream"})


def streaming_only(request: dict[str, Any]) -> Said:
    words = "This model only support stream mode, please enable the stream parameter to access the model."
    return events(ANSWER[:9], ANSWER[9:]) if request.get("stream") else failure(400, words)


def forbidding(request: dict[str, Any]) -> Said:
    """Refuse, one after the other, what a strict server does not know, as FastAPI words it."""
    for name in ("response_format", "max_tokens"):
        if name in request:
            detail = [{"type": "extra_forbidden", "loc": ["body", name], "msg": "Extra inputs are not permitted"}]
            return Said(json.dumps({"detail": detail}).encode(), 422)
    return message(ANSWER)


PAGE = Said(b"<html><h1>502 Bad Gateway</h1></html>", 502, headers={"Content-Type": "text/html", "retry-after-ms": "1"})
LIMIT = failure(429, "Rate limit reached for requests")
LIMIT.headers = {"Retry-After": "1"}
HOUR = failure(429, "slow down")
HOUR.headers = {"Retry-After": "3600"}
CALL = {"id": "1", "type": "function", "function": {"name": "answer", "arguments": ANSWER}}
HABITS = {
    "max_completion_tokens": Habit((refusing(400, "Unsupported parameter: 'max_tokens'", "max_tokens"),), "", 2),
    "temperature of 1 alone": Habit((refusing(400, "temperature: only 1 is supported", "temperature"),), "", 2),
    "no role system": Habit((refusing(400, "System role not supported", "system"),), "", 2),
    "500 for a schema": Habit(
        (refusing(500, "json_schema is not supported", "response_format"),), "", 3
    ),  # asked again, then without
    "404 for a schema": Habit((refusing(404, "No endpoints found that support this", "response_format"),), "", 2),
    "only streams": Habit((streaming_only,), "", 2),
    "streams unasked": Habit((events("Here it is: ", ANSWER),)),
    "429 with Retry-After": Habit((LIMIT, message(ANSWER)), "", 2),
    "429 for good": Habit((failure(429, "You exceeded your current quota"),), "exceeded your current quota", 2, 0),
    "a page for an error": Habit((PAGE,), "502.*check OPENAI_BASE_URL", 2, 0),
    "a page that is fine": Habit((Said(b"<html>welcome</html>"),), "no chat completion.*OPENAI_BASE_URL", 1),
    "no choices": Habit((Said(b'{"choices": [], "usage": {}}'),), "no chat completion", 1),
    "thoughts in a field": Habit((message(ANSWER, reasoning_content='{"shelf": "wrong", "count": 0}'),)),
    "thoughts in the answer": Habit((message(f"<think>{{maybe}}</think>\n```json\n{ANSWER}\n```"),)),
    "cut by length": Habit((with_choice(finish_reason="length", message={"content": ""}),), "raise it"),
    "cut in a stream": Habit((events(ANSWER[:12], reason="length"),), "raise it"),
    "filter of the answer": Habit((with_choice(finish_reason="content_filter", message={"content": None}),), "filter"),
    "filter of the question": Habit((failure(400, "content_filter: Violence"),), "filter refuses the question", 1, 0),
    "refusal": Habit((message(None, refusal="I cannot\nhelp."),), "a refusal: I cannot help.*word prompt"),
    "a tool's call": Habit((with_choice(finish_reason="tool_calls", message={"content": None, "tool_calls": [CALL]}),)),
    "a function's call": Habit((with_choice(message={"content": None, "function_call": CALL["function"]}),)),
    "a call with an object": Habit(
        (with_choice(message={"content": "", "tool_calls": [{"function": {"arguments": json.loads(ANSWER)}}]}),)
    ),
    "a refusal in parts": Habit(
        (message([{"type": "refusal", "refusal": "I cannot."}]),),
        "a refusal: I cannot.*word prompt",  # type: ignore[arg-type]
    ),
    "cut by the context": Habit((with_choice(finish_reason="model_length", message={"content": ""}),), "raise it"),
    "guardrail": Habit((with_choice(finish_reason="guardrail_intervened", message={"content": ""}),), "filter"),
    "fields that are forbidden": Habit((forbidding,), "", 3),
    "a mark before the answer": Habit((Said(b"\xef\xbb\xbf" + message(ANSWER).body),)),
    "a reason of its own form": Habit(
        (Said(b'{"detail": [{"msg": "unknown model gpt-4o"}]}', 422),), "unknown model gpt-4o.*llm.model", 2, 0
    ),
    "no balance": Habit((failure(402, "Insufficient Balance"),), "Insufficient Balance", 1, 0),
    "slow": Habit((Said(b"", wait=3.0),), "did not end its answer in time; raise llm.timeout|timed out", 2, 0),
    "an error that is fine": Habit(
        (Said(b'{"error": {"message": "Provider returned error"}}'),), "Provider returned", 1
    ),
    "an error in place of a choice": Habit(
        (with_choice(finish_reason="error", error={"message": "Provider died"}, message={"content": ANSWER[:9]}),),
        "Provider died",
    ),
    "an error beside an answer": Habit((Said(b'{"error": {"message": "late"}, ' + message(ANSWER).body[1:]),)),
    "an error of a choice with an answer": Habit((with_choice(error={"message": "late"}),)),
    "an error beside a tool's call": Habit(
        (with_choice(error={"message": "late"}, message={"content": None, "tool_calls": [CALL]}),)
    ),
    "an error beside half an answer": Habit(
        (Said(b'{"error": {"message": "Provider died"}, ' + message(ANSWER[:9]).body[1:]),), "cut by an error.*died"
    ),
    "an error without an answer": Habit(
        (with_choice(error={"message": "Provider died"}, message={"content": ""}),), "failed:.*Provider died"
    ),
    "an error after an answer in a stream": Habit((streamed({"content": ANSWER}, error={"message": "overloaded"}),)),
    "an error in a stream": Habit((streamed({"content": ANSWER[:9]}, error={"message": "overloaded"}),), "overloaded"),
    "a call in a stream": Habit((streamed(call(ANSWER[:9]), call(ANSWER[9:])),)),
    "a refusal in a stream": Habit((streamed({"refusal": "I can"}, {"refusal": "not."}),), "a refusal: I cannot"),
    "parts in a stream": Habit((streamed({"content": [{"type": "text", "text": ANSWER}]}, choices=None),)),
    "an object for the content": Habit((message(json.loads(ANSWER)),)),
    "texts for the content": Habit((message([ANSWER[:9], ANSWER[9:]]),)),  # type: ignore[arg-type]
    "thoughts alone": Habit((message("", reasoning_content=ANSWER),), "thoughts and nothing else"),
    "thoughts alone in a stream": Habit((streamed({"reasoning": ANSWER}),), "thoughts and nothing else"),
    "429 for an hour": Habit((HOUR,), "slow down", 1, 0),
    "a key that is repeated": Habit((failure(401, "Incorrect API key: secret-key"),), r"API key: \*\*\*", 1, 0),
    "parts of content": Habit((message([{"type": "text", "text": ANSWER}]),)),  # type: ignore[arg-type]
    "parts of an output": Habit(
        (message([{"type": "reasoning", "text": "{"}, {"type": "output_text", "text": ANSWER}]),)  # type: ignore[arg-type]
    ),
}


@pytest.mark.parametrize("name", HABITS)
def test_a_habit_is_answered_or_one_line_and_paid_once(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    habit, answered = HABITS[name], list[bool]()

    def counted(reply: Reply | Said) -> Reply:
        def count(request: dict[str, Any]) -> Said:
            said = reply(request) if callable(reply) else reply
            answered.append(said.status == 200 and not said.wait)
            return said

        return count

    with endpoint(*map(counted, habit.replies)) as there:
        monkeypatch.setenv("OPENAI_API_KEY", "secret-key")
        monkeypatch.setenv("OPENAI_BASE_URL", there.url)
        changes = {"attempts": 1, "timeout": 0.4 if name == "slow" else 5.0}
        chat = Chat(load(LlmConfig, {**compose("insert", ["llm=chat"])["llm"], **changes}))
        request, usage = Request("plan", "Answer.", (("user", "Where?"),), SCHEMA, {}), UsageLog((1.0, 1.0))
        if habit.outcome:
            with pytest.raises(InputError, match=habit.outcome) as caught:
                ask(chat, request, lambda text: parse(text, Wanted), 2, usage)
            assert "\n" not in str(caught.value) and "secret-key" not in str(caught.value)
        else:
            wanted = ask(chat, request, lambda text: parse(text, Wanted), 2, usage)
            assert wanted == Wanted("drawer", 2) and len(usage.entries) == 1
    assert (len(there.asked), sum(answered)) == (habit.requests, habit.paid)
