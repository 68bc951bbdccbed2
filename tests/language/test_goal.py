"""Goals: read strictly, judged on the room alone, reached by skills chosen in the room as it stands."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from drawer_room import drawer_room
from nested_room import INNER, nested_room, quick

from s2a.commands import cli
from s2a.core.errors import InputError
from s2a.language.do.episode import Outcome, RoomChange, at_state
from s2a.language.do.facts import gather
from s2a.language.do.goal import Condition, holds, listed, opened, pursue, read
from s2a.language.do.plan import Skill
from s2a.language.do.run import RoomContext
from s2a.prepare.room import prepare
from s2a.scene.usd.sim_scene import SimRoom

SHUT, PLACED = Condition("shut", "drawer_2"), Condition("on", "cube_9", "cabinet_1")
OPEN = RoomChange({"drawer_2": 0.2})
ON_FLOOR, ON_CUBE = (1.0, 1.5, 0.02, 0.0, 0.0, 0.0, 1.0), (0.0, 0.3, 0.875, 0.0, 0.0, 0.0, 1.0)
ON_CABINET = (0.2, 0.1, 0.822, 0.0, 0.0, 0.0, 1.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[", "cannot be read as YAML"),
        ("shut all", "expected the keys shut, on and in"),
        ("shut: []", "has no relation"),
        ("open: all", "expected the keys shut, on and in"),
        ("shut: {drawer_2: 1}", "give a list of ids, or all"),
        ("shut: [cabinet_1]", "'cabinet_1' does not open here; what opens: drawer_2"),
        ("on: [cube_9]", "give object: id"),
        ("on: {mug_1: cabinet_1}", "'mug_1' is not free; free are: cube_9, cube_10"),
        ("on: {cube_9: drawer_2}", "needs a fixed part of the room, not 'drawer_2'"),
        ("in: {cube_9: cabinet_1}", "needs a part that opens of the room, not 'cabinet_1'"),
        ("on: {cube_9: cabinet_1}\nin: {cube_9: drawer_2}", "'cube_9' has two places"),
    ],
)
def test_what_cannot_be_a_goal_is_one_line(text: str, message: str, room: SimRoom, tmp_path: Path) -> None:
    (tmp_path / "goal.yaml").write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read(tmp_path / "goal.yaml", gather(room, None, {}, "panda"))
    assert "\n" not in str(error.value)


def test_a_goal_is_read_once_each(room: SimRoom, tmp_path: Path) -> None:
    (tmp_path / "goal.yaml").write_text("shut: all\non: {cube_9: cabinet_1}\n")
    assert read(tmp_path / "goal.yaml", gather(room, None, {}, "panda")) == (SHUT, PLACED)
    assert listed(("drawer_2", "drawer_2"), gather(room, None, {}, "panda"), "key 'opened'") == ["drawer_2"]


def pursued(context: RoomContext, start: RoomChange, *outcomes: Outcome) -> tuple[list[str], dict[str, str]]:
    """Return the skills that were chosen when they end so, and the relations that do not hold then."""
    chosen: list[str] = []

    def execute(skill: Skill, _: RoomChange, number: int) -> Outcome:
        chosen.append(skill.words)
        return outcomes[number - 1]

    return chosen, pursue(context, (PLACED, SHUT), execute, start).unmet


def test_parts_are_shut_before_objects_are_placed_and_what_holds_needs_no_skill(context: RoomContext) -> None:
    away = RoomChange({"drawer_2": 0.2}, {"cube_9": ON_CUBE})
    shut, done = RoomChange({}, {"cube_9": ON_CUBE}), RoomChange({}, {"cube_9": ON_CABINET})
    outcomes = Outcome(True, "", shut, {}), Outcome(True, "", done, {})
    assert pursued(context, away, *outcomes) == (["close drawer_2", "pick_place cube_9 -> cabinet_1"], {})
    assert pursued(context, done) == ([], {})


def test_a_skill_that_calls_itself_done_in_an_unchanged_room_is_not_believed(context: RoomContext) -> None:
    chosen, unmet = pursued(context, OPEN, *[Outcome(True, "", OPEN, {})] * 2)
    assert chosen == ["close drawer_2"] * 2 and unmet == {"drawer_2 shut": "it does not hold after its skill"}


def test_what_fails_is_tried_again_only_after_another_skill_has_succeeded(context: RoomContext) -> None:
    away = RoomChange({"drawer_2": 0.2}, {"cube_9": ON_CUBE})
    failed, placed = Outcome(False, "why.", away, {}), Outcome(True, "", OPEN, {})
    close, place = "close drawer_2", "pick_place cube_9 -> cabinet_1"
    assert pursued(context, OPEN, Outcome(False, "why.", OPEN, {}))[0] == [close]
    outcomes = failed, placed, Outcome(False, "why.", OPEN, {})
    assert pursued(context, away, *outcomes) == ([close, place, close], {"drawer_2 shut": "why"})


@pytest.mark.parametrize(("pose", "expected"), [(ON_CABINET, True), (ON_CUBE, False), (ON_FLOOR, False)])
def test_an_object_is_on_what_is_directly_below_it(
    room: SimRoom, pose: tuple[float, ...], expected: bool, context: RoomContext
) -> None:
    _, unmet = pursued(
        context, RoomChange({}, {"cube_9": pose}), *[Outcome(False, "", RoomChange({}, {"cube_9": pose}))] * 2
    )
    assert (unmet == {}) == expected


@pytest.mark.parametrize(("x", "z", "expected"), [(0.2, 0.69, True), (0.32, 0.95, False)])  # on its floor; on its front
def test_an_object_on_the_edge_of_a_drawers_front_is_not_in_it(
    room: SimRoom, x: float, z: float, expected: bool
) -> None:
    there = at_state(room, RoomChange({"drawer_2": 0.2}, {"cube_9": (x + 0.2, 0.0, z, 0.0, 0.0, 0.0, 1.0)}))
    facts = gather(there, None, {"drawer_2": 0.2}, "panda")
    assert facts["cube_9"].on == "drawer_2" and holds(Condition("in", "cube_9", "drawer_2"), facts) == expected


def test_a_part_is_shut_up_to_two_centimetres(room: SimRoom) -> None:
    for path, expected in ((0.019, True), (0.021, False)):
        assert holds(SHUT, gather(room, None, {"drawer_2": path}, "panda")) == expected


def test_what_lies_in_a_part_is_moved_with_it(room: SimRoom) -> None:
    inside = RoomChange({}, {"cube_9": (0.2, 0.0, 0.69, 0.0, 0.0, 0.0, 1.0)})
    state = opened(at_state(room, inside), ["drawer_2"], 0.2)
    assert state.joints == {"drawer_2": pytest.approx(0.2)} and list(state.objects) == ["cube_9"]
    np.testing.assert_allclose(state.objects["cube_9"], (0.4, 0.0, 0.69, 0.0, 0.0, 0.0, 1.0), atol=1e-9)


@pytest.mark.slow
def test_what_lies_in_a_part_is_moved_with_what_carries_that(room: SimRoom) -> None:
    nested = prepare(nested_room(), "all", quick())
    drawer = nested.bodies[INNER]
    inside = np.concatenate([each.mesh.vertices for each in drawer.colliders]).mean(axis=0)
    cube = next(iter(room.free.values()))
    body = cube.__class__(**{**vars(cube), "position": tuple(map(float, inside))})
    within = SimRoom(**{**vars(nested), "free": {"cube_9": body}})
    carrier = nested.carriers(INNER)[0]
    state = opened(within, [carrier, INNER], 0.1)
    here = np.array(state.objects["cube_9"][:3])
    own = opened(within, [INNER], 0.1).objects["cube_9"]
    assert np.linalg.norm(np.subtract(own[:3], inside)) == pytest.approx(abs(state.joints[INNER]), abs=1e-6)
    hinge = nested.articulations[carrier].joint
    axis = np.array(hinge.axis)
    radius = [
        np.linalg.norm(np.cross(axis, np.subtract(point, hinge.origin))) for point in (own[:3], here)
    ]  # the door turns what the drawer has moved
    assert radius[0] == pytest.approx(radius[1], abs=1e-6) and np.linalg.norm(here - own[:3]) > 0.01


@pytest.mark.slow
def test_a_drawer_that_stands_open_is_shut(tmp_path: Path) -> None:
    drawer_room(tmp_path / "sim.usda")
    (tmp_path / "goal.yaml").write_text("shut: all\n")
    keys = [f"goal={tmp_path / 'goal.yaml'}", f"stage={tmp_path / 'sim.usda'}", f"out={tmp_path / 'do.json'}"]
    assert cli.main(["do", *keys, "opened=all", "device=cpu"]) == 0
    record = json.loads((tmp_path / "do.json").read_text())
    assert [each["skill"] for each in record["skills"]] == ["close"] and record["unmet"] == {}
    assert record["skills"][0]["began"]["joints"]["drawer_2"] == pytest.approx(0.2, abs=1e-3)


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ([], "give a sentence"),
        (["sentence=open drawer_2", "goal=goal.yaml"], "not both"),
        (["sentence=open drawer_2", "opened=all"], "'opened' needs a goal"),
        (["goal=goal.yaml", "plan_only=true"], "'plan_only' needs a sentence"),
    ],
)
def test_keys_that_exclude_each_other(keys: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["do", "stage=room.usd", "out=do.json", *keys]) == 2
    assert message in capsys.readouterr().err
