"""All articulated parts of a room in one file: each as if it had been prepared alone, none lost for another's sake."""

from __future__ import annotations

import logging
from dataclasses import replace

import numpy as np
import pytest
from nested_room import INNER, LONE, nested_room, quick

from s2a.core.errors import InputError
from s2a.prepare import part as parts_module
from s2a.prepare.grasp import bodies, find_target, parent_body
from s2a.prepare.room import prepare
from s2a.scene.geometry.convex import overlap, sweep, volume
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import SimRoom

ALL = ("drawer_7", "drawer_8", "door_5", "door_6", INNER, LONE)


@pytest.fixture(scope="module")
def room() -> SimRoom:
    return prepare(nested_room(), "all", quick())


def test_every_part_moves_against_the_body_that_it_hangs_on(room: SimRoom) -> None:
    assert tuple(room.articulations) == ALL
    assert {i: a.parent for i, a in room.articulations.items()} == {
        **dict.fromkeys(ALL[:4], "cabinet_3"), INNER: "door_5", LONE: f"{LONE}_anchor",
    }  # fmt: skip
    assert room.fixed == ("cabinet_3", f"{LONE}_anchor")
    assert room.carriers(INNER) == ("door_5", "cabinet_3")


@pytest.mark.parametrize("targets", ["all", []])
def test_a_room_where_nothing_moves_is_a_room_that_names_what_brings_joints(targets: str | list[str]) -> None:
    scene = nested_room()
    parts = {i: replace(part, motion="fixed") for i, part in scene.parts.items()}
    still = prepare(replace(scene, parts=parts), targets, quick())
    assert still.articulations == {} and still.bodies == {}
    assert {c.part for c in still.static_colliders} == {i for i, part in parts.items() if len(part.mesh.faces)}
    assert any("s2a annotate" in note for note in still.notes)


def test_no_part_of_the_scene_is_in_two_bodies_or_in_none(room: SimRoom) -> None:
    owners = [{c.part for c in body.colliders} for body in room.bodies.values()]
    owners.append({c.part for c in room.static_colliders})
    assert sum(map(len, owners)) == len(set().union(*owners))
    assert set().union(*owners) == set(nested_room().parts)
    assert {c.part for c in room.bodies["door_5"].colliders} == {"door_5", "knob_15"}


def test_the_grasp_of_a_door_is_its_own_and_not_that_of_a_drawer_behind_it(room: SimRoom) -> None:
    assert nested_room().grasp_parts("door_5") == ("knob_15",)
    assert nested_room().grasp_parts(INNER) == ("handle_31",)
    assert find_target(nested_room(), "door_5").grasp.point == room.articulations["door_5"].grasp.point


def test_a_part_is_the_same_whether_the_others_are_prepared_or_not(room: SimRoom) -> None:
    alone = prepare(nested_room(), "drawer_7", quick())
    body, among = alone.bodies["drawer_7"], room.bodies["drawer_7"]
    assert replace(body, colliders=()) == replace(among, colliders=())
    # Among others that move it is trimmed apart from them; of a frozen one the cabinet's hull gives way.
    whole, left = (sum(volume(c.mesh) for c in each.colliders) for each in (body, among))
    assert 0.95 * whole < left <= whole
    assert replace(alone.articulations["drawer_7"], filtered=(), notes=()) == replace(
        room.articulations["drawer_7"], filtered=(), notes=()
    )
    # The others are frozen into the cabinet.
    assert {"drawer_8", "door_5", INNER} < {c.part for c in alone.bodies["cabinet_3"].colliders}


@pytest.mark.slow
def test_several_processes_find_what_one_finds(
    room: SimRoom, monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    monkeypatch.setenv("S2A_CACHE", str(tmp_path_factory.mktemp("empty")))
    monkeypatch.setattr(parts_module, "FEW", 100)
    again = prepare(nested_room(), "all", quick())
    assert again == room


@pytest.mark.slow
def test_the_second_time_nothing_is_computed_again(room: SimRoom, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parts_module, "_part", lambda *_: pytest.fail("not from the cache"))
    assert prepare(nested_room(), "all", quick()) == room


def test_no_static_hull_reaches_into_the_path_of_any_part(room: SimRoom) -> None:
    for part, articulation in room.articulations.items():
        for cover in sweep(room.bodies[part].visual, articulation.joint):
            assert max(overlap(c.mesh, cover) for c in room.static_colliders) < 5e-4


@pytest.mark.slow
def test_a_part_that_cannot_be_prepared_costs_no_other_and_is_named(caplog: pytest.LogCaptureFixture) -> None:
    scene = nested_room()
    bare = {
        i: replace(scene.parts[i], mesh=Mesh(np.zeros((0, 3)), np.zeros((0, 3)))) for i in ("drawer_8", "handle_12")
    }
    far = replace(scene.parts["door_5"], motion=replace(scene.joint("door_5"), limits=(0.5, 1.0)))
    scene = replace(scene, parts={**scene.parts, **bare, "door_5": far})
    with caplog.at_level(logging.WARNING):
        found = prepare(scene, "all", quick())
    assert tuple(found.articulations) == ("drawer_7", "door_6", INNER, LONE)
    assert "drawer_8 is left out" in caplog.text and "no surface" in caplog.text
    assert "door_5 is left out" in caplog.text and "do not hold 0" in caplog.text
    # What hung on the door hangs on what that is frozen to.
    assert found.articulations[INNER].parent == "cabinet_3"
    assert "door_5" in {c.part for c in found.bodies["cabinet_3"].colliders}
    with pytest.raises(InputError, match="drawer_8"):
        prepare(scene, ["drawer_7", "drawer_8"], quick())


@pytest.mark.parametrize("articulated", [("drawer_7",), ("door_5", INNER), (INNER,), (LONE,), ALL])
def test_parts_belong_to_the_nearest_body_above_them(articulated: tuple[str, ...]) -> None:
    scene = nested_room()
    owners = bodies(scene, articulated)
    assert {owner for owner in owners.values() if owner} <= {*articulated, "cabinet_3"}
    assert all(owners[part] == part for part in articulated)
    assert owners["handle_31"] == (INNER if INNER in articulated else owners["door_5"])
    assert owners["table_4"] is None
    for part in articulated:
        assert parent_body(scene, part, owners) in {*articulated, "cabinet_3", f"{LONE}_anchor"}
