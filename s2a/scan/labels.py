"""Annotators' labels: `door.1.2` is a door, and part of whatever carries the index path 1."""

import logging
import re
from collections.abc import Iterable, Mapping

_log = logging.getLogger(__name__)

IndexPath = tuple[str, ...]
_REMOVED = re.compile(r"[\W_]*(to[\W_]+(be[\W_]+)?)?removed?(?![a-z])", re.IGNORECASE)
_SPLIT = re.compile(r"[\W_]*split[\W_\d]*$", re.IGNORECASE)


def split(label: str) -> tuple[str, IndexPath]:
    """Split a label into the object's name and its index path: "handle base.1.2_1" -> "handle base", ("1", "2_1").

    The first dot ends the name. Stray dots and blanks, which annotators leave behind, are dropped: "box lid." is a
    "box lid" without a path.
    """
    name, _, path = label.partition(".")
    tokens = (token.strip() for token in path.split("."))
    return " ".join(name.split()), tuple(token for token in tokens if token)


def is_removed(label: str) -> bool:
    """Return whether annotators marked a region as an artefact of the reconstruction: "REMOVE", "remove 2", "Removed.3"."""
    return _REMOVED.match(label) is not None


def is_split(label: str) -> bool:
    """Return whether annotators marked a region as one that could not be annotated: "SPLIT", "split_2"."""
    return _SPLIT.match(label) is not None


def family(names: Iterable[str], label: str) -> str:
    """Return the longest of some names that a label ends with, "oven door" rather than "door"; "" for none."""
    words = f" {label.lower().replace('_', ' ')}"
    return max((name for name in names if words.endswith(f" {name}")), key=len, default="")


def part_id(name: str, number: int) -> str:
    """Return a part's id, a valid USD prim name: ("handle base", 4) -> "handle_base_4"."""
    safe = re.sub(r"[^A-Za-z0-9_]", "_", name) or "part"
    return f"{'_' if safe[0].isdigit() else ''}{safe}_{number}"


def parents(labels: Mapping[int, str]) -> dict[int, int | None]:
    """Return each part's parent by number: the part whose index path is the longest proper beginning of its own.

    Names play no role: "handle.1.2.1" belongs to "door.1.2" or, if nobody has 1.2, to "door frame.1". Where two parts
    share an index path, children go to the first (and a warning is logged). A label without an index path is an object.
    """
    paths = {number: split(label)[1] for number, label in labels.items()}
    owners: dict[IndexPath, int] = {}
    for number, path in paths.items():
        if path:
            owners.setdefault(path, number)
    parent_of = {number: _nearest(path, owners) for number, path in paths.items()}
    _warn_of_ambiguity(labels, paths, owners, parent_of)
    return parent_of


def artefacts(labels: Mapping[int, str], parent_of: Mapping[int, int | None]) -> set[int]:
    """Return the parts that annotators marked as artefacts, and all that belongs to one."""
    removed: set[int] = set()
    for number in parents_first(parent_of):
        if parent_of[number] in removed or is_removed(labels[number]):
            removed.add(number)
    return removed


def without(parent_of: Mapping[int, int | None], gone: set[int]) -> dict[int, int | None]:
    """Return each other part's parent when some parts go: the nearest ancestor that stays."""
    parents_left: dict[int, int | None] = {}
    for number, parent in parent_of.items():
        while parent is not None and parent in gone:
            parent = parent_of[parent]
        if number not in gone:
            parents_left[number] = parent
    return parents_left


def depths(parent_of: Mapping[int, int | None]) -> dict[int, int]:
    """Return the number of ancestors of every part."""
    depth_of: dict[int, int] = {}
    for number in parents_first(parent_of):
        parent = parent_of[number]
        depth_of[number] = 0 if parent is None else 1 + depth_of[parent]
    return {number: depth_of[number] for number in parent_of}


def parents_first(parent_of: Mapping[int, int | None]) -> list[int]:
    """Return the parts as a tree is printed: each followed by all that belongs to it, siblings in the given order."""
    children: dict[int | None, list[int]] = {}
    for number, parent in parent_of.items():
        children.setdefault(parent, []).append(number)
    order: list[int] = []
    waiting = children.get(None, [])[::-1]
    while waiting:
        order.append(waiting.pop())
        waiting += children.get(order[-1], [])[::-1]
    return order


def grasped(movable: set[int], parent_of: Mapping[int, int | None]) -> set[int]:
    """Return where hands take hold: each movable part's deepest descendants, or the part itself if it has none."""
    depth = depths(parent_of)
    below: dict[int, list[int]] = {number: [] for number in movable}
    for number in parent_of:
        ancestor = parent_of[number]
        while ancestor is not None:
            if ancestor in below:
                below[ancestor].append(number)
            ancestor = parent_of[ancestor]
    handles: set[int] = set()
    for number, descendants in below.items():
        deepest = max((depth[i] for i in descendants), default=0)
        handles |= {i for i in descendants if depth[i] == deepest} or {number}
    return handles


def _nearest(path: IndexPath, owners: Mapping[IndexPath, int]) -> int | None:
    """Return the part with the longest proper beginning of an index path, or None."""
    beginnings = (path[:length] for length in range(len(path) - 1, 0, -1))
    return next((owners[beginning] for beginning in beginnings if beginning in owners), None)


def _warn_of_ambiguity(
    labels: Mapping[int, str],
    paths: Mapping[int, IndexPath],
    owners: Mapping[IndexPath, int],
    parent_of: Mapping[int, int | None],
) -> None:
    """Log what the labels leave open: parents that share their index path, and labels without one."""
    used = set(parent_of.values())
    for number, path in paths.items():
        first = owners.get(path, number)
        if first != number and first in used:
            _log.warning("labels %r and %r share an index path; parts go to the first", labels[first], labels[number])
    bare = [labels[number] for number, path in paths.items() if not path]
    if bare:
        _log.warning("%d labels without an index path are objects of their own: %s", len(bare), ", ".join(bare[:5]))
