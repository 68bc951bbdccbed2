"""Wishes: understood, checked on the result, heeded or declined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rough_furniture import at, block, sheet

from s2a.core.errors import InputError
from s2a.language.grammar import parse_wish
from s2a.language.insert.describe import RoomState
from s2a.language.insert.plan import Choice, Place, Plan
from s2a.language.insert.supports import SurfaceConfig
from s2a.language.insert.wish import wished
from s2a.language.insert.wish_check import (
    PlacedBodies,
    RoomRelations,
    allowed,
    any_allowed,
    decline,
    met,
    planned_place,
    read_wish,
    verdict,
)
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Mesh, Part, Scene

CUP = block(0.08, 0.08, 0.1)


def room() -> Scene:
    """A desk before a wall at y = 0.6, seen from -y: from left to right a lamp, a keyboard, a crate; a shelf of three boards."""
    boards = [at(block(0.8, 0.3, 0.02), -1.5, 0.45, height) for height in (0.1, 0.6, 1.1, 1.6)]
    sides = [at(block(0.02, 0.3, 1.6), x, 0.45, 0.0) for x in (-1.9, -1.1)]
    back = at(block(0.8, 0.02, 1.6), -1.5, 0.6, 0.0)
    tray = merge([at(block(0.4, 0.3, 0.01), 2.2, 0.3, 0.0)] + [
        at(block(*size, 0.2), 2.2 + x, 0.3 + y, 0.0)
        for size, x, y in (((0.01, 0.3), -0.2, 0), ((0.01, 0.3), 0.2, 0), ((0.4, 0.01), 0, -0.15), ((0.4, 0.01), 0, 0.15))
    ])  # fmt: skip
    flat = sheet((-2, 3), (0, 2.5), 0.0, 0.05)
    return Scene("room", {
        "floor_1": Part("floor", sheet((-2, 3), (-3, 0.6), 0.0, 0.05)),
        "desk_2": Part("office desk", sheet((0, 1.6), (0, 0.6), 0.74)),
        "lamp_3": Part("lamp", at(block(0.12, 0.12, 0.4), 0.2, 0.4, 0.741)),
        "keyboard_4": Part("keyboard", at(block(0.4, 0.14, 0.03), 0.8, 0.2, 0.741)),
        "crate_5": Part("crate", at(block(0.2, 0.2, 0.2), 1.4, 0.4, 0.741)),
        "shelf_6": Part("shelf", merge([*boards, *sides, back])),
        "box_7": Part("storage box", tray),
        "wall_8": Part("wall", Mesh(flat.vertices[:, [0, 2, 1]] + [0, 0.62, 0], flat.faces)),
    })  # fmt: skip


LABELS = {part_id: part.label for part_id, part in room().parts.items()}


@pytest.mark.parametrize(
    ("said", "kinds", "things"),
    [
        ("put it next to the keyboard", ["near"], ["keyboard_4"]),
        ("on the desk, to the left of the crate", ["on", "left"], ["desk_2", "crate_5"]),
        ("Between the lamp and the keyboard.", ["between"], ["lamp_3", "keyboard_4"]),
        ("at the back edge of the office desk", ["back edge"], ["desk_2"]),
        ("on the top shelf", ["top"], ["shelf_6"]),
        ("inside the storage box please", ["in"], ["box_7"]),
        ("hang it on the wall above the desk at 1.5 m", ["height", "wall", "above"], ["wall_8", "desk_2"]),
        ("in front of the keyboard, not on the floor", ["front", "on"], ["keyboard_4", "floor_1"]),
        ("on desk_2", ["on"], ["desk_2"]),
        ("somewhere nice", [], []),
        ("in the middle of the room", [], []),
        ("beside the little bedside lamp, please", ["near"], ["lamp_3"]),
        ("somewhere I can reach it from the desk", ["near"], ["desk_2"]),
        ("it should greet people who sit on the desk", ["seen from"], ["desk_2"]),
        ("visible from the desk", ["seen from"], ["desk_2"]),
        ("in sight of the desk, on the shelf", ["seen from", "on"], ["desk_2", "shelf_6"]),
        ("for people who like to sit on the desk", [], []),
        ("on the desk next to the crate", ["on", "near"], ["desk_2", "crate_5"]),
        ("on the desk at the left end", ["on", "left edge"], ["desk_2", "desk_2"]),
        ("on the left end of the desk", ["left edge"], ["desk_2"]),
        ("on the left side of the crate, on the desk", ["left", "on"], ["crate_5", "desk_2"]),
        ("on the wall opposite the shelf", ["wall", "opposite"], ["wall_8", "shelf_6"]),
        ("on the top of the shelf", ["top"], ["shelf_6"]),
        ("near the lamp and the crate", ["near", "near"], ["lamp_3", "crate_5"]),
        ("in the office area, on the desk", ["area", "on"], ["desk_2", "desk_2"]),
        ("on the floor near the lamp on the desk", ["on", "near"], ["floor_1", "lamp_3"]),
        ("near the lamp on the desk", ["near", "on"], ["lamp_3", "desk_2"]),
        ("on the bookcase, not under the lamp", ["on", "below"], ["shelf_6", "lamp_3"]),
    ],
)
def test_wishes_become_relations(said: str, kinds: list[str], things: list[str]) -> None:
    wish = parse_wish(said, LABELS)
    assert [one.kind for one in wish.relations] == kinds
    assert [ids[0] for one in wish.relations for ids in one.part_ids] == things
    assert wish.missing == ()
    assert [one.negated for one in wish.relations] == ["not" in said and n == 1 for n in range(len(wish.relations))]


@pytest.mark.parametrize(
    ("said", "missing"),
    [
        ("in the bathtub", "bathtub"),
        ("between the lamp and the piano", "piano"),
        ("next to my aquarium", "aquarium"),
        ("hidden inside the wall safe", "wall safe"),
        ("on the desk near the lamp on the piano", "piano"),
    ],
)
def test_what_is_not_there_is_missing_and_declined_by_name(said: str, missing: str) -> None:
    wish = read_wish(said, room())
    assert wish.missing == (missing,)
    with pytest.raises(
        InputError, match=f"there is no '{missing}' in this room.*there are: floor, office desk.*wish=prefer"
    ):
        decline(wish, said, room(), understood=True)


@pytest.mark.parametrize(
    ("said", "unread"),
    [
        ("at the left end", "at the left end"),
        ("on the desk, 30 cm left of the crate", "30 cm"),
        ("on the desk in the kitchen", "in kitchen"),
        ("on the desk facing the shelf", "facing"),
    ],
)
def test_a_wish_of_which_a_part_is_not_read_is_declined_and_never_heeded(said: str, unread: str) -> None:
    wish = read_wish(said, room())
    assert wish.unread == (unread,)
    with pytest.raises(InputError, match="the rules"):
        decline(wish, said, room(), understood=False)
    assert verdict(wish, said, room(), at(CUP, 1.2, 0.4, 0.745))["heeded"] is not True


def test_an_object_is_in_the_area_whose_things_are_nearest() -> None:
    stove = Part("stove", at(block(0.6, 0.6, 0.9), 2.6, -0.3, 0.0))
    scene = replace(room(), parts=room().parts | {"stove_20": stove})
    relation = read_wish("on the floor, in the kitchen", scene).relations[1]
    assert relation.kind == "area" and relation.part_ids == (("stove_20",),)
    only = replace(scene, parts={i: part for i, part in scene.parts.items() if i not in ("desk_2", "keyboard_4")})
    for x, beside_the_desk, alone in ((2.6, True, True), (0.5, False, True)):
        cup = at(CUP, x, -1.0, 0.003)
        assert (met(scene, cup, relation), met(only, cup, relation)) == (beside_the_desk, alone)


@pytest.mark.parametrize(("label", "noun"), [("trashcan", "bin"), ("dishrack", "dish rack"), ("wardrobe", "closet")])
def test_people_name_things_otherwise_than_annotators(label: str, noun: str) -> None:
    assert parse_wish(f"next to the {noun}", {"thing_1": label}).relations[0].part_ids == (("thing_1",),)


def test_a_screen_is_a_monitor_and_a_sheet_of_shelves_is_not_made_up() -> None:
    assert parse_wish("close to my screen", {"m_1": "monitor"}).relations[0].part_ids == (("m_1",),)
    assert parse_wish("on the top shelf", {"cabinet_1": "cabinet"}).missing == ("shelf",)


def test_nothing_stands_beside_a_lamp_at_the_ceiling() -> None:
    lamp = Part("ceiling lamp", at(block(0.3, 0.3, 0.2), 1.0, -1.0, 2.3))
    only = replace(room(), parts={i: part for i, part in room().parts.items() if i != "lamp_3"} | {"ceiling_9": lamp})
    assert read_wish("beside the lamp", only).missing == ("ceiling lamp",)
    assert read_wish("under the lamp", only).missing == ()
    both = replace(room(), parts={**room().parts, "ceiling_9": lamp})
    assert read_wish("beside the lamp", both).relations[0].part_ids == (("lamp_3",),)


def test_what_the_rules_do_not_understand_they_decline() -> None:
    with pytest.raises(InputError, match="the rules know relations"):
        decline(read_wish("somewhere nice", room()), "somewhere nice", room(), understood=False)
    decline(read_wish("somewhere nice", room()), "somewhere nice", room(), understood=True)


@pytest.mark.parametrize(
    ("said", "place", "holds"),
    [
        ("on the desk", (0.5, 0.3, 0.745), True),
        ("on the desk", (0.5, -0.3, 0.745), False),
        ("on the desk", (0.5, 0.3, 0.9), False),
        ("on the floor", (0.5, -1.0, 0.003), True),
        ("on the floor", (0.5, 0.3, 0.745), False),
        ("not on the floor", (0.5, 0.3, 0.745), True),
        ("not on the floor", (0.5, -1.0, 0.003), False),
        ("left of the keyboard", (0.5, 0.2, 0.745), True),
        ("left of the keyboard", (1.1, 0.2, 0.745), False),
        ("right of the keyboard", (1.1, 0.2, 0.745), True),
        ("in front of the keyboard", (0.8, 0.06, 0.745), True),
        ("in front of the keyboard", (0.8, 0.4, 0.745), False),
        ("behind the keyboard", (0.8, 0.4, 0.745), True),
        ("between the lamp and the crate", (0.8, 0.4, 0.745), True),
        ("between the lamp and the crate", (1.55, 0.4, 0.745), False),
        ("between the lamp and the crate", (0.8, 0.05, 0.745), False),
        ("next to the lamp", (0.4, 0.4, 0.745), True),
        ("next to the lamp", (1.2, 0.1, 0.745), False),
        ("far from the lamp", (1.2, 0.1, 0.745), True),
        ("at the back edge of the desk", (0.6, 0.5, 0.745), True),
        ("at the back edge of the desk", (0.6, 0.1, 0.745), False),
        ("at the front edge of the desk", (0.6, 0.06, 0.745), True),
        ("in the corner of the desk", (0.06, 0.06, 0.745), True),
        ("in the corner of the desk", (0.8, 0.06, 0.745), False),
        ("in the middle of the desk", (0.8, 0.33, 0.745), True),
        ("in the middle of the desk", (0.2, 0.2, 0.745), False),
        ("in the box", (2.2, 0.3, 0.015), True),
        ("in the box", (2.7, 0.3, 0.003), False),
        ("in the shelf", (-1.5, 0.45, 0.62), True),
        ("on the top shelf", (-1.5, 0.45, 1.12), True),
        ("on the top shelf", (-1.5, 0.45, 0.62), False),
        ("on the bottom shelf", (-1.5, 0.45, 0.12), True),
        ("on the bottom shelf", (-1.5, 0.45, 1.12), False),
        ("above the desk", (0.8, 0.55, 1.4), True),
        ("above the desk", (-1.0, 0.55, 1.4), False),
        ("under the desk", (0.8, 0.3, 0.003), True),
        ("under the desk", (0.8, -0.5, 0.003), False),
        ("at the left end of the desk", (0.1, 0.3, 0.745), True),
        ("at the left end of the desk", (0.9, 0.3, 0.745), False),
        ("at the right end of the desk", (1.5, 0.3, 0.745), True),
        ("opposite the shelf", (-1.5, -1.5, 0.003), True),
        ("opposite the shelf", (0.8, -1.5, 0.003), False),
        ("on the wall", (0.8, 0.57, 1.4), True),
        ("on the wall", (0.8, 0.3, 0.745), False),
        ("at 1.5 m", (0.8, 0.57, 1.45), True),
        ("at 1.5 m", (0.8, 0.57, 1.1), False),
    ],
)
def test_a_relation_is_told_from_where_the_object_is(said: str, place: tuple[float, float, float], holds: bool) -> None:
    (relation,) = parse_wish(said, LABELS).relations
    assert met(room(), at(CUP, *place), relation) == holds


def test_all_of_the_gap_of_two_things_with_large_faces_is_between_them() -> None:
    things = {
        "lamp_3": Part("lamp", at(block(2, 2, 0.5), -1.3, 0, 0)),
        "crate_5": Part("crate", at(block(2, 2, 0.5), 1.3, 0, 0)),
    }
    (relation,) = parse_wish("between the lamp and the crate", LABELS).relations
    assert all(met(Scene("room", things), at(CUP, 0.0, y, 0.0), relation) for y in np.linspace(-0.9, 0.9, 13))


def test_what_is_seen_from_a_sofa_is_before_it_and_not_behind_a_wall() -> None:
    sofa = merge([at(block(1.8, 0.8, 0.42), 0, 0, 0), at(block(1.8, 0.2, 0.8), 0, -0.3, 0)])
    back, screen = at(block(3.0, 0.1, 2.4), 0, -0.46, 0), at(block(3.0, 0.1, 2.4), 0, 3.0, 0)
    scene = Scene("room", {
        "floor_1": Part("floor", sheet((-2, 2), (-0.4, 5), 0.0, 0.05)), "sofa_2": Part("sofa", sofa),
        "wall_3": Part("wall", back), "wall_4": Part("wall", screen),
    })  # fmt: skip
    wish = parse_wish("visible from the couch", {i: part.label for i, part in scene.parts.items()})
    assert met(scene, at(CUP, 0.0, 1.2, 0.4), wish.relations[0])
    assert not met(scene, at(CUP, 0.0, 3.5, 0.4), wish.relations[0])
    # In the line of the eyes, but behind the head: on top of the back.
    assert not met(scene, at(CUP, 0.0, -0.3, 0.9), wish.relations[0])


def test_the_verdict_says_what_holds_and_what_does_not() -> None:
    wish = parse_wish("on the desk left of the crate", LABELS)
    good = verdict(wish, "w", room(), at(CUP, 1.2, 0.4, 0.745))
    assert good["heeded"] is True
    bad = verdict(wish, "w", room(), at(CUP, 1.55, 0.4, 0.745))
    assert [one["met"] for one in bad["relations"]] == [True, False]
    assert bad["heeded"] is False
    assert verdict(parse_wish("nicely", LABELS), "nicely", room(), CUP)["heeded"] is None


def test_left_and_right_change_with_the_side_of_the_room() -> None:
    parts = room().parts.items()
    meshes = {i: Mesh(part.mesh.vertices * [-1, -1, 1], part.mesh.faces) for i, part in parts}
    turned = Scene("room", {i: replace(part, mesh=meshes[i]) for i, part in parts})
    (left,) = parse_wish("left of the keyboard", LABELS).relations
    assert met(turned, at(CUP, -0.5, -0.2, 0.745), left)
    assert not met(turned, at(CUP, -1.1, -0.2, 0.745), left)


def test_the_place_of_a_plan_is_searched_for_as_a_wish() -> None:
    choice = Choice("desk_2", "horizontal", "on", 0.74, "there")
    wish = planned_place(Plan("+z", "-y", None, (choice,), (Place("left", ("keyboard_4",)),)))
    keep = allowed(wish, RoomRelations(room()), CUP)
    assert keep is not None
    assert keep(np.array([(0.5, 0.2, 0.741), (1.1, 0.2, 0.741)])).tolist() == [True, False]


def test_the_height_of_what_hangs_is_that_of_its_middle() -> None:
    choice = Choice("wall_8", "vertical", "hanging", 1.5, "there")
    keep = allowed(planned_place(Plan("+z", "-y", None, (choice,))), RoomRelations(room()), block(0.4, 0.04, 0.6))
    assert keep is not None
    # The places are those of the foot; 0.3 m above that is the middle.
    assert keep(np.array([(0.5, 0.6, 1.2), (0.5, 0.6, 1.5)])).tolist() == [True, False]


def test_what_is_to_be_under_a_thing_is_searched_for_there() -> None:
    keep = allowed(read_wish("under the desk", room()), RoomRelations(room()), CUP)
    assert keep is not None
    assert keep(np.array([(0.8, 0.3, 0.003), (0.8, -1.0, 0.003)])).tolist() == [True, False]


@pytest.mark.parametrize("said", ["on the desk but not near the lamp", "on the desk, far from the lamp"])
def test_what_is_to_be_away_is_searched_for_away(said: str) -> None:
    keep = allowed(read_wish(said, room()), RoomRelations(room()), CUP)
    assert keep is not None
    assert keep(np.array([(0.35, 0.4, 0.741), (1.2, 0.1, 0.741)])).tolist() == [False, True]


def test_a_blanket_carries_for_its_bed() -> None:
    bed, blanket = at(block(1.4, 2.0, 0.4), 0.0, 0.0, 0.0), at(block(1.4, 2.0, 0.05), 0.0, 0.0, 0.4)
    parts = {"bed_1": Part("bed", bed), "blanket_2": Part("blanket", blanket)}
    scene = Scene("room", parts | {"blanket_3": Part("blanket", at(blanket, 9.0, 0.0, 0.0))})
    (relation,) = read_wish("on the bed", scene).relations
    assert met(scene, at(CUP, 0.0, 0.0, 0.451), relation)
    assert not met(scene, at(CUP, 0.9, 0.0, 0.451), relation)
    assert not met(scene, at(CUP, 9.0, 0.0, 0.451), relation)  # of another bed


def test_what_is_under_a_picture_is_at_its_foot() -> None:
    picture = Part("picture", at(block(0.6, 0.02, 0.4), 1.0, 0.6, 1.4))
    scene = replace(room(), parts={**room().parts, "picture_9": picture})
    (relation,) = read_wish("below the picture", scene).relations
    assert met(scene, at(CUP, 1.0, 0.45, 0.745), relation)
    assert not met(scene, at(CUP, 1.0, -0.5, 0.003), relation)


@pytest.mark.parametrize(
    "said", ["under the desk", "on the desk, left of the crate", "in the box", "on the top shelf", "by the lamp"]
)
def test_a_box_and_the_object_itself_have_the_same_relations(said: str) -> None:
    related, bodies = RoomRelations(room()), np.random.default_rng(0).uniform((-2, -1, 0), (3, 0.6, 0), (300, 3))
    bodies[:, 2] = np.random.default_rng(1).choice([0.003, 0.745, 0.62, 1.12, 0.015], 300)
    for relation in read_wish(said, room()).relations:
        rough = related.met(PlacedBodies.at(bodies, CUP), relation)
        exact = [related.met(PlacedBodies.of(at(CUP, *place)), relation)[0] for place in bodies]
        assert (rough == exact).mean() > 0.97
        assert rough.any()


@pytest.mark.parametrize(
    ("noun", "label"), [("desk", "table"), ("monitor", "screen"), ("door", "door frame"), ("painting", "wall art")]
)
def test_the_labels_of_headsets_stand_for_what_they_cover(noun: str, label: str) -> None:
    assert parse_wish(f"near the {noun}", {"a_1": label}).relations[0].part_ids == (("a_1",),)
    both = parse_wish(f"near the {noun}", {"a_1": label, "b_2": noun}).relations[0]
    assert both.part_ids == (("b_2",),)


def test_what_a_headset_does_not_say_stands_for_nothing_else() -> None:
    assert parse_wish("on the desk", {"a_1": "coffee table"}).missing == ("desk",)
    assert parse_wish("near the painting", {"a_1": "Wall_Art"}).relations[0].part_ids == (("a_1",),)


def test_a_shelf_at_a_height_is_no_wall() -> None:
    choices = wished(RoomState(room(), "", SurfaceConfig("regions")), read_wish("on the shelf at 0.7 m", room()), False)
    assert {(one["target"], one["height"]) for one in choices["choices"]} == {("shelf_6", 0.62)}


def test_the_one_place_that_is_as_wished_is_found() -> None:
    places = np.column_stack([np.arange(5000.0)] * 3)
    assert any_allowed(lambda some: some[:, 0] == 4321, places)
    assert not any_allowed(lambda some: some[:, 0] == 5000, places)


def test_what_is_missing_is_answered_by_what_is_used_alike() -> None:
    with pytest.raises(
        InputError, match="no 'monitor' in this room; most alike: office desk, keyboard; there are: office desk"
    ):
        decline(read_wish("on the monitor", room()), "w", room(), understood=True)
    with pytest.raises(InputError, match="no 'keybord' in this room; most alike: keyboard; there are: keyboard, "):
        decline(read_wish("on the keybord", room()), "w", room(), understood=True)
    with pytest.raises(InputError, match="no 'moon' in this room; there are: "):
        decline(read_wish("on the moon", room()), "w", room(), understood=True)
