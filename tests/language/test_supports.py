"""What counts as a support: no door's edge, no thin thing, and a floor among furniture is no basin."""

from __future__ import annotations

import numpy as np
from rough_furniture import at, block, frame, sheet, walls

from s2a.language.insert.supports import is_basin, target_regions
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.regions import RegionConfig
from s2a.scene.scene import Joint, Mesh, Part, Scene

REGIONS = RegionConfig()
HINGE = Joint("revolute", (0.0, 0.0, 1.0), (0.5, 0.2, 0.0), (0.0, 1.5))


def test_the_top_of_a_door_carries_nothing() -> None:
    body = at(block(1.0, 0.4, 1.0), 0.0, 0.0, 0.0)
    door = at(block(1.0, 0.12, 1.2), 0.0, -0.3, 0.0)
    parts = {"cabinet_1": Part("cabinet", body), "door_2": Part("door", door, "cabinet_1", HINGE)}
    heights = [region.height for region in target_regions(Scene("room", parts), "cabinet_1", REGIONS, ("horizontal",))]
    assert heights
    assert max(heights) < 1.05


def test_a_thin_thing_takes_its_place_and_the_floor_below_is_none() -> None:
    top = sheet((-0.5, 0.5), (-0.4, 0.4), 0.7)
    paper = at(block(0.3, 0.2, 0.003), 0.0, 0.0, 0.701)
    bare = Scene("room", {"table_1": Part("table", top)})
    laid = Scene("room", {**bare.parts, "paper_2": Part("paper", paper)})
    free = [target_regions(scene, "table_1", REGIONS, ("horizontal",))[0].free_area for scene in (bare, laid)]
    # 0.3 x 0.2 m, and its border on a grid of 1 cm.
    assert 0.05 < free[0] - free[1] < 0.08
    # The floor below a table is no place on it, though its label goes down there.
    under = sheet((-0.5, 0.5), (-0.4, 0.4), 0.01)
    boxed = Scene("room", {"table_1": Part("table", merge([top, under])), "floor_2": Part("floor", under)})
    (level,) = target_regions(boxed, "table_1", REGIONS, ("horizontal",))
    assert abs(level.height - 0.7) < 0.01


def tray(width: float) -> Scene:
    """A level surface with a rim all around."""
    half = width / 2
    whole = merge([sheet((-half, half), (-half, half), 0.0), walls(half, 0.012, 0.1), frame(half + 0.03, half, 0.1)])
    return Scene("room", {"floor_1": Part("floor", whole)})


def test_a_walled_floor_is_no_basin_and_a_tub_is_one() -> None:
    for width, basin in ((0.6, True), (2.0, False)):
        regions = target_regions(tray(width), "floor_1", REGIONS, ("horizontal",))
        largest = max(regions, key=lambda region: region.area)
        assert largest.rim_fraction > 0.5
        assert is_basin(largest) is basin


def test_a_seat_with_waves_carries_between_its_arms_and_not_on_its_back() -> None:
    seat = sheet((-0.9, 0.9), (-0.3, 0.3), 0.45, 0.02)
    waves = 0.02 * np.sin(9 * seat.vertices[:, 0]) * np.sin(11 * seat.vertices[:, 1])
    seat = Mesh(seat.vertices + np.stack([0 * waves, 0 * waves, waves], axis=1), seat.faces)
    back = sheet((-0.9, 0.9), (0.32, 0.62), 0.85)
    parts = {label: Part(label, merge([seat, back])) for label in ("couch", "counter")}
    scene = Scene("room", parts | {"floor": Part("floor", sheet((-2, 2), (-2, 2), 0.0, 0.1))})
    (region, *rest) = target_regions(scene, "couch", REGIONS, ("horizontal",))
    # 1.8 x 0.6 m, carried by its waves' tops; a level support of this noise is in pieces, and has its back as another one.
    assert region.area > 0.9
    assert 0.45 < region.height < 0.475
    assert all(one.height < 0.6 for one in rest)
    # A patch of the floor below a bed is not its mattress, whatever is below the floor.
    patch = Part("bed", merge([seat, sheet((-0.9, 0.9), (-0.5, 0.5), 0.0)]))
    pit = Scene("room", scene.parts | {"bed": patch, "box": Part("box", sheet((3, 3.2), (0, 0.2), -1.0))})
    beds = target_regions(pit, "bed", REGIONS, ("horizontal",))
    assert max(one.height for one in beds) > 0.4
    level = target_regions(scene, "counter", REGIONS, ("horizontal",))
    assert max((one.area for one in level if one.height < 0.6), default=0.0) < 0.6
    assert any(one.height > 0.8 for one in level)
