"""Charts as SVG: lines over a common axis, and intervals that fit into a cell of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from s2a.view.report.document import Markup, text

WIDTH, HEIGHT = 640, 300
LEFT, RIGHT, TOP, BOTTOM = 76, 36, 12, 46
"""[px] Of a chart, and its margins, which have room for numbers of eight characters."""
POINTS = 400
"""Of a line at most; of a longer one the means of neighbours are drawn."""
BAR = 180
"""[px] Width of an interval."""
COLOURS = ("#57606a", "#d4761c", "#2f6fd0", "#2a8a3c", "#a13fb5", "#b3261e", "#008c8c", "#7a6a00")


@dataclass(frozen=True)
class Line:
    """A line of a chart.

    Attributes:
        name: for the legend; lines of one name have one colour.
        x: coordinates, rising.
        y: values; those that are not finite leave a gap.
    """

    name: str
    x: Sequence[float]
    y: Sequence[float]


def lines(title: str, x_title: str, series: Sequence[Line], unit: float = 1.0, top: float | None = None) -> str:
    """Return a figure with lines.

    Args:
        title: above it.
        x_title: of the horizontal axis.
        series: the lines.
        unit: that values are divided by, 0.01 for percent.
        top: of the vertical axis; None: the largest value.
    """
    drawn = [_thinned(line) for line in series]
    points = [(x, y / unit) for line in drawn for x, y in zip(line.x, line.y, strict=True) if math.isfinite(x + y)]
    if not points:
        return f"<figure><figcaption>{text(title)}: no values</figcaption></figure>"
    x_ticks = ticks(min(x for x, _ in points), max(x for x, _ in points))
    y_ticks = ticks(min(0.0, *(y for _, y in points)), max(y for _, y in points) if top is None else top)
    names = list(dict.fromkeys(line.name for line in series))
    colour = {name: COLOURS[i % len(COLOURS)] for i, name in enumerate(names)}
    scale = _Scale(x_ticks, y_ticks)
    paths = "".join(
        f"<path d='{scale.path(line, unit)}' fill='none' stroke='{colour[line.name]}' stroke-width='1.8'/>"
        for line in drawn
    )
    legend = "".join(f"<span><i style='background:{colour[name]}'></i>{text(name)}</span>" for name in names)
    return (
        f"<figure><figcaption>{text(title)}</figcaption><div class='legend'>{legend}</div>"
        f"<svg viewBox='0 0 {WIDTH} {HEIGHT}' role='img' font-size='13' fill='#57606a'>"
        f"{scale.axes(x_title)}{paths}</svg></figure>"
    )


def ticks(low: float, high: float, count: int = 5) -> list[float]:
    """Return about so many round numbers from a number at or below `low` to one at or above `high`."""
    span = (high - low) or abs(high) or 1.0
    raw = span / count
    power = 10.0 ** math.floor(math.log10(raw))
    step = next(factor * power for factor in (1, 2, 5, 10) if factor * power >= raw * 0.999)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    return [step * i for i in range(first, max(last, first + 1) + 1)]


def interval(rate: float, low: float, high: float) -> tuple[Markup, Markup]:
    """Return a fraction with its interval as a bar, and as text in percent."""
    ends = [BAR * min(max(x, 0.0), 1.0) if math.isfinite(x) else 0.0 for x in (low, high, rate)]
    bar = (
        f"<svg width='{BAR + 8}' height='14' viewBox='-4 0 {BAR + 8} 14'><rect y='6' width='{BAR}' height='2' fill='#e3e7ec'/>"
        f"<rect x='{ends[0]:.1f}' y='4' width='{max(ends[1] - ends[0], 1):.1f}' height='6' rx='2' fill='#a9c4ee'/>"
        f"<circle cx='{ends[2]:.1f}' cy='7' r='4' fill='#2f6fd0'/></svg>"
    )
    return Markup(bar), Markup(text(percent(rate, low, high)), "n")


def percent(rate: float, low: float, high: float) -> str:
    """Return a fraction with its interval in percent."""
    return f"{100 * rate:.1f} % [{100 * low:.1f}, {100 * high:.1f}]"


def _thinned(line: Line) -> Line:
    """Return a line of at most POINTS points."""
    size = math.ceil(len(line.x) / POINTS)
    if size <= 1:
        return line
    chunks = [slice(i, i + size) for i in range(0, len(line.x), size)]
    return Line(line.name, [_mean(line.x[c]) for c in chunks], [_mean(line.y[c]) for c in chunks])


def _mean(values: Sequence[float]) -> float:
    return sum(values) / len(values)


@dataclass(frozen=True)
class _Scale:
    """From values to pixels."""

    x_ticks: list[float]
    y_ticks: list[float]

    def place(self, x: float, y: float) -> tuple[float, float]:
        across = (x - self.x_ticks[0]) / (self.x_ticks[-1] - self.x_ticks[0])
        up = (y - self.y_ticks[0]) / (self.y_ticks[-1] - self.y_ticks[0])
        return LEFT + across * (WIDTH - LEFT - RIGHT), HEIGHT - BOTTOM - up * (HEIGHT - TOP - BOTTOM)

    def path(self, line: Line, unit: float) -> str:
        """Return the commands of a path, which begins again after values that are not finite."""
        found, pen = [], "M"
        for x, y in zip(line.x, line.y, strict=True):
            if not math.isfinite(x + y):
                pen = "M"
                continue
            px, py = self.place(x, y / unit)
            found.append(f"{pen}{px:.1f} {py:.1f}")
            pen = "L"
        return "".join(found)

    def axes(self, x_title: str) -> str:
        """Return grid, numbers and the title of the horizontal axis."""
        found = []
        for y in self.y_ticks:
            px, py = self.place(self.x_ticks[0], y)
            found.append(f"<path d='M{px:.1f} {py:.1f}H{WIDTH - RIGHT}' stroke='#e3e7ec'/>")
            found.append(f"<text x='{LEFT - 8}' y='{py + 4:.1f}' text-anchor='end'>{y:.6g}</text>")
        for x in self.x_ticks:
            px, _ = self.place(x, self.y_ticks[0])
            found.append(f"<text x='{px:.1f}' y='{HEIGHT - BOTTOM + 18}' text-anchor='middle'>{x:.6g}</text>")
        middle = (LEFT + WIDTH - RIGHT) / 2
        return "".join(found) + f"<text x='{middle}' y='{HEIGHT - 8}' text-anchor='middle'>{text(x_title)}</text>"
