"""The keys of `s2a view` that are about its page, and the file that it writes."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import tiny_scan
import usd_room

from s2a.commands import cli
from s2a.scene.scene import Mesh, Part, Scene
from s2a.scene.usd import geometric
from s2a.view.page.glb import clustered, thinned
from s2a.view.page.room import PageRoom, hue, of_scene


def plane(size: float, step: float) -> Mesh:
    """Return a square in the plane z = 1 of small triangles, red where x is above half of it."""
    count = round(size / step) + 1
    x, y = np.meshgrid(np.arange(count) * step, np.arange(count) * step)
    corner = np.arange(count * count).reshape(count, count)
    a, b, c, d = (corner[:-1, :-1], corner[:-1, 1:], corner[1:, 1:], corner[1:, :-1])
    faces = np.concatenate([np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)])
    points = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1)
    return Mesh(points, faces, np.where(points[:, :1] > size / 2, (255, 0, 0), (0, 0, 255)))


@pytest.fixture
def wide() -> PageRoom:
    """A table of 20,000 triangles, and a drawer in it."""
    parts = {"table_1": Part("table", plane(2.0, 0.02)), "drawer_7": usd_room.room().parts["drawer_7"]}
    moved = Part("drawer", parts["drawer_7"].mesh, "table_1", parts["drawer_7"].motion)
    return of_scene(Scene("wide", {**parts, "drawer_7": moved}))


@pytest.mark.parametrize("max_faces", [12, 100, 1500, 15_000])
def test_a_thinned_room_keeps_its_extent_colours_and_what_moves(wide: PageRoom, max_faces: int) -> None:
    few = thinned(wide, max_faces)
    assert few.faces <= max_faces
    assert few.parts.keys() == wide.parts.keys() and few.joints == wide.joints
    if max_faces >= 100:
        assert few.parts["drawer_7"] == wide.parts["drawer_7"]
        table = few.parts["table_1"].surface
        assert len(table.faces) > max_faces / 8
        cell = 2.0 * np.sqrt(2.0 * 2.0 / len(table.faces)) + 0.02
        np.testing.assert_allclose(table.bounds, [(0, 0, 1), (2, 2, 1)], atol=cell)
        blue = table.colors[table.vertices[:, 0] < 1.0 - cell]
        assert (blue == (0, 0, 255)).all()


def test_a_room_with_few_faces_stays_as_it_is(wide: PageRoom) -> None:
    assert thinned(wide, wide.faces) is wide


def test_vertices_of_one_cell_become_their_mean() -> None:
    points = np.array([[0.0, 0, 0], [0.1, 0, 0], [1.0, 0, 0], [0, 1.0, 0]])
    mesh = clustered(Mesh(points, np.array([[0, 2, 3], [1, 2, 3], [0, 1, 2]])), 0.5)
    expected = [(0.0, 1.0, 0.0), (0.05, 0.0, 0.0), (1.0, 0.0, 0.0)]
    np.testing.assert_allclose(sorted(map(tuple, mesh.vertices.tolist())), expected, atol=1e-6)
    assert len(mesh.faces) == 2  # the third has two corners in one cell


def test_neighbouring_hues_differ() -> None:
    colors = np.array([hue(i) for i in range(50)], float)
    assert np.linalg.norm(np.diff(colors, axis=0), axis=1).min() > 60


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["page=true", "part=sofa_9"], ["'sofa_9'", "lists its parts"]),
        (["port=0", "page=true"], ["'port'", "0", "65535"]),
        (["max_faces=0", "page=true"], ["'max_faces'", "0", "1 or more"]),
        (["colliders=true", "page=true"], ["'colliders'", "image=FILE.png"]),
        (["part=door_3"], ["'part'", "page=true"]),
        (["text=false"], ["'text'", "page=true"]),
        (["html=room.png"], ["'html'", "'room.png'", "html=FILE.html"]),
    ],
)
def test_a_page_that_cannot_be_is_one_line(
    arguments: list[str], words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    scan = tiny_scan.write(tmp_path / "scan")
    assert cli.main(["view", f"path={scan}", *arguments]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1 and [word for word in words if word not in error] == []
    assert [path.name for path in tmp_path.iterdir()] == ["scan"]


def test_without_the_library_the_extra_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name in [name for name in sys.modules if name.startswith("s2a.view.page.") or name == "viser"]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, "viser", None)
    scan = tiny_scan.write(tmp_path / "scan")
    assert cli.main(["view", f"path={scan}", f"html={tmp_path / 'room.html'}"]) == 2
    assert "pip install 's2a[view]'" in capsys.readouterr().err


@pytest.fixture
def page(tmp_path: Path) -> Iterator[Path]:
    pytest.importorskip("viser")
    geometric.write(usd_room.room(), tmp_path / "room.usd")
    yield tmp_path / "room.html"


def test_the_file_is_whole_and_says_what_it_holds(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    stage = page.with_suffix(".usd")
    assert cli.main(["view", f"path={stage}", f"html={page}"]) == 0
    said = capsys.readouterr().out
    assert "108 faces" in said and "4 joints" in said and "room.html" in said
    text = page.read_text()
    assert "<title>036bce3393</title>" in text
    assert 'src="http' not in text and 'href="http' not in text
    assert cli.main(["view", f"path={stage}", f"html={page}", "max_faces=60"]) == 0
    assert "of 108 faces" in capsys.readouterr().out
