"""Objects lifted out of the room: closed, weighed, set on what carries them, and staying there."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from cabinet_rooms import clean_cabinet_room
from settings import load

from s2a.certify.check_suite import CertifyConfig
from s2a.certify.physics import MujocoWorld, rest
from s2a.core.errors import InputError
from s2a.prepare.free_objects import free_object, free_objects
from s2a.prepare.room import PrepareConfig, prepare
from s2a.prepare.room_hulls import level_top
from s2a.scene.geometry.convex import APART, border, box, close, deepest, drop_small_components, loops
from s2a.scene.geometry.mesh_ops import keep, merge
from s2a.scene.geometry.mesh_query import first_hits, ray_mesh
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import SimRoom, in_scene

SIZE = np.array([0.2, 0.12, 0.16])
"""[m] of the carton on the table, whose top is at 0.74 m."""


def carton() -> Mesh:
    """Return a carton as a scan sees it: noisy, without underside and without the side at the wall, one hole in the top."""
    solid = trimesh.creation.box(extents=SIZE)
    for _ in range(4):
        solid = solid.subdivide()
    middle, across = solid.triangles_center, solid.face_normals
    hole = (np.linalg.norm(middle[:, :2], axis=1) < 0.02) & (across[:, 2] > 0.5)
    seen = (across[:, 2] > -0.5) & (across[:, 0] > -0.5) & ~hole
    noise = np.random.default_rng(0).normal(0.0, 0.0005, solid.vertices.shape)
    whole = Mesh(solid.vertices + noise + [0.5, 1.2, 0.74 + SIZE[2] / 2 + 0.001], solid.faces)
    return keep(whole, seen)


def room(**changes: Part) -> Scene:
    scene = clean_cabinet_room()
    return replace(scene, parts={**scene.parts, "box_20": Part("box", carton()), **changes})


def settings() -> PrepareConfig:
    found = load(PrepareConfig, "prepare/handle")
    furniture, around = (replace(one, resolution=3000) for one in (found.cabinet, found.room))
    return replace(found, cabinet=furniture, room=around, base=replace(found.base, search=False))


@pytest.fixture(scope="module")
def prepared() -> SimRoom:
    return prepare(room(), "drawer_7", settings(), ["box_20"])


def test_a_border_is_walked_in_closed_loops_that_use_each_edge_once() -> None:
    edges = border(carton().faces)
    found = loops(edges)
    walked = [(a, b) for loop in found for a, b in zip(loop, np.roll(loop, -1), strict=True)]
    assert sorted(walked) == sorted(map(tuple, edges.tolist()))
    assert len(found) == 2
    assert len(border(trimesh.creation.icosphere().faces)) == 0


def test_what_was_seen_from_some_sides_becomes_a_solid_of_its_true_volume() -> None:
    solid = close(carton(), 0.74, 0.03)
    assert len(border(solid.faces)) == 0
    assert solid.bounds[0, 2] == pytest.approx(0.74, abs=1e-6)
    volume = trimesh.Trimesh(solid.vertices, solid.faces, process=False).volume
    # The noise and the millimetre under the carton change it by a few per cent.
    assert volume == pytest.approx(SIZE.prod(), rel=0.03)


def test_a_crumb_is_left_out() -> None:
    crumb = trimesh.creation.icosphere(radius=0.004)
    crumb.apply_translation([0, 0, 2])
    both = trimesh.util.concatenate([trimesh.creation.box(extents=SIZE), crumb])
    assert len(drop_small_components(Mesh(both.vertices, both.faces), 0.02).faces) == 12


def test_the_object_leaves_the_room_and_stands_on_the_table(prepared: SimRoom) -> None:
    (body,) = prepared.free.values()
    assert body.id == "box_20" and "box_20" not in prepared.static_parts
    assert not any(collider.part == "box_20" for collider in prepared.static_colliders)
    tops = [c.mesh.bounds[1, 2] for c in prepared.static_colliders if c.part == "table_4"]
    assert max(tops) == pytest.approx(0.74, abs=2e-3)
    assert min(in_scene(body, c.mesh)[:, 2].min() for c in body.colliders) == pytest.approx(0.74, abs=1e-5)
    # 0.2 x 0.12 x 0.16 m at 250 kg/m^3
    assert body.mass.mass == pytest.approx(0.96, rel=0.05)
    assert body.position == pytest.approx([0.5, 1.2, 0.82], abs=0.005) and body.mass.center == (0.0, 0.0, 0.0)
    exact = np.sort(0.96 / 12 * (np.sum(SIZE**2) - SIZE**2))
    assert np.sort(body.mass.inertia) == pytest.approx(exact, rel=0.1)


def test_what_stood_though_most_of_its_underside_was_not_seen_stands_on_its_outline() -> None:
    half = carton()
    seen = half.vertices[half.faces].mean(axis=1)
    leaning = keep(half, (seen[:, 0] > 0.56) | (seen[:, 2] > 0.74 + 0.12))
    body = free_object(room(box_21=Part("box", leaning)), "box_21", settings().free).body
    feet = [collider.mesh for collider in body.colliders[:3]]
    # Any three points of the three feet have the centre of mass, the frame's origin, between them.
    random = np.random.default_rng(0)
    for _ in range(100):
        a, b, c = (random.dirichlet(np.ones(len(foot.vertices))) @ foot.vertices[:, :2] for foot in feet)
        turns = [float(q[0] * p[1] - q[1] * p[0]) for p, q in ((a, b), (b, c), (c, a))]
        assert min(turns) > 0 or max(turns) < 0
    outline = np.ptp(np.concatenate([foot.vertices for foot in feet]), axis=0)[:2]
    assert (outline > 0.7 * SIZE[:2]).all() and (outline < SIZE[:2] + 0.01).all()


def test_it_stays_where_it_is(prepared: SimRoom, tmp_path: Path) -> None:
    sim_stage.write(prepared, tmp_path / "sim.usd")
    config = load(CertifyConfig, "certify/default")
    world = MujocoWorld(tmp_path / "sim.usd", config.physics)
    assert "box_20" in " ".join(world.model.body_label)
    found = {check.name: check for check in rest(world, replace(config.motion, open_time=2.0))}
    assert found["rest_displacement"].status == found["self_opening"].status == "pass"


@pytest.mark.parametrize(
    ("part", "words"),
    [
        ("box_21", "box_20"),
        ("drawer_8", "a part of"),
        ("air_22", "no horizontal surface"),
        ("cabinet_23", "on a joint"),
    ],
)
def test_what_cannot_be_lifted_is_refused_in_a_sentence(part: str, words: str) -> None:
    floating = Mesh(carton().vertices + [0, 0, 0.5], carton().faces)
    drawer = clean_cabinet_room().parts["drawer_7"]
    more = {"air_22": Part("air", floating), "cabinet_23": Part("cabinet", carton())}
    more["drawer_24"] = replace(drawer, parent="cabinet_23")
    with pytest.raises(InputError, match=words):
        free_object(room(**more), part, settings().free)


def test_what_was_scanned_inside_out_weighs_what_its_hull_holds() -> None:
    turned = Mesh(carton().vertices, carton().faces[:, ::-1])
    body = free_object(room(box_21=Part("box", turned)), "box_21", settings().free).body
    assert body.mass.mass == pytest.approx(0.96, rel=0.05) and min(body.mass.inertia) > 0
    assert body.position == pytest.approx([0.5, 1.2, 0.82], abs=0.005)


def on_a_tray() -> Scene:
    """Return the room with a carton on the carton, and one on a tray, 2 cm above the table."""
    top = Mesh(carton().vertices + [0, 0, SIZE[2]], carton().faces)
    tray = box(np.array([0.5, 1.45, 0.75]), np.eye(3), np.array([0.3, 0.2, 0.02]))
    raised = Mesh(carton().vertices + [0, 0.25, 0.02], carton().faces)
    return room(box_21=Part("box", top), tray_22=Part("tray", tray), box_23=Part("box", raised))


def test_what_carries_an_object_hides_what_is_below() -> None:
    found = free_object(on_a_tray(), "box_23", settings().free)
    assert found.below == "tray_22"
    assert found.top.height == pytest.approx(0.76, abs=1e-5)
    assert free_object(on_a_tray(), "box_21", settings().free).below == "box_20"


def noisy(extent: float, rise: float = 0.0) -> Mesh:
    """Return a table's top as a scan sees it, `extent` [m] wide around the carton, which rises by `rise` [m] along x."""
    solid = trimesh.creation.box(extents=(extent, extent, 0.03))
    for _ in range(5):
        solid = solid.subdivide()
    points = solid.vertices + np.random.default_rng(1).normal(0.0, 0.0008, solid.vertices.shape)
    points[:, 2] += rise * points[:, 0] / extent
    return Mesh(points + [0.5, 1.2, 0.725], solid.faces)


