"""A hundred labelled household things, twenty in each of five categories, and how they come off the web."""

from s2a.scan.virtual.zoo import bathroom, bedroom, kitchen, living_room, stationery
from s2a.scan.virtual.zoo.things import Thing

__all__ = ["Thing", "zoo"]


def zoo() -> list[Thing]:
    """Return all things, by category."""
    return [
        *bathroom.things(),
        *kitchen.things(),
        *bedroom.things(),
        *stationery.things(),
        *living_room.things(),
    ]
