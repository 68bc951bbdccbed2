"""Worlds that are played on the page: states are kept as they are, and the slider of time moves the drawer in all of them."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from cabinet import free_cube, write_cabinet

browser = pytest.importorskip("browser", reason="selenium is not installed", exc_type=ImportError)
pytest.importorskip("viser", reason="viser is not installed")

from s2a.scene.geometry.camera import CameraPose  # noqa: E402
from s2a.scene.scene import Mesh  # noqa: E402
from s2a.view.page import room as read  # noqa: E402
from s2a.view.page import serve  # noqa: E402
from s2a.view.page.room import Played, PlayedWorld  # noqa: E402

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (browser.CHROMIUM and browser.DRIVER), reason="Chromium and its driver are not installed"),
]
WIDTH, HEIGHT = 1280, 800
VIEW = CameraPose((4.0, 1.2, 2.4), (0.3, 0.0, 0.6))
FRAMES, RATE = 21, 10.0


def world(name: str, opening: float) -> PlayedWorld:
    """Return a world whose drawer opens evenly, whose cube rises, and whose robot stands still."""
    part = np.linspace(0.0, 1.0, FRAMES)
    moved = np.tile(np.eye(4), (FRAMES, 1, 1))
    moved[:, 2, 3] = 0.5 * part
    links = np.tile([0.9, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (FRAMES, 1, 1))
    return PlayedWorld(name, {"drawer_2": opening * part}, {"cube_9": moved}, links)


@pytest.fixture
def page(tmp_path: Path) -> Iterator[browser.Page]:
    room = read.read(write_cabinet(tmp_path / "sim.usd", free=[free_cube("cube_9", (0.0, 0.0, 0.852), 0.1, 0.2)]))
    link = Mesh(np.array([(0.0, 0, 0), (0.1, 0, 0), (0, 0, 0.4)]), np.array([(0, 1, 2)]))
    played = Played(RATE, (link,), (world("world 0", 0.3), world("world 1", 0.1)))
    view = serve.whole(VIEW, room, 2)
    with browser.browser(WIDTH, HEIGHT) as page, serve.served_worlds(room, played, view, 0.8, 8410) as address:
        page.open(address)
        page.wait(lambda: "time [s]" in page.text(), 30.0)
        page.wait(lambda: "world 1, drawer_2 0 mm" in page.text(), 30.0)
        page.wait(lambda: (page.image()[:, : WIDTH - serve.WIDTH] < 245).any(axis=-1).mean() > 0.1, 30.0)
        yield page
        assert page.errors() == []


def changed(before: np.ndarray, after: np.ndarray) -> np.ndarray:
    differs = np.abs(before.astype(int) - after)[:, : WIDTH - serve.WIDTH].max(axis=-1) > 24
    return np.argwhere(differs)[:, ::-1]


def test_the_slider_of_time_moves_both_worlds(page: browser.Page) -> None:
    before = page.image()
    page.type("time [s]", 2)
    page.wait(lambda: "world 0, drawer_2 300 mm" in page.text() and "world 1, drawer_2 100 mm" in page.text(), 10.0)
    page.wait(lambda: len(changed(before, page.image())) > 300, 10.0)
    across = changed(before, page.image())[:, 0]
    middle = (WIDTH - serve.WIDTH) / 2
    assert (across < middle).sum() > 50 and (across > middle).sum() > 50
    page.type("time [s]", 0)
    page.wait(lambda: len(changed(before, page.image())) == 0, 10.0)


def test_it_plays_to_the_end_and_stops(page: browser.Page) -> None:
    page.press("play")
    page.wait(lambda: "pause" in page.text(), 10.0)
    page.wait(lambda: "world 0, drawer_2 300 mm" in page.text(), 30.0)
    page.wait(lambda: "play" in page.text() and "pause" not in page.text(), 10.0)
    assert float(page.value("time [s]") or 2) == 2.0