@pytest.mark.slow
def test_a_level_support_is_flat_over_all_of_its_extent() -> None:
    scene = room(table_4=Part("table", noisy(0.8)))
    found = prepare(scene, "drawer_7", settings(), ["box_20"])
    x, y = (a.ravel() for a in np.meshgrid(np.linspace(0.12, 0.88, 40), np.linspace(0.82, 1.58, 40)))
    starts = np.c_[x, y, np.full(len(x), 0.78)]
    own = merge([c.mesh for c in found.static_colliders if c.part == "table_4"])
    falls = first_hits(ray_mesh(own.vertices, own.faces), starts, np.tile([0.0, 0.0, -1.0], (len(x), 1)))
    assert np.ptp(falls) < 1e-5
    # Half of the noise's faces lie above the height of the top, which is their median.
    assert 0.78 - falls[0] == pytest.approx(0.74, abs=5e-4)


def test_where_an_object_stands_does_not_depend_on_how_finely_it_is_meshed() -> None:
    foot = trimesh.creation.box(extents=(0.1, 0.1, 0.12))
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.05)
    foot.apply_translation([0.5, 1.2, 0.80])
    ball.apply_translation([0.5, 1.2, 0.90])
    both = trimesh.util.concatenate([foot, ball])
    found = free_object(room(cup_26=Part("cup", Mesh(both.vertices, both.faces))), "cup_26", settings().free)
    assert found.below == "table_4"
    assert found.bounds[0, 2] == pytest.approx(0.74, abs=2e-3)


