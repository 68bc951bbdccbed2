"""Kitchen and bathroom: furnished as asked, nothing in anything else, and all that opens opens into free space."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from solid_sweep import SHELL, Solid, clashes, overlaps, parts, whole

from s2a.homes.catalog import cad, catalog, clean_scene
from s2a.homes.room import Room
from s2a.homes.rooms import ROOMS
from s2a.homes.solids import Piece, at, box
from s2a.scene.geometry.mesh_query import first_hits, nearest_faces, ray_mesh
from s2a.scene.scene import Joint

TOUCH = 0.0015
"""How deep solids may be in each other [m]: faces that lie on each other, and sampling."""
every_room = pytest.mark.parametrize(
    ("name", "seed"), [(name, seed) for name in ("kitchen", "bathroom") for seed in range(3)]
)


@cache
def furnished(name: str, seed: int) -> Room:
    """Furnish a room; its own frame: x along the main row, which stands before y = depth."""
    return ROOMS[name](np.random.default_rng(seed))


def everything(room: Room) -> list[Piece]:
    """Return all parts of a room."""
    return [part for piece in room.pieces for part in parts(piece)]


def fronts(room: Room, *names: str) -> list[tuple[Piece, Joint]]:
    """Return the parts that move, or those of the given names, each with its joint."""
    return [(p, p.joint) for p in everything(room) if p.joint is not None and (not names or p.name in names)]


def named(room: Room, name: str) -> Piece:
    """Return the first part of a name."""
    return next(part for part in everything(room) if part.name == name)


def extent(piece: Piece) -> np.ndarray:
    """Return smallest and largest corner of a piece with all its parts, shape [2 3]."""
    return Solid(whole(piece), 1.0).bounds


@every_room
def test_there_are_many_objects_and_every_style_of_handle(name: str, seed: int) -> None:
    room = furnished(name, seed)
    assert sum(piece.name not in SHELL for piece in room.pieces) >= 25
    assert len(fronts(room)) >= 6
    assert {part.style for part in everything(room)} >= {"bar", "knob", "cup", "edge"}
    level = {bool(abs(bar.pose[2, 1]) < 0.1) for bar in everything(room) if bar.style == "bar"}
    assert level == {True, False}, "bars lie and stand"


@every_room
def test_fronts_slide_turn_left_turn_right_and_turn_up(name: str, seed: int) -> None:
    joints = [joint for _, joint in fronts(furnished(name, seed))]
    assert {round(j.axis[2]) for j in joints if j.kind == "revolute"} == {-1, 0, 1}
    travels = [joint.limits[1] for _, joint in fronts(furnished(name, seed), "drawer")]
    assert travels and 0.3 <= min(travels) <= max(travels) <= 0.45


@every_room
def test_nothing_is_in_anything_else(name: str, seed: int) -> None:
    assert overlaps(furnished(name, seed), TOUCH) == []


@every_room
def test_all_that_opens_opens_into_free_space(name: str, seed: int) -> None:
    assert clashes(furnished(name, seed), TOUCH) == []


def test_a_box_before_the_oven_is_in_its_doors_way() -> None:
    kitchen = furnished("kitchen", 0)
    place = named(kitchen, "oven door").pose @ at(0.35, 0)
    crate = Piece("crate", box((-0.1, 0.1), (-0.1, 0.1), (-0.2, 0.0), (90, 90, 90)).moved(place))
    lines = clashes(Room((*kitchen.pieces, crate), kitchen.scanners, kitchen.size), TOUCH)
    assert len(lines) == 1
    assert lines[0].startswith("oven door") and "enters crate" in lines[0]


@every_room
def test_closed_fronts_are_two_millimetres_apart_or_more(name: str, seed: int) -> None:
    solids = [Solid(whole(front), 0.03) for front, _ in fronts(furnished(name, seed))]
    for i, one in enumerate(solids):
        mesh = ray_mesh(one.surface.vertices, one.surface.faces)
        for other in solids[:i] + solids[i + 1 :]:
            if ((one.bounds[0] < other.bounds[1] + 0.01) & (other.bounds[0] < one.bounds[1] + 0.01)).all():
                assert nearest_faces(mesh, other.points)[1].min() > 0.0018


@every_room
def test_a_robot_has_room_before_every_front(name: str, seed: int) -> None:
    """1.2 m before cabinets and large appliances nothing stands higher than a mat."""
    room = furnished(name, seed)
    clouds = [Solid(whole(piece), 0.05).points for piece in room.pieces if piece.name not in SHELL]
    points = np.concatenate(clouds)
    owners = ("drawer", "door", "oven door", "dishwasher door", "refrigerator door", "washing machine door")
    for front, _ in fronts(room, *owners):
        x, y, _ = ((points - front.pose[:3, 3]) @ front.pose[:3, :3]).T
        before = (x > 0.075) & (x < 1.2) & (np.abs(y) < front.size[1] / 2 - 0.01)
        low = (points[:, 2] > 0.1) & (points[:, 2] < 2.0)
        if front.pose[2, 3] < 1.3 and not _leads_out(front, room):
            assert not (before & low).any(), front.name


def _leads_out(front: Piece, room: Room) -> bool:
    """Whether a front is the room's door."""
    return any(front is child for piece in room.pieces if piece.name == "door frame" for child in piece.children)


