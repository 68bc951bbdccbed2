"""An annotation that is being made: parts with fronts, joints and handles on a surface; every edit returns a new one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from s2a.annotate import handle as handles
from s2a.annotate.handle import Shape
from s2a.annotate.region import FrontRegion, GrowConfig, cut_out
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
