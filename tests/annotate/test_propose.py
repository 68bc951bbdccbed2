"""Proposals: a front for each handle, which opens as furniture does."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import plain_room
import pytest

from s2a import cli, config, scan
from s2a.annotate.propose import ProposeConfig, propose
from s2a.annotate.propose.layers import Layer
from s2a.annotate.propose.motion import FrontShape, motion
from s2a.annotate.propose.partition import divide
from s2a.annotate.propose.patches import CellBox
from s2a.annotate.region import GrowConfig
from s2a.annotate.surface import SplitSurface

VALUES = config.file("annotate")
GROW, PROPOSE = config.load(GrowConfig, VALUES["grow"]), config.load(ProposeConfig, VALUES["propose"])


def test_the_board_with_a_bar_is_the_one_front() -> None:
    mesh = plain_room.room()
    (item,) = propose(SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors), PROPOSE, GROW)
    np.testing.assert_allclose(item.region.normal, (1, 0, 0), atol=1e-6)
    np.testing.assert_allclose(item.region.size, (0.8, 0.9), atol=0.05)
    np.testing.assert_allclose(item.region.center, (0, -0.4, 0.45), atol=0.03)
    middles = mesh.vertices[mesh.faces].mean(axis=1)[item.handle]
    assert (
        item.proposed and (middles[:, 0] > 0.005).all() and (np.abs(middles[:, 1:] - plain_room.BAR[1:]) < 0.07).all()
    )


def shape(**other: float) -> FrontShape:
    values = {
        "width": 0.6,
        "height": 0.2,
        "middle": 0.7,
        "x": 0.5,
        "y": 0.5,
        "handle_width": 0.2,
        "handle_height": 0.02,
    }
    return FrontShape(**(values | other))


@pytest.mark.parametrize(
    ("front", "expected"),
    [
        (shape(), "slide"),
        (shape(height=0.7, width=0.45, x=0.9, handle_width=0.02, handle_height=0.2), "left"),
        (shape(height=0.7, width=0.45, x=0.1, handle_width=0.03, handle_height=0.03), "right"),
        (shape(height=0.6, y=0.9), "bottom"),
        (shape(height=0.4, middle=1.6, y=0.1), "top"),
    ],
)
def test_a_front_opens_away_from_its_handle(front: FrontShape, expected: str) -> None:
    assert motion(front) == expected


def test_a_dark_line_divides_two_fronts_rather_than_the_middle() -> None:
    color = np.full((40, 80, 3), 150.0)
    color[:, 50] = 20.0
    layer = Layer(
        np.array([1.0, 0, 0]),
        np.array([0, 1.0, 0]),
        0.0,
        np.zeros(2),
        0.01,
        color,
        np.zeros((40, 80)),
        np.zeros((40, 80)),
    )
    handles = [CellBox(18, 18, 22, 20), CellBox(62, 18, 66, 20)]
    (left, first), (right, second) = divide(layer, CellBox(0, 0, 80, 40), handles)
    assert 49 <= left.right == right.left <= 51 and [first, second] == [[handles[0]], [handles[1]]]


def test_the_command_writes_proposals_without_a_page(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = plain_room.write(tmp_path / "scan")
    keys = [f"scan={folder}", f"out={tmp_path / 'out'}", "auto=true", "page=false"]
    assert cli.main(["annotate", *keys]) == 0
    assert "1 parts (1 drawer), 1 with a handle" in capsys.readouterr().out
    assert len(scan.read(tmp_path / "out").movable) == 1
    assert cli.main(["annotate", *keys[:2], "page=false"]) == 2
    assert "auto=true" in capsys.readouterr().err
