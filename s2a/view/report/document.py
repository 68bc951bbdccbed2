"""A self-contained HTML page: tables, images, and charts as SVG."""

from __future__ import annotations

import base64
import html
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import zip_longest
from pathlib import Path

from s2a.core.errors import InputError

STYLE = """
* { box-sizing: border-box }
body { font: 15px/1.5 system-ui, sans-serif; margin: 0 auto; max-width: 84rem; padding: 1.5rem 2rem 3rem }
body { color: #1f2328; background: #fff }
h1 { font-size: 1.6rem; margin: 0 0 .3rem; overflow-wrap: anywhere }
h2 { font-size: 1.2rem; margin: 2rem 0 .6rem }
p { max-width: 60rem; margin: .4rem 0 }
.about { color: #57606a; overflow-wrap: anywhere }
.wide { overflow-x: auto }
table { border-collapse: collapse; margin: .3rem 0 1rem }
th, td { padding: .25rem .8rem; text-align: left; vertical-align: top; border-bottom: 1px solid #d8dee4 }
th { font-weight: 600; background: #f6f8fa }
td.n, th.n { text-align: right; font-variant-numeric: tabular-nums }
td.n { white-space: nowrap }
td svg { vertical-align: middle }
table.dense { font-size: 12px }
.dense th, .dense td { padding: .15rem .28rem }
.pass { color: #1a7f37 }
.fail { color: #b3261e; font-weight: 600 }
.info, .skipped { color: #6e7781 }
.grid { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(26rem, 100%), 1fr)); gap: 1rem 2rem }
figure { margin: 0 }
figure img, figure video, figure svg { width: 100%; max-width: 44rem; height: auto }
figcaption { color: #57606a; font-size: .9em }
.legend { display: flex; flex-wrap: wrap; gap: .1rem 1.2rem; font-size: .9em }
.legend i { display: inline-block; width: 1.4em; height: 3px; margin-right: .4em; vertical-align: middle }
"""
# First bytes of the images that browsers show
MAGIC = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp", b"GIF8": "image/gif"}
MAX_IMAGE = 8_000_000  # [bytes] Of one image in a page


@dataclass(frozen=True)
class Document:
    """A report."""

    title: str  # in plain text
    about: str  # what was measured, and with what: one line of plain text
    sections: tuple[tuple[str, str], ...]  # title in plain text and HTML of each

    def html(self) -> str:
        """Return the whole page."""
        body = "".join(f"<section><h2>{text(title)}</h2>{content}</section>" for title, content in self.sections)
        return (
            f"<!doctype html><html lang='en'><head><meta charset='utf-8'><title>{text(self.title)}</title>"
            "<meta name='viewport' content='width=device-width'><link rel='icon' href='data:,'>"
            f"<style>{STYLE}</style></head><body><h1>{text(self.title)}</h1>"
            f"<p class='about'>{text(self.about)}</p>{body}</body></html>\n"
        )


@dataclass(frozen=True)
class Markup:
    """A cell of a table with markup of its own: HTML, and the class of its column."""

    html: str
    kind: str = ""


def text(value: object) -> str:
    """Return plain text as HTML; control characters are left out."""
    return html.escape("".join(c for c in str(value) if c.isprintable() or c == "\n"))


def table(header: Sequence[str], rows: Iterable[Sequence[object]], dense: bool = False) -> str:
    """Return a table; numbers are set right, None is empty; without names in the header it has none."""
    body = [[_cell(value) for value in row] for row in rows]
    if not body:
        return "<p>none</p>"
    right = [all(cell.kind == "n" for cell in column) for column in zip(*body, strict=True)]
    head = "".join(f"<th{' class=n' * flag}>{text(name)}" for name, flag in zip(header, right, strict=True))
    lines = ("".join(f"<td class='{cell.kind}'>{cell.html}" for cell in row) for row in body)
    top = f"<tr>{head}" if any(header) else ""
    kind = " class='dense'" * dense
    return f"<div class='wide'><table{kind}>{top}{''.join(f'<tr>{line}' for line in lines)}</table></div>"


def _cell(value: object) -> Markup:
    if isinstance(value, Markup):
        return value
    if value is None or isinstance(value, (bool, str)):
        return Markup({None: "", True: "yes", False: "no"}.get(value) or text(value or ""))  # type: ignore[arg-type]
    return Markup(text(f"{value:.4g}" if isinstance(value, float) else value), "n")


def facts(values: Mapping[str, object]) -> str:
    """Return a table of names and values, without those that are None."""
    return table(("", ""), [(name, value) for name, value in values.items() if value is not None])


def images(files: Iterable[Path]) -> str:
    """Return image files, embedded, with their names below.

    Raises:
        InputError: a file that is not an image that browsers show, or one too large for a page.
    """
    return figures((file.stem, _image(file)) for file in files)


def figures(shown: Iterable[tuple[str, bytes]]) -> str:
    """Return images, embedded, with their captions below; nothing where there is none.

    `shown`: caption in plain text, and the bytes of a PNG, JPEG, WebP or GIF file, of each.
    """
    each = "".join(
        f"<figure><img src='{_data(_kind(data), data)}' alt='{text(caption)}'><figcaption>{text(caption)}</figcaption></figure>"
        for caption, data in shown
    )
    return f"<div class='grid'>{each}</div>" if each else ""


