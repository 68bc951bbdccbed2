"""The state of an annotation session: its history, the selected part, and the edits that clicks ask for."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from s2a.annotate import region
from s2a.annotate.annotation import Draft, Item
from s2a.annotate.handle import Shape
from s2a.annotate.region import Direction, FrontRegion, GrowConfig, hinge, hinge_at, side, slide

RECTANGULAR = 0.8  # Fraction of its rectangle that a region fills from which on its sides are straight
END = 0.05  # [m] A dragged side this near to where the region ends lies there
MIN_SIDE = 0.03  # [m] A front is no smaller


@dataclass(frozen=True, eq=False)
class Step:
    """A state that undo goes back to: the annotation, and the index of the selected part."""

    annotation: Draft
    selected: int | None


class Editor:
    """Edits an annotation, and undoes edits.

    Attributes:
        config: how regions grow.
    """

    def __init__(self, start: Draft, config: GrowConfig) -> None:
        self.config = config
        self._steps = [Step(start, None)]

    @property
    def annotation(self) -> Draft:
        """The annotation as it stands."""
        return self._steps[-1].annotation

    @property
    def selected(self) -> int | None:
        """Index of the selected part, or None."""
        return self._steps[-1].selected

    @property
    def item(self) -> Item | None:
        """The selected part, or None."""
        return None if self.selected is None else self.annotation.items[self.selected]

    def undo(self) -> bool:
        """Take the last edit back; return False where there is none."""
        if len(self._steps) > 1:
            self._steps.pop()
            return True
        return False

    def select(self, index: int | None) -> None:
        """Select a part; no edit, so that undo passes over it."""
        self._steps[-1] = replace(self._steps[-1], selected=index)

    def click_front(self, face: int) -> None:
        """Select the part that a face belongs to, or make one of the region around it."""
        part = self.annotation.at(face)
        if part is not None:
            self.select(part)
            return
        self._make(region.grow(self.annotation.surface, face, self.config))

    def rectangle(self, corners: np.ndarray) -> None:
        """Cut the selected front out as a rectangle; its hinge goes along.

        `corners`: of the rectangle, on the front's plane as seen from the camera [m], shape [4 3].
        """
        if self.item is None or self.selected is None:
            return
        annotation = self.annotation.with_rectangle(self.selected, _rectangle(self.item.region, corners), self.config)
        item = annotation.items[self.selected]
        if item.joint is not None and item.joint.kind == "revolute":
            edge = side(self.item.region, np.array(item.joint.origin))[0]
            annotation = annotation.changed(self.selected, joint=hinge_at(item.region, edge))
        self._do(annotation)

    def rectangle_around(self, faces: np.ndarray, corners: Callable[[FrontRegion], np.ndarray | None]) -> None:
        """Make a part of a rectangle.

        Args:
            faces: that are seen in it, the one at its middle first.
            corners: of the rectangle on the plane of a region [m], shape [4 3]; None where that is seen from its edge.
        """
        front = region.grow_most(self.annotation.surface, faces, self.config)
        places = corners(front)
        if places is not None:
            self._make(front, places)

    def slide(self, direction: Direction = "out") -> None:
        """Let the selected part slide."""
        if self.item is not None:
            self._change(joint=slide(self.item.region, direction))

    def hinge(self, points: np.ndarray) -> None:
        """Let the selected part turn about the side at a point, or the line through two, shape [point 3] [m]."""
        if self.item is not None:
            self._change(joint=hinge(self.item.region, points))

    def limit(self, upper: float) -> None:
        """Let the selected part open so far [m] or [rad]."""
        if self.item is not None and self.item.joint is not None:
            self._change(joint=replace(self.item.joint, limits=(0.0, upper)))

    def label(self, name: str) -> None:
        """Name the selected part; dots would be read as index paths."""
        if self.item is not None and (clean := " ".join(name.replace(".", " ").split())) != self.item.label:
            self._change(label=clean)

    def handle(self, point: np.ndarray, kind: Shape | None = None) -> None:
        """Give the selected part the handle at a place [3] [m]; `kind`: the shape to add where the mesh shows none."""
        if self.selected is not None:
            self._do(self.annotation.with_handle(self.selected, point, kind))

    def accept(self) -> None:
        """Take the selected proposal over."""
        self._change(proposed=False)

    def accept_all(self) -> None:
        """Take all proposals over."""
        items = tuple(replace(item, proposed=False) for item in self.annotation.items)
        self._do(replace(self.annotation, items=items))

    def remove(self) -> None:
        """Remove the selected part: rejects a proposal."""
        if self.selected is not None:
            self._steps.append(Step(self.annotation.removed(self.selected), None))

    def _make(self, front: FrontRegion, corners: np.ndarray | None = None) -> None:
        """Add a part with a region, cut out where it is a rectangle or is to be one, and select it."""
        annotation = self.annotation.added(Item(front))
        index = len(annotation.items) - 1
        filled = annotation.surface.areas[front.faces].sum() / float(np.prod(front.size))
        if corners is not None:
            annotation = annotation.with_rectangle(index, _rectangle(front, corners), self.config)
        elif filled > RECTANGULAR:
            annotation = annotation.with_rectangle(index, front, self.config)
        self._steps.append(Step(annotation, index))

    def _change(self, **fields: object) -> None:
        if self.selected is not None:
            self._do(self.annotation.changed(self.selected, **fields))

    def _do(self, annotation: Draft) -> None:
        self._steps.append(Step(annotation, self.selected))


def _rectangle(front: FrontRegion, corners: np.ndarray) -> FrontRegion:
    """Return a region with the rectangle that corners on its plane stand for; its ends are kept where they are near.

    A camera that looks askew turns a rectangle on the screen into another quadrilateral: each side lies in the middle of its
    two corners.
    """
    flat = np.sort(front.local(corners)[:, :2], axis=0)
    low, high = flat[:2].mean(axis=0), flat[2:].mean(axis=0)
    half = front.size / 2
    low = np.where(np.abs(low + half) < END, -half, low)
    high = np.where(np.abs(high - half) < END, half, high)
    size = np.maximum(high - low, MIN_SIDE)
    center = front.center + front.axes @ ((low + high) / 2)
    return replace(front, center=center, size=size)
