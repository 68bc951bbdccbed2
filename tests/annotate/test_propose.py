"""Proposals: what a network sees in the image of a plane becomes fronts, joints and handles."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import plain_room
import pytest
import torch

from s2a import scan
from s2a.annotate import files
from s2a.annotate.annotation import Item
from s2a.annotate.propose import fronts as run
from s2a.annotate.propose.fronts import CellBox, SeenFront, fronts, propose
from s2a.annotate.propose.layers import Layer, Points, ProposeConfig, framed_rows, layers
from s2a.annotate.propose.network import CHANNELS, COARSE, FILE, MOTIONS, MULTIPLE, FrontNetwork, image, load
from s2a.annotate.region import GrowConfig
from s2a.annotate.surface import SplitSurface
from s2a.commands import cli
from s2a.core import config
from s2a.core.errors import InputError
from s2a.scene.scene import Scene

VALUES = config.file("annotate")
GROW, PROPOSE = GrowConfig(), config.load(ProposeConfig, VALUES["propose"])
ROWS, COLUMNS = 100, 130
SLIDES, TURNS = MOTIONS.index(("slide", "out")), MOTIONS.index(("hinge", "left"))


def layer(rows: int = ROWS, columns: int = COLUMNS) -> Layer:
    """Return the image of a flat, grey plane that faces x."""
    none = np.zeros((rows, columns))
    color = np.full((rows, columns, 3), 128.0)
    x, y = np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0])
    height, ahead, relief = none.copy(), none.copy(), none.copy()
    return Layer(x, y, 0.0, np.zeros(2), PROPOSE.cell, color, height, ahead, relief, none.astype(bool))


class Told(FrontNetwork):
    """Says what it is told: rectangles with a motion each, handles, and cells that are wrong about their rectangle."""

    def __init__(
        self,
        told: list[tuple[CellBox, int]],
        handles: tuple[CellBox, ...] = (),
        wrong: float = 0.0,
        wrong_by: float = 5.0,
    ) -> None:
        super().__init__()
        self.told, self.handles, self.wrong, self.wrong_by = told, handles, wrong, wrong_by

    def forward(self, image: torch.Tensor) -> tuple[torch.Tensor, ...]:
        rows, columns = image.shape[2:]
        assert rows % MULTIPLE == 0 and columns % MULTIPLE == 0
        size = (rows // COARSE, columns // COARSE)
        front, sides, motion = torch.full(size, -9.0), torch.ones(4, *size), torch.zeros(len(MOTIONS), *size)
        x, y = (COARSE * (torch.arange(n) + 0.5) for n in reversed(size))
        random = torch.Generator().manual_seed(0)
        for box, opens in self.told:
            mine = ((x > box.left) & (x < box.right))[None] & ((y > box.bottom) & (y < box.top))[:, None]
            lost = mine & (torch.rand(size, generator=random) < self.wrong)
            front[mine], motion[opens][mine] = 9.0, 9.0
            away = (x[None] - box.left, y[:, None] - box.bottom, box.right - x[None], box.top - y[:, None])
            for k, one in enumerate(away):
                sides[k][mine] = (one.expand(size) * PROPOSE.cell)[mine]
            sides[:, lost] = self.wrong_by
        handle = torch.full((rows, columns), -9.0)
        for box in self.handles:
            handle[box.cells] = 9.0
        return front[None], sides[None], motion[None], handle[None]


def seen(*args, **keys) -> list[SeenFront]:
    return list(fronts(layer(), Told(*args, **keys).see(image(layer(), 0.0)), PROPOSE))


def sides(box: CellBox) -> tuple[float, ...]:
    return box.left, box.bottom, box.right, box.top


def test_fronts_that_touch_are_told_apart_by_their_sides() -> None:
    drawers = [CellBox(10, 10, 60, 30), CellBox(10, 30, 60, 50), CellBox(60, 10, 100, 50)]
    found = seen([(drawers[0], SLIDES), (drawers[1], SLIDES), (drawers[2], TURNS)])
    assert {tuple(np.round(sides(one.box)).astype(int)) for one in found} == {sides(box) for box in drawers}
    assert {one.motion for one in found if one.box.left > 50} == {("hinge", "left")}
    assert {one.motion for one in found if one.box.left < 50} == {("slide", "out")}
    assert all(one.score == pytest.approx(1.0, abs=0.01) for one in found)


@pytest.mark.parametrize("wrong_by", [5.0, 0.0])
def test_cells_that_disagree_lower_the_score_and_move_no_side(wrong_by: float) -> None:
    box = CellBox(10, 10, 60, 40)
    (found,) = seen([(box, SLIDES)], wrong=0.3, wrong_by=wrong_by)
    assert sides(found.box) == pytest.approx(sides(box), abs=0.5)
    assert found.score == pytest.approx(0.7, abs=0.05)


def test_what_most_cells_disagree_about_is_no_front() -> None:
    assert seen([(CellBox(10, 10, 60, 40), SLIDES)], wrong=0.7) == []


@pytest.mark.parametrize("at", np.linspace(10.0, 12.0, 9))
def test_a_score_is_a_fraction_wherever_a_small_front_lies(at: float) -> None:
    (found,) = seen([(CellBox(at, at, at + 16.2, at + 8.2), SLIDES)])
    assert 0.85 < found.score <= 1.0  # a cell whose middle is on a side may count


def test_a_handle_is_that_of_the_front_that_it_lies_on() -> None:
    boxes, bar = [CellBox(10, 10, 60, 40), CellBox(70, 10, 120, 40)], CellBox(80, 30, 96, 33)
    found = {
        one.box.left < 65: one for one in seen([(b, SLIDES) for b in boxes], handles=(bar, CellBox(90, 15, 92, 17)))
    }
    assert found[True].handle is None
    assert sides(found[False].handle) == sides(bar)  # the larger of two


@pytest.mark.parametrize(
    ("motion", "at", "expected"),
    [
        (("hinge", "left"), 15, ("hinge", "right")),
        (("hinge", "right"), 55, ("hinge", "left")),
        (("hinge", "left"), 33, ("hinge", "left")),
        (("hinge", "right"), 33, ("hinge", "right")),
        (("hinge", "top"), 15, ("hinge", "top")),
        (("slide", "out"), 15, ("slide", "out")),
    ],
)
def test_a_door_turns_about_the_side_away_from_its_handle(motion, at: int, expected) -> None:
    (found,) = seen([(CellBox(10, 10, 60, 60), MOTIONS.index(motion))], handles=(CellBox(at, 20, at + 2, 30),))
    assert found.motion == expected


def test_framed_doors_stand_in_a_row_and_meet_between_their_panels() -> None:
    """Panels 18 cm wide, 12 cm apart: doors of 30 cm, whose stiles are 6 cm wide. One alone, 2 mm deep or flat is none."""
    for depth, columns, doors in (
        (0.008, (16, 46, 76), 3),
        (0.002, (16, 46, 76), 0),
        (0.008, (16,), 0),
        (-0.008, (16, 46, 76), 0),
    ):
        plane = layer(140)
        for column in columns:
            plane.height[30 : 90 if depth > 0 else 42, column : column + 18] = -abs(depth)
        rows = list(framed_rows(plane))
        assert {len(row) for row, _ in rows} == ({doors} if doors else set())
        for row, sure in rows:
            assert row == pytest.approx(np.array([[10, 24, 40, 96], [40, 24, 70, 96], [70, 24, 100, 96]]), abs=1.5)
            assert sure == pytest.approx(0.95, abs=0.05)  # three doors alone are not sure


def test_a_handle_at_the_border_of_the_image_is_whole_and_that_of_a_neighbour_is_not_taken() -> None:
    (found,) = seen([(CellBox(0, 0, 40, 30), SLIDES)], handles=(CellBox(10, 0, 20, 1),))
    assert found.handle is not None and sides(found.handle) == (10, 0, 20, 1)
    (found,) = seen([(CellBox(0, 0, 40, 30.4), SLIDES)], handles=(CellBox(10, 30, 20, 32),))
    assert found.handle is None


def test_nothing_is_seen_where_there_is_nothing() -> None:
    assert seen([]) == []


def test_the_network_sees_heights_over_the_floor_and_no_colour_where_nothing_was_scanned() -> None:
    plane = layer(4, 6)
    plane.height[1, 2] = np.nan
    plane.color[1, 2] = np.nan
    seen = image(plane, floor=-0.5)
    assert seen.shape == (CHANNELS, 4, 6) and np.isfinite(seen).all()
    assert seen[0, 1, 2] == 0 and (seen[1:5, 1, 2] == 0).all() and seen[0].sum() == 23
    np.testing.assert_allclose(seen[-1, :, 0], [-0.5, -0.49, -0.48, -0.47])


@pytest.mark.parametrize("size", [(3, 3), (65, 31)])
def test_the_network_takes_planes_of_any_size(size: tuple[int, int]) -> None:
    probability, to_sides, motion, handle = load().see(image(layer(*size), 0.0))
    assert handle.shape == size and motion.shape[1:] == probability.shape == to_sides.shape[1:]
    assert all(np.isfinite(x).all() for x in (probability, to_sides, motion, handle)) and (to_sides > 0).all()
    np.testing.assert_allclose(motion.sum(axis=0), 1.0, atol=1e-5)


def test_the_file_is_no_larger_than_2_mb_and_a_damaged_one_is_named(tmp_path: Path) -> None:
    assert FILE.stat().st_size < 2e6
    (tmp_path / "fronts.pt").write_bytes(FILE.read_bytes()[:1000])
    for name in ("fronts.pt", "missing.pt"):
        with pytest.raises(InputError, match=f"{name}.*not a network that proposes fronts"):
            load(tmp_path / name)


def test_a_scan_of_a_floor_alone_has_no_planes_and_no_proposals() -> None:
    floor = plain_room.grid(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), (2.0, 2.0), (120, 120, 120))
    assert propose(SplitSurface.of(floor.vertices, floor.faces, floor.colors), PROPOSE, GROW) == ()


@pytest.mark.slow
def test_most_proposals_in_an_office_that_the_network_was_not_trained_on_are_parts(
    office_scan: Path, office: Scene
) -> None:
    """It was trained on homes of seeds 0 to 10."""
    bare = files.read(office_scan)
    items = propose(bare.surface, PROPOSE, GROW)
    middles = bare.surface.centroids
    bounds = {
        p: np.stack([office.part(p).mesh.vertices.min(0), office.part(p).mesh.vertices.max(0)]) for p in office.movable
    }

    def part_of(item: Item) -> str | None:
        """Return the part whose box holds nearly all of a proposal, and is hardly larger."""
        for part, (low, high) in bounds.items():
            mine = ((middles[item.region.faces] > low - 0.03) & (middles[item.region.faces] < high + 0.03)).all(axis=1)
            if mine.mean() > 0.9 and item.region.size.prod() > 0.6 * np.sort(high - low)[1:].prod():
                return part
        return None

    found = [part_of(item) for item in items]
    assert len(set(found) - {None}) >= 5 and found.count(None) <= 0.35 * len(items)
    kinds = [item.joint.kind == office.joint(part).kind for item, part in zip(items, found, strict=True) if part]
    assert np.mean(kinds) > 0.7
    assert [item.score for item in items] == sorted((item.score for item in items), reverse=True)


def test_a_proposed_handle_is_found_as_one_that_is_clicked(monkeypatch: pytest.MonkeyPatch) -> None:
    """On the board, a bar that the scan shows; without its faces, one that is added there."""
    mesh = plain_room.room()
    surface = SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors)
    box, bar = CellBox(0, 0, 80, 90), CellBox(34, 69, 46, 71)
    told = Told([(box, SLIDES)], handles=(bar,))
    monkeypatch.setattr(run.layers, "layers", lambda points, config: [on_the_board()])
    (item,) = propose(surface, PROPOSE, GROW, told)
    np.testing.assert_allclose(item.region.normal, (1, 0, 0), atol=1e-6)
    np.testing.assert_allclose(item.region.size, (0.8, 0.9), atol=0.01)
    np.testing.assert_allclose(item.grip, plain_room.BAR, atol=0.01)
    # A flap that turns about its upper side has no handle there.
    top = MOTIONS.index(("hinge", "top"))
    (flap,) = propose(surface, PROPOSE, GROW, Told([(box, top)], handles=(bar,)))
    assert flap.joint is not None and flap.joint.kind == "revolute" and flap.grip is None
    assert item.joint.kind == "prismatic" and item.proposed and not len(item.handle)
    (scanned,) = run.cut(surface, (item,), GROW).items
    assert len(scanned.handle) and not scanned.completed
    board = surface.centroids[:, 0] < 0.01
    bare = SplitSurface.of(mesh.vertices, mesh.faces[board], mesh.colors)
    (added,) = run.cut(bare, propose(bare, PROPOSE, GROW, told), GROW).items
    assert added.completed == "bar" and len(added.handle)


def on_the_board() -> Layer:
    """Return the image of the board's left half."""
    plane = layer(92, 82)
    plane.ahead[69:71, 34:46] = plain_room.BAR[0]
    return replace(plane, low=np.array([-0.8, 0.0]))


