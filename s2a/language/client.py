"""Language models over the network: any endpoint that speaks OpenAI's chat protocol."""

import base64
import hashlib
import json
import os
import re
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from queue import Empty, SimpleQueue
from threading import TIMEOUT_MAX, Lock, Thread
from typing import Any, Literal, TypeVar

from s2a.core.bounds import Count, CountFromZero, NotNegative, Positive
from s2a.core.errors import InputError, encodable, printable
from s2a.core.outputs import atomic_write
from s2a.language.ask import Answer, Model, Request, is_count, tokens
from s2a.scene.scene import UNANNOTATED

# Numbers of a pose in the question for a script. A recording has a slot for each, because the same question may come
# with another pose: surfaces and search results differ in their last digits
EXACT = re.compile(r"(?<![\w.])-?\d+\.\d{4,}(?![\w.])")
NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d+(?![\w.])")
TEXTS = ("step", "prompt", "about", "gist", "model", "answer")
COUNTS = ("prompt_tokens", "completion_tokens")  # Keys of an entry
OTHER = "recorded in this room when its measures were others"


def recorder(model: Model, path: Path) -> Model:
    """Return a model that is asked, and whose answers are added to a file; a question that it had before has the same answer.

    Answers of an earlier run are replaced: they are replayed by llm=replay alone.
    """
    entries, own, lock = _load(path) if path.exists() else {}, set[str](), Lock()

    def answer(request: Request) -> Answer:
        if key(request) in own:
            return _answer(entries[key(request)], request, "")
        reply = model(request)
        if reply.cut:  # half an answer is none to play again
            return reply
        about = {"step": request.step, "prompt": _hash(request.system), "about": _about(request), "gist": gist(request)}
        tokens = {"prompt_tokens": reply.prompt_tokens, "completion_tokens": reply.completion_tokens}
        with lock, atomic_write(path) as room:
            own.add(key(request))
            entries[key(request)] = {**about, "model": reply.model, **tokens, "answer": _slotted(reply.text, request)}
            room.write_text(json.dumps(dict(sorted(entries.items())), indent=1, ensure_ascii=False) + "\n")
        return reply

    return answer


def recorded(path: Path) -> Model:
    """Return a model that replays the answers of a recording.

    A question that differs in nothing but the measures of the room has the recorded answer too, which then says so.

    Raises:
        InputError: no such recording; from the model: a question that is not recorded.
    """
    entries = _load(path)
    gists = {entry["gist"]: entry for entry in entries.values()}

    def answer(request: Request) -> Answer:
        if key(request) in entries:
            return _answer(entries[key(request)], request, "")
        for digest in (gist(request), gist(request, left_over=False)):
            if digest in gists:
                return _answer(gists[digest], request, OTHER)
        raise InputError(_missing(request, entries, path))

    return answer


def key(request: Request) -> str:
    """Return the hash of a question; of one for a script, without the numbers of the pose."""
    numbers = count()
    texts = [request.step, request.system, *(f"{role}: {text}" for role, text in request.messages)]
    if request.step == "script":
        texts = [EXACT.sub(lambda _: _slot(next(numbers)), text) for text in texts]
    return _hash("\n\n".join(texts))


def gist(request: Request, left_over: bool = True) -> str:
    """Return the hash of a question without the room's measures: prompt, object, placement hint and the ids of the room.

    `left_over`: with the surface that no annotation covers, which is part of questions since it offers supports.
    """
    facts = request.facts
    named = [facts.get(name) for name in ("label", "sides", "height", "wish", "id", "tried")]
    if request.step == "review":
        named += [facts.get(name) for name in ("carrier", "relation", "up", "front")]
    ids = sorted(
        i for i in (line["id"] for line in facts.get("room", ())) if left_over or not i.startswith(UNANNOTATED)
    )
    return _hash(json.dumps([request.step, request.system, named, ids, len(request.messages)]))


def _answer(entry: dict[str, Any], request: Request, note: str) -> Answer:
    """Return a recorded answer, with the numbers of this question."""
    text = entry["answer"]
    for number, exact in enumerate(_exact(request)):
        text = text.replace(_slot(number), exact)
    return Answer(text, entry["model"], 0.0, entry["prompt_tokens"], entry["completion_tokens"], note, replayed=True)


def _slotted(text: str, request: Request) -> str:
    """Return an answer with a slot for each number of the question's pose, however many zeros the model wrote."""
    slots: dict[float, str] = {}
    for number, exact in enumerate(_exact(request)):
        slots.setdefault(float(exact), _slot(number))
    return NUMBER.sub(lambda match: slots.get(float(match[0]), match[0]), text) if slots else text


