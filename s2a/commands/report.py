"""Command `s2a report`: show a run, a sweep, an evaluation, a study or a validation report as one page."""

import json
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
        states: states file of s2a evaluate, or dataset of s2a collect: one success and one failure are shown as videos; or null.
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
    refuse_another_run(config.path, config.states)
    further = [("Videos", _videos(config.states, config.stage))] if config.states or config.stage else []
    further += [("Images", images(config.images))] if config.images else []
    document = replace(document, sections=(*document.sections, *further))
    with atomic_write(config.out) as file:
        file.write_text(document.html())
        size = file.stat().st_size
    return f"{config.out}: {document.title}; {size / 1000:.0f} kB"


def refuse_another_run(path: Path, file: Path | None) -> None:
    """Raise InputError where states are not those of the evaluation at `path`; files of earlier versions do not tell."""
    if file is None or file.suffix != ".npz" or path.suffix != ".json":
        return
    values = json.loads(path.read_text())
    if not isinstance(values, dict) or "settings" not in values or "sha256" not in values:
        return
    from s2a.view import states  # of the extra "sim"

    record = states.read(file)
    count = round(values["success"]["rate"] * values["episodes"]) if "success" in values else None
    pairs = {
        "room (SHA-256)": (record.sha256, values["sha256"]),
        "robot": (record.robot, values["robot"]),
        "moving part": (values["part"] in {*record.parts, *record.objects}, True),
        "number of worlds": (len(record.names), values["episodes"]),
        "successes": (sum(record.success), count) if record.success and count is not None else (0, 0),
    }
    if other := [name for name, (own, expected) in pairs.items() if own != expected]:
        raise InputError(
            f"key 'states': {file} belongs to another run than {path}: other {', '.join(other)}; give its own states"
        )


def _videos(states: Path | None, stage: Path | None) -> str:
    """Return the videos of a file of states as HTML; InputError where it or its room is missing, or damaged."""
    if not states or not stage:
        given, missing = ("states", "stage=ROOM.usd") if states else ("stage", "states=FILE.npz")
        raise InputError(f"key {given!r} is given alone; a video needs both: give {missing}, too")
    from s2a.view.film import films  # of the extras "sim" and "collect"

    return videos((film.caption, film.data) for film in films(states, stage))
