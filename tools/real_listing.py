"""What the list of a real scene's prims says beside virtual rooms: labels, objects, parts."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np

QUANTILES = (1, 5, 25, 50, 75, 95, 99)
"""[%] Given in the summary, beside the minimum."""


def overlap(labels: dict[str, int], movable: set[str], listing: Path) -> dict[str, Any]:
    """Return which labels of a real scan's list of prims the virtual rooms have, and the counts that the list tells.

    Args:
        labels: of all parts of the virtual rooms.
        movable: labels of those that move; the list has no joints, so that real parts with these labels count as movable.
        listing: the list.
    """
    prims = json.loads(listing.read_text())
    names = Counter(prim["label"].replace("_", " ") for prim in prims)
    parents = {prim["part_id"]: prim["parent_id"] for prim in prims}
    sizes = Counter(_root(number, parents) for number in parents)
    nested = [size for size in sizes.values() if size > 1]
    inner = [prim["label"].replace("_", " ") for prim in prims if prim["parent_id"] is not None]
    return {
        "labels shared": sorted(set(names) & set(labels)),
        "labels missing": sorted(set(names) - set(labels)),
        "fraction of prims": round(sum(count for name, count in names.items() if name in labels) / len(prims), 3),
        "prims": len(prims),
        "objects": len(sizes),
        "objects with parts": len(nested),
        "parts of an object with parts": quantiles(nested),
        "movables by their labels": sum(label in movable for label in inner),
    }


def _root(number: int, parents: dict[int, int | None]) -> int:
    """Return the number of the object that a real part belongs to."""
    while (parent := parents[number]) is not None:
        number = parent
    return number


def quantiles(values: list[float]) -> dict[str, float]:
    """Return the minimum and the quantiles of some values, by name."""
    found = np.percentile(values, QUANTILES).round(3).tolist()
    return {"min": round(float(min(values)), 3)} | {f"{q} %": v for q, v in zip(QUANTILES, found, strict=True)}
