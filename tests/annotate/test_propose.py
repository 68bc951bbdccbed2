"""Proposals: a front for each handle, which opens as furniture does."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import plain_room
import pytest

from s2a import cli, config, scan
from s2a.annotate.propose import ProposeConfig, propose, run
from s2a.annotate.propose.cells import CellBox
from s2a.annotate.propose.layers import Layer
from s2a.annotate.propose.motion import FrontShape, motion
from s2a.annotate.propose.partition import divide
from s2a.annotate.propose.patches import patches
from s2a.annotate.propose.wall_leaves import leaves
from s2a.annotate.region import GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.geometry.mesh_ops import merge
from s2a.mesh import Mesh

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


def image(color: np.ndarray, ahead: np.ndarray | None = None, sharp: bool = True, cell: float = 0.01) -> Layer:
    """Return the image of a flat plane that faces x; what stands out of it is a handle's."""
    none = np.zeros(color.shape[:2])
    out = none if ahead is None else ahead
    odd = np.linalg.norm(color - np.median(color, axis=(0, 1)), axis=-1)
    frame = np.array([1.0, 0, 0]), np.array([0, 1.0, 0])
    return Layer(*frame, 0.0, np.zeros(2), cell, color, none, out, out, odd, none > 0, sharp)


def test_a_dark_line_divides_two_fronts_rather_than_the_middle() -> None:
    color = np.full((40, 80, 3), 150.0)
    color[:, 50] = 20.0
    handles = [CellBox(18, 18, 22, 20), CellBox(62, 18, 66, 20)]
    (left, first), (right, second) = divide(image(color), CellBox(0, 0, 80, 40), handles, np.ones((40, 80), bool))
    assert 49 <= left.right == right.left <= 51 and [first, second] == [[handles[0]], [handles[1]]]


def test_equal_fronts_are_divided_where_they_end_though_their_handles_are_at_their_tops() -> None:
    handles = [CellBox(30, 20 * k + 15, 50, 20 * k + 17) for k in range(4)]
    found = divide(image(np.full((80, 80, 3), 150.0)), CellBox(0, 0, 80, 80), handles, np.ones((80, 80), bool))
    assert sorted(box.bottom for box, _ in found) == pytest.approx([0, 20, 40, 60], abs=1.5)


def test_a_wide_drawer_has_two_handles_and_stays_one() -> None:
    handles = [CellBox(15, 12, 35, 14), CellBox(85, 12, 105, 14)]
    plain = np.full((24, 120, 3), 150.0)
    assert len(divide(image(plain), CellBox(0, 0, 120, 24), handles, np.ones((24, 120), bool))) == 1
    plain[:, 60] = 20.0
    assert len(divide(image(plain), CellBox(0, 0, 120, 24), handles, np.ones((24, 120), bool))) == 2


def test_a_bar_that_a_scan_shows_in_pieces_is_one_handle_and_two_knobs_are_two() -> None:
    out = np.zeros((60, 100))
    for left in range(20, 56, 8):
        out[30, left : left + 4] = 0.03
    (patch,) = patches(image(np.full((60, 100, 3), 150.0), out), PROPOSE)
    assert [(blob.left, blob.right) for blob in patch.blobs] == [(20, 56)]
    out[:] = 0
    out[30:33, 40:43] = out[30:33, 47:50] = 0.03
    (patch,) = patches(image(np.full((60, 100, 3), 150.0), out), PROPOSE)
    assert len(patch.blobs) == 2


def phone(color: np.ndarray, grain: float = 1.0, seed: int = 0) -> Layer:
    """Return a plane as a phone shows it: without relief, each colour a bit off."""
    noise = np.random.default_rng(seed).normal(0.0, grain, color.shape)
    plain = np.median(color[np.isfinite(color[..., 0])], axis=0)
    layer = image(color + noise, sharp=False)
    return replace(layer, odd=np.linalg.norm(np.nan_to_num(color + noise - plain), axis=-1))


