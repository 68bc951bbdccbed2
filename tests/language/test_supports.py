"""What counts as a support: no door's edge, no thin thing, and a floor among furniture is no basin."""

from __future__ import annotations

from rough_furniture import at, block, frame, sheet, walls

from s2a.language.insert.supports import is_basin, target_regions
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.regions import RegionConfig
from s2a.scene.scene import Joint, Part, Scene

REGIONS = RegionConfig()
HINGE = Joint("revolute", (0.0, 0.0, 1.0), (0.5, 0.2, 0.0), (0.0, 1.5))


def test_the_top_of_a_door_carries_nothing() -> None:
    body = at(block(1.0, 0.4, 1.0), 0.0, 0.0, 0.0)
    door = at(block(1.0, 0.12, 1.2), 0.0, -0.3, 0.0)
    parts = {"cabinet_1": Part("cabinet", body), "door_2": Part("door", door, "cabinet_1", HINGE)}
    heights = [region.height for region in target_regions(Scene("room", parts), "cabinet_1", REGIONS, ("horizontal",))]
    assert heights
    assert max(heights) < 1.05


def test_a_thin_thing_takes_its_place() -> None:
    top = sheet((-0.5, 0.5), (-0.4, 0.4), 0.7)
    paper = at(block(0.3, 0.2, 0.003), 0.0, 0.0, 0.701)
    bare = Scene("room", {"table_1": Part("table", top)})
    laid = Scene("room", {**bare.parts, "paper_2": Part("paper", paper)})
    free = [target_regions(scene, "table_1", REGIONS, ("horizontal",))[0].free_area for scene in (bare, laid)]
    # 0.3 x 0.2 m, and its border on a grid of 1 cm.
    assert 0.05 < free[0] - free[1] < 0.08


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
