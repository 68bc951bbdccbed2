"""Command `s2a report`: show a run, a sweep, an evaluation, a study or a validation report as one page."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from s2a.core.errors import InputError
from s2a.core.outputs import Output, atomic_write
from s2a.view.report import read
from s2a.view.report.document import images, videos


@dataclass(frozen=True)
class Config:
    """Keys of `s2a report`.

    Attributes:
        path: a run's folder, a folder of runs, a result file, or a validation report.
        out: the HTML file to write.
        images: further images to show, PNG, JPEG, WebP or GIF.
        states: of s2a evaluate, or a dataset of s2a collect, of which one success and one failure are shown as videos; or null.
        stage: the room of the states, or null.
    """

    path: Path
    out: Output
    images: tuple[Path, ...]
    states: Path | None
    stage: Path | None


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
    further = [("Videos", _videos(config.states, config.stage))] if config.states or config.stage else []
    further += [("Images", images(config.images))] if config.images else []
    document = replace(document, sections=(*document.sections, *further))
    with atomic_write(config.out) as file:
        file.write_text(document.html())
        size = file.stat().st_size
    return f"{config.out}: {document.title}; {size / 1000:.0f} kB"


def _videos(states: Path | None, stage: Path | None) -> str:
    """Return the videos of a file of states as HTML; InputError where it or its room is missing, or damaged."""
    if not states or not stage:
        given, missing = ("states", "stage=ROOM.usd") if states else ("stage", "states=FILE.npz")
        raise InputError(f"key {given!r} is given alone; a video needs both: give {missing}, too")
    from s2a.view.film import films  # of the extras "sim" and "collect"

    return videos((film.caption, film.data) for film in films(states, stage))
