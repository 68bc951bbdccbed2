"""Bounds of numbers and lists in the configuration, as annotations of a field's type."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, is_dataclass
from types import UnionType
from typing import Annotated, Any, Union, get_args, get_origin, get_type_hints

from s2a.core.errors import InputError


@dataclass(frozen=True)
class Above:
    """A number above `low`, up to `high`; infinity is allowed, NaN is not."""

    low: float
    high: float = math.inf

    def holds(self, value: float) -> bool:
        """Return True for a value within the bounds."""
        return self.low < value <= self.high

    def __str__(self) -> str:
        return f"a number above {self.low:g}" + (f", up to {self.high:g}" if self.high < math.inf else "")


@dataclass(frozen=True)
class AtLeast:
    """A number from `low` to `high`, both possible."""

    low: float
    high: float = math.inf

    def holds(self, value: float) -> bool:
        """Return True for a value within the bounds."""
        return self.low <= value <= self.high

    def __str__(self) -> str:
        return f"a number from {self.low:g} to {self.high:g}" if self.high < math.inf else f"{self.low:g} or more"


@dataclass(frozen=True)
class NotEmpty:
    """A list with at least one item."""

    def holds(self, value: tuple[Any, ...]) -> bool:
        """Return True for a value within the bounds."""
        return len(value) > 0

    def __str__(self) -> str:
        return "a list of one or more, [a,b]"


BOUNDS = (Above, AtLeast, NotEmpty)  # The annotations that `check` evaluates; it ignores all others
Positive = Annotated[float, Above(0.0)]  # For example a divisor, a duration, a density
NotNegative = Annotated[float, AtLeast(0.0)]  # For example a tolerance, an error magnitude, a gain
Fraction = Annotated[float, AtLeast(0.0, 1.0)]  # A fraction of a whole, 0 to 1
Count = Annotated[int, AtLeast(1)]  # A number of items, at least one
CountFromZero = Annotated[int, AtLeast(0)]  # A number of items, possibly none; a seed
Numbers = Annotated[tuple[float, ...], NotEmpty()]  # A list of at least one number


def check(kind: Any, value: Any, key: str = "") -> None:
    """Check a value against the bounds of its type, and those of the types inside it.

    `kind`: the type, such as a dataclass of settings or the type of one of its fields.

    Raises:
        InputError: naming the key, the value and the bounds.
    """
    kind = _given(kind, value)
    if get_origin(kind) is Annotated:
        kind, *bounds = get_args(kind)
        for bound in bounds:
            if isinstance(bound, BOUNDS) and not bound.holds(value):
                given = list(value) if isinstance(value, tuple) else value
                raise InputError(f"key {key!r} is {given}; give {bound}")
    for inner, part, name in _inside(kind, value):
        check(inner, part, f"{key}.{name}" if key else name)


def _given(kind: Any, value: Any) -> Any:
    """Return the type that a value has of `type | None`; other types as they are."""
    others = [other for other in get_args(kind) if other is not type(None)]
    optional = get_origin(kind) in (Union, UnionType) and len(others) == 1
    return others[0] if optional and value is not None else kind


def _inside(kind: Any, value: Any) -> list[tuple[Any, Any, str]]:
    """List the type, the value and the name of what a value is made of: fields, or entries."""
    if isinstance(kind, type) and is_dataclass(kind):
        hints = get_type_hints(kind, include_extras=True)
        return [(inner, getattr(value, name), name) for name, inner in hints.items()]
    kinds = get_args(kind)
    if isinstance(value, Mapping):
        return [(kinds[1], part, name) for name, part in value.items()]
    if isinstance(value, tuple) and get_origin(kind) is tuple:
        each = kinds[:1] * len(value) if kinds[-1] is Ellipsis else kinds
        return [(inner, part, str(i)) for i, (inner, part) in enumerate(zip(each, value, strict=True))]
    return []
