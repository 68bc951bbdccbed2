"""The page in headless Chromium: it opens, moves, shows, hides, and says what was clicked."""

from __future__ import annotations

import json
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from cabinet import HANDLE, free_cube, write_cabinet

browser = pytest.importorskip("browser", reason="selenium is not installed", exc_type=ImportError)
pytest.importorskip("viser", reason="viser is not installed")

from s2a.commands import cli  # noqa: E402
from s2a.scene.geometry.camera import CameraPose  # noqa: E402
from s2a.view.page import cards, scene_nodes, serve  # noqa: E402
from s2a.view.page import room as read  # noqa: E402

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (browser.CHROMIUM and browser.DRIVER), reason="Chromium and its driver are not installed"),
]
WIDTH, HEIGHT, PANEL = 1280, 800, serve.WIDTH
EYE, TARGET, FOV = np.array([2.4, 1.2, 1.6]), np.array([0.3, 0.0, 0.6]), 0.8
SECONDS = 5.0
"""In which the page opens. Software rendering on a busy machine gets the factor below."""
BUSY = 4.0


@pytest.fixture(scope="module")
def stage(tmp_path_factory: pytest.TempPathFactory) -> Path:
    cube = free_cube("cube_9", (0.0, 0.0, 0.852), 0.1, 0.2)
    return write_cabinet(tmp_path_factory.mktemp("page") / "sim.usd", free=[cube])


@pytest.fixture(scope="module")
def visitor() -> Iterator[browser.Page]:
    with browser.browser(WIDTH, HEIGHT) as page:
        yield page


@pytest.fixture
def page(stage: Path, visitor: browser.Page) -> Iterator[browser.Page]:
    with serve.served(read.read(stage), CameraPose(tuple(EYE), tuple(TARGET)), FOV, 8400) as address:
        start = time.monotonic()
        visitor.open(address)
        visitor.wait(lambda: "Joints (1)" in visitor.text(), 30.0)
        visitor.wait(lambda: _shown(visitor.image()) > 0.1, 30.0)
        assert time.monotonic() - start < BUSY * SECONDS
        yield visitor
        assert visitor.errors() == []
        visitor.open("about:blank")  # or it would miss its server


def _shown(image: np.ndarray) -> float:
    """Return the fraction of the scene's side of the window that is not empty."""
    return float((image[:, : WIDTH - PANEL] < 245).any(axis=-1).mean())


def pixel(point: np.ndarray) -> np.ndarray:
    """Return where the page shows a point of the scene at first [pixel]: x, y."""
    return browser.pixel(point, EYE, TARGET, FOV, (WIDTH - PANEL, HEIGHT))


