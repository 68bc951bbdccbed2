"""Support regions of made-up furniture, scanned roughly."""

from __future__ import annotations

import numpy as np
import pytest
from rough_furniture import sheet, sink

from s2a.scene.geometry.convex import box
from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.geometry.planes import RansacConfig, ransac_plane
from s2a.scene.geometry.regions import Region, RegionConfig, support_regions
from s2a.scene.scene import Mesh, Scene

CONFIG = RegionConfig()


def level(regions: list[Region]) -> list[Region]:
    return [region for region in regions if region.kind != "vertical"]


def test_a_table_is_one_region_of_its_size_and_height() -> None:
    (region,) = support_regions(sheet((0, 1.2), (0, 0.6), 0.74), CONFIG)
    assert region.kind == "horizontal"
    assert region.height == pytest.approx(0.74, abs=0.001)
    assert region.area == pytest.approx(1.2 * 0.6, rel=0.04)
    assert region.free_area == pytest.approx(region.area)
    assert sorted(region.size) == pytest.approx([0.6, 1.2], abs=0.03)
    assert region.outline[:, :2].min(axis=0) == pytest.approx([0, 0], abs=0.02)
    assert region.outline[:, :2].max(axis=0) == pytest.approx([1.2, 0.6], abs=0.02)


def test_basin_rim_and_counter_of_a_sink_are_three_regions() -> None:
    found = level(support_regions(sink(), CONFIG))
    assert [round(region.height, 2) for region in sorted(found, key=lambda region: region.height)] == [0.70, 0.85, 0.86]
    basin, counter, rim = sorted(found, key=lambda region: region.height)
    assert basin.area == pytest.approx(0.16, rel=0.1)
    # Cells at a border count whole: half a cell along the rim's two borders.
    assert rim.area == pytest.approx(0.472**2 - 0.4**2, abs=0.6 * CONFIG.cell * 4 * (0.472 + 0.4))
    assert counter.area == pytest.approx(1.2**2 - 0.48**2, rel=0.05)


def test_a_basin_is_walled_and_a_table_is_not() -> None:
    basin = min(level(support_regions(sink(), CONFIG)), key=lambda region: region.height)
    assert basin.rim_fraction > 0.9
    assert support_regions(sheet((0, 1.2), (0, 0.6), 0.74), CONFIG)[0].rim_fraction == 0.0


def test_compartments_of_a_shelf_are_insides_with_their_room() -> None:
    boards = [box(np.array([0, 0, z - 0.01]), np.eye(3), np.array([0.8, 0.3, 0.02])) for z in (0.1, 0.5, 0.8)]
    found = level(support_regions(merge(boards), CONFIG))
    assert [(region.kind, round(region.height, 2)) for region in sorted(found, key=lambda region: region.height)] == [
        ("inside", 0.1),
        ("inside", 0.5),
        ("horizontal", 0.8),
    ]
    room = {round(region.height, 2): region.clearance for region in found}
    assert room[0.1] == pytest.approx(0.38, abs=0.005)
    assert room[0.5] == pytest.approx(0.28, abs=0.005)


def test_what_stands_on_a_table_takes_its_area() -> None:
    top = sheet((0, 1.2), (0, 0.6), 0.74)
    crate = box(np.array([0.3, 0.3, 0.84]), np.eye(3), np.array([0.3, 0.2, 0.2]))
    closed, open_below = (
        crate,
        Mesh(crate.vertices, crate.faces[crate.vertices[crate.faces][..., 2].max(axis=1) > 0.75]),
    )
    for standing in (closed, open_below):
        (region,) = support_regions(top, CONFIG, [standing])
        assert region.area - region.free_area == pytest.approx(0.06, rel=0.2)


def test_small_holes_are_bridged_and_large_ones_are_not() -> None:
    top = sheet((0, 1.0), (0, 0.6), 0.74)
    middle = top.vertices[top.faces].mean(axis=1)
    for radius, bridged in ((0.015, True), (0.1, False)):
        keep = np.linalg.norm(middle[:, :2] - [0.5, 0.3], axis=1) > radius
        (region,) = support_regions(Mesh(top.vertices, top.faces[keep]), CONFIG)
        row, column = np.floor(region.places(np.array([[0.5, 0.3, 0.74]]))[0, :2]).astype(int)
        assert region.support[row, column] == bridged


def test_a_turned_wall_is_an_upright_region_that_looks_into_the_room() -> None:
    flat = sheet((0, 2.0), (0, 1.5), 0.0)
    c, s = np.cos(0.4), np.sin(0.4)
    wall = Mesh(flat.vertices @ np.array([[c, s, 0], [0, 0, 1], [s, -c, 0]]), flat.faces)
    (region,) = support_regions(wall, CONFIG)
    assert region.kind == "vertical"
    assert region.normal == pytest.approx([s, -c, 0], abs=0.01)
    assert region.area == pytest.approx(3.0, rel=0.05)


def test_ransac_finds_the_plane_of_most_points_and_only_that() -> None:
    points = sink().vertices
    plane = ransac_plane(points, False, RansacConfig())
    assert plane is not None
    heights = points[plane.faces][:, 2]
    assert heights.mean() == pytest.approx(0.85, abs=0.005)
    # The rim is within the threshold of the counter: one plane, where there are two regions.
    assert heights.max() > 0.855


def test_the_desk_of_a_scanned_office(office: Scene) -> None:
    (desk,) = (part.mesh for part in office.parts.values() if part.label == "desk")
    others = [part.mesh for part in office.parts.values() if part.label != "desk"]
    top = support_regions(desk, CONFIG, others, ("horizontal",))[0]
    assert top.height == pytest.approx(0.74, abs=0.003)
    assert sorted(top.size) == pytest.approx([0.693, 1.741], abs=0.04)
    assert 0.5 * top.area < top.free_area < 0.99 * top.area
