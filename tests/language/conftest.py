"""The hand-made room with a drawer and two cubes, in which sentences and goals are planned."""

from __future__ import annotations

import pytest
from drawer_room import drawer_room
from settings import skills

from s2a.language.do.run import RoomContext
from s2a.scene.usd.sim_scene import SimRoom


@pytest.fixture(scope="module")
def room(tmp_path_factory: pytest.TempPathFactory) -> SimRoom:
    return drawer_room(tmp_path_factory.mktemp("room") / "sim.usda")


@pytest.fixture(scope="module")
def context(room: SimRoom) -> RoomContext:
    return RoomContext(room, None, "panda", 0.3, skills())
