"""The one articulated part of a room that was prepared for a single one."""

from __future__ import annotations

from s2a.scene.usd.sim_scene import Articulation, Base, SimBody, SimRoom


def part(room: SimRoom) -> Articulation:
    """Return how it moves."""
    (found,) = room.articulations.values()
    return found


def moving(room: SimRoom) -> SimBody:
    """Return its body."""
    return room.bodies[room.part(None)]


def cabinet(room: SimRoom) -> SimBody:
    """Return the body that it moves against."""
    return room.bodies[part(room).parent]


def base(room: SimRoom) -> Base:
    """Return where the robot stands."""
    return part(room).bases["panda"]
