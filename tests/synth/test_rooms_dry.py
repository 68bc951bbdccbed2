"""Bedroom and living room: furnished as asked, and everything that opens opens into free space."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from solid_sweep import SHELL, Solid, clashes, moved, overlaps, parts, whole

from s2a.homes.catalog import cad, catalog, moves
from s2a.homes.room import Room
from s2a.homes.rooms import ROOMS
from s2a.homes.solids import Piece
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh

EVERY = [(name, seed) for name in ("bedroom", "living_room") for seed in range(3)]
CLASH = 0.003
"""How deep a moving front may be in something [m]: as much as a hinge's play and a front that hangs askew."""
PRESSED = 0.005
"""How deep things may be in each other [m]: pillows and clothes give way."""


@cache
def furnished(name: str, seed: int) -> Room:
    """Furnish a room."""
    return ROOMS[name](np.random.default_rng(seed))


def movables(piece: Piece) -> list[Piece]:
    """Return the parts of a piece that have a joint."""
    return [part for part in parts(piece) if part.joint is not None]


every_room = pytest.mark.parametrize(("name", "seed"), EVERY)


@every_room
def test_a_room_has_many_objects_and_every_kind_of_handle(name: str, seed: int) -> None:
    pieces = furnished(name, seed).pieces
    moving = [part for piece in pieces for part in movables(piece)]
    everything = [part for piece in pieces for part in parts(piece)]
    assert sum(piece.name not in {*SHELL, "book"} for piece in pieces) >= 25
    assert len(moving) >= 6
    assert {"drawer", "door", "lid", "window"} <= {part.name for part in moving}
    assert {"bar", "knob", "cup", "edge", "lever"} <= {part.style for part in everything if part.style}
    tall = [np.ptp(part.surface.vertices[:, 2]) > 0.1 for part in everything if part.style == "bar"]
    assert any(tall) and not all(tall), "upright and level bars"
    hinges = {np.sign(part.joint.axis[2]) for part in moving if part.name == "door"}
    assert hinges == {1.0, -1.0}, "doors that open to the left and to the right"
    assert [moves(piece) for piece in pieces] == sorted((moves(piece) for piece in pieces), reverse=True)


@every_room
def test_things_stand_beside_each_other_not_in_each_other(name: str, seed: int) -> None:
    # A blanket hangs around what it covers.
    assert [line for line in overlaps(furnished(name, seed), PRESSED) if "blanket" not in line] == []


@every_room
def test_whatever_opens_moves_through_free_space(name: str, seed: int) -> None:
    assert clashes(furnished(name, seed), CLASH) == []


@every_room
def test_whoever_opens_furniture_has_room_to_stand(name: str, seed: int) -> None:
    clouds = [(piece, Solid(whole(piece), 0.03).points) for piece in furnished(name, seed).pieces]
    crowded = []
    for piece, _ in clouds:
        if not moves(piece) or piece.name in ("door frame", "window frame"):
            continue
        into_frame = np.linalg.inv(piece.pose)
        fronts = moved(np.concatenate([part.surface.vertices for part in movables(piece)]), into_frame)
        low, high = fronts.min(axis=0), fronts.max(axis=0)
        free = np.array([(high[0] + 0.06, low[1] + 0.01, 0.06), (high[0] + 1.19, high[1] - 0.01, 1.59)])
        for other, points in clouds:
            there = moved(points, into_frame)
            if other is not piece and ((there > free[0]) & (there < free[1])).all(axis=1).any():
                crowded.append((piece.name, other.name))
    assert crowded == []


@every_room
def test_scanners_stand_in_free_air_and_see_every_handle(name: str, seed: int) -> None:
    room = furnished(name, seed)
    surface, owners = cad(entries := catalog(room.pieces))
    mesh = ray_mesh(surface.vertices, surface.faces)
    assert len(room.scanners) == 6
    assert (room.scanners > 0).all() and (room.scanners < room.size).all()
    assert nearest_faces(mesh, room.scanners)[1].min() > 0.2, "no scanner stands in or against something"
    unseen = {}
    for entry in entries:
        if entry.piece.style is not None:
            points = surface.vertices[np.unique(surface.faces[owners == entry.number])]
            rays = points[None] - room.scanners[:5, None]
            far = np.linalg.norm(rays, axis=2)
            starts = np.broadcast_to(room.scanners[:5, None], rays.shape)
            hits = first_hits(mesh, starts.reshape(-1, 3), (rays / far[..., None]).reshape(-1, 3)).reshape(far.shape)
            below = np.arcsin(-rays[..., 2] / far) < 1.05
            seen = ((hits > far - 0.004) & below).mean(axis=1)
            if np.sort(seen)[-2:].min() < 0.1:
                unseen[entry.label, entry.parent] = seen.round(2).tolist()
    assert unseen == {}
