"""Colliders of neighbours: how deep they overlap along a path, trimmed apart, and which pairs stay filtered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from settings import load

from s2a.prepare.neighbours import filtered_pairs, trim_apart
from s2a.prepare.room import PrepareConfig
from s2a.scene.geometry.convex import box, volume
from s2a.scene.scene import Joint
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody
from s2a.sim.contacts import Engine, RestingRoom, mujoco_depths, newton_depths

CONFIG = load(PrepareConfig, "prepare/handle").room
OUT = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.3))
HINGE = Joint("revolute", (0.0, 0.0, 1.0), (0.01, -0.2, 0.0), (0.0, 1.5))  # at an outer edge of the lowest front


def body(name: str, *boxes: tuple[tuple[float, float, float], tuple[float, float, float]]) -> SimBody:
    """Return a body of boxes: centre and size [m]; the second is its handle."""
    meshes = [box(np.array(center), np.eye(3), np.array(size)) for center, size in boxes]
    parts = [name, "handle"][: len(meshes)]
    colliders = tuple(Collider(part, mesh) for part, mesh in zip(parts, meshes, strict=True))
    return SimBody(name, meshes[0], colliders, Mass(5.0, (0.0, 0.0, 0.1), (0.1, 0.1, 0.1)))


def front(name: str, low: float) -> SimBody:
    """Return a front of 0.4 x 0.2 m that begins at a height [m], and its handle of 6 cm, 3 cm before it."""
    return body(name, ((0.0, 0.0, low + 0.1), (0.02, 0.4, 0.2)), ((0.04, 0.0, low + 0.1), (0.01, 0.06, 0.01)))


def drawers(gap: float, joint: Joint = OUT) -> RestingRoom:
    """Return two fronts, one above the other, that stand this far apart [m]."""
    bodies = {"drawer_1": front("drawer_1", 0.0), "drawer_2": front("drawer_2", 0.2 + gap)}
    return RestingRoom(bodies, dict.fromkeys(bodies, joint), dict.fromkeys(bodies, "cabinet"))


def trimmed(room: RestingRoom, *frozen: str) -> dict[str, SimBody]:
    """Return the bodies of a room, trimmed apart."""
    handles = {i: [c for c in room.bodies[i].colliders if c.part == "handle"] for i in room.joints}
    return trim_apart(room.bodies, room.joints, room.parents, handles, frozen, CONFIG)


def pairs_of(room: RestingRoom) -> dict[str, dict[str, float]]:
    """Return the filtered pairs of a room, with their depths [m]."""
    moving = {i: room.bodies[i] for i in room.joints}
    return filtered_pairs(moving, {i: body for i, body in room.bodies.items() if i not in moving}, room.joints)


@pytest.mark.parametrize("engine", [mujoco_depths, newton_depths])
def test_a_planted_overlap_is_found_in_both_engines_and_trimmed(engine: Engine) -> None:
    # The fronts overlap by 13 mm; a post of the cabinet stands 12 mm in the lower one's side and a bar 5 cm before it.
    room = drawers(-0.013)
    post, bar = ((0.0, 0.208, 0.1), (0.05, 0.04, 0.2)), ((0.1, 0.15, 0.05), (0.02, 0.02, 0.02))
    cabinet = body("cabinet", post, bar)
    cabinet = replace(cabinet, colliders=tuple(replace(each, part="cabinet") for each in cabinet.colliders))
    room = replace(room, bodies={**room.bodies, "cabinet": cabinet})
    found = room.overlaps("drawer_1", engine)
    assert found["drawer_2"].rest == pytest.approx(0.013, abs=1e-4)
    assert found["cabinet"].rest == pytest.approx(0.012, abs=1e-4)
    assert found["cabinet"].travel > 0.014 and 0.08 < found["cabinet"].q < 0.12
    apart = replace(room, bodies=trimmed(room))
    assert all(apart.overlaps(part, engine) == {} for part in room.joints)
    assert pairs_of(apart) == {"drawer_1": {}, "drawer_2": {}}
    for part in room.joints:
        (was, handle), (now, same) = (each.bodies[part].colliders for each in (room, apart))
        assert same is handle and volume(now.mesh) >= 0.8 * volume(was.mesh)
    # 13 mm and the gap of 2 of 400 mm of two fronts
    left, whole = (sum(volume(each.bodies[i].colliders[0].mesh) for i in room.joints) for each in (apart, room))
    assert left / whole == pytest.approx(1 - 15 / 400, abs=2e-3)


def test_a_frame_gets_a_rebate_in_which_a_door_turns() -> None:
    # The door's inner edge turns past its hinge into the frame, 20 mm thick as the door is.
    room = drawers(0.1, HINGE)
    frame = body("frame", ((0.0, -0.23, 0.1), (0.02, 0.06, 0.2)))
    room = replace(room, bodies={**room.bodies, "frame": frame}, parents=dict.fromkeys(room.joints, "frame"))
    assert room.overlaps("drawer_1")["frame"].travel > 0.005
    apart = replace(room, bodies=trimmed(room))
    assert apart.overlaps("drawer_1") == {}
    assert apart.bodies["drawer_1"] == room.bodies["drawer_1"]
    assert 0.4 < sum(volume(c.mesh) for c in apart.bodies["frame"].colliders) / volume(frame.visual) < 1.0


@pytest.mark.parametrize(
    ("center", "size"),
    [
        ((0.2, 0.0, 0.1), (0.02, 0.1, 0.1)),  # in the middle of the path: a hole in the front, or nothing of it left
        ((0.04, 0.03, 0.1), (0.1, 0.06, 0.1)),  # half of the handle is in it
        ((0.0, -0.15, 0.1), (0.1, 0.2, 0.2)),  # at rest, in more than a fifth of the front
    ],
)
def test_a_real_collision_keeps_both_whole_and_its_filter(center: tuple, size: tuple) -> None:
    room = drawers(0.5)
    room = replace(room, bodies={**room.bodies, "drawer_2": body("drawer_2", (center, size))})
    assert trimmed(room) == room.bodies
    assert list(pairs_of(room)["drawer_1"]) == ["drawer_2"]
    # one with the furniture, it is no more cut away than when it moves
    frozen = replace(body("drawer_2", (center, size)), id="cabinet")
    room = drawers(0.5)
    room = replace(room, bodies={"drawer_1": room.bodies["drawer_1"], "cabinet": frozen}, joints={"drawer_1": OUT})
    assert trimmed(room, "drawer_2") == room.bodies == trimmed(room)
    # furniture gives way, but does not vanish: the first two lie in the path as a whole
    room.bodies["cabinet"] = body("cabinet", (center, size))
    assert (trimmed(room) == room.bodies) == (center[0] > 0.0)


def test_no_hull_of_many_vanishes_and_a_pane_is_cut_no_more_than_a_part() -> None:
    # Before a front of 4 % of its drawer's hulls stands a leaf that moves, too: what one leaves of the other is half.
    drawer = body("drawer", ((-0.26, 0.0, 0.1), (0.48, 0.38, 0.19)), ((0.0, 0.0, 0.1), (0.02, 0.4, 0.2)))
    room = drawers(0.5)
    both = {"drawer_1": drawer, "drawer_2": body("drawer_2", ((0.0, 0.0, 0.1), (0.02, 0.6, 0.4)))}
    room = replace(room, bodies=both, joints={"drawer_1": OUT, "drawer_2": replace(OUT, limits=(0.0, 0.01))})
    assert trim_apart(room.bodies, room.joints, room.parents, {}, [], CONFIG) == both
    # a window's frame gives way to its sash, a pane beside that only by what it can bear
    post, pane = ((0.0, -0.21, 0.1), (0.04, 0.03, 0.3)), ((0.0, 0.3, 0.1), (0.004, 0.4, 0.2))
    aside = replace(OUT, axis=(0.0, 1.0, 0.0))
    both = {"drawer_1": front("drawer_1", 0.0), "cabinet": body("cabinet", post, pane)}
    left = trimmed(replace(room, bodies=both, joints={"drawer_1": aside}))
    (was, glass), (now, same) = both["cabinet"].colliders, left["cabinet"].colliders[-2:]
    assert same is glass and 0.0 < volume(now.mesh) < volume(was.mesh)


def test_what_is_thinner_than_a_step_is_found_and_filtered_late_on_a_path() -> None:
    # a wire of 1 mm, shortly before the end of a slide of 0.3 m and of a turn of 1.5 rad
    for joint, place in ((OUT, (0.29, 0.1, 0.1)), (HINGE, (-0.187, -0.166, 0.1))):
        room = drawers(0.5, joint)
        room = replace(room, bodies={**room.bodies, "wire": body("wire", (place, (0.001, 0.001, 0.1)))})
        assert room.overlaps("drawer_1")["wire"].travel > 5e-4
        assert list(pairs_of(room)["drawer_1"]) == ["wire"]


@pytest.mark.parametrize(("gap", "filtered"), [(-1e-3, True), (0.0, True), (1e-4, True), (1e-3, False)])
def test_fronts_that_overlap_or_touch_are_filtered(gap: float, filtered: bool) -> None:
    room = drawers(gap)
    pairs = pairs_of(room)
    assert [list(others) for others in pairs.values()] == ([["drawer_2"], ["drawer_1"]] if filtered else [[], []])
    # the radius of the largest ball in the overlap
    depths = [depth for others in pairs.values() for depth in others.values()]
    assert depths == pytest.approx([max(0.0, -gap / 2)] * len(depths), abs=2e-5)
