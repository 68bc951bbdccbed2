"""A question to a model, and what happens to an answer that cannot be used: it goes back with what is wrong with it."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal, TypeVar

import dacite

from s2a.errors import InputError
from s2a.llm.usage_log import UsageLog

T = TypeVar("T")
Step = Literal["plan", "scale", "script"]
Message = tuple[Literal["user", "assistant"], str]
QUOTED = 2000
"""Characters of a refused answer that the model is shown again."""


@dataclass(frozen=True)
class Request:
    """What a model is asked.

    Attributes:
        step: of the insertion.
        system: what holds for every question of this step.
        messages: (role, text), the question first, then refused answers and what was wrong with them.
        schema: JSON schema of the answer; None where the answer is a script.
        facts: what the question is about, as the text says it: for models that do not read.
    """

    step: Step
    system: str
    messages: tuple[Message, ...]
    schema: Mapping[str, Any] | None
    facts: Mapping[str, Any]

    def with_feedback(self, answer: str, feedback: str) -> Request:
        """Return the question again, after an answer and what is wrong with it."""
        more: tuple[Message, Message] = (("assistant", answer[:QUOTED] or "(nothing)"), ("user", feedback))
        return replace(self, messages=(*self.messages, *more))


@dataclass(frozen=True)
class Answer:
    """What came back.

    Attributes:
        text: the answer.
        model: who gave it.
        seconds: that it took.
        prompt_tokens: of the request, as the model counts, or an estimate (`s2a.llm.usage_log.tokens`); 0 without a model.
        completion_tokens: of the answer.
        note: what else there is to know of it, for the record.
    """

    text: str
    model: str
    seconds: float = 0.0
    prompt_tokens: int = 0
    completion_tokens: int = 0
    note: str = ""


Model = Callable[[Request], Answer]


class ValidationFeedback(Exception):
    """An answer cannot be used; the message is for the model."""


def ask(model: Model, request: Request, accept: Callable[[str], T], retries: int, usage: UsageLog) -> T:
    """Return what an answer says.

    Args:
        model: the language model.
        request: what.
        accept: reads an answer; raises ValidationFeedback that goes back to the model.
        retries: how often it may.
        usage: log of the answers, appended to.

    Raises:
        InputError: no answer could be used.
    """
    for _ in range(retries + 1):
        answer = model(request)
        try:
            accepted = accept(answer.text)
        except ValidationFeedback as feedback:
            usage.note(request.step, answer, str(feedback))
            said, request = str(feedback), request.with_feedback(answer.text, str(feedback))
        else:
            usage.note(request.step, answer)
            return accepted
    raise InputError(
        f"model {answer.model!r} gave no usable answer to step {request.step!r} in {retries + 1} tries; the last one: "
        f"{said[:300]}; try another model, or llm=rules"
    )


def parse(text: str, kind: type[T]) -> T:
    """Return the JSON object in an answer as a dataclass; words around it are ignored.

    Raises:
        ValidationFeedback: there is none, or a key is missing or of another type.
    """
    try:
        values = json.loads(text[text.index("{") : text.rindex("}") + 1])
    except (ValueError, RecursionError) as error:
        raise ValidationFeedback(
            f"That is not one JSON object ({error}). Answer with the JSON object alone."
        ) from error
    rules = dacite.Config(cast=[tuple], type_hooks={float: _number})
    try:
        return dacite.from_dict(kind, values, rules)
    except (dacite.DaciteError, TypeError, ValueError) as error:
        raise ValidationFeedback(
            f"The JSON does not fit the schema: {str(error)[:300]}. Answer with all keys as asked."
        ) from error


def _number(value: Any) -> Any:
    """Whole numbers are numbers, too; a model writes 1 for 1.0."""
    return float(value) if isinstance(value, int) and not isinstance(value, bool) else value