def _exact(request: Request) -> list[str]:
    """Return the numbers of the pose in a question for a script, in order."""
    return EXACT.findall(request.messages[0][1]) if request.step == "script" else []


def _slot(number: int) -> str:
    return f"\N{LEFT-POINTING DOUBLE ANGLE QUOTATION MARK}{number}\N{RIGHT-POINTING DOUBLE ANGLE QUOTATION MARK}"


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _about(request: Request) -> str:
    """Return the subject of a question, for readers of a recording."""
    tries = len(request.messages) // 2
    return f"{request.facts.get('label', '')}{f', try {tries + 1}' if tries else ''}"


def _missing(request: Request, entries: dict[str, Any], path: Path) -> str:
    """Return the message for a question that is not recorded."""
    same = [entry for entry in entries.values() if entry["step"] == request.step]
    lack = f"{path} has no answer to step {request.step!r} for {_about(request)!r}"
    if same and _hash(request.system) not in {entry["prompt"] for entry in same}:
        return f"{lack}: its prompt has changed since the recording; record again with llm=chat record={path}"
    if _about(request) in {entry["about"] for entry in same}:
        return (
            f"{lack} in this room: the room or the object has changed since; record again with llm=chat record={path}"
        )
    return f"{lack}; record it with llm=chat record={path}"


def _load(path: Path) -> dict[str, Any]:
    """Read a recording."""
    if not path.is_file():
        raise InputError(f"{path}: no such recording; make one with llm=chat record={path}")
    try:
        entries = json.loads(path.read_text(encoding="utf-8"))
        damaged = [name for name, entry in entries.items() if not _whole(entry)]
        if damaged:
            raise ValueError(
                f"entry {damaged[0][:40]!r} lacks one of {', '.join((*TEXTS, *COUNTS))}, or has another type"
            )
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{path}: not a recording, or a damaged one ({printable(str(error)[:200])}); make one with record=FILE"
        ) from error
    return {name: {**entry, "answer": encodable(entry["answer"])} for name, entry in entries.items()}


def _whole(entry: Any) -> bool:
    """Return True for an entry that has all its values."""
    if not isinstance(entry, dict):
        return False
    return all(isinstance(entry.get(key), str) for key in TEXTS) and all(is_count(entry.get(key)) for key in COUNTS)


T = TypeVar("T")
MAX_WAIT = 60.0  # Before a retry, as an endpoint may ask for [s]


# What some models refuse, and the words in which their servers say so; "whole": an answer that comes at once
REFUSABLE = {
    "response_format": r"response_?format|json_?schema|schema|structured|guided|grammar",
    "max_tokens": r"max_tokens",
    "max_completion_tokens": r"max_completion_tokens",
    "temperature": r"temperature",
    "whole": r"\bstream\w*\b.{0,24}(?:mode|only|true|required|parameter)|(?:only|must)\b.{0,24}\bstream",
    "system": r"role\W+(?:\w+\W+){0,4}system|\bsystem\W+(?:role|message|prompt|instruction)|developer instruction|must alternate",
}
THOUGHT_FIELDS = ("reasoning_content", "reasoning")  # Of a message: what a model wrote to itself
EVENTS = re.compile(rb"(?:\s|:[^\n]*\n|event:[^\n]*\n)*data:")  # The beginning of a response that comes in parts
REFUSALS = (400, 404, 415, 422, 500, 501)  # Status of a response that refuses a request as it is
FILTERS = re.compile(
    r"content_filter|content management|safety|blocklist|prohibited|recitation|guardrail", re.IGNORECASE
)
TOO_LONG = re.compile(r"context.{0,9}(?:length|window|size)|too long|too many tokens", re.IGNORECASE)


@dataclass(frozen=True, kw_only=True)
class LlmConfig:
    """The language model.

    Attributes:
        kind: "chat" queries a model over the network, "replay" answers from a recording, "rules" is the rule-based fallback;
            "auto" is chat where OPENAI_API_KEY is set, and rules elsewhere.
        model: name of the model at the endpoint. Key and address come from OPENAI_API_KEY and OPENAI_BASE_URL.
        timeout: maximum time for one answer [s].
        attempts: retries after a broken connection, an overload or a server error; the wait doubles from half a second.
        temperature: sampling temperature; 0 for the likeliest answer.
        max_tokens: maximum number of tokens of an answer.
        prices: US dollars per million tokens of the request and of the answer.
        answers: the recording, for replay.
    """

    kind: Literal["auto", "chat", "replay", "rules"]
    model: str
    timeout: Positive
    attempts: CountFromZero
    temperature: NotNegative
    max_tokens: Count
    max_response_bytes: Count = 2000000  # of a response; a longer one is an error
    prices: tuple[NotNegative, NotNegative]
    answers: Path | None


