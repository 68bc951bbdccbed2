"""The box behind a scanned drawer front."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from scanned_drawers import scanned_drawer
from settings import load

from s2a.geometry.surfaces import merge
from s2a.prepare import PrepareConfig, prepare
from s2a.prepare.interior import drawer_box
from s2a.scene import Joint


def test_the_box_is_as_deep_as_the_drawer_opens_and_open_at_the_top() -> None:
    bottom, back, *sides = drawer_box(scanned_drawer(), "drawer_7")
    low, high = merge([bottom, back, *sides]).bounds
    # The front lies at x = 0 and is 0.7588 m wide; the joint's range is 0.4 m.
    assert high[0] - low[0] == pytest.approx(0.4, abs=0.005)
    assert high[0] == pytest.approx(-0.02, abs=0.006)
    assert high[1] - low[1] == pytest.approx(0.7588 - 0.03, abs=0.01)
    assert bottom.bounds[1, 2] < sides[0].bounds[1, 2] - 0.05
    assert back.bounds[1, 0] < low[0] + 0.01


def test_the_box_ends_inside_the_carcass() -> None:
    room = clean_cabinet_room()
    drawer = room.parts["drawer_7"]
    far = Joint("prismatic", (1.0, 0.0, 0.0), drawer.motion.origin, (0.0, 2.0))
    scene = replace(room, parts={**room.parts, "drawer_7": replace(drawer, motion=far)})
    for piece in drawer_box(scene, "drawer_7"):
        assert piece.bounds[0, 0] > room.parts["cabinet_3"].mesh.bounds[0, 0]


def test_a_door_gets_none() -> None:
    assert drawer_box(clean_cabinet_room(), "door_5") == []


def test_it_is_added_to_looks_and_colliders_on_request_and_told() -> None:
    settings = load(PrepareConfig, "prepare/handle")
    settings = replace(settings, base=replace(settings.base, search=False))
    without, with_box = (
        prepare(scanned_drawer(), "drawer_7", replace(settings, interior=chosen)) for chosen in (False, True)
    )
    assert len(with_box.target.colliders) == len(without.target.colliders) + 4
    assert np.ptp(with_box.target.visual.bounds[:, 0]) > np.ptp(without.target.visual.bounds[:, 0]) + 0.2
    assert any("box" in note for note in with_box.notes)
    assert not any("box" in note for note in without.notes)
