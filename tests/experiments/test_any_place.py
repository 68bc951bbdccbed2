"""The experiment that tries every place for an object finds one where there is one, and nowhere else."""

from __future__ import annotations

import pytest
from rough_furniture import at, block, sheet

pytest.importorskip("s2a.language", reason="needs s2a.language")
from any_place import any_place

from s2a.language.grammar import parse_wish
from s2a.scene.scene import Part, Scene


@pytest.mark.slow
def test_a_place_is_found_where_there_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("any_place.STEP", 0.05)
    scene = Scene("room", {
        "floor_1": Part("floor", sheet((-2, 3), (-3, 0.6), 0.0, 0.05)),
        "desk_2": Part("office desk", sheet((0, 1.6), (0, 0.6), 0.74)),
        "crate_5": Part("crate", at(block(0.2, 0.2, 0.2), 1.4, 0.4, 0.741)),
    })  # fmt: skip
    labels = {part_id: part.label for part_id, part in scene.parts.items()}
    relations = parse_wish("on the desk, right of the crate", labels).relations  # 10 cm are left there
    place = any_place(scene, block(0.08, 0.08, 0.1), relations)
    assert place is not None
    assert 1.48 < place[0] < 1.6 and place[2] == pytest.approx(0.74, abs=0.01)
    assert any_place(scene, block(0.3, 0.3, 0.1), relations) is None
