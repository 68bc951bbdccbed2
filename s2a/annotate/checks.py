"""What the scanned surface says about an annotation that is being made: the checks of `s2a check`, of one part or of all."""

from __future__ import annotations

import numpy as np

from s2a.annotate.annotation import Draft
from s2a.scan import labels
from s2a.scan.evidence import annotation as evidence
from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding
from s2a.scan.evidence.front import front
from s2a.scan.evidence.surface import ScanSurface
from s2a.scan.rest import UNANNOTATED
from s2a.scene.scene import Part, Scene


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


def of_part(annotation: Draft, index: int, bounds: Bounds) -> list[Finding]:
    """Return what the surface says about one part with a joint; nothing about one without."""
    found, ids = scene(annotation)
    if index not in ids or not len(annotation.items[index].front):
        return []
    surface = ScanSurface(found)
    return list(evidence.moving_part(surface, ids[index], front(surface, ids[index]), bounds))


def of_all(annotation: Draft, bounds: Bounds) -> list[Finding]:
    """Return what the surface says about the whole annotation."""
    return evidence.check(scene(annotation)[0], bounds)
