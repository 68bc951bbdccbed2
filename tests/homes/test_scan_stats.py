"""The figures of a scan: shapes whose borders, pieces, gaps and noise are known by hand."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from s2a.homes.grips import bar, knob
from s2a.homes.solids import Piece, box
from s2a.scan.ply_file import write_ply
from s2a.scene.scene import Mesh, Part, Scene

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

import scan_stats
import webs

GREY = (128, 128, 128)


def plate(cells: int, missing: tuple[tuple[int, int], ...] = (), size: float = 0.1) -> Mesh:
    """Return a square plate of cells of a given size [m], two triangles each, without some of them."""
    n = cells + 1
    x, y = np.meshgrid(np.arange(n) * size, np.arange(n) * size, indexing="ij")
    vertices = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3)
    faces = []
    for i in range(cells):
        for j in range(cells):
            if (i, j) not in missing:
                a, b, c, d = i * n + j, (i + 1) * n + j, (i + 1) * n + j + 1, i * n + j + 1
                faces += [(a, b, c), (a, c, d)]
    return Mesh(vertices, faces)


def front_with(handle: Piece) -> Scene:
    """Return a scene of a handle on a front."""
    front = Part("drawer", box((-0.02, 0), (-0.3, 0.3), (-0.1, 0.1), GREY).mesh)
    return Scene("front", {"drawer_1": front, "handle_2": Part("handle", handle.surface.mesh, parent="drawer_1")})


def joined(*meshes: Mesh) -> Mesh:
    return webs.merge([Mesh(mesh.vertices, mesh.faces) for mesh in meshes])


def sheet(y: tuple[float, float], x: tuple[float, float]) -> Mesh:
    """Return a web from y to y and x to x [m] below a bar."""
    corners = [(x[0], y[0], -0.01), (x[1], y[0], -0.01), (x[1], y[1], -0.01), (x[0], y[1], -0.01)]
    return Mesh(np.array(corners), [(0, 1, 2), (0, 2, 3)])


def test_a_plate_with_two_holes_has_three_borders() -> None:
    mesh = plate(10, missing=((2, 2), (6, 6), (6, 7)))
    assert sorted(scan_stats.border_lengths(mesh)) == pytest.approx([0.4, 0.6, 4.0])


def test_a_closed_box_has_no_border() -> None:
    assert len(scan_stats.border_lengths(box((0, 1), (0, 1), (0, 1), GREY).mesh)) == 0


def test_pieces_that_share_no_vertex_are_counted() -> None:
    solids = [box((i, i + 0.5), (0, 1), (0, 1), GREY).mesh for i in range(3)]
    assert scan_stats.components(joined(*solids)) == 3


def test_the_median_edge_of_a_grid_is_its_cell() -> None:
    assert scan_stats.median_edge(plate(10, size=0.03)) == pytest.approx(0.03)


def test_a_box_scanned_from_above_is_seen_by_a_sixth() -> None:
    truth = Scene("box", {"box_1": Part("box", box((0, 1), (0, 1), (-1, 0), GREY).mesh)})
    assert scan_stats.seen(plate(10), truth)["box_1"] == pytest.approx(1 / 6, abs=0.02)


def test_surface_that_faces_away_is_not_seen() -> None:
    truth = Scene("box", {"box_1": Part("box", box((0, 1), (0, 1), (0, 1), GREY).mesh)})
    assert scan_stats.seen(plate(10), truth)["box_1"] < 0.02


def test_a_bars_gap_is_as_deep_as_it_was_built() -> None:
    scene = front_with(bar(0.16, 0.024, 0.014, 0.024, 0.02))
    gap = webs.find_gap(scene, "handle_2", np.eye(4))
    assert np.allclose(gap.back, 0.024, atol=1e-4)
    assert np.allclose(gap.front, 0.0, atol=1e-3)
    assert np.abs(gap.places[:, 0]).max() <= 0.06


def test_a_knob_this_low_leaves_no_gap() -> None:
    scene = front_with(knob(0.015, 0.012))
    assert webs.webs(joined(*(p.mesh for p in scene.parts.values())), scene, {"handle_2": np.eye(4)}) == {}


@pytest.mark.parametrize(
    ("web", "share"),
    [
        (sheet((0.09, 0.1), (0.0, 0.024)), 0.0),
        (sheet((-0.065, 0.065), (0.0, 0.024)), 1.0),
        (sheet((-0.065, 0.0), (0.0, 0.024)), 0.5),
        (sheet((-0.06, 0.06), (0.0, 0.004)), 0.0),
    ],
    ids=["beside", "whole", "half", "skirt"],
)
def test_a_web_is_told_by_how_far_it_closes_the_gap(web: Mesh, share: float) -> None:
    scene = front_with(bar(0.16, 0.024, 0.014, 0.024, 0.02))
    scan = joined(*(part.mesh for part in scene.parts.values()), web)
    found = webs.webs(scan, scene, {"handle_2": np.eye(4)})
    assert found["handle_2"] == pytest.approx(share, abs=0.05)


def test_noise_is_that_which_was_added(tmp_path: Path) -> None:
    from s2a.scene.usd import geometric

    truth = Scene("box", {"box_1": Part("box", box((-1, 2), (-1, 2), (-1, 0), GREY).mesh)})
    flat = plate(100, size=0.01)
    noise = np.random.default_rng(0).normal(0.0, 0.002, len(flat.vertices))
    rough = Mesh(flat.vertices + np.stack([0 * noise, 0 * noise, noise], axis=1), flat.faces, flat.vertices * 0)
    (tmp_path / "truth").mkdir()
    write_ply(tmp_path / "mesh_aligned_0.05.ply", rough)
    geometric.write(truth, tmp_path / "truth" / "truth.usda")
    (tmp_path / "truth" / "truth.json").write_text('{"parts": {}}')
    figures = scan_stats.measure(tmp_path)
    # The mean of a triangle's plane varies less than its corners: half as much in variance.
    assert figures.noise == pytest.approx(0.002 * np.sqrt(0.5), rel=0.05)
    assert figures.density == pytest.approx(101**2, rel=0.1)
    assert figures.webs == {}


def test_a_mesh_without_truth_has_the_figures_that_need_none(tmp_path: Path) -> None:

    mesh = plate(10, missing=((2, 2),))
    write_ply(tmp_path / "real.ply", Mesh(mesh.vertices, mesh.faces, mesh.vertices * 0))
    figures = scan_stats.measure(tmp_path / "real.ply")
    assert (figures.holes, figures.border) == pytest.approx((2 / 0.99, 4.4 / 0.99), rel=1e-3)
    assert np.isnan(figures.noise) and figures.seen == {}
    assert scan_stats._row(figures)["noise"] is None