def test_what_is_not_level_has_no_level_top() -> None:
    config = settings().free
    assert level_top("slab", noisy(0.8), 0.74, config.thickness, config.top) is not None
    assert level_top("slab", noisy(0.8, rise=0.02), 0.74, config.thickness, config.top) is None


def test_what_stands_on_something_that_moves_is_refused() -> None:
    scene = on_a_tray()
    with pytest.raises(InputError, match="box_21: it stands on 'box_20', which moves too"):
        free_objects(scene, ["box_21", "box_20"], ["drawer_7"], settings().free)
    tray = replace(clean_cabinet_room().parts["drawer_7"], mesh=scene.parts["tray_22"].mesh, parent=None)
    scene = replace(scene, parts={**scene.parts, "tray_22": tray})
    with pytest.raises(InputError, match="box_23: it stands on 'tray_22'"):
        free_objects(scene, ["box_23"], ["tray_22"], settings().free)


@pytest.mark.slow
def test_a_drawer_that_reaches_into_what_an_object_above_stands_on_slides_all_the_same() -> None:
    """A scanned front may reach above the underside of the top over it; on its way nothing of the room meets it."""
    front = box(np.array([0.56, 1.2, 0.66]), np.eye(3), np.array([0.02, 0.2, 0.123]))
    grip = box(np.array([0.60, 1.2, 0.65]), np.eye(3), np.array([0.02, 0.1, 0.02]))
    slide = Joint("prismatic", (1.0, 0.0, 0.0), (0.56, 1.2, 0.66), (0.0, 0.3))
    more = {
        "drawer_30": Part("drawer", front, "table_4", slide),
        "handle_31": Part("handle", grip, "drawer_30", "fixed", True),
    }
    found = prepare(room(table_4=Part("table", noisy(0.8, rise=0.02)), **more), "drawer_30", settings(), ["box_20"])
    hulls = [collider.mesh for collider in found.bodies["drawer_30"].colliders]
    assert deepest(hulls, [collider.mesh for collider in found.static_colliders], slide) <= APART
    tops = [c.mesh.bounds for c in found.static_colliders if c.part == "table_4"]
    assert max(top[1, 2] for top in tops) == pytest.approx(
        min(in_scene(b, c.mesh)[:, 2].min() for b in found.free.values() for c in b.colliders), abs=1e-5
    )


def test_what_is_large_holds_air() -> None:
    small, large = (
        Mesh(
            box(np.zeros(3), np.eye(3), np.full(3, side)).vertices + [0.5, 1.2, 0.74 + side / 2],
            box(np.zeros(3), np.eye(3), np.full(3, side)).faces,
        )
        for side in (0.1, 0.4)
    )
    mass = {
        s: free_object(room(box_21=Part("crate", m)), "box_21", settings().free).body.mass.mass
        for s, m in (("s", small), ("l", large))
    }
    assert mass["s"] == pytest.approx(0.25, rel=0.05)
    # 64 l weigh a quarter of what a solid of that size would: 16 kg, of 4 l 1 kg; in between as the root.
    assert mass["l"] == pytest.approx(250 * 0.064 * (0.004 / 0.064) ** 0.5, rel=0.05)


def test_a_free_object_needs_no_part_that_moves() -> None:
    still = {i: replace(part, motion="fixed") for i, part in room().parts.items()}
    made = prepare(Scene("room", still), "all", settings(), ["box_20"])
    assert list(made.free) == ["box_20"] and not made.articulations
