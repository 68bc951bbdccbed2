"""Reports in headless Chromium: nothing is wider than the window, cut, or wrong in the console."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

browser = pytest.importorskip("browser", reason="selenium is not installed", exc_type=ImportError)

from s2a.view.report import document, read  # noqa: E402
from s2a.view.report.document import Line, lines  # noqa: E402

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (browser.CHROMIUM and browser.DRIVER), reason="Chromium and its driver are not installed"),
]
RESULTS = Path(__file__).parents[2] / "experiments/results"
NAMES = ("many_parts_cpu", "bench_pretrained", "number_of_parts", "many_parts_training", "insertion_rules")
CUT = """
const cut = [], width = document.documentElement.clientWidth;
for (const e of document.querySelectorAll('h1, h2, p, td, th, table, figure, img, video, .legend')) {
  const r = e.getBoundingClientRect();
  if (r.right > width || r.left < 0 || e.scrollWidth > e.clientWidth + 1) cut.push(e.tagName + ' ' + e.textContent.slice(0, 40));
}
for (const e of document.querySelectorAll('svg text')) {
  const r = e.getBoundingClientRect(), s = e.ownerSVGElement.getBoundingClientRect();
  if (r.left < s.left || r.right > s.right || r.top < s.top || r.bottom > s.bottom) cut.push('text ' + e.textContent);
}
return cut
"""


@pytest.fixture(scope="module", params=[1280, 1920])
def visitor(request: pytest.FixtureRequest) -> Iterator[browser.Page]:
    with browser.browser(request.param, 900) as page:
        yield page


@pytest.mark.parametrize("name", NAMES)
def test_a_report_fits_its_window(name: str, visitor: browser.Page, tmp_path: Path) -> None:
    file = tmp_path / "report.html"
    file.write_text(read(RESULTS / f"{name}.json").html())
    visitor.open(file.as_uri())
    assert visitor.driver.execute_script(CUT) == []
    assert visitor.errors() == []


def test_the_numbers_of_a_chart_are_not_cut(visitor: browser.Page, tmp_path: Path) -> None:
    charts = [(0.00064, 0.00192, 89.0), (0.0, 1041.6, -0.00031), (125000.0, 990000.0, -123456.0)]
    figures = [lines("title", "steps", [Line("one", [a, b], [0.0, y])]) for a, b, y in charts]
    file = tmp_path / "report.html"
    file.write_text(document.Document("title", "about", (("Curves", "".join(figures)),)).html())
    visitor.open(file.as_uri())
    assert visitor.driver.execute_script(CUT) == []


def test_a_video_is_ready_to_play_and_as_long_as_it_is(visitor: browser.Page, tmp_path: Path) -> None:
    film = pytest.importorskip("s2a.view.film", reason="av or newton is not installed", exc_type=ImportError)
    level = np.linspace(0, 255, 16).astype(np.uint8)
    images = [np.full((64, 96, 3), value, np.uint8) for value in level]
    section = document.videos([("world 0: success", film.encoded(images, film.RATE))])
    file = tmp_path / "report.html"
    file.write_text(document.Document("title", "about", (("Videos", section),)).html())
    visitor.open(file.as_uri())
    state = "const v = document.querySelector('video'); return [v.readyState, v.duration, v.videoWidth, v.error]"
    visitor.wait(lambda: visitor.driver.execute_script(state)[0] == 4, 20.0)  # HAVE_ENOUGH_DATA
    _, duration, width, error = visitor.driver.execute_script(state)
    assert duration == pytest.approx(len(images) / film.RATE, abs=1 / film.RATE) and width == 96 and error is None
    visitor.driver.execute_script("document.querySelector('video').play()")
    visitor.wait(lambda: visitor.driver.execute_script("return document.querySelector('video').ended"), 20.0)
    assert visitor.driver.execute_script(CUT) == []
    assert visitor.errors() == []