def kind_of(config: LlmConfig) -> str:
    """Return who is asked: "chat", "replay" or "rules"."""
    if config.kind != "auto":
        return config.kind
    return "chat" if os.environ.get("OPENAI_API_KEY") else "rules"


def choose(config: LlmConfig, record: Path | None, fallback: Model) -> Model:
    """Return the model that is asked for; its answers are added to the recording `record`, if one is given.

    `record`: the recording, or None; `fallback`: the rules.

    Raises:
        InputError: replay without a recording, or chat without a key.
    """
    kind = kind_of(config)
    if record is not None and not record.parent.is_dir():
        raise InputError(
            f"record {str(record)!r} lies in no folder; make {str(record.parent)!r} first, or choose another"
        )
    if kind == "replay":
        if config.answers is None:
            raise InputError(
                "llm=replay needs a recording; give llm.answers=FILE, which record=FILE of llm=chat writes"
            )
        return recorded(config.answers)
    model = fallback if kind == "rules" else Chat(config)
    return model if record is None else recorder(model, record)


class Chat:
    """Asks an endpoint."""

    def __init__(self, config: LlmConfig) -> None:
        import httpx2  # these take a second, which nobody pays who asks no model
        import openai

        if not os.environ.get("OPENAI_API_KEY"):
            raise InputError(
                "llm=chat needs OPENAI_API_KEY in the environment; set it (a local server takes any), or llm=rules"
            )
        self._config, self._openai, self._refused = config, openai, set[str]()
        # No wait for a part of a response is longer than that for the whole.
        try:
            self._client = openai.OpenAI(timeout=config.timeout, max_retries=config.attempts)
        except (openai.OpenAIError, httpx2.InvalidURL, ValueError) as error:
            raise InputError(f"the model's endpoint cannot be reached: {error}; check OPENAI_BASE_URL") from error

    def __call__(self, request: Request) -> Answer:
        """Return the model's answer; an empty one if it declines.

        Raises:
            InputError: the endpoint cannot be reached, refuses the request, does not answer in time, or answers what is no
                chat completion.
        """
        start = time.perf_counter()
        try:
            body = self._completion(request)
        except InputError:
            raise
        except Exception as error:  # of the client, its transport, or what they make of an odd response
            text = _line(_words(error)) or type(error).__name__
            remedy = "check OPENAI_BASE_URL, OPENAI_API_KEY and llm.model, or give llm=rules"
            if FILTERS.search(text):
                remedy = "its filter refuses the question: word prompt and label otherwise, or set another llm.model"
            elif TOO_LONG.search(text):
                remedy = "lower llm.max_tokens, set an llm.model with a longer context, or give llm=rules"
            raise InputError(
                f"model {self._config.model!r} at {self._client.base_url} failed: {text}; {remedy}"
            ) from error
        return self._answer(body, request, time.perf_counter() - start)

    def _completion(self, request: Request) -> dict[str, Any]:
        """Return the response; what the endpoint refuses is left out from then on, and the question asked once more."""
        while True:
            more = self._options(request)
            try:
                return self._read(self._send(request, more))
            except self._openai.APIStatusError as error:
                refused = _refused(error, [*more, "system", "whole"])
                if refused is None or refused in self._refused:
                    raise
                self._refused.add(refused)

    def _options(self, request: Request) -> dict[str, Any]:
        """Return what is asked beside the messages, but for what the endpoint has refused."""
        limit = "max_completion_tokens" if "max_tokens" in self._refused else "max_tokens"
        options: dict[str, Any] = {"temperature": self._config.temperature, limit: self._config.max_tokens}
        if request.schema:
            wanted = {"name": request.step, "schema": request.schema, "strict": True}
            options["response_format"] = {"type": "json_schema", "json_schema": wanted}
        if "whole" in self._refused:
            options["stream"] = True
        return {name: value for name, value in options.items() if name not in self._refused}

    def _send(self, request: Request, more: dict[str, Any]) -> bytes:
        """Send a request and return the response, if it comes in time and is not too long."""
        messages: list[dict[str, Any]] = [{"role": role, "content": text} for role, text in request.messages]
        if "system" in self._refused:
            messages[0]["content"] = f"{request.system}\n\n{messages[0]['content']}"
        if request.images:
            messages[0]["content"] = [{"type": "text", "text": messages[0]["content"]}, *map(_image, request.images)]
        if "system" not in self._refused:
            messages = [{"role": "system", "content": request.system}, *messages]
        # The client bounds each wait for a part of a response; this bounds their sum, headers and retries included.
        seconds = self._config.timeout * (self._config.attempts + 1) + MAX_WAIT * self._config.attempts
        return within(min(seconds, TIMEOUT_MAX), lambda: self._receive(messages, more), self._late)

    def _receive(self, messages: list[dict[str, Any]], more: dict[str, Any]) -> bytes:
        """Return the response to a request; its body may take as long as an answer may."""
        with self._client.chat.completions.with_streaming_response.create(
            model=self._config.model,
            messages=messages,  # type: ignore[arg-type]
            **more,
        ) as response:
            body, deadline = bytearray(), time.monotonic() + self._config.timeout
            for piece in response.iter_bytes():  # as they come: a size would wait for as many
                body += piece
                if len(body) > self._config.max_response_bytes:
                    raise InputError(
                        f"model {self._config.model!r} answered more than {self._config.max_response_bytes} bytes; "
                        f"try another model, or raise llm.max_response_bytes"
                    )
                if time.monotonic() > deadline:
                    raise self._late()
        return bytes(body)

    def _late(self) -> InputError:
        return InputError(
            f"model {self._config.model!r} did not end its answer in time; "
            f"raise llm.timeout ({self._config.timeout:g} s), or try another model"
        )

    def _read(self, text: bytes) -> dict[str, Any]:
        """Return a response as a dictionary."""
        try:
            body = _gathered(text) if EVENTS.match(text) else json.loads(text)
            if (reason := _failure(body)) and not any(_content(each.get("message")) for each in _choices(body)[:1]):
                raise InputError(
                    f"model {self._config.model!r} at {self._client.base_url} failed: {reason}; check llm.model"
                )
            if not isinstance(body["choices"][0]["message"], dict):
                raise TypeError("the message is no object")
        except InputError:
            raise
        except (ValueError, TypeError, LookupError, AttributeError, RecursionError) as error:
            raise InputError(
                f"{self._client.base_url} returned no chat completion: {text[:80]!r}; check OPENAI_BASE_URL"
            ) from error
        response: dict[str, Any] = body
        return response

    def _answer(self, body: dict[str, Any], request: Request, seconds: float) -> Answer:
        """Return what a response says; what is not text is nothing. Tokens that it does not tell are estimated."""
        choice = body["choices"][0]
        message = choice["message"]
        text, refusal = encodable(_content(message)), message.get("refusal")
        if not refusal and isinstance(message.get("content"), list):
            refusal = "".join(str(part.get("refusal") or "") for part in message["content"] if isinstance(part, dict))
        thoughts = any(message.get(name) for name in THOUGHT_FIELDS)
        reason, cut = str(choice.get("finish_reason")), ""
        if reason.lower() in ("length", "max_tokens", "model_length", "max_output_tokens"):
            limit = f"llm.max_tokens={self._config.max_tokens}"
            is_ours = "max_completion_tokens" not in self._refused
            cut = (
                f"was cut at {limit} tokens, thoughts included; raise it"
                if is_ours
                else "was cut by the endpoint's limit"
            )
        elif FILTERS.search(reason):
            cut = "was cut by the endpoint's filter; word prompt and label otherwise"
        elif failure := _failure(body):
            cut = f"was cut by an error: {failure}; ask again"
        elif not text and isinstance(refusal, str) and refusal:
            cut = f"is a refusal: {_line(refusal)}; word prompt and label otherwise"
        elif not text and thoughts:
            cut = "holds thoughts and nothing else; change how the server tells thoughts from answers"
        counts = body.get("usage")
        usage = counts if isinstance(counts, dict) else {}
        prompt, completion = (usage.get(key) for key in ("prompt_tokens", "completion_tokens"))
        estimate = tokens(request.system + "".join(message for _, message in request.messages))
        return Answer(
            text,
            self._config.model,
            seconds,
            prompt if is_count(prompt) and prompt else estimate,
            completion if is_count(completion) and completion else tokens(text),
            cut=cut,
        )


