from __future__ import annotations

import re
from pathlib import Path

import pytest
import tiny_scan
from cabinet import write_cabinet
from usd_room import room

from s2a import scan
from s2a.core.errors import InputError
from s2a.scan.visuals import fitted, tree
from s2a.scene.usd import descriptive, geometric


def line(text: str, name: str) -> str:
    """Return the first line of a prim, without the tree's branches."""
    lines = [line.lstrip("│├└─ ") for line in text.splitlines()]
    return next(line for line in lines if line.split("  ")[0] == name)


@pytest.fixture(scope="module")
def shapes(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("tree") / "geometric.usd"
    geometric.write(room(), path)
    return tree(path)


def test_a_drawer_is_told_in_millimetres_with_its_grasp_point(shapes: str) -> None:
    assert line(shapes, "drawer_7") == (
        "drawer_7  'drawer'  12 triangles  slides -10 to 400 mm along (0.9998, 0.02, 0.003)  grasp at (1.3, 1, 0.5)"
    )


def test_a_hinge_is_told_in_degrees_with_its_origin(shapes: str) -> None:
    assert "turns -11.5 to 90 deg about (0, 0, -1) through (-1.45, 0.1, 0.333)" in line(shapes, "door_20")


def test_the_tree_nests_as_the_labels_do(shapes: str) -> None:
    lines = shapes.splitlines()
    depth = {name: next(line.index(name) for line in lines if name in line) for name in ("cabinet_3", "handle_9")}
    assert depth["handle_9"] - depth["cabinet_3"] == 3 * 4


def test_every_part_has_one_line_and_counts_stand_on_top(shapes: str) -> None:
    assert len(shapes.splitlines()) == 1 + len(room().parts)
    assert shapes.splitlines()[0] == "036bce3393: 12 parts, 4 jointed, 75 vertices, 108 triangles"


@pytest.mark.parametrize("columns", [60, 80, 120])
def test_a_fitted_tree_has_the_same_words_in_lines_that_are_no_longer(shapes: str, columns: int) -> None:
    text = fitted(shapes, columns)
    assert max(map(len, text.splitlines())) <= columns
    assert re.findall(r"[^\s│├└─]+", text) == re.findall(r"[^\s│├└─]+", shapes)
    assert fitted(shapes, 1000) == shapes
    lines = text.splitlines()
    part = next(i for i, each in enumerate(lines) if "── drawer_7 " in each)
    if columns < 100:
        assert re.match(r"[│ ]+\S", lines[part + 1]) and "──" not in lines[part + 1], "it goes on below its branch"


def test_brackets_in_labels_are_no_markup(tmp_path: Path) -> None:
    scene = room()
    scene.parts["wall_1"] = type(scene.parts["wall_1"])("[bold]wall[/bold]", scene.parts["wall_1"].mesh)
    geometric.write(scene, tmp_path / "x.usd")
    assert "[bold]wall[/bold]" in tree(tmp_path / "x.usd")


def test_a_description_is_told_with_joints_in_words(tmp_path: Path) -> None:
    descriptive.write(room(), tmp_path / "descriptive.usda")
    assert "slides -10 to 400 mm along (0.9998, 0.02, 0.003)" in line(tree(tmp_path / "descriptive.usda"), "drawer_7")


def test_a_folder_of_a_scan_is_told_as_its_geometric_stage_is(tmp_path: Path) -> None:
    folder = tiny_scan.write(tmp_path / "scan")
    geometric.write(scan.read(folder), tmp_path / "geometric.usd")
    assert tree(folder) == tree(tmp_path / "geometric.usd")
    assert "turns 0 to 90 deg" in line(tree(folder), "door_3")


def test_a_simulation_ready_stage_is_told_with_bodies_colliders_and_joints(tmp_path: Path) -> None:
    text = tree(write_cabinet(tmp_path / "sim.usd"))
    assert "articulation root  60 kg" in line(text, "cabinet_1")
    assert "body  5.32 kg" in line(text, "drawer_2")
    assert "4 convexHull  48 triangles  for drawer_2 (4)" in text
    assert "cabinet_1 -> drawer_2  slides 0 to 400 mm along (1, 0, 0)" in text
    assert "grasp  Sphere  at (0.351, 0, 0.727)" in text


def test_another_file_is_told_of(tmp_path: Path) -> None:
    (tmp_path / "x.usd").write_text("hello")
    with pytest.raises(InputError, match="damaged"):
        tree(tmp_path / "x.usd")
