"""The truth about a virtual scan, as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from s2a.homes.catalog import Entry


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
    found: str | None = truth.get("facts", {}).get("family", truth["style"])
    return found
