"""The five classic rooms: published figures are of these very solids."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from s2a.synth.catalog import cad, catalog
from s2a.synth.rooms import ROOMS

EARLIER = {
    "office": "6910cf4e146297c0",
    "bathroom": "2112b3ceeb4a2b01",
    "bedroom": "55d8c868ca57faa9",
    "kitchen": "6ef77e0991594983",
    "living_room": "c665b3443498d1bd",
}
"""First 16 hexadecimal digits of the SHA-256 of the solids and scanner positions of seed 0, before the builders shared code."""


@pytest.mark.parametrize("name", ROOMS)
def test_a_classic_room_has_the_same_solids(name: str) -> None:
    room = ROOMS[name](np.random.default_rng(0).spawn(5)[0])
    surface, owners = cad(catalog(room.pieces))
    digest = hashlib.sha256()
    for array in (surface.vertices, surface.faces, surface.colors, surface.textures, surface.dropout, owners):
        digest.update(np.ascontiguousarray(array).tobytes())
    digest.update(room.scanners.tobytes() + np.array(room.size).tobytes())
    assert digest.hexdigest()[:16] == EARLIER[name]
