"""All checks of an annotated scan."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from s2a.scan.articulate3d_files import Overlap
from s2a.scan.evidence import contact, room
from s2a.scan.evidence import joint as hinge
from s2a.scan.evidence import joint as slide
from s2a.scan.evidence.finding import Bounds, Finding, bounded_above, unknown
from s2a.scan.evidence.front import Front, front, panel
from s2a.scan.evidence.joint import kind, opens_outward
from s2a.scan.evidence.surface import ScanSurface
from s2a.scan.evidence.sweep import Sweep, sweep
from s2a.scene.scene import Scene


def check(scene: Scene, bounds: Bounds, overlaps: Sequence[Overlap] = ()) -> list[Finding]:
    """Return what the scanned surface says about an annotation: of the room first, then of each moving part.

    Args:
        scene: as read from a scan or a geometric stage: no surface trimmed.
        bounds: thresholds.
        overlaps: faces that two unrelated parts of the scan list, which a scene cannot tell (`read_overlaps`).

    Returns:
        Every answer, also those that pass; of parts that float and of shared faces the failures alone.
    """
    surface = ScanSurface(scene)
    fronts = {part: front(surface, part) for part in scene.movable}
    findings = [*room.findings(surface, fronts, bounds), *contact.floating(surface, bounds)]
    findings += contact.shared_faces(overlaps, bounds)
    for part, found in fronts.items():
        findings += moving_part(surface, part, found, bounds)
    return findings


def moving_part(surface: ScanSurface, part: str, front: Front | None, bounds: Bounds) -> Iterator[Finding]:
    """Yield what the surface says about one moving part.

    Args:
        surface: the room.
        part: id of the part.
        front: its front, if it has one.
        bounds: thresholds.
    """
    scene, joint = surface.scene, surface.scene.joint(part)
    if front is None:
        yield unknown("front", part, "it has no flat surface, so that its joint cannot be checked")
        return
    points = panel(scene, part).vertices.astype(float)
    handle = contact.has_handle(scene, part)
    yield opens_outward(part, joint, front, bounds)
    yield kind(part, scene.parts[part].label, joint, front, bounds)
    if joint.kind == "prismatic":
        yield slide.slide_axis(part, joint, front, bounds)
        yield slide.slide_level(part, scene.parts[part].label, joint, bounds)
        yield slide.slide_travel(part, joint, front, surface, bounds)
        if handle:
            yield slide.slide_handle(part, joint, front, scene.grasp_point(part), bounds)
    else:
        yield hinge.hinge_edge(part, joint, front, points, bounds)
        yield hinge.hinge_parallel(part, joint, front, bounds)
        yield hinge.hinge_range(part, joint, bounds)
        if handle:
            yield hinge.hinge_handle(part, joint, front, points, scene.grasp_point(part), bounds)
    if handle:
        yield contact.handle_on_part(part, scene, bounds)
        yield contact.handle_relief(part, scene, front, bounds)
    if contact.region(scene, part).face_areas.any():
        yield contact.grasp_on_region(part, scene, bounds)
    yield path(part, sweep(surface, part, bounds.blocked), joint.kind, bounds)


def path(part: str, found: Sweep, kind: str, bounds: Bounds) -> Finding:
    """Judge the swept path of a part against the untrimmed rest of the scan."""
    unit = "m" if kind == "prismatic" else "rad"
    names = " and ".join(name for name, _ in found.obstacles[:2])
    message = f"{found.blocked:.0%} of it runs into {names or 'nothing'}; free up to {found.free:.2f} of {found.full:.2f} {unit}"
    remedy = f"possible: up to {bounds.blocked:.0%}; correct the joint, or is something in its way?"
    return bounded_above("swept_path", part, found.blocked, bounds.blocked, "of the surface", message, remedy, "warn")
