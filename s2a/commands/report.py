"""A run, a sweep, an evaluation, a study or a validation report -> one self-contained page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from s2a.errors import InputError
from s2a.outputs import atomic_write
from s2a.report.document import images
from s2a.report.read import read


@dataclass(frozen=True)
class Config:
    """Keys of `s2a report`.

    Attributes:
        path: a run's folder, a folder of runs, a result file, or a validation report.
        out: the HTML file to write.
        images: further images to show, PNG, JPEG, WebP or GIF.
    """

    path: Path
    out: Path
    images: tuple[Path, ...]


def run(config: Config) -> str:
    """Write the page; return what it shows.

    Raises:
        InputError: nothing that can be reported, or a damaged file; an output that is not HTML.
    """
    if config.out.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"key 'out' is {str(config.out)!r}; expected an HTML file: give out=FILE.html")
    if missing := [file for file in config.images if not file.is_file()]:
        raise InputError(f"key 'images': {missing[0]} is not a file; give images=[FILE.png,...]")
    document = read(config.path)
    if config.images:
        document = replace(document, sections=(*document.sections, ("Images", images(config.images))))
    with atomic_write(config.out) as file:
        file.write_text(document.html())
        size = file.stat().st_size
    return f"{config.out}: {document.title}; {size / 1000:.0f} kB"
