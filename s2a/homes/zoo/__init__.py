"""A hundred labelled household objects, twenty in each of five categories, and how they come off the web."""

from functools import cache

from s2a.homes.zoo import bathroom, bedroom, comfort, curios, desk, food, kitchen, living_room, ornaments, stationery
from s2a.homes.zoo.zoo_object import ZooObject

__all__ = ["ZooObject", "zoo"]

MODULES = (bathroom, food, kitchen, comfort, bedroom, stationery, desk, living_room, ornaments, curios)
"""Where they are made, by category."""


@cache
def zoo() -> tuple[ZooObject, ...]:
    """Return all objects, by category."""
    return tuple(item for module in MODULES for item in module.objects())
