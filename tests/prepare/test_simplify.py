"""Fewer faces for the immovable room, and how far its surface moved."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from cabinet_rooms import clean_cabinet_room
from only_part import moving
from pxr import Usd, UsdGeom
from scipy.spatial import cKDTree
from settings import load

from s2a.prepare.room import PrepareConfig, prepare
from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import centroids, keep, merge
from s2a.scene.geometry.simplify import DecimateConfig, Decimated, decimate, decimate_room, deviation
from s2a.scene.scene import Mesh, Part, Scene
from s2a.scene.usd import sim_stage

SIDE = 60
"""Cells along a sheet of 1.2 m."""


def sheet(
    height: float, color: tuple[int, int, int], noise: float = 0.001, start: float = 0.0, side: int = SIDE
) -> Mesh:
    """Return a rough square sheet of 20 mm cells whose lower corner lies at x = start [m]."""
    steps = np.arange(side + 1) * 0.02
    x, y = np.meshgrid(start + steps, steps, indexing="ij")
    z = height + noise * np.random.default_rng(0).standard_normal(x.shape)
    corner = np.arange((side + 1) ** 2).reshape(side + 1, -1)
    a, b, c, d = corner[:-1, :-1], corner[1:, :-1], corner[1:, 1:], corner[:-1, 1:]
    faces = np.stack([a, b, c, a, c, d], axis=-1).reshape(-1, 3)
    vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    return Mesh(vertices, faces, np.tile(np.uint8(color), (len(vertices), 1)))


ROOM = Scene(
    "sheets",
    {
        "floor_1": Part("floor", sheet(0.0, (10, 10, 10))),
        "table_2": Part("table", sheet(0.7, (200, 0, 0))),
        "desk_3": Part("desk", sheet(0.7, (0, 0, 200), start=1.3)),
    },
)


def config(**changes: object) -> DecimateConfig:
    return replace(load(PrepareConfig, "prepare/handle").decimate, **changes)


@cache
def decimated(mode: str = "ratio") -> Decimated:
    return decimate_room(ROOM, tuple(ROOM.parts), config(mode=mode))


def open_edges(mesh: Mesh) -> np.ndarray:
    """Return the ends of the open edges [m], shape [edge 2 3]."""
    edges = np.sort(mesh.faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    found, uses = np.unique(edges, axis=0, return_counts=True)
    return mesh.vertices[found[uses == 1]].astype(np.float64)


def along(edges: np.ndarray) -> np.ndarray:
    """Return points on edges [m], 2 mm apart or less, shape [point 3]."""
    return np.concatenate([np.linspace(a, b, 2 + int(500 * np.linalg.norm(b - a))) for a, b in edges])


def test_the_shares_are_reached_within_one_percent() -> None:
    faces = 2 * SIDE**2
    found = {r.group: r for r in decimated().reductions}
    assert found["structure"].before == faces and found["other"].before == 2 * faces
    assert found["structure"].after == pytest.approx(0.1 * faces, rel=0.01)
    assert found["other"].after == pytest.approx(0.3 * 2 * faces, rel=0.01)
    assert all(r.reached for r in found.values())
    assert len(decimated().mesh.faces) == sum(r.after for r in found.values())


def test_open_borders_stay_where_they_are_with_fewer_vertices() -> None:
    before = np.concatenate([open_edges(part.mesh) for part in ROOM.parts.values()])
    after = open_edges(decimated().mesh)
    assert len(after) < 0.9 * len(before)
    # The sheets are rough by 1 mm (at most 4), so a border that is straight in plan runs up and down by as much.
    for one, other in ((before, after), (after, before)):
        assert cKDTree(along(one)).query(along(other))[0].max() < 0.005


def test_flat_scraps_leave_their_faces_to_the_surface_that_needs_them() -> None:
    # Half of the faces lie in flat scraps of 4 x 4 cells, with 16 of 25 vertices on an open border; 2 faces each would do.
    scraps = [sheet(1.0, (0, 0, 0), noise=0.0, start=2.0 + 0.1 * k, side=4) for k in range(SIDE**2 // 16)]
    flat = sheet(0.0, (0, 0, 0), noise=0.0)
    # The other half is wavy, by 10 mm over 0.2 m. Flat faces that span h miss curves of c = 0.01 (2 pi / 0.2)^2 = 10 / m by
    # c h^2 / 8: 0.5 mm with all cells, 0.9 mm with the 54 % left if the scraps get 2 faces each. With their borders
    # frozen they would keep 14 each, which leaves 16 % and 3 mm.
    wave = 0.01 * np.prod(np.sin(10 * np.pi * flat.vertices[:, :2]), axis=1)
    wavy = Mesh(flat.vertices + wave[:, None] * [0, 0, 1], flat.faces)
    less = decimate(merge([wavy, *scraps]), 0.3, config().aggressiveness)
    assert len(less.faces) == pytest.approx(0.3 * 4 * SIDE**2, rel=0.01)
    low = keep(less, centroids(less)[:, 2] < 0.5)
    assert deviation(wavy, low, 20000).p99 < 0.002


def test_holes_keep_their_size() -> None:
    cells = sheet(0.0, (0, 0, 0), noise=0.0)
    hole = np.abs(centroids(cells)[:, :2] - 0.6).max(axis=1) < 0.3
    whole = keep(cells, ~hole)
    less = decimate(whole, 0.1, config().aggressiveness)
    assert less.face_areas.sum() == pytest.approx(whole.face_areas.sum(), rel=1e-3)
    assert deviation(whole, less, 20000).max < 0.001


def test_no_fin_is_left_standing() -> None:
    # A fin stands upright on an open edge while the edges collapse, 12 mm high here.
    for ratio in (0.05, 0.3, 0.9):
        for aggressiveness in (3.0, 5.0, 12.0):
            assert np.ptp(decimate(sheet(0.0, (0, 0, 0), noise=0.0), ratio, aggressiveness).vertices[:, 2]) < 1e-6


@pytest.mark.parametrize("mode", ["ratio", "none"])
def test_each_face_keeps_its_part_and_its_color(mode: str) -> None:
    found = decimated(mode)
    middle = centroids(found.mesh)
    expected = np.where(middle[:, 2] < 0.3, 0, np.where(middle[:, 0] < 1.25, 1, 2))
    assert (found.face_part == expected).all()
    colors = found.mesh.colors[found.mesh.faces[:, 0]]
    assert (colors == np.array([(10, 10, 10), (200, 0, 0), (0, 0, 200)])[expected]).all()


def test_two_parallel_sheets_are_as_far_apart_as_they_are() -> None:
    a, b = sheet(0.0, (0, 0, 0), noise=0.0), sheet(0.003, (0, 0, 0), noise=0.0)
    found = deviation(a, b, 1000)
    assert (found.mean, found.p99, found.max) == pytest.approx((0.003,) * 3, abs=1e-6)


def test_a_surface_that_is_missing_counts_though_what_is_left_is_exact() -> None:
    whole = sheet(0.0, (0, 0, 0), noise=0.0)
    half = Mesh(whole.vertices, whole.faces[: SIDE**2])
    # Half of the sheet is missing; its farthest points are 0.6 m away.
    for pair in ((whole, half), (half, whole)):
        assert deviation(*pair, 4000).max == pytest.approx(0.6, abs=0.01)


def test_a_surface_is_infinitely_far_from_none() -> None:
    none = Mesh(np.empty((0, 3)), np.empty((0, 3)))
    assert deviation(sheet(0.0, (0, 0, 0)), none, 10).mean == deviation(none, sheet(0.0, (0, 0, 0)), 10).max == np.inf
    assert deviation(none, none, 10).max == 0.0


def test_what_would_vanish_stays_as_it_is() -> None:
    crate = Scene("crate", {"crate_1": Part("crate", box(np.zeros(3), np.eye(3), np.ones(3)))})
    found = decimate_room(crate, ("crate_1",), config(other=0.1))
    assert len(found.mesh.faces) == 12 and not found.reductions[0].reached
    # However far the surface may move, some of it has to be left.
    found = decimate_room(crate, ("crate_1",), config(mode="error", max_error=5.0))
    assert 0 < len(found.mesh.faces) < 12 and found.reductions[0].p99 < 5.0


def test_the_stated_error_is_that_of_the_surfaces() -> None:
    found, whole = decimated(), decimated("none")
    structure = next(r for r in found.reductions if r.group == "structure")
    floors = [Mesh(m.mesh.vertices, m.mesh.faces[m.face_part == 0]) for m in (whole, found)]
    again = deviation(*floors, 50000, seed=1)
    assert structure.mean == pytest.approx(again.mean, rel=0.05)
    assert structure.p99 == pytest.approx(again.p99, rel=0.05)
    assert 0.0 < structure.mean < structure.p99 < structure.max < 0.01


def test_no_decimation_changes_nothing() -> None:
    assert len(decimated("none").mesh.faces) == sum(len(part.mesh.faces) for part in ROOM.parts.values())
    assert [(r.before, r.max) for r in decimated("none").reductions] == [(2 * SIDE**2, 0.0), (4 * SIDE**2, 0.0)]


@pytest.mark.slow
def test_a_bound_on_the_error_is_kept_with_as_few_faces_as_it_allows() -> None:
    loose, tight = (decimate_room(ROOM, ("floor_1",), config(mode="error", max_error=e)) for e in (0.0015, 0.0005))
    assert loose.reductions[0].p99 <= 0.0015 and tight.reductions[0].p99 <= 0.0005
    assert loose.reductions[0].after < tight.reductions[0].after < 2 * SIDE**2


@pytest.mark.slow
def test_what_the_robot_moves_keeps_every_face_and_the_stage_says_what_the_room_lost(tmp_path: Path) -> None:
    room = clean_cabinet_room()
    settings = load(PrepareConfig, "prepare/handle")
    coarse = replace(settings, cabinet=replace(settings.cabinet, resolution=3000))
    scene = prepare(
        Scene("more", {**room.parts, **ROOM.parts}),
        "drawer_7",
        replace(coarse, room=replace(settings.room, part_hulls=1)),
    )
    members = ("drawer_7", "handle_11")
    assert len(moving(scene).visual.faces) == sum(len(room.parts[i].mesh.faces) for i in members)
    sim_stage.write(scene, tmp_path / "sim.usda")
    stage = Usd.Stage.Open(str(tmp_path / "sim.usda"))
    static = stage.GetPrimAtPath("/scene/static")
    structure = next(r for r in scene.reductions if r.group == "structure")
    assert static.GetAttribute("s2a:structure:facesAfter").Get() == structure.after
    assert static.GetAttribute("s2a:structure:errorP99").Get() == structure.p99
    assert sim_stage.read(tmp_path / "sim.usda").reductions == scene.reductions
    visual = stage.GetPrimAtPath("/scene/static/visual")
    part = UsdGeom.PrimvarsAPI(visual).GetPrimvar("s2a:part").Get()
    names = [visual.GetAttribute("s2a:parts").Get()[k] for k in part]
    assert len(names) == len(scene.static_visual.faces)
    assert set(names) == {"wall_1", "floor_2", "table_4", "floor_1", "table_2", "desk_3"}
