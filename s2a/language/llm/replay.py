"""Recordings of a model's answers, keyed by the question: a second run needs no model and has the same result."""

from __future__ import annotations

import hashlib
import json
import re
from itertools import count
from pathlib import Path
from threading import Lock
from typing import Any

from s2a.core.errors import InputError, encodable, printable
from s2a.core.outputs import atomic_write
from s2a.language.llm.ask import Answer, Model, Request, is_count

EXACT = re.compile(r"(?<![\w.])-?\d+\.\d{4,}(?![\w.])")
"""Numbers of a pose in the question for a script. A recording has a slot for each, because the same question may come
with another pose: surfaces and search results differ in their last digits."""
NUMBER = re.compile(r"(?<![\w.])-?\d+\.\d+(?![\w.])")
TEXTS = ("step", "prompt", "about", "gist", "model", "answer")
COUNTS = ("prompt_tokens", "completion_tokens")
"""Keys of an entry."""
OTHER = "recorded in this room when its measures were others"


def recorder(model: Model, path: Path) -> Model:
    """Return a model that records its answers in a file and answers recorded questions from it."""
    kept, lock = _load(path) if path.exists() else {}, Lock()

    def answer(request: Request) -> Answer:
        if key(request) in kept:
            return _answer(kept[key(request)], request, "")
        said = model(request)
        about = {"step": request.step, "prompt": _hash(request.system), "about": _about(request), "gist": gist(request)}
        tokens = {"prompt_tokens": said.prompt_tokens, "completion_tokens": said.completion_tokens}
        with lock, atomic_write(path) as room:
            kept[key(request)] = {**about, "model": said.model, **tokens, "answer": _slotted(said.text, request)}
            room.write_text(json.dumps(dict(sorted(kept.items())), indent=1, ensure_ascii=False) + "\n")
        return said

    return answer


def recorded(path: Path) -> Model:
    """Return a model that replays the answers of a recording.

    A question that differs in nothing but the measures of the room has the recorded answer too, which then says so.

    Raises:
        InputError: no such recording; from the model: a question that is not recorded.
    """
    kept = _load(path)
    gists = {entry["gist"]: entry for entry in kept.values()}

    def answer(request: Request) -> Answer:
        if key(request) in kept:
            return _answer(kept[key(request)], request, "")
        if gist(request) in gists:
            return _answer(gists[gist(request)], request, OTHER)
        raise InputError(_missing(request, kept, path))

    return answer


def key(request: Request) -> str:
    """Return the hash of a question; of one for a script, without the numbers of the pose."""
    numbers = count()
    texts = [request.step, request.system, *(f"{role}: {text}" for role, text in request.messages)]
    if request.step == "script":
        texts = [EXACT.sub(lambda _: _slot(next(numbers)), text) for text in texts]
    return _hash("\n\n".join(texts))


def gist(request: Request) -> str:
    """Return the hash of a question without the room's measures: prompt, object, placement hint and the ids of the room."""
    facts = request.facts
    named = [facts.get(name) for name in ("label", "sides", "height", "wish", "id", "tried")]
    if request.step == "review":
        named += [facts.get(name) for name in ("carrier", "relation", "up", "front")]
    ids = sorted(line["id"] for line in facts.get("room", ()))
    return _hash(json.dumps([request.step, request.system, named, ids, len(request.messages)]))


def _answer(entry: dict[str, Any], request: Request, note: str) -> Answer:
    """Return a recorded answer, with the numbers of this question."""
    text = entry["answer"]
    for number, exact in enumerate(_exact(request)):
        text = text.replace(_slot(number), exact)
    return Answer(text, entry["model"], 0.0, entry["prompt_tokens"], entry["completion_tokens"], note)


def _slotted(text: str, request: Request) -> str:
    """Return an answer with a slot for each number of the question's pose, however many zeros the model wrote."""
    slots: dict[float, str] = {}
    for number, exact in enumerate(_exact(request)):
        slots.setdefault(float(exact), _slot(number))
    return NUMBER.sub(lambda found: slots.get(float(found[0]), found[0]), text) if slots else text


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


def _missing(request: Request, kept: dict[str, Any], path: Path) -> str:
    """Return the message for a question that is not recorded."""
    same = [entry for entry in kept.values() if entry["step"] == request.step]
    known = f"{path} has no answer to step {request.step!r} for {_about(request)!r}"
    if same and _hash(request.system) not in {entry["prompt"] for entry in same}:
        return f"{known}: its prompt has changed since the recording; record again with llm=chat record={path}"
    if _about(request) in {entry["about"] for entry in same}:
        return (
            f"{known} in this room: the room or the object has changed since; record again with llm=chat record={path}"
        )
    return f"{known}; record it with llm=chat record={path}"


def _load(path: Path) -> dict[str, Any]:
    """Read a recording."""
    if not path.is_file():
        raise InputError(f"{path}: no such recording; make one with llm=chat record={path}")
    try:
        kept = json.loads(path.read_text(encoding="utf-8"))
        damaged = [name for name, entry in kept.items() if not _whole(entry)]
        if damaged:
            raise ValueError(
                f"entry {damaged[0][:40]!r} lacks one of {', '.join((*TEXTS, *COUNTS))}, or has another type"
            )
    except (ValueError, TypeError, AttributeError, RecursionError) as error:
        raise InputError(
            f"{path}: not a recording, or a damaged one ({printable(str(error)[:200])}); make one with record=FILE"
        ) from error
    return {name: {**entry, "answer": encodable(entry["answer"])} for name, entry in kept.items()}


def _whole(entry: Any) -> bool:
    """Return True for an entry that has all its values."""
    if not isinstance(entry, dict):
        return False
    return all(isinstance(entry.get(key), str) for key in TEXTS) and all(is_count(entry.get(key)) for key in COUNTS)