def _gathered(text: bytes) -> dict[str, Any]:
    """Return a response that came in parts, as events of a stream, as if it had come whole."""
    message, calls = dict.fromkeys(("content", "refusal", *THOUGHT_FIELDS), ""), dict[Any, str]()
    reason = usage = error = None
    for line in text.splitlines():
        data = line[5:].strip() if line.startswith(b"data:") else b""
        if data in (b"", b"[DONE]"):
            continue
        part = json.loads(data)
        error, usage = part.get("error") or error, part.get("usage") or usage
        for choice in (part.get("choices") or [])[:1]:
            delta = choice.get("delta") or choice.get("message") or {}
            for name in message:
                message[name] += _text(delta.get(name))
            for call in delta.get("tool_calls") or []:
                calls.setdefault(call.get("index"), "")
                calls[call.get("index")] += (call.get("function") or {}).get("arguments") or ""
            reason, error = choice.get("finish_reason") or reason, choice.get("error") or error
    tools = [{"function": {"arguments": each}} for each in calls.values()]
    choice = {"message": {**message, "tool_calls": tools}, "finish_reason": reason, "error": error}
    return {"choices": [choice], "usage": usage}


def _choices(body: dict[str, Any]) -> list[dict[str, Any]]:
    """Return the choices of a response, without what is none."""
    choices = body.get("choices")
    return [each for each in choices if isinstance(each, dict)] if isinstance(choices, list) else []


