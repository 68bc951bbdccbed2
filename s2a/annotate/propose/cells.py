"""Rectangles of cells of a plane's image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class CellBox:
    """A rectangle of an image: cells from `low` to below `high`, each (column, row)."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width(self) -> float:
        """Columns."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Rows."""
        return self.top - self.bottom

    @property
    def cells(self) -> tuple[slice, slice]:
        """What it selects of an image: rows and columns."""
        return slice(int(self.bottom), int(np.ceil(self.top))), slice(int(self.left), int(np.ceil(self.right)))

    @property
    def middle(self) -> tuple[float, float]:
        """Column and row of its middle."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2
