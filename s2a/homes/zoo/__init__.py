"""A hundred labelled household objects, twenty in each of five categories, and the untidy files in which they come."""

from functools import cache

from s2a.homes.zoo import bathroom, bedroom, desk, kitchen, living_room
from s2a.homes.zoo.shapes import ZooObject

__all__ = ["ZooObject", "zoo"]

MODULES = (bathroom, kitchen, bedroom, desk, living_room)
"""Where they are made, by category."""


@cache
def zoo() -> tuple[ZooObject, ...]:
    """Return all objects, by category."""
    return tuple(item for module in MODULES for item in module.objects())
