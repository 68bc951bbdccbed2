"""The rooms that can be furnished, by name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from s2a.homes.room import Room
from s2a.homes.rooms.bathroom import bathroom
from s2a.homes.rooms.bedroom import bedroom
from s2a.homes.rooms.kitchen import kitchen
from s2a.homes.rooms.living_room import living_room
from s2a.homes.rooms.office import office

ROOMS: dict[str, Callable[[np.random.Generator], Room]] = {
    "office": office,
    "bathroom": bathroom,
    "bedroom": bedroom,
    "kitchen": kitchen,
    "living_room": living_room,
}
