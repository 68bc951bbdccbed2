"""Questions to a model; an unusable answer goes back with validation feedback."""

from __future__ import annotations

import json
import math
import re
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Literal, TypeVar

import dacite

from s2a.core.errors import InputError, printable

T = TypeVar("T")
Step = Literal["plan", "scale", "script", "review", "skills"]
Message = tuple[Literal["user", "assistant"], str]
# The models that write them end with them before the answer begins
THOUGHTS = re.compile(r"\A.*</(?:think|thinking|thought|reasoning)>", re.DOTALL | re.IGNORECASE)
QUOTED = 2000  # Characters of a rejected answer that are quoted back to the model


@dataclass(frozen=True)
class Request:
    """A question to a model."""

    step: Step  # of an insertion; "skills" plans for a sentence
    system: str  # system prompt of the step
    messages: tuple[Message, ...]  # (role, text), the question first, then rejected answers and the feedback on them
    schema: Mapping[str, Any] | None  # JSON schema of the answer; None where the answer is a script
    facts: Mapping[str, Any]  # content of the question as values, for the rule-based fallback
    images: tuple[bytes, ...] = ()  # PNG files that go with the question, for models that see

    def with_feedback(self, answer: str, feedback: str) -> Request:
        """Return the question followed by an answer and the feedback on it."""
        more: tuple[Message, Message] = (("assistant", answer[:QUOTED] or "(nothing)"), ("user", feedback))
        return replace(self, messages=(*self.messages, *more))


@dataclass(frozen=True)
class Answer:
    """An answer of a model.

    Attributes:
        text: the answer.
        model: name of the model.
        seconds: duration.
        prompt_tokens: of the request, as the model counts, or an estimate (`s2a.language.ask.tokens`); 0 without a
        model. completion_tokens: of the answer.
        note: remark for the record.
        cut: why it ends too early, and what to do; empty for a whole answer.
        replayed: it was given before, and costs nothing again.
    """

    text: str
    model: str
    seconds: float = 0.0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    note: str = ""
    cut: str = ""
    replayed: bool = False


Model = Callable[[Request], Answer]


class ValidationFeedback(Exception):
    """An answer cannot be used; the message goes back to the model."""


def ask(model: Model, request: Request, accept: Callable[[str], T], retries: int, usage: UsageLog) -> T:
    """Ask until an answer is accepted, and return what it is parsed to.

    `accept`: parses an answer; raises ValidationFeedback that goes back to the model.

    Raises:
        InputError: no answer could be used.
    """
    for _ in range(retries + 1):
        answer = model(request)
        try:
            if answer.cut and request.schema is None:  # half a script may look whole
                raise ValidationFeedback(answer.cut)
            accepted = accept(answer.text)
        except ValidationFeedback as feedback:
            usage.add(request.step, answer, answer.cut or str(feedback))
            if answer.cut:  # the next one would be as well
                raise InputError(
                    f"the answer of model {answer.model!r} to step {request.step!r} {answer.cut}; "
                    f"or try another llm.model, or llm=rules"
                ) from feedback
            reason, request = str(feedback), request.with_feedback(answer.text, str(feedback))
        else:
            usage.add(request.step, answer)
            return accepted
    raise InputError(
        f"model {answer.model!r} gave no usable answer to step {request.step!r} in {retries + 1} tries; the last one: "
        f"{printable(reason[:300])}; try another model, or llm=rules"
    )


def parse(text: str, kind: type[T], *, strict: bool = False) -> T:
    """Return the JSON object in an answer as a dataclass; words around it are ignored, and unknown keys unless `strict`.

    Raises:
        ValidationFeedback: there is none, or a key is missing or of another type.
    """
    text = without_thoughts(text)
    try:
        values = json.loads(text[text.index("{") : text.rindex("}") + 1])
        json.dumps(values, ensure_ascii=False).encode()  # half a character can be spelled, and not be written anywhere
    except (ValueError, RecursionError) as error:
        raise ValidationFeedback(
            f"That is not one JSON object ({error}). Answer with the JSON object alone."
        ) from error
    rules = dacite.Config(cast=[tuple], type_hooks={float: _number}, strict=strict)
    try:
        return dacite.from_dict(kind, values, rules)
    except (dacite.DaciteError, TypeError, ValueError, ArithmeticError) as error:
        raise ValidationFeedback(
            f"The JSON does not fit the schema: {str(error)[:300]}. Answer with all keys as asked."
        ) from error


def object_schema(**properties: Any) -> dict[str, Any]:
    """Return the JSON schema of an object all of whose keys are required, as structured output wants it."""
    return {"type": "object", "properties": properties, "required": list(properties), "additionalProperties": False}


def without_thoughts(text: str) -> str:
    """Return an answer without what a model wrote to itself before it: <think>...</think>, also where only the end is left."""
    return THOUGHTS.sub("", text)


def _number(value: Any) -> Any:
    """Accept integers as floats: models write 1 for 1.0; raise a ValueError for infinity and NaN, an OverflowError near them."""
    number = float(value) if isinstance(value, int) and not isinstance(value, bool) else value
    if isinstance(number, float) and not math.isfinite(number):
        raise ValueError(f"{number} is no finite number")
    return number


Record = dict[str, Any]  # Results of an insertion by step: plain values for JSON
MOST_TOKENS = 10**9
PER_TOKEN = 3.5  # Characters per token: between 3 and 4 for the JSON of a room with the tokenizers of 2024 and 2025


@dataclass
class UsageLog:
    """Log of a model's answers with their tokens and prices."""

    # US dollars for a million tokens of the request and of the answer; zeros where it is free
    prices: tuple[float, float]
    entries: list[dict[str, Any]] = field(default_factory=list)  # one per answer

    def add(self, step: str, answer: Answer, refused: str = "") -> None:
        """Log an answer, and why it was rejected."""
        entry = {
            "step": step,
            "model": answer.model,
            "seconds": round(answer.seconds, 3),
            "prompt_tokens": answer.prompt_tokens,
            "completion_tokens": answer.completion_tokens,
            "characters": len(answer.text),
        }
        notes = {"replayed": answer.replayed, "note": answer.note, "refused": refused}
        self.entries.append(entry | {name: value for name, value in notes.items() if value})

    def total(self) -> dict[str, Any]:
        """Return the number of calls, the tokens, seconds and US dollars of what was asked, and how many were replayed."""
        billed = [entry for entry in self.entries if not entry.get("replayed")]
        prompt, completion = (sum(entry[key] for entry in billed) for key in ("prompt_tokens", "completion_tokens"))
        return {
            "calls": len(billed),
            "replayed": len(self.entries) - len(billed),
            "prompt_tokens": prompt,
            "completion_tokens": completion,
            "seconds": round(sum(entry["seconds"] for entry in self.entries), 3),
            "dollars": round((prompt * self.prices[0] + completion * self.prices[1]) / 1e6, 6),
        }


def is_count(value: object) -> bool:
    """Return True for a number of tokens that an answer can have."""
    return isinstance(value, int) and not isinstance(value, bool) and 0 <= value < MOST_TOKENS


def tokens(text: str) -> int:
    """Estimate the number of tokens of a text."""
    return math.ceil(len(text) / PER_TOKEN)


@contextmanager
def step(record: Record, name: str) -> Iterator[Record]:
    """Yield the record of a step and add its duration, and its `problem` if it fails."""
    result: Record = record.setdefault(name, {})
    start = time.perf_counter()
    try:
        yield result
    except InputError as error:
        result["problem"] = str(error)
        raise
    finally:
        result["seconds"] = round(result.get("seconds", 0.0) + time.perf_counter() - start, 3)
