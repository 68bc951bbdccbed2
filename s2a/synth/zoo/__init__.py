"""A hundred labelled household things, twenty in each of five categories, and how they come off the web."""

from functools import cache

from s2a.synth.zoo import bathroom, bedroom, comfort, curios, desk, food, kitchen, living_room, ornaments, stationery
from s2a.synth.zoo.things import Thing

__all__ = ["Thing", "zoo"]

MODULES = (bathroom, food, kitchen, comfort, bedroom, stationery, desk, living_room, ornaments, curios)
"""Where they are made, by category."""


@cache
def zoo() -> tuple[Thing, ...]:
    """Return all things, by category."""
    return tuple(thing for module in MODULES for thing in module.things())
