"""The rule-based fallback on a hand-made room: what sentences mean, and what is refused."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
from settings import skills

from s2a.language.ask import UsageLog
from s2a.language.do.facts import RoomPart
from s2a.language.do.plan import SkillPlan, plan
from s2a.language.do.rules import rules


def thing(
    i: str, label: str, at: tuple[float, float, float], size: tuple[float, float, float], **more: object
) -> RoomPart:
    return RoomPart(i, label, center=at, size=size, **more)  # type: ignore[arg-type]


def drawer(i: str, parent: str, y: float, z: float) -> RoomPart:
    """A front of a cabinet that faces +x: to somebody before it, +y is on the right."""
    return thing(i, "drawer", (0.4, y, z), (0.4, 0.4, 0.2), parent=parent, kind="slides", facing=(1.0, 0.0), base=True)


def oven(i: str, label: str, kind: str) -> RoomPart:
    """A part of an oven that faces -x."""
    return thing(i, label, (3.0, 0.0, 0.5), (0.1, 0.6, 0.5), parent="oven_13", kind=kind, facing=(-1.0, 0.0), base=True)


THINGS = [
    thing("desk_1", "desk", (0.2, 0.0, 0.375), (0.8, 1.6, 0.75)),
    thing("cabinet_2", "storage cabinet", (0.2, 0.4, 0.3), (0.5, 0.4, 0.6)),
    drawer("drawer_3", "cabinet_2", 0.4, 0.15),
    drawer("drawer_4", "cabinet_2", 0.4, 0.45),
    thing("chest_5", "chest of drawers", (0.2, 3.0, 0.4), (0.5, 1.0, 0.8)),
    *(drawer(f"drawer_{6 + n}", "chest_5", 2.75 + 0.5 * (n % 2), 0.2 + 0.2 * (n // 2)) for n in range(6)),
    thing("window_12", "window", (2.0, 2.0, 1.5), (1.0, 0.1, 1.0), kind="turns", facing=(0.0, -1.0), base=True),
    thing("oven_13", "oven", (3.0, 0.0, 0.4), (0.6, 0.6, 0.8)),
    oven("oven_door_14", "oven door", "turns"),
    oven("drawer_15", "drawer", "slides"),
    thing("cup_16", "cup", (0.2, -0.3, 0.8), (0.1, 0.1, 0.1), kind="free", on="desk_1"),
    thing("cup_17", "cup", (0.2, -0.6, 0.8), (0.1, 0.1, 0.1)),
    thing("glue_18", "glue stick", (0.2, 0.3, 0.8), (0.03, 0.03, 0.1), kind="free", on="desk_1"),
    thing("table_19", "table", (0.5, -1.5, 0.375), (0.8, 0.8, 0.75)),
]
FACTS = {each.id: each for each in THINGS}


def planned(sentence: str, facts: dict[str, RoomPart] = FACTS) -> SkillPlan:
    """Return what the rules plan, in a room where every plan fits."""
    return plan(rules, sentence, facts, lambda _: None, 0, UsageLog((0.0, 0.0)), skills())


def words(sentence: str) -> list[str]:
    found = planned(sentence)
    assert found.refusal is None, found
    return [skill.words for skill in found.skills]


@pytest.mark.parametrize(
    ("sentence", "skills"),
    [
        ("open the window", ["open window_12"]),
        ("Please open the window!", ["open window_12"]),
        ("open drawer_3", ["open drawer_3"]),
        ("open the top drawer of the desk", ["open drawer_4"]),  # of the cabinet that stands below it
        ("open the desk's bottom drawer", ["open drawer_3"]),
        ("open the top desk drawer", ["open drawer_4"]),
        ("open the storage cabinet's upper drawer", ["open drawer_4"]),
        # Facing the chest, which faces +x, one looks along -x: +y is on the right.
        ("open the top right drawer of the chest of drawers", ["open drawer_11"]),
        ("open the lower left drawer of the chest of drawers", ["open drawer_6"]),
        ("open the second drawer on the left of the chest of drawers", None),
        ("pull the left middle drawer of the chest of drawers open", ["open drawer_8"]),
        ("open the oven", ["open oven_door_14"]),
        ("open the drawer of the oven", ["open drawer_15"]),
        ("open the window and close it again", ["open window_12", "close window_12"]),
        ("open the window and the oven", ["open window_12", "open oven_door_14"]),
        ("put the glue stick into the top drawer of the desk", ["put_in glue_18 -> drawer_4"]),
        ("open the top drawer of the desk and put the glue stick in it", ["put_in glue_18 -> drawer_4"]),
        (
            "put the glue stick into drawer_4, open it, and put the glue stick on the desk",
            ["put_in glue_18 -> drawer_4", "open drawer_4", "pick_place glue_18 -> desk_1"],
        ),
        ("take the glue stick and put it on the table", ["pick_place glue_18 -> table_19"]),
        ("set the glue stick down on the table", ["pick_place glue_18 -> table_19"]),
        (
            "put the glue in the top drawer of the desk, then open the bottom one",
            ["put_in glue_18 -> drawer_4", "open drawer_3"],
        ),
    ],
)
def test_meaning(sentence: str, skills: list[str] | None) -> None:
    if skills is None:
        assert planned(sentence).refusal
    else:
        assert words(sentence) == skills


@pytest.mark.parametrize(
    ("sentence", "kind"),
    [
        ("open a drawer", "ambiguous"),
        ("open the chest of drawers", "ambiguous"),
        ("open the top drawer of the chest of drawers", "ambiguous"),  # one on each side
        ("open the top drawer", "ambiguous"),  # of which furniture?
        ("put the cup on the table", "ambiguous"),  # two cups, one of them free
        ("close it", "ambiguous"),
        ("put the glue stick", "ambiguous"),
        ("open the fridge", "unknown"),
        ("open the fridge window", "unknown"),  # the only window is no fridge's
        ("put the paper cup on the table", "unknown"),
        ("open the drawer of the wardrobe", "unknown"),
        ("put the glue stick into the safe", "unknown"),
        ("open the table", "impossible"),
        ("wash the cup", "impossible"),
        ("put the table on the desk", "impossible"),
        ("put the glue stick into the table", "impossible"),
        ("put the glue stick on the desk", "impossible"),  # it is there
        ("take the glue stick", "impossible"),
        ("bring me the glue stick", "impossible"),
        ("open the drawer next to the window", "unknown"),
        ("please", "impossible"),
        ("...", "impossible"),
        ("\N{LATIN CAPITAL LETTER O WITH DIAERESIS}ffne das Fenster", "impossible"),
        ("\u6253\u5f00\u7a97\u6237", "impossible"),
    ],
)
def test_refusals(sentence: str, kind: str) -> None:
    assert planned(sentence).refusal == kind


@pytest.mark.parametrize(
    "no", ["do not ", "don't ", "don\N{RIGHT SINGLE QUOTATION MARK}t ", "never ", "please do not ever "]
)
@pytest.mark.parametrize("rest", ["open the window", "put the glue stick into the top drawer of the desk"])
def test_negations_are_never_overlooked(no: str, rest: str) -> None:
    assert planned(no + rest).refusal == "impossible"
    assert planned(f"open the oven and {no}{rest}").refusal == "impossible"


@pytest.mark.parametrize("word", ["all", "every", "both", "any", "two", "if it is shut", "unless", "only", "half"])
def test_quantities_and_conditions_are_refused(word: str) -> None:
    assert planned(f"open {word} the window").refusal == "impossible"


def test_a_drawer_of_furniture_is_its_own_before_that_of_furniture_below_it() -> None:
    facts = FACTS | {"drawer_20": drawer("drawer_20", "desk_1", -0.4, 0.4)}
    assert [skill.words for skill in planned("open the top drawer of the desk", facts).skills] == ["open drawer_20"]
    assert planned("open the drawer under the desk", facts).refusal == "ambiguous"


def test_an_object_is_told_from_another_by_what_it_stands_on() -> None:
    other = replace(FACTS["glue_18"], id="glue_20", on="table_19")
    assert planned("put the glue stick into drawer_3", FACTS | {"glue_20": other}).refusal == "ambiguous"
    found = planned("put the glue stick on the table into drawer_3", FACTS | {"glue_20": other})
    assert [skill.words for skill in found.skills] == ["put_in glue_20 -> drawer_3"]


def test_a_part_is_told_from_others_by_its_furniture() -> None:
    stand = thing("nightstand_20", "nightstand", (0.2, 6.0, 0.3), (0.5, 0.4, 0.6))
    facts = FACTS | {"nightstand_20": stand, "drawer_21": drawer("drawer_21", "nightstand_20", 6.0, 0.3)}
    assert [skill.words for skill in planned("open the nightstand drawer", facts).skills] == ["open drawer_21"]
    desk = planned("open the desk drawer", facts)
    assert (desk.refusal, set(desk.options)) == ("ambiguous", {"drawer_3", "drawer_4"})


def test_left_of_a_thing_without_a_front_is_asked_and_near_it_is_not() -> None:
    lamp = thing("lamp_20", "lamp", (0.2, 0.0, 0.9), (0.1, 0.1, 0.3))
    other = replace(FACTS["glue_18"], id="glue_21", center=(0.6, 0.0, 0.8))
    facts = FACTS | {"lamp_20": lamp, "glue_21": other}
    left = planned("put the glue stick left of the lamp into drawer_3", facts)
    assert left.refusal == "ambiguous"
    assert "front" in left.reason
    near = planned("put the glue stick near the lamp into drawer_3", facts)
    assert near.refusal == "ambiguous"  # 0.3 m and 0.4 m off in plan
    far = facts | {"glue_21": replace(other, center=(0.75, 0.0, 0.8))}
    near = planned("put the glue stick near the lamp into drawer_3", far)
    assert [skill.words for skill in near.skills] == ["put_in glue_18 -> drawer_3"]


def test_any_words_give_a_plan_or_a_refusal() -> None:
    for sentence in (
        "a" * 500,
        "open " * 90,
        "put in on into",
        "of of of",
        "\\d+(((",
        "open ((drawer",
        "'s 's 's",
        "{}[]",
    ):
        found = planned(sentence)
        assert bool(found.skills) != bool(found.refusal)
        json.dumps(found.reason)


@pytest.mark.parametrize(
    ("colors", "sentence", "plan"),
    [
        ((("red",), ("blue",)), "put the red cup on the table", "cup_16"),
        ((("blue",), ("blue",)), "put the red cup on the table", "unknown"),
        (((), ("blue",)), "put the red cup on the table", "ambiguous"),
        (((),), "put the red cup on the table", "cup_16"),
        ((("blue",),), "put the red cup on the table", "unknown"),
        ((("pink",),), "put the red cup on the green table", "cup_16"),
        (((),), "put the big cup on the white table", "cup_16"),
        ((("pink",), ()), "put the red cup on the table", "ambiguous"),
        ((("blue",), ("red",)), "put the red cup_16 on the table", "unknown"),
        ((("white", "pink"),), "put the red cup on the table", "unknown"),
        # Of three cups the larger the later: the big red one is the largest red one
        ((("red",), ("red",), ("pink", "brown")), "put the big red cup on the table", "cup_17"),
        ((("red",), ("red",), ("blue",)), "put the red small cup on the table", "cup_16"),
        ((("red",), ("red",), ("blue",)), "put the red cup on the table", "ambiguous"),
    ],
)
def test_a_colour_chooses_among_what_is_known_and_a_wrong_one_is_refused(
    colors: tuple[tuple[str, ...], ...], sentence: str, plan: str
) -> None:
    facts = {i: part for i, part in FACTS.items() if part.label != "cup"}
    for k, names in enumerate(colors):
        size = (0.08, 0.08, 0.1 * 1.5**k)
        cup = replace(FACTS["cup_16"], id=f"cup_{16 + k}", colors=names, size=size)
        facts[cup.id] = cup
    made = planned(sentence, facts)
    assert plan == (made.refusal or made.skills[0].object)


def test_a_word_for_a_colour_may_belong_to_a_name_and_a_position_chooses_before_unknown_colours() -> None:
    glass = replace(FACTS["cup_16"], id="Glass_20", label="glass of red wine")
    juice = replace(FACTS["cup_16"], id="juice_21", label="orange juice")
    facts = FACTS | {"cup_16": replace(FACTS["cup_16"], colors=("red",)), "Glass_20": glass, "juice_21": juice}
    for name, part in (("red cup", "cup_16"), ("orange juice", "juice_21"), ("glass of red wine", "Glass_20")):
        assert [skill.object for skill in planned(f"put the {name} on the table", facts).skills] == [part]
    both = planned("put the orange juice on the table and Glass_20 on the table", facts)
    assert [skill.object for skill in both.skills] == ["juice_21", "Glass_20"]
    assert words("open the top white drawer of the desk") == words("open the top drawer of the desk")
    several = planned("open the white drawer of the desk")
    assert (several.refusal, "leave the colour out" in several.reason) == ("ambiguous", True)


def test_a_verb_goes_on_with_ids_and_with_places() -> None:
    assert words("open drawer_3 and then drawer_4") == [*words("open drawer_3"), *words("open drawer_4")]
    both = [*words("put the glue stick on the table"), *words("put cup_16 on the table")]
    assert words("put the glue stick on the table and cup_16 on the table") == both


def test_a_table_is_what_a_kind_of_table_means_and_another_kind_is_not() -> None:
    chest = drawer("drawer_30", "table_19", -1.5, 0.3)
    bedside = thing("bedside_31", "bedside table", (4.0, 0.0, 0.3), (0.4, 0.4, 0.6))
    facts = FACTS | {
        "drawer_30": chest,
        "bedside_31": bedside,
        "drawer_32": replace(chest, id="drawer_32", parent=bedside.id),
    }
    made = planned("open the drawer of the coffee table", facts)
    assert [skill.part for skill in made.skills] == ["drawer_30"]
    del facts["table_19"], facts["drawer_30"]
    assert planned("open the drawer of the coffee table", facts).refusal == "unknown"