def test_a_phone_shows_knobs_by_a_little_colour_and_gaps_are_none() -> None:
    color = np.full((60, 80, 3), 90.0)
    color[12:15, 39:42] = color[42:45, 39:42] = 90.0 - 22.0
    for left in range(2, 78, 6):  # dashes
        color[29:31, left : left + 4] = 90.0 + 40.0
    (patch,) = patches(phone(color), PROPOSE)
    assert sorted(blob.middle for blob in patch.blobs) == [(40.5, 13.5), (40.5, 43.5)]


@pytest.mark.parametrize(
    ("front", "there"),
    [
        (shape(width=0.8, x=0.55), True),
        (shape(width=0.8, x=0.9), True),
        (shape(width=0.8, x=0.3), False),
        (shape(width=0.3, x=0.3), True),
    ],
)
def test_a_handle_is_in_the_middle_or_at_a_side(front: FrontShape, there: bool) -> None:
    assert run._reachable(front) == there  # 24 cm from the side is neither


def test_a_gap_alone_is_no_handle() -> None:
    color = np.full((60, 80, 3), 90.0)
    for left in range(2, 78, 6):
        color[29:31, left : left + 4] = 90.0 + 40.0
    (patch,) = patches(phone(color), PROPOSE)
    assert not patch.blobs


def test_of_two_tints_that_of_most_marks_is_the_handles() -> None:
    color = np.full((60, 80, 3), 90.0)
    color[12:15, 39:42] = color[42:45, 39:42] = 90.0 - 22.0
    color[28:30, 60:64] = 90.0 + 30.0  # what is left of a gap
    (patch,) = patches(phone(color), PROPOSE)
    assert sorted(blob.middle for blob in patch.blobs) == [(40.5, 13.5), (40.5, 43.5)]


def test_the_grain_of_wood_hides_what_differs_as_little() -> None:
    color = np.full((60, 80, 3), 90.0)
    color[28:31, 39:42] = 90.0 - 22.0
    assert len(next(iter(patches(phone(color), PROPOSE))).blobs) == 1
    assert not any(patch.blobs for patch in patches(phone(color, grain=2.0), PROPOSE))


def test_what_runs_over_from_beyond_the_border_is_no_handle() -> None:
    plain = np.full((60, 100, 3), 150.0)
    plain[:, 80:] = 40.0  # another thing, darker
    smeared, handle = plain.copy(), plain.copy()
    smeared[20:34, 75:80] = 90.0
    handle[20:34, 74:77] = 210.0, 210.0, 90.0
    first, second = (next(iter(patches(phone(color), PROPOSE))).blobs for color in (smeared, handle))
    assert len(first) == 0 and len(second) == 1


def test_fronts_that_lie_in_an_l_end_where_it_does() -> None:
    color = np.full((80, 100, 3), 150.0)
    color[35:, 45:] = np.nan
    color[10:13, 23:26] = color[10:13, 73:76] = color[60:63, 23:26] = 60.0
    within = np.isfinite(color[..., 0])
    (patch,) = patches(replace(phone(color), height=np.where(within, 0.0, np.nan)), PROPOSE)
    found = divide(phone(color), patch.box, list(patch.blobs), patch.within)
    boxes = sorted((box.left, box.bottom, box.right, box.top) for box, _ in found)
    assert len(found) == 3 and all(len(blobs) == 1 for _, blobs in found)
    np.testing.assert_allclose(boxes[1], (2, 35, 45, 77), atol=5)  # the one that ends where the L does


