"""Reports in headless Chromium: nothing is wider than the window, cut, or wrong in the console."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

browser = pytest.importorskip("browser", reason="selenium is not installed", exc_type=ImportError)

from s2a.report.read import read  # noqa: E402

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(not (browser.CHROMIUM and browser.DRIVER), reason="Chromium and its driver are not installed"),
]
RESULTS = Path(__file__).parents[2] / "experiments/results"
NAMES = ("planner_room_office", "bench_pretrained", "reward_ablation", "many_parts_training", "insertion_rules")
CUT = """
const cut = [], width = document.documentElement.clientWidth;
for (const e of document.querySelectorAll('h1, h2, p, td, th, table, figure, img, .legend')) {
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