def videos(films: Iterable[tuple[str, bytes]]) -> str:
    """Return videos, embedded, with their captions below.

    `films`: caption in plain text, and the bytes of an mp4 file, of each.
    """
    figures = (
        f"<figure><video controls muted playsinline preload='auto' src='{_data('video/mp4', data)}'></video>"
        f"<figcaption>{text(caption)}</figcaption></figure>"
        for caption, data in films
    )
    return f"<div class='grid'>{''.join(figures)}</div>"


def _data(kind: str | None, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _kind(data: bytes) -> str | None:
    """Return the media type of an image file; None for anything else."""
    return next((kind for magic, kind in MAGIC.items() if data.startswith(magic)), None)


def _image(file: Path) -> bytes:
    if (size := file.stat().st_size) > MAX_IMAGE:
        raise InputError(
            f"{file}: {size / 1e6:.0f} MB are too large for a page; give an image below {MAX_IMAGE / 1e6:.0f} MB"
        )
    data = file.read_bytes()
    if _kind(data) is None:
        raise InputError(f"{file}: not an image; give PNG, JPEG, WebP or GIF files")
    return data


WIDTH, HEIGHT = 640, 300
# [px] Of a chart, and its margins, which have room for numbers of eight characters
LEFT, RIGHT, TOP, BOTTOM = 76, 36, 12, 46
POINTS = 400  # Of a line at most; of a longer one the means of neighbours are drawn
BAR = 180  # [px] Width of an interval
COLOURS = ("#57606a", "#d4761c", "#2f6fd0", "#2a8a3c", "#a13fb5", "#b3261e", "#008c8c", "#7a6a00")


@dataclass(frozen=True)
class Line:
    """A line of a chart."""

    name: str  # for the legend; lines of one name have one colour
    x: Sequence[float]  # coordinates, rising
    y: Sequence[float]  # values; those that are not finite leave a gap


def lines(title: str, x_title: str, series: Sequence[Line], unit: float = 1.0, top: float | None = None) -> str:
    """Return a figure with lines.

    Args:
        title: above it.
        x_title: of the horizontal axis.
        series: the lines; of those of one name, such as seeds of a training, mean and range are drawn too.
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
        _strokes([line for line in drawn if line.name == name], colour[name], scale, unit) for name in names
    )
    legend = "".join(f"<span><i style='background:{colour[name]}'></i>{text(name)}</span>" for name in names)
    return (
        f"<figure><figcaption>{text(title)}</figcaption><div class='legend'>{legend}</div>"
        f"<svg viewBox='0 0 {WIDTH} {HEIGHT}' role='img' font-size='13' fill='#57606a'>"
        f"{scale.axes(x_title)}{paths}</svg></figure>"
    )


def _strokes(seeds: Sequence[Line], colour: str, scale: _Scale, unit: float) -> str:
    """Return the lines of one name as paths; several are thin, with their mean, and a band from the lowest to the highest."""
    if len(seeds) == 1:
        return f"<path d='{scale.path(seeds[0], unit)}' fill='none' stroke='{colour}' stroke-width='1.8'/>"
    thin = "".join(
        f"<path d='{scale.path(line, unit)}' fill='none' stroke='{colour}' stroke-width='.7' opacity='.6'/>"
        for line in seeds
    )
    longest = max(seeds, key=lambda line: len(line.x))
    columns = [
        [y for y in each if y is not None and math.isfinite(y)] for each in zip_longest(*(line.y for line in seeds))
    ]
    points = [(x, column) for x, column in zip(longest.x, columns, strict=True) if column]
    band = [(x, max(column)) for x, column in points] + [(x, min(column)) for x, column in reversed(points)]
    edge = " ".join(f"{px:.1f},{py:.1f}" for px, py in (scale.place(x, y / unit) for x, y in band))
    mean = Line(longest.name, [x for x, _ in points], [_mean(column) for _, column in points])
    return (
        f"<polygon points='{edge}' fill='{colour}' opacity='.15'/>{thin}"
        f"<path d='{scale.path(mean, unit)}' fill='none' stroke='{colour}' stroke-width='1.8'/>"
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
        commands, pen = [], "M"
        for x, y in zip(line.x, line.y, strict=True):
            if not math.isfinite(x + y):
                pen = "M"
                continue
            px, py = self.place(x, y / unit)
            commands.append(f"{pen}{px:.1f} {py:.1f}")
            pen = "L"
        return "".join(commands)

    def axes(self, x_title: str) -> str:
        """Return grid, numbers and the title of the horizontal axis."""
        marks = []
        for y in self.y_ticks:
            px, py = self.place(self.x_ticks[0], y)
            marks.append(f"<path d='M{px:.1f} {py:.1f}H{WIDTH - RIGHT}' stroke='#e3e7ec'/>")
            marks.append(f"<text x='{LEFT - 8}' y='{py + 4:.1f}' text-anchor='end'>{y:.6g}</text>")
        for x in self.x_ticks:
            px, _ = self.place(x, self.y_ticks[0])
            marks.append(f"<text x='{px:.1f}' y='{HEIGHT - BOTTOM + 18}' text-anchor='middle'>{x:.6g}</text>")
        middle = (LEFT + WIDTH - RIGHT) / 2
        return "".join(marks) + f"<text x='{middle}' y='{HEIGHT - 8}' text-anchor='middle'>{text(x_title)}</text>"