def _failure(body: dict[str, Any]) -> str:
    """Return the error that a response or a choice of it states, as a short line; empty without one."""
    errors = [each.get("error") for each in (body, *_choices(body))]
    return _line(str(next(filter(None, errors)))) if any(errors) else ""


def _content(message: Any) -> str:
    """Return the text of a message, or else the arguments of the only tool that it calls; empty without either."""
    if not isinstance(message, dict):
        return ""
    calls = message.get("tool_calls")
    call = message.get("function_call")  # how some servers give an object of a schema
    if not call and isinstance(calls, list) and len(calls) == 1 and isinstance(calls[0], dict):
        call = calls[0].get("function")
    return _text(message.get("content")) or (_text(call.get("arguments")) if isinstance(call, dict) else "")


def _text(content: Any) -> str:
    """Return the text of a content: a text, an object of a schema, or parts, of which thoughts and others are none."""
    if isinstance(content, list):
        kinds = ("text", "output_text")
        parts = [part.get("text") if isinstance(part, dict) and part.get("type") in kinds else part for part in content]
        return "".join(part for part in parts if isinstance(part, str))
    return json.dumps(content) if isinstance(content, dict) else content if isinstance(content, str) else ""


def _line(words: str) -> str:
    """Return the words of an endpoint as a short line, without the key, which some repeat."""
    key = os.environ.get("OPENAI_API_KEY", "")
    return printable(" ".join((words.replace(key, "***") if len(key) > 7 else words).split())[:300])


def _words(error: Exception) -> str:
    """Return what an endpoint answers to a request; the client leaves out what is not worded as OpenAI does."""
    body = getattr(error, "body", None)
    return (
        f"{error} - {json.dumps(body)}"
        if body and not isinstance(body, str) and " - " not in str(error)
        else str(error)
    )


def _refused(error: Any, given: list[str]) -> str | None:
    """Return what of a request an endpoint refuses: what its words name first, else the schema; None where it may be none."""
    text = f"{error.param or ''} {_words(error)}".lower()
    if error.status_code not in REFUSALS or FILTERS.search(text):
        return None
    hits = {name: re.search(REFUSABLE[name], text) for name in given}
    named = [(hit.start(), name) for name, hit in hits.items() if hit]
    return min(named)[1] if named else "response_format" if "response_format" in given else None


def _image(png: bytes) -> dict[str, Any]:
    """Return a PNG file as a part of a message."""
    return {"type": "image_url", "image_url": {"url": f"data:image/png;base64,{base64.b64encode(png).decode()}"}}


def within(seconds: float, call: Callable[[], T], late: Callable[[], Exception]) -> T:
    """Return the result of a call, or raise what it raises, or what `late` makes if it takes longer than `seconds`.

    A late call goes on in a thread that ends with the program.
    """
    done: SimpleQueue[tuple[T | None, BaseException | None]] = SimpleQueue()

    def work() -> None:
        try:
            done.put((call(), None))
        except BaseException as error:
            done.put((None, error))

    Thread(target=work, daemon=True).start()
    try:
        result, error = done.get(timeout=seconds)
    except Empty:
        raise late() from None
    if error is not None:
        raise error
    return result  # type: ignore[return-value]
