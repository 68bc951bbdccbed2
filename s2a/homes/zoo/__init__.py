"""A hundred labelled household objects, twenty in each of five categories, and the untidy files in which they come."""

from functools import cache
from typing import get_args

from s2a.homes.zoo import bathroom, bedroom, desk, kitchen, living_room  # noqa: F401 # each adds its objects
from s2a.homes.zoo.shapes import MAKERS, Category, ZooObject

__all__ = ["ZooObject", "zoo"]


@cache
def zoo() -> tuple[ZooObject, ...]:
    """Return all objects, by category."""
    return tuple(sorted((make() for make in MAKERS), key=lambda item: get_args(Category).index(item.category)))
