"""An annotation that is being made: parts with fronts, joints and handles on a surface, and the session that edits them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from s2a.annotate import handle as handles
from s2a.annotate import region
from s2a.annotate.handle import Shape
from s2a.annotate.region import Direction, FrontRegion, GrowConfig, cut_out, hinge, hinge_at, side, slide
from s2a.annotate.surface import SplitSurface
from s2a.core.check import Check
from s2a.scan import labels
from s2a.scan.evidence import Bounds
from s2a.scan.evidence import annotation as evidence
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scan.formats.articulate3d import TYPES
from s2a.scan.predictions import USUAL_LABEL
from s2a.scene.scene import UNANNOTATED, Joint, Part, Scene

NO_FACES = np.empty(0, np.int64)


@dataclass(frozen=True, eq=False)
class Item:
    """A part that moves."""

    region: FrontRegion  # its front
    label: str = ""  # its name; empty: the usual one of its joint's kind
    joint: Joint | None = None  # None while nobody has said how it moves
    # numbers of its handle's faces; those of the region count as the handle's, too
    handle: np.ndarray = field(default_factory=lambda: NO_FACES)
    completed: str = ""  # shape of a handle that was added where the mesh shows none; empty for a scanned one
    proposed: bool = False  # nobody has accepted it yet
    score: float = 1.0  # of a proposal, 0 to 1
    # place at which a proposal's handle was seen [m], shape [3]; None where none was, and for all others
    grip: np.ndarray | None = None
    number: int | None = None  # of the part in an existing annotation that is edited; None for a new one

    @property
    def name(self) -> str:
        """Its label, or the usual one."""
        return self.label or USUAL_LABEL[TYPES["prismatic" if self.joint is None else self.joint.kind]]

    @property
    def front(self) -> np.ndarray:
        """Numbers of the front's faces without the handle's."""
        return np.setdiff1d(self.region.faces, self.handle)


@dataclass(frozen=True, eq=False)
class Draft:
    """All parts so far."""

    surface: SplitSurface  # the scan, split where borders cross its triangles
    items: tuple[Item, ...] = ()  # the parts

    def added(self, item: Item) -> Draft:
        """Return the annotation with one more part."""
        return replace(self, items=(*self.items, item))

    def changed(self, index: int, **fields: object) -> Draft:
        """Return the annotation with other values of a part."""
        items = list(self.items)
        items[index] = replace(items[index], **fields)  # type: ignore[arg-type]
        return replace(self, items=tuple(items))

    def removed(self, index: int) -> Draft:
        """Return the annotation without a part."""
        return replace(self, items=self.items[:index] + self.items[index + 1 :])

    def at(self, face: int) -> int | None:
        """Return the part that a face belongs to, the smallest of several, or None."""
        parts = [i for i, item in enumerate(self.items) if face in item.region.faces or face in item.handle]
        return min(parts, key=lambda i: len(self.items[i].region.faces), default=None)

    def with_rectangle(self, index: int, region: FrontRegion, config: GrowConfig) -> Draft:
        """Return the annotation with a part's front cut out as a rectangle; what others have is left out."""
        surface, region, parents = cut_out(self.surface, region, config)
        items = [_divided(item, len(self.surface.faces), parents) for item in self.items]
        taken = [item.front for i, item in enumerate(items) if i != index]
        own = np.setdiff1d(region.faces, np.concatenate([NO_FACES, *taken]))
        items[index] = replace(items[index], region=replace(region, faces=own))
        return Draft(surface, tuple(items))

    def with_handle(self, index: int, point: np.ndarray, kind: Shape | None) -> Draft:
        """Return the annotation with a part's handle at a place [3]: the faces that stand out there, or a parametric shape.

        Args:
            index: of the part.
            point: where it is [m].
            kind: the shape to add; None: the scanned faces, or where none stand out the usual shape.
        """
        item = self.items[index]
        faces = handles.find(self.surface, item.region, point) if kind is None else NO_FACES
        if len(faces):
            return self.changed(index, handle=faces, completed="")
        kind = kind or handles.USUAL
        first = len(self.surface.faces)
        taken = [other.front for i, other in enumerate(self.items) if i != index]
        smeared = np.setdiff1d(handles.smeared(self.surface, item.region, point), np.concatenate([NO_FACES, *taken]))
        region = replace(item.region, faces=np.union1d(item.region.faces, smeared))
        height = handles.rise(self.surface, region, point)
        surface = self.surface.with_mesh(handles.shape(kind, region, point, item.joint, height))
        numbers = np.arange(first, len(surface.faces))
        return Draft(surface, self.changed(index, region=region, handle=numbers, completed=kind).items)


def _divided(item: Item, first: int, parents: np.ndarray) -> Item:
    """Return a part that keeps the pieces of its faces; those are numbered from `first` on, cut from `parents`."""
    return replace(
        item,
        region=replace(item.region, faces=_with_pieces(item.region.faces, first, parents)),
        handle=_with_pieces(item.handle, first, parents),
    )


def _with_pieces(faces: np.ndarray, first: int, parents: np.ndarray) -> np.ndarray:
    mine = np.zeros(first + len(parents), bool)
    mine[faces] = True
    for piece, parent in enumerate(parents, start=first):  # a piece may be cut again
        mine[piece] = mine[parent]
    return np.flatnonzero(mine)


def scene(annotation: Draft, name: str = "scan") -> tuple[Scene, dict[int, str]]:
    """Return the scene as it would be read from the written files, and the id of each part with a joint by its index."""
    parts: dict[str, Part] = {}
    ids: dict[int, str] = {}
    left = np.ones(len(annotation.surface.faces), bool)
    left[annotation.surface.source < 0] = False
    for index, item in enumerate(annotation.items):
        if item.joint is None:
            continue
        ids[index] = owner = labels.part_id(item.name, len(parts) + 1)
        parts[owner] = Part(item.name, annotation.surface.mesh(item.front), motion=item.joint)
        left[item.front] = False
        if len(item.handle):
            mesh = annotation.surface.mesh(item.handle)
            parts[labels.part_id("handle", len(parts) + 1)] = Part("handle", mesh, owner, graspable=True)
            left[item.handle] = False
    rest = annotation.surface.mesh(np.flatnonzero(left))
    parts[labels.part_id(UNANNOTATED, len(parts) + 1)] = Part(UNANNOTATED, rest)
    return Scene(name, parts), ids


def of_part(annotation: Draft, index: int, bounds: Bounds) -> list[Check]:
    """Return what the surface says about one part with a joint; nothing about one without."""
    room, ids = scene(annotation)
    if index not in ids or not len(annotation.items[index].front):
        return []
    surface = ScanSurface(room)
    return list(evidence.moving_part(surface, ids[index], front(surface, ids[index]), bounds))


def of_all(annotation: Draft, bounds: Bounds) -> list[Check]:
    """Return what the surface says about the whole annotation."""
    return evidence.check(scene(annotation)[0], bounds)


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