@every_room
def test_the_sink_is_an_open_bowl_below_the_counter_with_a_rim_above_it(name: str, seed: int) -> None:
    room = furnished(name, seed)
    surface, _ = cad(catalog(room.pieces))
    top = extent(named(room, f"{'kitchen' if name == 'kitchen' else 'bathroom'} counter"))[1, 2]
    low, high = extent(named(room, "sink"))
    middle = (low + high) / 2
    starts = [(middle[0] + 0.12, middle[1] + 0.05, 1.2), (middle[0], low[1] + 0.01, 1.2)]
    bottom, rim = 1.2 - first_hits(
        ray_mesh(surface.vertices, surface.faces), np.array(starts), np.tile((0.0, 0.0, -1.0), (2, 1))
    )
    assert 0.1 < top - bottom < 0.2
    assert 0.002 < rim - top < 0.006


@every_room
def test_every_front_is_seen_and_no_scanner_stands_in_anything(name: str, seed: int) -> None:
    """Five scanners, as both details have: each sees half or more of what a hand takes hold of on some front."""
    room = furnished(name, seed)
    surface, _ = cad(catalog(room.pieces))
    mesh = ray_mesh(surface.vertices, surface.faces)
    assert nearest_faces(mesh, room.scanners)[1].min() > 0.25
    assert ((room.scanners > 0.3) & (room.scanners < np.array(room.size) - 0.3)).all()
    assert (room.scanners[:, 2] > 1.15).all() and (room.scanners[:, 2] < 1.8).all()
    scene = clean_scene("room", catalog(room.pieces))
    for part_id in scene.movable:
        grasp = [scene.parts[i].mesh for i in scene.grasp_parts(part_id)]
        points = np.concatenate([m.vertices[m.faces].mean(axis=1) for m in grasp])
        seen = np.zeros(len(points), bool)
        for scanner in room.scanners[:5]:
            ways = points - scanner
            far = np.linalg.norm(ways, axis=1)
            hits = first_hits(mesh, np.tile(scanner, (len(points), 1)), ways / far[:, None])
            seen |= hits > far - 0.002
        assert seen.mean() > 0.25, f"{part_id}: {seen.mean():.0%}"


def test_appliances_and_worktop_have_their_usual_sizes() -> None:
    kitchen, bathroom = furnished("kitchen", 0), furnished("bathroom", 0)
    assert np.allclose(extent(named(kitchen, "kitchen counter"))[1, 2], 0.9)
    assert np.allclose(np.ptp(extent(named(kitchen, "oven")), axis=0)[0], 0.6, atol=0.002)
    width, depth, height = np.ptp(extent(named(kitchen, "refrigerator")), axis=0)
    assert np.allclose((width, height), (0.6, 1.85), atol=0.01) and 0.65 < depth < 0.70, "depth with its handles"
    assert np.allclose(np.ptp(extent(named(bathroom, "bathtub")), axis=0), (1.7, 0.75, 0.57), atol=1e-6)
    assert np.isclose(extent(named(bathroom, "toilet seat"))[1, 2], 0.42)


def test_the_oven_tips_forward_about_its_lower_edge() -> None:
    door, joint = fronts(furnished("kitchen", 0), "oven door")[0]
    low, high = extent(door)
    assert abs(joint.axis[2]) < 0.01
    assert abs(joint.origin[2] - low[2]) < 0.005
    handle = door.children[0].surface.vertices.mean(axis=0)
    first = np.cross(joint.axis, handle - joint.origin)
    assert first[1] < 0.0 and abs(first[1]) > 10 * abs(first[2]), "into the room"
