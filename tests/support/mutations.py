"""Texts and JSON values with something odd put in at random."""

from __future__ import annotations

import copy
import json
import random
from typing import Any

ODD: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 1, 5, 10**400, -(10**400), 1e308, -0.0, float("nan"), float("inf"), -float("inf")),
    *("", "x", "\0", "\ud800", "\x1b[2J\x07", "\n\n", "9" * 5000, "é" * 300, "NaN", "{", "```", "__class__"),
    *([], {}, [[]], [None], {"": None}, [1, "a", None], {"a": {"b": []}}, [[[[[[[[1]]]]]]]], [0] * 1000, "x" * 100_000),
)
"""Values that nobody expects."""


def mutated_value(value: Any, dice: random.Random) -> Any:
    """Return a JSON value in which one to three items are replaced, removed or added."""
    value = copy.deepcopy(value)
    for _ in range(dice.randint(1, 3)):
        value = _replaced(value, dice)
    return value


def _replaced(value: Any, dice: random.Random) -> Any:
    if not isinstance(value, (dict, list)) or not value or dice.random() < 0.15:
        return copy.deepcopy(dice.choice(ODD))
    key = dice.choice(list(value)) if isinstance(value, dict) else dice.randrange(len(value))
    deed = dice.random()
    if deed < 0.15:
        del value[key]
    elif deed < 0.25 and isinstance(value, list):
        value.insert(key, copy.deepcopy(dice.choice(ODD)))
    elif deed < 0.25 and isinstance(value, dict):
        value[dice.choice(("", "x", "0", "\ud800"))] = copy.deepcopy(dice.choice(ODD))
    else:
        value[key] = _replaced(value[key], dice)
    return value


def mutated_bytes(text: bytes, snippets: tuple[bytes, ...], dice: random.Random) -> bytes:
    """Return a text with one to four pieces changed: bytes flipped, pieces cut, doubled, moved or replaced by snippets."""
    for _ in range(dice.randint(1, 4)):
        start = dice.randrange(len(text) + 1)
        end = min(len(text), start + int(dice.expovariate(0.1)) + 1)
        piece = text[start:end]
        place = dice.randrange(len(text) + 1)
        deed = dice.randrange(6)
        if deed == 0:
            text = text[:start] + bytes([dice.randrange(256)]) + text[start + 1 :]
        elif deed == 1:
            text = text[:start] + text[end:]
        elif deed == 2:
            text = text[:place] + piece + text[place:]
        elif deed == 3:
            text = text[:place] + dice.choice(snippets) + text[place:]
        else:
            old = dice.choice(snippets)  # by kind: a word of the text for another
            text = text.replace(old, dice.choice(snippets), dice.randint(1, 2)) if old in text else text
    return text


def mutated_json(value: Any, snippets: tuple[bytes, ...], dice: random.Random) -> bytes:
    """Return JSON with odd values, and in one of four cases odd bytes."""
    text = json.dumps(mutated_value(value, dice)).encode()
    return mutated_bytes(text, snippets, dice) if dice.random() < 0.25 else text
