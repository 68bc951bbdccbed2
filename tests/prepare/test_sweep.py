"""What the target meets on its way, and stages for several targets."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from only_part import moving, part
from pxr import Usd
from settings import load

from s2a.certify.check_suite import CertifyConfig
from s2a.certify.contents import Contents
from s2a.certify.static import joint_limits
from s2a.commands import prepare as verb
from s2a.core import config as configuration
from s2a.core.errors import InputError
from s2a.prepare.grasp import target_joint
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.articulation import displace, opening_direction
from s2a.scene.geometry.convex import box, contains, deepest, overlap, sweep
from s2a.scene.scene import Joint, Mesh, Part, Scene, Vec3
from s2a.scene.usd import geometric, sim_stage
from s2a.scene.usd.joints import write_joint
from s2a.scene.usd.sim_scene import SimRoom
from s2a.scene.usd.stage import new_stage

SHAPES = load(CertifyConfig, "certify/default").shapes
SLIDE = Joint("prismatic", (1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.4))


def cube(x: float, size: float = 0.1) -> Mesh:
    return box(np.array([x, 0.0, 0.0]), np.eye(3), np.full(3, size))


def coarse() -> PrepareConfig:
    settings = load(PrepareConfig, "prepare/handle")
    furniture, room = (replace(one, resolution=3000) for one in (settings.cabinet, settings.room))
    return replace(settings, cabinet=furniture, room=room)


@pytest.fixture(scope="module")
def prepared() -> SimRoom:
    return prepare(clean_cabinet_room(), "drawer_7", coarse())


def test_the_centre_of_mass_lies_inside_the_part(prepared: SimRoom) -> None:
    low, high = moving(prepared).visual.bounds
    assert (moving(prepared).mass.center > low).all() and (moving(prepared).mass.center < high).all()


@pytest.mark.parametrize("axis", [(1.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.6, 0.0, 0.8)])
def test_what_turns_about_its_own_grasp_point_still_has_a_direction(axis: Vec3) -> None:
    dial = Joint("revolute", axis, (0.1, 0.2, 0.3), (0.0, 1.5))
    found = opening_direction(dial, np.array(dial.origin))
    assert np.linalg.norm(found) == pytest.approx(1.0) and found @ axis == pytest.approx(0.0, abs=1e-12)


def test_a_clash_is_found_where_it_is_deepest() -> None:
    # A cube of 0.1 m slides through one of 0.06 m, into which no ball of more than 0.03 m fits.
    assert deepest([cube(0.0)], [cube(0.2, 0.06)], SLIDE, steps=9) == pytest.approx(0.03, abs=1e-4)
    assert deepest([cube(0.0)], [cube(-0.1)], SLIDE) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("share", np.linspace(0.0, 1.0, 6))
def test_no_collider_of_the_room_is_met_on_the_way(share: float, prepared: SimRoom) -> None:
    lower, upper = part(prepared).joint.limits
    q = lower + share * (upper - lower)
    moved = [Mesh(displace(c.mesh.vertices, part(prepared).joint, q), c.mesh.faces) for c in moving(prepared).colliders]
    assert max(overlap(a, b.mesh) for a in moved for b in prepared.static_colliders) < 5e-4


def test_what_overlaps_on_the_path_is_filtered_and_the_stage_says_so(prepared: SimRoom, tmp_path: Path) -> None:
    for others in (("cabinet_3",), ()):
        changed = replace(part(prepared), filtered=others, notes=("told",))
        sim_stage.write(replace(prepared, articulations={"drawer_7": changed}), tmp_path / "sim.usda")
        stage = Usd.Stage.Open(str(tmp_path / "sim.usda"))
        stage.Reload()
        pairs = stage.GetPrimAtPath("/scene/drawer_7").GetRelationship("physics:filteredPairs").GetTargets()
        assert [str(path) for path in pairs] == [f"/scene/{other}" for other in others]
        assert list(stage.GetPrimAtPath("/scene/drawer_7").GetAttribute("s2a:notes").Get()) == ["told"]


@pytest.mark.slow
def test_several_parts_become_one_room(tmp_path: Path) -> None:
    geometric.write(clean_cabinet_room(), tmp_path / "room.usd")
    given = [f"stage={tmp_path / 'room.usd'}", "targets=[drawer_7,door_5]", f"out={tmp_path / 'sims/sim.usd'}"]
    given += ["prepare.cabinet.resolution=3000", "prepare.room.resolution=3000", "prepare.base.search=false"]
    told = verb.run(configuration.load(verb.Config, configuration.compose("prepare", given)))
    assert sorted(path.name for path in (tmp_path / "sims").iterdir()) == ["sim.usd", "sim_visuals.usd"]
    assert "door_5 on cabinet_3" in told and "panda: 0.55 m before the handle" in told
    assert list(sim_stage.read(tmp_path / "sims/sim.usd").articulations) == ["drawer_7", "door_5"]


def test_nothing_is_written_where_one_of_several_does_not_move(tmp_path: Path) -> None:
    geometric.write(clean_cabinet_room(), tmp_path / "room.usd")
    given = [f"stage={tmp_path / 'room.usd'}", "targets=[drawer_7,table_4]", f"out={tmp_path / 'sims/sim.usd'}"]
    with pytest.raises(InputError, match="drawer_7, "):
        verb.run(configuration.load(verb.Config, configuration.compose("prepare", given)))
    assert not (tmp_path / "sims").exists()


LIMITS = [
    ("prismatic", (0.0, 0.4)),
    ("prismatic", (-0.1, 0.3)),
    ("prismatic", (-0.4, 0.0)),
    ("prismatic", (0.0, 0.01)),
    ("prismatic", (0.25, 0.5)),
    ("prismatic", (-0.5, -0.25)),
    ("prismatic", (1e-12, 0.4)),
    ("prismatic", (0.0, 0.0)),
    ("prismatic", (-0.004, 0.005)),
    ("prismatic", (0.0, 3.0)),
    ("prismatic", (0.0, 3.1)),
    ("revolute", (0.0, 1.5708)),
    ("revolute", (-math.pi, math.pi)),
    ("revolute", (0.0, 6.2832)),
    ("revolute", (0.2, 1.0)),
    ("revolute", (0.0, 0.0)),
]
"""Limits [m] or [rad], of which some suit a robot."""


@pytest.mark.parametrize(("kind", "limits"), LIMITS)
def test_a_target_is_refused_for_the_limits_that_no_certificate_allows(kind: str, limits: tuple[float, float]) -> None:
    stage, joint = new_stage(), replace(SLIDE, kind=kind, limits=limits)
    prim = write_joint(stage, "/scene/joint", joint, "/scene/a", "/scene/b").GetPrim()
    certified = joint_limits(Contents(stage, "", None, prim, None, (), (), ()), SHAPES).status == "pass"
    scene = Scene("one", {"drawer_3": Part("drawer", cube(0.0), motion=joint)})
    if certified:
        assert target_joint(scene, "drawer_3") == joint
    else:
        with pytest.raises(InputError, match=r"^part 'drawer_3' of scene 'one': .*rangeMin and rangeMax.*s2a export"):
            target_joint(scene, "drawer_3")


@pytest.mark.parametrize(("limits", "says"), [((0.25, 0.5), "0.25 to 0.5 m do not hold 0"), ((0, 0), "0.01 to 3 m")])
def test_a_part_that_no_robot_opens_is_not_prepared(limits: tuple[float, float], says: str) -> None:
    room = clean_cabinet_room()
    drawer = room.parts["drawer_7"]
    stuck = replace(drawer, motion=replace(room.joint("drawer_7"), limits=limits))
    scene = replace(room, parts={**room.parts, "drawer_7": stuck})
    with pytest.raises(InputError, match=says):
        prepare(scene, "drawer_7", coarse())


@pytest.mark.parametrize("joint", [SLIDE, Joint("revolute", (0.0, 0.0, 1.0), (-0.05, 0.0, 0.0), (-0.3, 1.6))])
def test_the_way_of_a_part_is_covered_with_the_clearance_all_around(joint: Joint) -> None:
    way = sweep(cube(0.0, 0.6), joint, clearance=0.003)
    random = np.random.default_rng(0)
    for q in np.linspace(*joint.limits, 13):
        moved = displace(cube(0.0, 0.6).vertices, joint, q)
        for point in moved:
            away = random.normal(size=(20, 3))
            around = point + 0.0029 * away / np.linalg.norm(away, axis=1, keepdims=True)
            held = np.any([contains(piece, around, 1e-6) for piece in way], axis=0)
            assert held.all()
