"""The box behind a scanned drawer front."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from only_part import cabinet, moving, part
from pxr import Usd
from scanned_drawers import scanned_drawer
from settings import load

from s2a.prepare.grasp import find_target
from s2a.prepare.mass import cabinet_walls, drawer_box
from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import centroids, keep, merge, normals
from s2a.scene.scene import Joint, Mesh, Scene
from s2a.scene.usd import sim_stage


def test_the_box_is_as_deep_as_the_drawer_opens_and_open_at_the_top() -> None:
    bottom, back, *sides = drawer_box(find_target(scanned_drawer(), "drawer_7"))
    low, high = merge([bottom, back, *sides]).bounds
    # The front lies at x = 0 and is 0.7588 m wide; the joint's range is 0.4 m.
    assert high[0] - low[0] == pytest.approx(0.4, abs=0.005)
    assert high[0] == pytest.approx(-0.02, abs=0.006)
    assert high[1] - low[1] == pytest.approx(0.7588 - 0.03, abs=0.01)
    assert bottom.bounds[1, 2] < sides[0].bounds[1, 2] - 0.05
    assert back.bounds[1, 0] < low[0] + 0.01


def test_the_box_ends_inside_the_cabinet() -> None:
    room = clean_cabinet_room()
    drawer = room.parts["drawer_7"]
    far = Joint("prismatic", (1.0, 0.0, 0.0), drawer.motion.origin, (0.0, 2.0))
    scene = replace(room, parts={**room.parts, "drawer_7": replace(drawer, motion=far)})
    for piece in drawer_box(find_target(scene, "drawer_7")):
        assert piece.bounds[0, 0] > room.parts["cabinet_3"].mesh.bounds[0, 0]


@pytest.mark.parametrize(("scanned", "depth"), [(0.1, 0.4), (0.3, 0.3 - 0.006 - 0.02)])
def test_a_cabinet_scanned_as_a_frame_does_not_end_the_box(scanned: float, depth: float) -> None:
    scene = scanned_drawer()
    back = box(np.array([-scanned / 2, 0.0, 0.73]), np.eye(3), np.array([scanned, 0.8, 0.3]))
    shallow = replace(scene, parts={**scene.parts, "cabinet_3": replace(scene.parts["cabinet_3"], mesh=back)})
    low, high = merge(drawer_box(find_target(shallow, "drawer_7"))).bounds
    assert high[0] - low[0] == pytest.approx(depth, abs=0.01)


def test_a_door_gets_none() -> None:
    assert drawer_box(find_target(clean_cabinet_room(), "door_5")) == []


@pytest.mark.parametrize("faces", [np.empty((0, 3)), np.array([[0, 0, 1]])])
def test_without_a_scanned_surface_nothing_is_added(faces: np.ndarray) -> None:
    room = clean_cabinet_room()
    none = Mesh(np.array([[0.3, -0.3, 0.7], [0.3, 0.3, 0.7]])[: 2 * len(faces)], faces)
    bare = {i: replace(room.parts[i], mesh=none) for i in ("drawer_7", "cabinet_3")}
    scene = replace(room, parts={**room.parts, **bare})
    assert (
        drawer_box(find_target(scene, "drawer_7"))
        == cabinet_walls(surface(scene, ["cabinet_3"]), find_target(scene, "drawer_7"))
        == []
    )


@pytest.mark.slow
def test_it_is_added_to_looks_and_colliders_on_request_and_told() -> None:
    settings = load(PrepareConfig, "prepare/handle")
    settings = replace(settings, base=replace(settings.base, search=False))
    without, with_box = (
        prepare(scanned_drawer(), "drawer_7", replace(settings, interior=chosen)) for chosen in (False, True)
    )
    assert len(moving(with_box).colliders) == len(moving(without).colliders) + 4
    assert np.ptp(moving(with_box).visual.bounds[:, 0]) > np.ptp(moving(without).visual.bounds[:, 0]) + 0.2
    assert any("box" in note for note in part(with_box).notes)
    assert not any("box" in note for note in part(without).notes)


def shallow_scan() -> Scene:
    """Return the cabinet as seen from its front: no side, no back."""
    room = clean_cabinet_room()
    cabinet = room.parts["cabinet_3"]
    at, across = centroids(cabinet.mesh), normals(cabinet.mesh)
    seen = (np.abs(across[:, 1]) < 0.5) & (at[:, 0] > cabinet.mesh.bounds[0, 0] + 0.03)
    return replace(room, parts={**room.parts, "cabinet_3": replace(cabinet, mesh=keep(cabinet.mesh, seen))})


def furniture(scene: Scene) -> list[str]:
    moving = ("drawer_7", *scene.descendants("drawer_7"))
    return [i for i in ("cabinet_3", *scene.descendants("cabinet_3")) if i not in moving]


def surface(scene: Scene, parts: list[str]) -> Mesh:
    return merge([scene.parts[i].mesh for i in parts])


def test_sides_and_back_that_were_not_seen_are_added_inside_the_furniture() -> None:
    scene = shallow_scan()
    walls = cabinet_walls(surface(scene, furniture(scene)), find_target(scene, "drawer_7"))
    assert len(walls) == 3
    low, high = merge([scene.parts[i].mesh for i in furniture(scene)]).bounds
    found = merge(walls).bounds
    assert (found[0] >= low - 1e-3).all() and (found[1] <= high + 1e-3).all()
    assert np.diff(found, axis=0)[0, :2] == pytest.approx((high - low)[:2], abs=0.04)


def test_walls_that_were_scanned_are_not_added_again() -> None:
    scene = clean_cabinet_room()
    assert cabinet_walls(surface(scene, furniture(scene)), find_target(scene, "drawer_7")) == []


def test_the_frame_of_a_door_stays_open() -> None:
    scene = shallow_scan()
    flat = Mesh(scene.parts["cabinet_3"].mesh.vertices * [0.1, 1, 1], scene.parts["cabinet_3"].mesh.faces)
    scene = replace(scene, parts={**scene.parts, "cabinet_3": replace(scene.parts["cabinet_3"], mesh=flat)})
    assert cabinet_walls(surface(scene, ["cabinet_3"]), find_target(scene, "drawer_7")) == []


@pytest.mark.slow
def test_added_walls_are_marked_in_the_stage_and_told(tmp_path: Path) -> None:
    settings = load(PrepareConfig, "prepare/handle")
    settings = replace(settings, interior=True, base=replace(settings.base, search=False))
    scene = prepare(shallow_scan(), "drawer_7", settings)
    assert cabinet(scene).completed == 3 * 12
    assert any("back and sides" in note for note in scene.notes)
    sim_stage.write(scene, tmp_path / "sim.usda")
    stage = Usd.Stage.Open(str(tmp_path / "sim.usda"))
    flag = np.array(stage.GetPrimAtPath("/scene/cabinet_3/visual").GetAttribute("primvars:s2a:completed").Get())
    assert flag.sum() == 36 and flag[-36:].all()
