"""The annotator's list: every part of a furnished room with its number, label, place in the tree, and exact facts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from s2a.homes.solids import Piece, Surface, join
from s2a.scene.scene import Part, Scene


@dataclass(frozen=True)
class Entry:
    """One annotated part.

    Attributes:
        number: 1-based, unique in the scene.
        label: as the data set writes it ("drawer.2.1"); objects without moving parts carry only their name.
        parent: number of the part it belongs to, or None.
        piece: its shape and joint, in the scene.
        articulated: Its object has moving parts, hence belongs to Articulate3D's annotation.
        carrier: number of the part in or on which it lies and with which it moves, or None.
    """

    number: int
    label: str
    parent: int | None
    piece: Piece
    articulated: bool
    carrier: int | None = None

    @property
    def part_id(self) -> str:
        """The part's id in a Scene: its name and number."""
        return f"{self.piece.name.replace(' ', '_')}_{self.number}"


def catalog(pieces: tuple[Piece, ...]) -> list[Entry]:
    """Number the parts of articulated objects, object by object and level by level, then all other objects."""
    entries: list[Entry] = []
    for index, piece in enumerate((piece for piece in pieces if moves(piece)), start=1):
        level: list[tuple[Piece, str, int | None]] = [(piece, str(index), None)]
        while level:
            below: list[tuple[Piece, str, int | None]] = []
            for part, path, parent in level:
                entries.append(Entry(len(entries) + 1, f"{part.name}.{path}", parent, part, True))
                below += [(child, f"{path}.{i}", entries[-1].number) for i, child in enumerate(part.children, start=1)]
            level = below
    loose: list[tuple[Piece, int | None]] = [(piece, None) for piece in pieces if not moves(piece)]
    loose += [(thing, entry.number) for entry in entries for thing in entry.piece.contents]
    for piece, carrier in loose:
        entries.append(Entry(len(entries) + 1, piece.name, None, piece, False, carrier))
        on = len(entries)
        entries += [
            Entry(on + i, thing.name, None, thing, False, on) for i, thing in enumerate(piece.contents, start=1)
        ]
    return entries


def moves(piece: Piece) -> bool:
    """Whether a piece or any part of it has a joint."""
    return piece.joint is not None or any(moves(child) for child in piece.children)


def clean_scene(name: str, entries: list[Entry]) -> Scene:
    """Return the exact scene: CAD surfaces, true joints; graspable are the deepest parts below each joint."""
    by_number = {entry.number: entry for entry in entries}
    parts = {
        entry.part_id: Part(
            label=entry.piece.name,
            mesh=entry.piece.surface.mesh,
            parent=None if entry.parent is None else by_number[entry.parent].part_id,
            motion=entry.piece.joint or "fixed",
            graspable=_graspable(entry, entries),
        )
        for entry in entries
    }
    return Scene(name, parts)


def _graspable(entry: Entry, entries: list[Entry]) -> bool:
    """Whether a part is where a hand takes hold: it moves or lies below a part that moves, and has no parts itself."""
    by_number = {other.number: other for other in entries}
    if any(other.parent == entry.number for other in entries):
        return False
    while entry.piece.joint is None and entry.parent is not None:
        entry = by_number[entry.parent]
    return entry.piece.joint is not None


def cad(entries: list[Entry]) -> tuple[Surface, np.ndarray]:
    """Return the surfaces of all parts as one, and the number of the part that each face belongs to, shape [face]."""
    surfaces = [entry.piece.surface for entry in entries]
    return join(*surfaces), np.repeat([entry.number for entry in entries], [len(s.faces) for s in surfaces])


def part_truth(entry: Entry, ids: Mapping[int, str]) -> dict[str, Any]:
    """Return the exact facts about one part: label, style, size, pose, joint, what carries it, a handle's family and lengths.

    Args:
        entry: the part.
        ids: of all parts by their numbers.
    """
    joint = entry.piece.joint
    facts: dict[str, Any] = {
        "label": entry.label,
        "style": entry.piece.style,
        "size": entry.piece.size.tolist(),
        "pose": entry.piece.pose.tolist(),
    }
    if joint is not None:
        facts["joint"] = {"kind": joint.kind, "axis": joint.axis, "origin": joint.origin, "limits": joint.limits}
    if entry.carrier is not None:
        facts["carrier"] = ids[entry.carrier]
    if entry.piece.facts:
        facts["facts"] = dict(entry.piece.facts)
    return facts


def handle_of(truth: Mapping[str, Any]) -> str | None:
    """Return the family of a part's handle, or its style where no family is known; None: it has none. `truth`: of part_truth."""
    family: str | None = truth.get("facts", {}).get("family", truth["style"])
    return family
