"""The five classic rooms: published figures are of these very solids."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from s2a.homes.catalog import cad, catalog
from s2a.homes.rooms import ROOMS

EARLIER = {
    "office": "73dea7475ede42c7",
    "bathroom": "0507d7fc2ec53c20",
    "bedroom": "57a37f409791ecd4",
    "kitchen": "72c0d588d0d7c6e0",
    "living_room": "bcc2bec5d8e28cc6",
}
"""First 16 hexadecimal digits of the SHA-256 of the solids and scanner positions of seed 0, to the micrometre."""


@pytest.mark.parametrize("name", ROOMS)
def test_a_classic_room_has_the_same_solids(name: str) -> None:
    room = ROOMS[name](np.random.default_rng(0).spawn(5)[0])
    surface, owners = cad(catalog(room.pieces))
    digest = hashlib.sha256()
    for array in (surface.vertices, surface.faces, surface.colors, surface.textures, surface.dropout, owners):
        digest.update(_rounded(array))
    digest.update(_rounded(room.scanners) + _rounded(np.array(room.size)))
    assert digest.hexdigest()[:16] == EARLIER[name]


def _rounded(array: np.ndarray) -> bytes:
    """Return the bytes of an array to six decimals: the last digits of a sine depend on the processor."""
    exact = array.dtype.kind in "iub"
    return np.ascontiguousarray(array if exact else np.round(array, 6) + 0.0).tobytes()
