"""What is kept of a room from one object to the next, and short cuts that must not change what is found."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest
from rough_furniture import at, block, sheet, table

from s2a.core.errors import InputError
from s2a.language.insert import describe
from s2a.language.insert.describe import RoomState
from s2a.language.insert.fit import NoRoom, SweptVolume, heights_within
from s2a.language.insert.rules import _choices, known
from s2a.language.insert.settings import Inserted
from s2a.language.insert.supports import SurfaceConfig, facing, target_regions
from s2a.scene.geometry.convex import halfspaces, hull
from s2a.scene.geometry.mesh_ops import merge, within
from s2a.scene.geometry.occupancy import distinct_cells
from s2a.scene.geometry.regions import Region, RegionConfig
from s2a.scene.scene import Mesh, Part, Scene

SURFACE = SurfaceConfig("regions")


REGIONS = SURFACE.regions


def inserted(name: str, mesh: Mesh, target: str) -> Inserted:
    """Return as much of an insertion as a room looks at."""
    said = {"placement": SimpleNamespace(part_id=name), "candidate": SimpleNamespace(target=target)}
    return cast(Inserted, SimpleNamespace(**said, part=Part("thing", mesh)))


def described(regions: list[Region]) -> list[tuple[Any, ...]]:
    return [(one.kind, one.area, one.free_area, one.clearance, one.free.tobytes()) for one in regions]


def test_what_parts_carry_is_kept_and_grown_again_where_a_thing_takes_room() -> None:
    shelf = Part("shelf", at(sheet((0, 1.2), (0, 0.6), 0.0), 0.0, 0.0, 1.4))
    room = RoomState(Scene("room", {**table().parts, "shelf_4": shelf}), "", SURFACE)
    before = {name: room.levels(name) for name in room.scene.parts}
    assert room.levels("table_2") is room.supports["table_2"]
    # It hangs from the shelf, so to say, and takes room over the table and the floor.
    room.add(inserted("lamp_5", at(block(0.3, 0.2, 0.3), 0.8, 0.3, 1.0), "shelf_4"))
    for name in room.scene.parts:
        fresh = target_regions(room.scene, name, REGIONS, ("horizontal", "inside"))
        assert described(room.levels(name)) == described(fresh)
    assert described(room.levels("table_2")) != described(before["table_2"])
    assert room.levels("crate_3") is before["crate_3"]  # which is to the left of it


def test_what_an_object_changes_is_looked_at_when_the_next_one_comes(monkeypatch: pytest.MonkeyPatch) -> None:
    room, asked, survey = RoomState(table(), "", SURFACE), [], describe.survey

    def counted(scene: Scene, config: RegionConfig, names: tuple[str, ...]) -> describe.Supports:
        asked.append(names)
        return survey(scene, config, names)

    monkeypatch.setattr(describe, "survey", counted)
    room.add(inserted("cup_4", at(block(0.1, 0.1, 0.1), 0.8, 0.3, 0.743), "table_2"))
    assert "cup_4" in room.scene.parts and not asked
    assert "cup_4" in [line["id"] for line in room.lines]
    assert asked == [("table_2", "cup_4")]
    assert "cup_4" in room.supports and asked == [("table_2", "cup_4")]


def test_what_has_no_level_surface_carries_nothing() -> None:
    wall = Mesh(np.array([[0, 0, 0], [0, 2, 0], [0, 2, 2], [0, 0, 2]]), np.array([[0, 1, 2], [0, 2, 3]]))
    room = RoomState(Scene("room", {"wall_1": Part("wall", wall)}), "", SURFACE)
    with pytest.raises(NoRoom, match="looks upwards"):
        room.levels("wall_1")
    with pytest.raises(InputError, match="wall_1"):
        room.levels("wall_2")


def test_triangles_within_a_box_are_those_whose_boxes_meet_it() -> None:
    random = np.random.default_rng(0)
    mesh = Mesh(random.random((300, 3)), random.integers(0, 300, (400, 3)))
    low, high = np.array([0.4, 0.45, 0.5]), np.array([0.5, 0.5, 0.7])
    corners = mesh.vertices[mesh.faces]
    meet = ((corners.max(axis=1) >= low) & (corners.min(axis=1) <= high)).all(axis=1)
    found = within(mesh, low, high)
    assert 0 < meet.sum() < 400
    assert np.array_equal(found.vertices[found.faces], corners[meet])


def test_a_line_is_inside_a_way_between_the_heights_that_are_told() -> None:
    random = np.random.default_rng(0)
    piece = hull(random.normal(size=(40, 3)))
    assert piece is not None
    planes, normal = halfspaces(piece), np.array([0.02, -0.01, 1.0])
    volume, places = SweptVolume("door_1", piece, planes), random.uniform(-2.5, 2.5, (200, 3)) * [1, 1, 0]
    first, last = heights_within(volume, places, normal)
    crosses = first < last
    assert 20 < crosses.sum() < 180
    for height in np.linspace(-3, 3, 61):
        inside = ((places + height * normal) @ planes[:, :3].T + planes[:, 3] < 0).all(axis=1)
        clear = np.minimum(np.abs(height - first), np.abs(height - last)) > 1e-9
        assert np.array_equal(inside[clear], (crosses & (first < height) & (height < last))[clear])


def test_distinct_cells_come_in_order() -> None:
    cells = np.random.default_rng(0).integers(-5, 9, (300, 2))
    assert np.array_equal(distinct_cells(cells), np.unique(cells, axis=0))
    assert len(distinct_cells(cells[:0])) == 0


def test_a_shelf_faces_where_its_own_boards_leave_the_view_open() -> None:
    back = Mesh(np.array([[0, 0, 0], [1, 0, 0], [1, 0, 1], [0, 0, 1]]), np.array([[0, 1, 2], [0, 2, 3]]))
    sides = [at(block(0.02, 0.3, 1.0), x, 0.15, 0.0) for x in (0.0, 1.0)]
    board = sheet((0, 1), (0, 0.3), 0.3)
    wall = Mesh(back.vertices * [9, 1, 3] - [4, 3, 0], back.faces)
    parts = {"shelf_1": Part("shelf", board), "wall_5": Part("wall", wall)}
    parts |= {f"side_{n}": Part("side", mesh, "shelf_1") for n, mesh in enumerate((back, *sides), start=2)}
    scene = Scene("room", parts)
    region = target_regions(scene, "shelf_1", REGIONS, ("horizontal",))[0]
    # The middle of the room is behind its back, where its own back is in the way.
    assert facing(scene, "shelf_1", region) == pytest.approx([0, 1, 0], abs=0.02)


def test_a_room_without_labels_offers_a_table_by_its_height() -> None:
    mesh = merge(
        [sheet((-2, 3), (-2, 2.6), 0.0, 0.05), sheet((0, 1.2), (0, 0.6), 0.74), sheet((2, 2.6), (2, 2.5), 0.42)]
    )
    scene = Scene("room", {"unannotated_1": Part("unannotated", mesh)})
    supports = describe.survey(scene, RegionConfig())
    (line,) = describe.describe(scene, supports)
    assert {support["like"]: support["height"] for support in line["supports"]} == {
        "floor-like": 0.0, "table-like": 0.74, "seat-like": 0.42,
    }  # fmt: skip
    # What stands for a table in wishes is as large as its top, and not as the room.
    top = RoomState(scene, "", SURFACE).named.parts["unannotated_1.table"].mesh
    np.testing.assert_allclose(top.bounds, [(0, 0, 0.74), (1.2, 0.6, 0.74)], atol=0.01)
    mug = known("mug")
    assert mug is not None
    (choice, *_) = _choices([line], mug, 0.1)
    assert (choice["target"], choice["height"]) == ("unannotated_1", 0.74)
    # A table top alone is no floor: 0.74 m above the lowest point of its leg.
    alone = {"unannotated_1": Part("unannotated", merge([sheet((0, 1.2), (0, 0.6), 0.74), block(0.02, 0.02, 0.4)]))}
    (line,) = describe.describe(Scene("room", alone), describe.survey(Scene("room", alone), RegionConfig()))
    assert line["supports"][0]["like"] == "table-like"
    # A low thing that the capture calls a table is a coffee table.
    low = Scene("room", {"floor_1": Part("floor", sheet((-2, 3), (-2, 2.6), 0.0, 0.05)),
                         "table_2": Part("table", sheet((0, 1.2), (0, 0.6), 0.45))})  # fmt: skip
    assert "table_2.coffee table" in RoomState(low, "", SURFACE).named.parts
    # One with a lower shelf is not.
    shelved = merge([sheet((0, 1.2), (0, 0.6), 0.45), sheet((0, 1.2), (0, 0.6), 0.74)])
    high = Scene("room", {**low.parts, "table_2": Part("table", shelved)})
    assert "table_2.coffee table" not in RoomState(high, "", SURFACE).named.parts
    # Where the room names a table, that is meant.
    named = Scene("room", {"table_2": Part("table", sheet((0, 1.2), (-1.6, -1.0), 0.70)), **scene.parts})
    lines = describe.describe(named, describe.survey(named, RegionConfig()))
    assert _choices(lines, mug, 0.1)[0]["target"] == "table_2"