def test_a_door_is_the_opening_around_its_lever_and_a_picture_is_none() -> None:
    wall, out = np.full((250, 300, 3), 200.0), np.zeros((250, 300))
    wall[:205, 100:190] = 90.0  # a door 0.9 m wide and 2.05 m high
    out[100:103, 104:116] = 0.05
    ((box, lever),) = leaves(image(wall, out), 0.0, PROPOSE)
    assert (box.left, box.right, box.bottom) == pytest.approx((100, 190, 0), abs=2) and box.top == pytest.approx(
        205, abs=2
    )
    assert lever.left == 104
    wall[:], out[:] = 200.0, 0.0
    wall[140:160, 100:190] = 90.0  # 0.2 m high: lower than any window
    out[150:153, 104:116] = 0.05
    assert list(leaves(image(wall, out), 0.0, PROPOSE)) == []


def test_a_window_is_its_leaf_within_the_fixed_frame_glass_and_wood() -> None:
    """Its glass alone would leave the wood, and the lever on it, in the wall."""
    y, z = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    wood, wall = (90, 60, 40), (220, 220, 220)

    def board(x: float, left: float, low: float, size: tuple[float, float], color: tuple[int, int, int]) -> Mesh:
        return plain_room.grid(np.array([x, left, low]), y, z, size, color)

    def ring(x: float, left: float, low: float, size: tuple[float, float], width: float, color) -> list[Mesh]:
        wide, high = size
        sides = [board(x, left + s * (wide - width), low, (width, high), color) for s in (0, 1)]
        ends = [board(x, left + width, low + s * (high - width), (wide - 2 * width, width), color) for s in (0, 1)]
        return sides + ends

    walls = [
        board(0, -1.5, 0, (1.1, 2.4), wall),
        board(0, 0.4, 0, (1.1, 2.4), wall),
        board(0, -0.4, 0, (0.8, 0.9), wall),
        board(0, -0.4, 1.9, (0.8, 0.5), wall),
    ]
    fixed = ring(0.0, -0.4, 0.9, (0.8, 1.0), 0.04, wood)
    leaf = ring(-0.01, -0.36, 0.94, (0.72, 0.92), 0.06, wood)
    glass = board(-0.045, -0.3, 1.0, (0.6, 0.8), (90, 120, 140))
    lever = board(0.05, 0.31, 1.34, (0.02, 0.12), (150, 150, 150))
    mesh = merge([*walls, *fixed, *leaf, glass, lever])
    waves = 0.003 * np.sin(mesh.vertices @ np.array([[0.0], [0.0], [30.0]]))  # as of a phone, which sees the glass
    mesh = Mesh(mesh.vertices + waves * [1.0, 0.0, 0.0], mesh.faces, mesh.colors)
    item = propose(SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors), PROPOSE, GROW)[0]
    np.testing.assert_allclose(item.region.size, (0.72, 0.92), atol=0.03)
    middles = mesh.vertices[mesh.faces].mean(axis=1)
    behind = middles[item.region.faces, 0] < -0.03
    assert 0.3 < behind.mean() < 0.8 and len(item.handle) and (middles[item.handle, 0] > 0.04).all()


@pytest.mark.parametrize(("lever_at", "expected"), [(110, (103.5, 186.5)), (102, (100, 190))])
def test_the_leaf_of_a_window_holds_its_lever(lever_at: int, expected: tuple[float, float]) -> None:
    wall, out = np.full((250, 300, 3), 200.0), np.zeros((250, 300))
    wall[90:200, 100:190] = 90.0
    out[140:152, lever_at : lever_at + 2] = 0.05
    ((box, _),) = leaves(image(wall, out), 0.0, PROPOSE)
    assert (box.left, box.right) == pytest.approx(expected, abs=1)


def test_the_command_writes_proposals_without_a_page(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = plain_room.write(tmp_path / "scan")
    keys = [f"scan={folder}", f"out={tmp_path / 'out'}", "auto=true", "page=false"]
    assert cli.main(["annotate", *keys]) == 0
    assert "1 parts (1 drawer), 1 with a handle" in capsys.readouterr().out
    assert len(scan.read(tmp_path / "out").movable) == 1
    assert cli.main(["annotate", *keys[:2], "page=false"]) == 2
    assert "auto=true" in capsys.readouterr().err
