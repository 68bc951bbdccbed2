"""A page that stands alone: tables, charts and images in one HTML file, which loads nothing."""

from __future__ import annotations

import base64
import html
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
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
MAGIC = {b"\x89PNG\r\n\x1a\n": "image/png", b"\xff\xd8\xff": "image/jpeg", b"RIFF": "image/webp", b"GIF8": "image/gif"}
"""First bytes of the images that browsers show."""
MAX_IMAGE = 8_000_000
"""[bytes] Of one image in a page."""


@dataclass(frozen=True)
class Document:
    """A report.

    Attributes:
        title: in plain text.
        about: what was measured, and with what: one line of plain text.
        sections: title in plain text and HTML of each.
    """

    title: str
    about: str
    sections: tuple[tuple[str, str], ...]

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
        InputError: a file that is no image that browsers show, or one too large for a page.
    """
    figures = (
        f"<figure><img src='{_embedded(file)}' alt='{text(file.stem)}'><figcaption>{text(file.stem)}</figcaption></figure>"
        for file in files
    )
    return f"<div class='grid'>{''.join(figures)}</div>"


def videos(films: Iterable[tuple[str, bytes]]) -> str:
    """Return videos, embedded, with their captions below.

    Args:
        films: caption in plain text, and the bytes of an mp4 file, of each.
    """
    figures = (
        f"<figure><video controls muted playsinline preload='auto' src='{_data('video/mp4', data)}'></video>"
        f"<figcaption>{text(caption)}</figcaption></figure>"
        for caption, data in films
    )
    return f"<div class='grid'>{''.join(figures)}</div>"


def _data(kind: str, data: bytes) -> str:
    return f"data:{kind};base64,{base64.b64encode(data).decode()}"


def _embedded(file: Path) -> str:
    if (size := file.stat().st_size) > MAX_IMAGE:
        raise InputError(
            f"{file}: {size / 1e6:.0f} MB are too large for a page; give an image below {MAX_IMAGE / 1e6:.0f} MB"
        )
    data = file.read_bytes()
    kind = next((kind for magic, kind in MAGIC.items() if data.startswith(magic)), None)
    if kind is None:
        raise InputError(f"{file}: not an image; give PNG, JPEG, WebP or GIF files")
    return _data(kind, data)
