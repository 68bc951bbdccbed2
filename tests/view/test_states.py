"""What worlds did comes back from its file, and becomes what a page plays."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import free_cube, write_cabinet

from s2a import robot
from s2a.core.errors import InputError
from s2a.scene.usd import sim_stage
from s2a.scene.usd.stamp import layer_hash
from s2a.view import states
from s2a.view import states as played
from s2a.view.states import States

START = np.array(robot.load("panda").start)
BASE = np.array([0.9, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0])
LENGTHS = (3, 5)


@pytest.fixture
def stage(tmp_path: Path) -> Path:
    return write_cabinet(tmp_path / "sim.usd", free=[free_cube("cube_9", (0.0, 0.0, 0.852), 0.1, 0.2)])


@pytest.fixture
def seen(stage: Path) -> States:
    """Return two worlds of other lengths: the drawer opens by 0.1 m a frame, the cube rises by as much."""
    steps = [0.1 * np.arange(length) for length in LENGTHS]
    cubes = [np.array([[0.0, 0.0, 0.852 + up, 0.0, 0.0, 0.0, 1.0] for up in each]) for each in steps]
    joints = [np.tile(START, (length, 1)) for length in LENGTHS]
    names = ["world 0", "world 1"]
    return States(60.0, "panda", BASE, layer_hash(stage), names, joints, {"drawer_2": steps}, {"cube_9": cubes})


def test_states_come_back_from_their_file(seen: States, stage: Path, tmp_path: Path) -> None:
    states.write(seen, tmp_path / "states.npz")
    back = played.read_played(tmp_path / "states.npz", stage, 0, 4)
    assert back.names == seen.names and back.rate == 60.0
    for k, length in enumerate(LENGTHS):
        assert back.joints[k].shape == (length, 9)
        np.testing.assert_array_equal(back.parts["drawer_2"][k], seen.parts["drawer_2"][k])
        np.testing.assert_array_equal(back.objects["cube_9"][k], seen.objects["cube_9"][k])
    assert played.read_played(tmp_path / "states.npz", stage, 1, 4).names == ["world 1"]


def test_another_room_or_world_or_file_is_one_line(seen: States, stage: Path, tmp_path: Path) -> None:
    states.write(replace(seen, sha256="other"), tmp_path / "states.npz")
    with pytest.raises(InputError, match="not the room"):
        played.read_played(tmp_path / "states.npz", stage, 0, 4)
    with pytest.raises(InputError, match="2 worlds; there is none with index 2"):
        played.read_played(tmp_path / "states.npz", stage, 2, 4)
    (tmp_path / "other.npz").write_bytes(b"no archive")
    with pytest.raises(InputError, match="no file of s2a evaluate"):
        states.read(tmp_path / "other.npz")


@pytest.mark.slow
def test_the_robot_stands_at_its_base_and_the_cube_rises(seen: States, stage: Path) -> None:
    found = played.of_states(seen, sim_stage.read(stage, visuals=False))
    one, other = found.worlds
    assert (one.frames, other.frames, found.frames) == (*LENGTHS, 5) and len(found.links) == one.links.shape[1]
    np.testing.assert_allclose(one.links[0, 0], BASE, atol=1e-6)  # its root link
    np.testing.assert_allclose(other.moved["cube_9"][4, :3, 3], (0.0, 0.0, 0.4), atol=1e-9)
    np.testing.assert_allclose(other.moved["cube_9"][0], np.eye(4), atol=1e-9)
    assert all(2 < len(mesh.faces) < 20_000 for mesh in found.links)