def changed(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    """Return the pixels [n 2] (x, y) of the scene that differ clearly."""
    differs = np.abs(before.astype(int) - after)[:, : WIDTH - PANEL].max(axis=-1) > 24
    return np.argwhere(differs)[:, ::-1]


def test_a_slider_moves_the_drawer_and_nothing_else(page: browser.Page) -> None:
    before = page.image()
    page.type("drawer_2 [mm]", 300)
    page.wait(lambda: len(changed(before, page.image())) > 500, 10.0)
    moved = changed(before, page.image())
    # The drawer's front, closed and 0.3 m open, with a margin for its handle.
    corners = [(x, y, z) for x in (0.3, 0.37 + 0.3) for y in (-0.36, 0.36) for z in (0.65, 0.79)]
    places = np.array([pixel(np.array(corner)) for corner in corners])
    assert (moved >= places.min(axis=0) - 6).all() and (moved <= places.max(axis=0) + 6).all()
    page.press("close")
    page.wait(lambda: len(changed(before, page.image())) == 0, 10.0)


def test_layers_come_and_go(page: browser.Page) -> None:
    start = page.image()
    page.tick("joint axes")
    page.wait(lambda: len(changed(start, page.image())) > 50, 10.0)
    page.tick("joint axes")
    page.wait(lambda: len(changed(start, page.image())) == 0, 10.0)
    page.tick("surfaces")
    page.wait(lambda: _shown(page.image()) < 0.03, 10.0)
    for layer in ("colliders", "grasp regions", "supports", "reach", "colours by part"):
        empty = page.image()
        page.tick(layer)
        page.wait(lambda empty=empty: len(changed(empty, page.image())) > 50, 10.0)


def test_a_click_in_the_scene_and_one_on_a_row_select_a_part(page: browser.Page) -> None:
    start = page.image()
    page.click(*pixel(np.array([HANDLE[0], 0.2, 0.7])))  # on the drawer's front
    page.wait(lambda: "slides 0 to 400 mm" in page.text() and "cabinet_1" in page.text(), 10.0)
    page.wait(lambda: len(changed(start, page.image())) > 500, 10.0)
    marked = page.image()
    page.press("Parts")
    page.press("cube_9")
    page.wait(lambda: "0.2 kg" in page.text(), 10.0)
    page.wait(lambda: len(changed(marked, page.image())) > 500, 10.0)


def test_all_faces_are_there_when_the_camera_rests(
    stage: Path, visitor: browser.Page, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page of a room with many faces begins with few of them, and ends as if it had sent all at once."""
    view = CameraPose(tuple(EYE), tuple(TARGET))
    images = []
    for limit in (scene_nodes.COARSE_FACES, 60):
        monkeypatch.setattr(scene_nodes, "COARSE_FACES", limit)
        with serve.served(read.read(stage), view, FOV, 8400) as address:
            visitor.open(address)
            visitor.wait(lambda: _shown(visitor.image()) > 0.02, 30.0)
            images.append(visitor.image())
            if limit == 60:
                assert len(changed(*images)) > 2000
                visitor.wait(lambda: len(changed(images[0], visitor.image())) < 20, 30.0)
                visitor.drag(np.array([300.0, 700.0]), np.array([310.0, 700.0]))  # the camera moves aside
                time.sleep(2 * scene_nodes.REST)
                assert len(changed(images[0], visitor.image())) > 20
            visitor.open("about:blank")
    assert visitor.errors() == []


@pytest.fixture
def insertion(tmp_path: Path) -> Path:
    """Write what an insertion of two objects leaves, one of which comes after the other, and one that found no place."""
    cubes = [free_cube(name, (0.0, y, 0.852), 0.1, 0.2) for name, y in (("mug_9", 0.2), ("book_10", -0.2))]
    write_cabinet(tmp_path / "insert.usda", free=cubes)
    steps = [
        {
            "id": name,
            "problem": "",
            "hint": hint,
            "pose": {"position": [0.0, y, 0.8]},
            "verify": {"drift": 0.001, "tilt": 0.0},
        }
        for name, y, hint in (("mug_9", 0.2, "left"), ("book_10", -0.2, "right"))
    ]
    (tmp_path / "insert.json").write_text(json.dumps({"objects": [*steps, {"id": "", "problem": "no place"}]}))
    return tmp_path


def test_the_slider_of_an_insertion_brings_its_objects_one_after_the_other(
    insertion: Path, visitor: browser.Page
) -> None:
    stage, noted = cards.of_path(insertion)
    room = replace(read.read(stage), notes=noted).with_inserted(cards.inserted(insertion, noted))
    places = {name: pixel(np.array([0.0, y, 0.852])) for name, y in (("mug_9", 0.2), ("book_10", -0.2))}

    def seen(before: np.ndarray) -> list[str]:
        """Return which objects are not as they were at first, by the middle of each in the image."""
        differs = {tuple(place) for place in changed(before, visitor.image())}
        return [name for name, place in places.items() if tuple(np.rint(place).astype(int)) in differs]

    with serve.served(room, CameraPose(tuple(EYE), tuple(TARGET)), FOV, 8400) as address:
        visitor.open(address)
        visitor.wait(lambda: "Notes (2)" in visitor.text(), 30.0)
        visitor.wait(lambda: _shown(visitor.image()) > 0.1, 30.0)
        visitor.press("Notes")
        visitor.type("step", 0)
        visitor.wait(lambda: "nothing is inserted yet" in visitor.text(), 10.0)
        time.sleep(1.0)
        empty = visitor.image()
        # Each object has the steps hint, place and rest: it is there from its second step on.
        for step, there in (
            (1, []),
            (2, ["mug_9"]),
            (3, ["mug_9"]),
            (4, ["mug_9"]),
            (5, ["mug_9", "book_10"]),
            (0, []),
        ):
            visitor.type("step", step)
            visitor.wait(lambda there=there: seen(empty) == there, 10.0)
        visitor.type("step", 6)
        visitor.wait(lambda: seen(empty) == ["mug_9", "book_10"], 10.0)
        browser.assert_readable(visitor, WIDTH)
        visitor.open("about:blank")
    assert visitor.errors() == []


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1920, 1080)])
def test_nothing_is_cut_or_covered(stage: Path, width: int, height: int) -> None:
    """All text of the panel lies within the window, and no caption over another."""
    with (
        browser.browser(width, height) as page,
        serve.served(read.read(stage), CameraPose(tuple(EYE), tuple(TARGET)), FOV, 8400) as url,
    ):
        page.open(url)
        page.wait(lambda: "Joints (1)" in page.text(), 30.0)
        browser.assert_readable(page, width)


def test_the_file_plays_without_a_server(stage: Path, tmp_path: Path) -> None:
    file = tmp_path / "room.html"
    assert cli.main(["view", f"path={stage}", f"html={file}"]) == 0
    assert file.stat().st_size < 2e6
    with browser.browser(480, 320) as page:  # small, since software renders every frame of it
        page.open(f"file://{file}")
        page.wait(lambda: len(changed(np.full((320, 480, 3), 255), page.image())) > 5000, 30.0)
        images = [page.image() for _ in range(8)]
        assert max(len(changed(images[0], image)) for image in images) > 100
        assert page.errors() == []
        assert page.driver.title == "test"
    text = file.read_text()
    assert "http://localhost" not in text and str(tmp_path) not in text
