"""The table of artefacts: one row for each kind of file that s2a shows or reports, registered by the room that owns it.

A row needs a name, `recognise`, and what it is used for: a row with `room` is shown by `s2a view` as a tree, as an image and on
the page. Another kind is one more row:

    artefacts.register(Artefact("a point file of mine", lambda path: path.suffix == ".mine", room=read_mine))
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, fields, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

from s2a.core.errors import InputError


@dataclass(frozen=True)
class Artefact:
    """One kind of file or folder."""

    name: str  # of the kind in messages, with its article: "a scan's folder"
    # returns whether a path that exists holds this kind, from names of files or a look into one; never raises
    recognise: Callable[[Path], bool]
    # returns what is seen of it: a Scene, a SimRoom, or the described parts by id
    room: Callable[[Path], Any] | None = None
    tree: Callable[[Path], str] | None = None  # returns it as text; None: the tree of its Scene
    # returns the stage that it is about, and what it notes of that stage's parts: rows of names and values by id
    notes: Callable[[Path], tuple[Path, dict[str, Any]]] | None = None
    report: Callable[[Path], Any] | None = None  # returns it as a document of `s2a report`
    instead: Callable[[Path], str] | None = None  # returns what to do instead, for a kind that is not shown itself
    # It is tried after all other rows: it takes whatever they leave, to say what is wrong with it
    fallback: bool = False


DATASET = "meta/s2a.json"  # By this file a folder is a dataset of s2a collect; what it is of
DATASET_STAGE = "meta/stage.json"  # In it: where the robot stood in the room
TABLE: list[Artefact] = []  # All rows; the first that recognises a path and has the use asked for counts
# Uses of a row that differ, in words
SHOWN = {"room": "shown", "tree": "shown", "notes": "shown", "report": "reported"}


def register(*rows: Artefact) -> None:
    """Add rows to the table; a row whose name is there already adds its uses to that one: rooms share a kind."""
    for row in rows:
        uses = {field.name: getattr(row, field.name) for field in fields(row) if getattr(row, field.name) is not None}
        at = next((i for i, earlier in enumerate(TABLE) if earlier.name == row.name), len(TABLE))
        TABLE[at:] = [replace(TABLE[at], **uses) if at < len(TABLE) else row, *TABLE[at + 1 :]]
    TABLE.sort(key=lambda row: row.fallback)


def recognised(path: Path, use: str) -> Artefact | None:
    """Return the row of a path that has a use ("room", "notes", "report", ...), or None.

    Raises:
        InputError: the path holds a kind that is not shown itself, or only reported; it says what to do instead.
    """
    assert use in {field.name for field in fields(Artefact)}
    row = next((row for row in TABLE if (getattr(row, use) or row.instead) and row.recognise(path)), None)
    if row is not None and row.instead:
        raise InputError(f"{path}: {row.instead(path)}")
    if use in ("room", "tree") and (row is None or row.fallback):
        other = next(
            (each for each in TABLE if each.report and not (each.fallback or each.notes) and each.recognise(path)), None
        )
        if other is not None:
            raise InputError(f"{path}: is {other.name}, which is not shown; give s2a report path={path}")
    return row


def find(path: Path, use: str) -> Artefact:
    """Return the row of a path that has a use ("room", "notes", "report", ...).

    Raises:
        InputError: no such file, or of no kind that has this use; it lists the kinds that have it.
    """
    names = ", ".join(row.name for row in TABLE if getattr(row, use) and not row.fallback)
    if not path.exists():
        raise InputError(f"{path}: does not exist; give {names}")
    if (row := recognised(path, use)) is None:
        raise InputError(f"{path}: cannot be {SHOWN[use]}; give {names}")
    return row


def values(path: Path) -> dict[str, Any]:
    """Return the object in a JSON file; empty for any other file."""
    try:
        about = path.stat()
        return _values(path, about.st_mtime_ns, about.st_size) if path.is_file() else {}
    except (OSError, ValueError, RecursionError):
        return {}


@lru_cache(maxsize=4)
def _values(path: Path, changed: int, size: int) -> dict[str, Any]:
    """Read a JSON file once for all rows that look into it; its time and size make a changed file another one."""
    content = json.loads(path.read_text())
    return content if isinstance(content, dict) else {}
