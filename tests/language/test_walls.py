"""What a model is told of walls: what is along them, and the gaps between at eye level."""

from __future__ import annotations

from rough_furniture import at, block, sheet

from s2a.language.insert.describe import wall_line
from s2a.scene.scene import Mesh, Part, Scene

FLAT = sheet((0, 4), (0, 2.5), 0.0, 0.05)
WALL = Part("wall", Mesh(FLAT.vertices[:, [0, 2, 1]] + [0, 2.0, 0], FLAT.faces))


def test_a_wall_names_what_is_along_it_in_order_and_its_gaps() -> None:
    parts = {
        "wall_1": WALL,
        "floor_2": Part("floor", sheet((0, 4), (-2, 2), 0.0, 0.1)),
        "wardrobe_3": Part("wardrobe", at(block(1.0, 0.5, 2.0), 3.0, 1.7, 0.0)),
        "chest_4": Part("chest", at(block(0.8, 0.4, 0.9), 0.6, 1.75, 0.0)),
        "table_5": Part("table", at(block(1.0, 0.6, 0.75), 2.0, 0.0, 0.0)),
    }
    line = wall_line(Scene("room", parts), "wall_1")
    # The chest ends below eye level, the table is in the middle of the room: the wardrobe alone, 2.5 to 3.5 m, leaves no gap.
    assert sorted(line["along"]) == ["chest_4", "wardrobe_3"]
    assert line["along"] in (["chest_4", "wardrobe_3"], ["wardrobe_3", "chest_4"])
    assert line["free"] == [2.5, 0.5]


def test_a_wall_of_several_sides_has_none() -> None:
    around = Mesh(sheet((0, 4), (0, 3), 1.0, 0.1).vertices, sheet((0, 4), (0, 3), 1.0, 0.1).faces)
    assert wall_line(Scene("room", {"wall_1": Part("wall", around)}), "wall_1") == {}
