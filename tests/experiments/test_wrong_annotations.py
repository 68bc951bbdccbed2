"""The experiment's wrong annotations are wrong by as much as they say, and it counts what is caught."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from box_room import bounds, room
from wrong_annotations import (
    CLASSES,
    Case,
    checked,
    far_hinge,
    other_edge,
    other_kind,
    table,
    tilted,
    transformed,
)

from s2a.scan.evidence import annotation
from s2a.scan.evidence.annotation import room_checks as whole_room
from s2a.scan.evidence.front import Front, front
from s2a.scan.evidence.surface import ScanSurface


def leaf() -> Front:
    found = front(ScanSurface(room()), "door_8")
    assert found is not None
    return found


@pytest.mark.parametrize("seed", range(5))
def test_wrong_joints_are_wrong_by_as_much_as_they_say(seed: int) -> None:
    right, random = room().joint("door_8"), np.random.default_rng(seed)
    axis = np.array(tilted(right, leaf(), random)[1].axis)
    assert np.degrees(np.arccos(axis @ right.axis)) == pytest.approx(15.0)
    away = np.array(far_hinge(right, leaf(), random)[1].origin) - right.origin
    assert np.linalg.norm(away) == pytest.approx(0.5) and away @ right.axis == pytest.approx(0.0)
    how, moved = other_edge(right, leaf(), random)
    assert moved.origin == pytest.approx((0.52, 1.52, 0.5)) and abs(moved.axis[2]) == pytest.approx(1.0)
    assert ("reversed" in how) is (moved.axis[2] < 0)
    assert other_kind(right, leaf(), random)[1].kind == "prismatic"


def test_a_transformed_scene_keeps_its_joints_with_its_surface() -> None:
    quarter = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]])
    scene = transformed(room(), 100.0 * quarter, labelled=True)
    joint = scene.joint("drawer_6")
    assert joint.axis == pytest.approx((0, 1, 0)) and joint.limits == pytest.approx((0, 40))
    assert joint.origin == pytest.approx((-125, 52, 50))


def test_every_class_is_drawn_and_caught_in_a_room_of_flat_sheets() -> None:
    surface, limits, random = ScanSurface(room()), bounds(), np.random.default_rng(0)
    fronts = {part: front(surface, part) for part in surface.scene.movable}
    right = {part: list(annotation.moving_part(surface, part, found, limits)) for part, found in fronts.items()}
    case = Case("box", surface, fronts, right | {"": whole_room(surface, fronts, limits)})
    rows = [checked(pick([case], random), limits) for pick in CLASSES.values()]
    assert [row["how"] for row in rows if not row["caught"]] == []


def test_the_published_figures_reach_the_goal() -> None:
    import json

    path = Path(__file__).parents[2] / "experiments/results/wrong_annotations.json"
    result = json.loads(path.read_text())
    assert result["all"]["fraction"] >= 0.95
    assert result["false_alarms"]["flagged_parts"] <= 0.02 * result["false_alarms"]["parts"]
    assert "| all | 45 |" in table(result)
