"""Typed access to annotation JSON: a wrong value becomes one line that names its place and the expected value."""

from __future__ import annotations

import json
import reprlib
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from s2a.core.errors import InputError


@dataclass(frozen=True)
class Record:
    """One JSON object of an annotation file."""

    values: dict[str, Any]  # its keys and values, unchecked
    where: str  # the file and the place in it, for messages ("/scans/0a5c_parts.json, part 7 'handle.1.2'")

    def has(self, key: str) -> bool:
        """Return True if a key is present with a value other than null."""
        return self.values.get(key) is not None

    def integer(self, key: str) -> int:
        """Return a whole number that is not negative."""
        value = self._get(key)
        if isinstance(value, bool) or not isinstance(value, int) or value < 0:
            self.refuse(key, "expected a whole number from 0")
        return value

    def number(self, key: str) -> float:
        """Return a finite number."""
        value = self._get(key)
        if not _is_finite(value):
            self.refuse(key, "expected a finite number")
        return float(value)

    def vector(self, key: str) -> np.ndarray:
        """Return three finite numbers, shape [3], float64."""
        value = self._get(key)
        if not isinstance(value, list) or len(value) != 3 or not all(map(_is_finite, value)):
            self.refuse(key, "expected a list of three finite numbers")
        return np.array(value, dtype=np.float64)

    def text(self, key: str) -> str:
        """Return a string."""
        value = self._get(key)
        if not isinstance(value, str):
            self.refuse(key, "expected a string")
        return value

    def integers(self, key: str) -> np.ndarray:
        """Return a list of whole numbers, shape [n], int64."""
        value = self._get(key)
        try:
            array = np.asarray(value)
        except ValueError:  # lists of different lengths inside the list
            array = np.empty((0, 0))
        if not isinstance(value, list) or (value and (array.ndim != 1 or array.dtype.kind not in "iu")):
            self.refuse(key, "expected a list of whole numbers")
        return array.astype(np.int64)

    def indices(self, key: str, count: int, elements: str) -> np.ndarray:
        """Return a list of indices from 0 to count - 1 into the elements (faces, vertices) of the mesh, shape [n], int64."""
        indices = self.integers(key)
        if len(indices) and not 0 <= indices.min() <= indices.max() < count:
            wrong = indices[(indices < 0) | (indices >= count)]
            raise InputError(
                f"{self.where}: {key} holds {wrong[0]}, but the mesh has {count} {elements} (0 to {count - 1}); "
                "take the mesh that was annotated"
            )
        return indices

    def record(self, key: str) -> Record:
        """Return a JSON object."""
        value = self._get(key)
        if not isinstance(value, dict):
            self.refuse(key, "expected an object {...}")
        return Record(value, f"{self.where}, {key}")

    def records(self, key: str, noun: str) -> list[Record]:
        """Return a list of JSON objects, each called by a noun and its position in messages."""
        value = self._get(key)
        if not isinstance(value, list) or not all(isinstance(item, dict) for item in value):
            self.refuse(key, "expected a list of objects [{...}, ...]")
        return [Record(item, f"{self.where}, {noun} {i}") for i, item in enumerate(value)]

    def refuse(self, key: str, remedy: str) -> NoReturn:
        """Raise an InputError that names the file, the place, the key and its value."""
        raise InputError(f"{self.where}: {key} is {reprlib.repr(self.values.get(key))}; {remedy}")

    def _get(self, key: str) -> Any:
        """Return a value, or raise an InputError that says which keys there are."""
        if not self.has(key):
            keys = ", ".join(map(repr, sorted(self.values)[:8])) or "none"
            raise InputError(f"{self.where}: key {key!r} is missing; keys found: {keys}")
        return self.values[key]


def load(path: Path) -> Record:
    """Read a JSON file, UTF-8 or UTF-16 with or without a byte order mark, whose top level is an object.

    Raises:
        InputError: the file cannot be read, is no JSON (truncated, say), has a key twice, or holds something else.
    """
    try:
        content = json.loads(path.read_bytes(), object_pairs_hook=_once)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror}); check the path and its permissions") from error
    except (ValueError, RecursionError) as error:  # of the decoder or the parser
        raise InputError(f"{path}: truncated or not JSON ({error}); copy or download it again") from error
    if not isinstance(content, dict):
        raise InputError(f"{path}: holds a {type(content).__name__}; expected an object {{...}}")
    return Record(content, str(path))


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return a JSON object; a ValueError for one that has a key twice, of which readers would take any."""
    record = dict(pairs)
    if len(record) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(f"an object has the key {twice!r} twice")
    return record


def _is_finite(value: object) -> bool:
    # Compared rather than asked with math.isfinite, which fails on JSON's arbitrarily large integers.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