@pytest.mark.slow
def test_the_command_writes_proposals_without_a_page(tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    folder = plain_room.write(tmp_path / "scan")
    keys = [f"scan={folder}", f"out={tmp_path / 'out'}", "auto=true", "page=false"]
    assert cli.main(["annotate", *keys]) == 0
    said, count = capsys.readouterr().out, len(scan.read(tmp_path / "out").movable)
    assert count >= 1 and f"{count} parts" in said
    assert cli.main(["annotate", *keys[:2], "page=false"]) == 2
    assert "auto=true" in capsys.readouterr().err


def plane_points(front: float, left: float, right: float, top: float) -> Points:
    """Return points of an upright plane that faces x, from the floor on, with 2 mm of noise."""
    random = np.random.default_rng(0)
    count = round(PROPOSE.density * (right - left) * top)
    place = random.uniform((0.0, left, 0.0), (0.0, right, top), (count, 3))
    place[:, 0] = front + random.normal(0.0, 0.002, count)
    return Points(place, np.tile([1.0, 0.0, 0.0], (count, 1)), np.full((count, 3), 128.0))


def together(*some: Points) -> Points:
    return Points(*(np.concatenate([getattr(each, name) for each in some]) for name in ("place", "normal", "color")))


@pytest.mark.slow
def test_a_door_2_cm_before_its_wall_has_an_image_of_its_own() -> None:
    """The wall is seven times as large, and its plane lies nearer to it than two planes can be told apart."""
    wall = together(plane_points(0.0, -3.0, 0.0, 2.5), plane_points(0.0, 0.8, 3.0, 2.5))
    found = list(layers(together(wall, plane_points(0.02, 0.0, 0.8, 2.0)), PROPOSE))
    offsets = sorted(each.offset for each in found)
    assert offsets == pytest.approx([0.0, 0.02], abs=0.002)
    door = max(found, key=lambda each: each.offset)
    assert door.low[0] == pytest.approx(0.0, abs=0.05)
    assert door.height.shape == pytest.approx((200, 80), abs=6)


def test_what_another_plane_takes_is_not_looked_at_again() -> None:
    """Shelves and fronts 28 mm apart: each lies within reach of the other, and each is one image."""
    both = together(plane_points(0.0, -1.0, 0.0, 1.0), plane_points(0.028, 0.0, 1.0, 1.0))
    assert sorted(each.offset for each in layers(both, PROPOSE)) == pytest.approx([0.0, 0.028], abs=0.002)


@pytest.mark.parametrize("flap", [True, False])
def test_what_slides_out_of_shallow_furniture_becomes_a_flap(monkeypatch: pytest.MonkeyPatch, flap: bool) -> None:
    """The board's left half, 0.8 by 0.9 m: as a flap it turns about its lower side, at the floor."""
    mesh = plain_room.room()
    monkeypatch.setattr(run.layers, "layers", lambda points, config: [on_the_board()])
    monkeypatch.setattr(run, "is_flap", lambda region, points, density: flap)
    surface = SplitSurface.of(mesh.vertices, mesh.faces, mesh.colors)
    (item,) = propose(surface, PROPOSE, GROW, Told([(CellBox(0, 0, 80, 90), SLIDES)]))
    assert item.joint.kind == ("revolute" if flap else "prismatic")
    assert abs(item.joint.axis[1 if flap else 0]) == pytest.approx(1.0)
    if flap:
        assert item.joint.origin[2] == pytest.approx(0.0, abs=0.01)
