"""The annotation page in headless Chromium: clicks and drags make parts, which are saved as a scan."""

from __future__ import annotations

import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import plain_room
import pytest

browser = pytest.importorskip("browser", reason="selenium is not installed", exc_type=ImportError)
pytest.importorskip("viser", reason="viser is not installed")

from s2a import scan  # noqa: E402
from s2a.annotate import files, panel  # noqa: E402
from s2a.annotate.annotation import Draft, Editor  # noqa: E402
from s2a.annotate.region import GrowConfig  # noqa: E402
from s2a.scan.evidence import Bounds  # noqa: E402
from s2a.scene.geometry.camera import CameraPose  # noqa: E402

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (browser.CHROMIUM and browser.DRIVER), reason="Chromium and its driver are not installed"),
]
WIDTH, HEIGHT = 1280, 800
EYE, TARGET, FOV = np.array([2.4, 0.4, 1.2]), np.array([0.0, 0.0, 0.4]), 0.8
GROW = GrowConfig()
BOUNDS = Bounds()


@pytest.fixture(scope="module")
def visitor() -> Iterator[browser.Page]:
    with browser.browser(WIDTH, HEIGHT) as page:
        yield page


@pytest.fixture
def room(tmp_path: Path) -> files.BareScan:
    return files.read(plain_room.write(tmp_path / "scan"))


@pytest.fixture
def page(room: files.BareScan, visitor: browser.Page, tmp_path: Path) -> Iterator[browser.Page]:
    editor = Editor(Draft(room.surface), GROW)

    def save(annotation) -> str:
        files.write(annotation, room, tmp_path / "out")
        return "saved it"

    view = CameraPose(tuple(EYE), tuple(TARGET))
    with panel.served(editor, "board", save, BOUNDS, 10**6, view, FOV, 8450) as address:
        visitor.open(address)
        visitor.wait(lambda: "Click a front" in visitor.text(), 30.0)
        visitor.wait(lambda: (visitor.image()[:, : WIDTH - panel.WIDTH] < 245).any(axis=-1).mean() > 0.1, 30.0)
        yield visitor
        assert visitor.errors() == []
        visitor.open("about:blank")


def pixel(point: tuple[float, float, float]) -> np.ndarray:
    return browser.pixel(np.array(point), EYE, TARGET, FOV, (WIDTH - panel.WIDTH, HEIGHT))


def test_a_drawer_by_a_click_a_drag_and_a_click(page: browser.Page, tmp_path: Path) -> None:
    page.click(*pixel((0.0, -0.4, 0.3)))
    page.wait(lambda: "Does it slide or turn?" in page.text(), 10.0)
    page.drag(pixel((0.0, -0.7, 0.79)), pixel((0.0, -0.1, 0.61)))
    page.wait(lambda: "faces" in page.text() and "800 x 900" not in page.text(), 10.0)
    page.press("slides out")
    page.wait(lambda: "Click the handle" in page.text() and "400 mm" in page.text(), 10.0)
    page.click(*pixel(tuple(plain_room.BAR)))
    page.wait(lambda: "handle_relief" in page.text(), 20.0)
    closed = page.image()
    page.type("open [%]", 100)
    page.wait(lambda: (np.abs(closed.astype(int) - page.image()).max(axis=-1) > 24).sum() > 3000, 10.0)
    page.press("save")
    page.wait(lambda: "saved it" in page.text(), 10.0)
    scene = scan.read(tmp_path / "out")
    assert scene.movable == ("drawer_1",) and scene.grasp_parts("drawer_1") == ("handle_2",)
    low, high = scene.parts["drawer_1"].mesh.bounds
    # A rectangle of the screen stands for a trapezoid of the board: EYE sees it askew.
    np.testing.assert_allclose([low[1], low[2], high[1], high[2]], [-0.7, 0.61, -0.1, 0.79], atol=0.04)


def test_a_door_turns_about_the_edge_that_is_clicked_and_goes_with_undo(page: browser.Page) -> None:
    page.click(*pixel((0.0, 0.4, 0.3)))
    page.wait(lambda: "Does it slide or turn?" in page.text(), 10.0)
    page.press("turns: edge")
    page.wait(lambda: "Click the edge" in page.text(), 10.0)
    page.click(*pixel((0.0, 0.78, 0.4)))
    page.wait(lambda: "Click the handle" in page.text(), 10.0)
    page.click(*pixel((0.0, 0.05, 0.5)))
    page.wait(lambda: "bar added" in page.value("part"), 10.0)
    page.wait(lambda: "hinge_handle" in page.text(), 20.0)
    for expected in ("no handle", "joint?", "none"):
        page.press("undo")
        page.wait(lambda expected=expected: expected in page.value("part"), 10.0)


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1920, 1080)])
def test_nothing_is_cut_or_covered(room: files.BareScan, width: int, height: int) -> None:
    view = CameraPose(tuple(EYE), tuple(TARGET))
    with (
        browser.browser(width, height) as page,
        panel.served(
            Editor(Draft(room.surface), GROW), "board", lambda _: "", BOUNDS, 10**6, view, FOV, 8450
        ) as address,
    ):
        page.open(address)
        page.wait(lambda: "Click a front" in page.text(), 30.0)
        time.sleep(1.0)
        browser.assert_readable(page, width)


def test_no_number_below_a_slider_is_covered_by_its_thumb(page: browser.Page) -> None:
    rows = page.driver.execute_script(
        "const box = e => e.getBoundingClientRect();"
        "return [...document.querySelectorAll('.mantine-Slider-root')].map(row => ["
        "box(row.querySelector('.mantine-Slider-thumb')).bottom,"
        "Math.min(...[...row.querySelectorAll('.mantine-Slider-markLabel')].map(e => box(e).top)) + 2])"
    )
    assert rows and all(thumb <= label for thumb, label in rows)  # a line of text begins 2 pixels below its box
