"""Charts: ticks, lines with gaps, intervals that stay in their cell."""

from __future__ import annotations

import math
import re

import pytest

from s2a.view.report import document, results
from s2a.view.report.document import Markup

RATE = {"rate": 0.75, "low": 0.5, "high": 0.9}


@pytest.mark.parametrize(
    ("low", "high"), [(0.0, 1.0), (0.0, 97.0), (-3.0, 5.0), (2.0, 2.0), (0.0, 0.0), (0.0, 1e9), (0.1, 0.11)]
)
def test_ticks_are_few_round_and_cover_the_range(low: float, high: float) -> None:
    found = document.ticks(low, high)
    assert 2 <= len(found) <= 9 and found[0] <= low + 1e-9 and found[-1] >= high - 1e-9
    steps = [b - a for a, b in zip(found, found[1:], strict=False)]
    assert max(steps) == pytest.approx(min(steps))
    mantissa = steps[0] / 10.0 ** math.floor(math.log10(steps[0]) + 1e-9)
    assert round(mantissa, 6) in (1, 2, 5)


def test_a_line_breaks_where_nothing_was_logged_and_ends_at_the_axes_corner() -> None:
    figure = document.lines(
        "t", "x", [document.Line("a", [0.0, 1.0, 2.0, 10.0], [0.0, math.nan, 50.0, 100.0])], 1.0, 100.0
    )
    left, right = document.LEFT, document.WIDTH - document.RIGHT
    assert re.search(rf"d='M{left}.0 254.0M\d+.\d 133.0L{right}.0 12.0'", figure)
    assert "no values" in document.lines("t", "x", [document.Line("a", [1.0], [math.nan])])


def test_long_lines_are_means_of_neighbours() -> None:
    count = 3 * document.POINTS
    figure = document.lines("t", "x", [document.Line("a", list(range(count)), [5.0] * count)])
    assert len(re.findall("L", figure)) == document.POINTS - 1


def test_an_interval_is_drawn_within_its_cell_whatever_the_file_says() -> None:
    bar, words = document.interval(0.5, 0.25, 1.75)
    assert (
        isinstance(bar, Markup)
        and f"x='{document.BAR * 0.25:.1f}'" in bar.html
        and f"width='{document.BAR * 0.75:.1f}'" in bar.html
    )
    assert words.html == "50.0 % [25.0, 175.0]"
    assert results.is_rate(RATE) and not results.is_rate({"rate": 1.0})
