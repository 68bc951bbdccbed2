"""Records of the steps of an insertion, and the log of tokens, seconds and dollars."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from s2a.core.errors import InputError

if TYPE_CHECKING:
    from s2a.language.llm.ask import Answer

Record = dict[str, Any]
"""Results of an insertion by step: plain values for JSON."""
MOST_TOKENS = 10**9
PER_TOKEN = 3.5
"""Characters per token: between 3 and 4 for the JSON of a room with the tokenizers of 2024 and 2025."""


@dataclass
class UsageLog:
    """Log of a model's answers with their tokens and prices.

    Attributes:
        prices: US dollars for a million tokens of the request and of the answer; zeros where it is free.
        entries: one per answer.
    """

    prices: tuple[float, float]
    entries: list[dict[str, Any]] = field(default_factory=list)

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
        notes = {"note": answer.note, "refused": refused}
        self.entries.append(entry | {name: said for name, said in notes.items() if said})

    def total(self) -> dict[str, Any]:
        """Return the number of calls, the tokens, seconds and US dollars of all answers."""
        asked, said = (sum(entry[key] for entry in self.entries) for key in ("prompt_tokens", "completion_tokens"))
        return {
            "calls": len(self.entries),
            "prompt_tokens": asked,
            "completion_tokens": said,
            "seconds": round(sum(entry["seconds"] for entry in self.entries), 3),
            "dollars": round((asked * self.prices[0] + said * self.prices[1]) / 1e6, 6),
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
    said: Record = record.setdefault(name, {})
    start = time.perf_counter()
    try:
        yield said
    except InputError as error:
        said["problem"] = str(error)
        raise
    finally:
        said["seconds"] = round(said.get("seconds", 0.0) + time.perf_counter() - start, 3)
