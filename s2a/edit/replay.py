"""Recordings: a model's answers by the question, so that a second run needs no model and has the same result."""

from __future__ import annotations

import hashlib
import json
import re
from pathlib import Path
from typing import Any

from s2a.edit.ask import Answer, Model, Request
from s2a.errors import InputError
from s2a.outputs import aside

EXACT = re.compile(r"(?<![\w.])-?\d+\.\d{4,}(?:[eE][-+]?\d+)?(?![\w.])")
"""Numbers with more decimals than a description has: a pose. In a recording a slot stands for each, because the same question
may be asked of a pose that differs in the last digit."""


def recorder(model: Model, path: Path) -> Model:
    """Return a model whose answers are kept in a file, beside those that are there already."""
    kept = _load(path) if path.exists() else {}

    def answer(request: Request) -> Answer:
        said = model(request)
        text = said.text
        for number, exact in enumerate(_exact(request)):
            text = re.sub(rf"(?<![\w.]){re.escape(exact)}(?![\w.])", _slot(number), text)
        tokens = {"prompt_tokens": said.prompt_tokens, "completion_tokens": said.completion_tokens}
        about = {"step": request.step, "prompt": _hash(request.system), "about": _about(request), "model": said.model}
        kept[key(request)] = {**about, **tokens, "answer": text}
        with aside(path) as room:
            room.write_text(json.dumps(dict(sorted(kept.items())), indent=1, ensure_ascii=False) + "\n")
        return said

    return answer


def recorded(path: Path) -> Model:
    """Return a model that gives the answers of a recording.

    Raises:
        InputError: no such recording; from the model: a question that it does not have.
    """
    kept = _load(path)

    def answer(request: Request) -> Answer:
        found = kept.get(key(request))
        if found is None:
            raise InputError(_missing(request, kept, path))
        text = found["answer"]
        for number, exact in enumerate(_exact(request)):
            text = text.replace(_slot(number), exact)
        return Answer(text, found["model"], 0.0, found["prompt_tokens"], found["completion_tokens"])

    return answer


def key(request: Request) -> str:
    """Return the hash of a question, exact numbers left out."""
    texts = [request.step, request.system, *(f"{role}: {text}" for role, text in request.messages)]
    for number, exact in enumerate(_exact(request)):
        texts = [re.sub(rf"(?<![\w.]){re.escape(exact)}(?![\w.])", _slot(number), text) for text in texts]
    return _hash("\n\n".join(texts))


def _exact(request: Request) -> list[str]:
    """Return the exact numbers of a question, each once, in order."""
    found = [number for _, text in request.messages for number in EXACT.findall(text)]
    return list(dict.fromkeys(found))


def _slot(number: int) -> str:
    return f"\N{LEFT-POINTING DOUBLE ANGLE QUOTATION MARK}{number}\N{RIGHT-POINTING DOUBLE ANGLE QUOTATION MARK}"


def _hash(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def _about(request: Request) -> str:
    """Return what a question is about, for people who read a recording."""
    tries = len(request.messages) // 2
    return f"{request.facts.get('label', '')}{f', try {tries + 1}' if tries else ''}"


def _missing(request: Request, kept: dict[str, Any], path: Path) -> str:
    """Return why a recording has no answer."""
    same = [entry for entry in kept.values() if entry["step"] == request.step]
    known = f"{path} has no answer to step {request.step!r} for {_about(request)!r}"
    if same and _hash(request.system) not in {entry["prompt"] for entry in same}:
        return f"{known}: its prompt has changed since the recording; record anew with llm=chat record={path}"
    if _about(request) in {entry["about"] for entry in same}:
        return (
            f"{known} in this room: the room or the object has changed since; record anew with llm=chat record={path}"
        )
    return f"{known}; record it with llm=chat record={path}"


def _load(path: Path) -> dict[str, Any]:
    """Read a recording."""
    if not path.is_file():
        raise InputError(f"{path}: no such recording; make one with llm=chat record={path}")
    try:
        kept = json.loads(path.read_text())
        for entry in kept.values():
            entry["step"], entry["prompt"], entry["about"], entry["model"], entry["answer"]
            entry["prompt_tokens"], entry["completion_tokens"]
    except (ValueError, TypeError, KeyError, AttributeError) as error:
        raise InputError(f"{path}: not a recording, or a damaged one ({error}); make one with record=FILE") from error
    return kept
