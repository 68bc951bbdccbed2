"""Each piece of knowledge about motions has one place in the package."""

from __future__ import annotations

import re
from pathlib import Path

import s2a
from s2a.core import config

SOURCES = {path: path.read_text() for path in Path(s2a.__file__).parent.rglob("*.py")}


def files_with(pattern: str) -> list[str]:
    """Return the names of the package's files in which a pattern is found."""
    return sorted(path.name for path, text in SOURCES.items() if re.search(pattern, text))


def test_the_control_frequency_is_computed_once() -> None:
    assert files_with(r"\.dt \* [\w.]*substeps|\.substeps \* [\w.]*dt\b") == ["solver.py"]


def test_the_approach_is_written_once() -> None:
    assert not [
        path for path in config.folder().rglob("*.yaml") if re.search(r"^\s*approach: ", path.read_text(), re.M)
    ]
    assert files_with(r"(?m)^STRAIGHT_APPROACH = ") == ["trajectory.py"]
    assert files_with(r"(?m)^    approach: Positive = (?!STRAIGHT_APPROACH\b)") == []


def test_joint_paths_from_many_bases_are_asked_for_by_one_search() -> None:
    """The other use follows a path from one base, which is given."""
    assert files_with(r"(?<!def )\bfollow\((kin|self\._kin), ") == ["open.py", "search.py"]
    assert files_with(r"^class _?Search\b|\nclass _?Search\b") == ["search.py"]


def test_there_is_one_class_of_obstacles_and_one_of_corrections() -> None:
    assert files_with(r"\nclass \w*Obstacles\b|\nclass RoomHulls\b|\nclass Surfaces\b") == ["obstacles.py"]
    assert files_with(r"\nclass \w*Correction\b") == ["correction.py"]
