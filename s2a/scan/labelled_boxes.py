"""Labelled boxes and rectangles of a capture -> the objects of a scan."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from s2a.scan.folder import GROUPS, SEGMENTS

MARGIN = 0.05
"""How far outside of its box a surface may lie [m]: capture programs fit boxes to rough surfaces."""
FLAT_MARGIN = 0.12
"""How far from its rectangle a wall, a floor or a door may lie [m]."""

_FLAT = 0.02  # [m]; thinner boxes are rectangles


@dataclass(frozen=True, eq=False)
class LabelledBox:
    """A box around an object, or a rectangle on a wall, which is a box without thickness.

    Attributes:
        label: kind of object ("couch").
        center: middle of the box, shape [3].
        axes: unit vectors along its edges, one a row, shape [3 3].
        size: lengths of its edges, in the order of `axes`, shape [3].
    """

    label: str
    center: np.ndarray
    axes: np.ndarray
    size: np.ndarray

    @property
    def is_flat(self) -> bool:
        """True for a rectangle."""
        return bool(self.size.min() < _FLAT)

    def moved(self, rotation: np.ndarray, scale: float, offset: np.ndarray) -> LabelledBox:
        """Return the box turned by a rotation [3 3], scaled, and then shifted by an offset [3]."""
        center, size = scale * (rotation @ self.center) + offset, scale * self.size
        return replace(self, center=center, axes=self.axes @ rotation.T, size=size)

    def holds(self, points: np.ndarray) -> np.ndarray:
        """Return which points [m], shape [point 3], lie in the box or near its border, shape [point]."""
        margin = np.where(self.size < _FLAT, FLAT_MARGIN, MARGIN)
        inside: np.ndarray = (np.abs((points - self.center) @ self.axes.T) <= self.size / 2 + margin).all(axis=1)
        return inside


def without_doubles(boxes: Sequence[LabelledBox]) -> list[LabelledBox]:
    """Return boxes without the rectangles that are a face of a box with the same label (a table's top)."""
    solid = [box for box in boxes if not box.is_flat]
    return [
        box
        for box in boxes
        if not box.is_flat or not any(one.label == box.label and one.holds(box.center[None])[0] for one in solid)
    ]


def owners(points: np.ndarray, boxes: Sequence[LabelledBox]) -> np.ndarray:
    """Return the box that each point [m], shape [point 3], belongs to, or -1, shape [point].

    A point in several boxes belongs to the smallest; rectangles take what no box holds.
    """
    owner = np.full(len(points), -1)
    order = sorted(range(len(boxes)), key=lambda i: (boxes[i].is_flat, float(np.sort(boxes[i].size)[1:].prod())))
    for index in order:
        owner[(owner < 0) & boxes[index].holds(points)] = index
    return owner


def write(folder: Path, vertices: np.ndarray, boxes: Sequence[LabelledBox]) -> int:
    """Write the objects in boxes as ScanNet++'s segments beside a scan's mesh; return their number.

    Args:
        folder: of the scan.
        vertices: of its mesh [m], shape [vertex 3].
        boxes: in the same coordinates [m].
    """
    owner = owners(vertices, boxes)
    objects = [index for index in range(len(boxes)) if (owner == index).any()]
    groups = [
        {"id": number, "objectId": number, "label": boxes[index].label, "segments": [index + 1]}
        for number, index in enumerate(objects, start=1)
    ]
    for name, data in ((SEGMENTS, {"segIndices": (owner + 1).tolist()}), (GROUPS, {"segGroups": groups})):
        (folder / name).write_text(json.dumps(data, separators=(",", ":")), encoding="utf-8")
    return len(objects)
