"""Two scans of a room, one with parts opened -> the faces that moved and the joint of each part.

The rooms are aligned by what stands still (`register_rooms`). Flat patches of what changed (`register_change`) give joints that
could be (`register_start`); those that open outwards, are held by what stands still and explain most surface of both scans are
kept (`register_search`, `register_check`) and fitted by least squares (`register_fit`).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.joints.register_change import CHANGED, REACH, Patch, changed, patches
from s2a.joints.register_faces import moving_faces
from s2a.joints.register_rooms import Alignment, align
from s2a.joints.register_search import FittedPart, Scans, candidates, chosen, grown
from s2a.joints.register_start import starts
from s2a.joints.register_surface import Cloud, OrientedMesh, match
from s2a.scene.articulation import lever_arm
from s2a.scene.scene import Joint

MIN_OVERLAP = 0.6
"""Fraction of the open scan that lies on the closed one if both are of one room; 0.90 to 0.95 among virtual pairs."""

OFFSET = 0.001
"""[m] Standard deviation of a whole front's distance between two scans: registration of the panoramas, alignment of the rooms."""


@dataclass(frozen=True, eq=False)
class Proposal:
    """A part that stands open in the open scan.

    Attributes:
        joint: in the closed scan's frame; its limits go from 0 to how far the part stands open.
        axis_deviation: standard deviation of the axis' direction [rad].
        origin_deviation: of the axis' place beside the part [m]; 0 for a slide, whose axis may be anywhere.
        open_deviation: of the open coordinate [m] or [rad].
        faces: of the closed scan that move, ascending, shape [face].
        explained: area that the joint explains in both scans [m^2].
        rms: distance between both there, along their normals [m].
    """

    joint: Joint
    axis_deviation: float
    origin_deviation: float
    open_deviation: float
    faces: np.ndarray
    explained: float
    rms: float


@dataclass(frozen=True, eq=False)
class Registration:
    """What two scans say.

    Attributes:
        alignment: of the open scan to the closed one.
        proposals: the parts that opened, those with most surface first.
    """

    alignment: Alignment
    proposals: list[Proposal]

    @property
    def one_room(self) -> bool:
        """Whether both scans show the same room."""
        return self.alignment.overlap >= MIN_OVERLAP


def register(closed: OrientedMesh, opened: OrientedMesh) -> Registration:
    """Return the parts that stand open in one scan of a room and not in the other; none where they show two rooms.

    Args:
        closed: the scan with the parts closed, its normals towards free space.
        opened: the other scan, in a frame of its own that differs by at most 0.2 rad about z.
    """
    alignment = align(closed, opened)
    if alignment.overlap < MIN_OVERLAP:
        return Registration(alignment, [])
    room = opened.moved(alignment.motion)
    scans = difference(closed, room)
    fronts = patches(scans.before)
    found = starts(fronts, patches(scans.after), scans.opened)
    picked = chosen(candidates(found, fronts, scans))
    proposals = []
    for candidate in picked:
        best, whole = grown(candidate, fronts, scans)
        faces = moving_faces(best.fit.joint, whole, closed, room)
        proposals.append(proposed(best, whole, faces))
    return Registration(alignment, proposals)


def proposed(found: FittedPart, front: Patch, faces: np.ndarray) -> Proposal:
    """Return a proposal with its standard deviations: those of the fit, and of OFFSET, which no number of samples lessens."""
    joint, deviations = found.fit.joint, found.fit.deviations
    hinge = joint.kind == "revolute"
    reach = max(lever_arm(joint, point) for point in front.cloud.points[:: max(1, len(front.cloud) // 200)])
    return Proposal(
        joint=joint,
        axis_deviation=float(np.linalg.norm(deviations[:2])),
        origin_deviation=float(np.hypot(np.linalg.norm(deviations[2:4]), OFFSET)) if hinge else 0.0,
        open_deviation=float(np.hypot(deviations[-1], OFFSET / reach)),
        faces=faces,
        explained=found.area,
        rms=found.fit.rms,
    )


def difference(closed: OrientedMesh, room: OrientedMesh) -> Scans:
    """Return what changed between two scans in one frame, as surfaces and as samples SPACING apart."""
    gaps = [match(faces_cloud(one), other, REACH).gap for one, other in ((closed, room), (room, closed))]
    moved = [gap > CHANGED for gap in gaps]
    before, after = (changed(one, mask) for one, mask in zip((closed, room), moved, strict=True))
    return Scans(
        closed=part(closed, moved[0]),
        opened=part(room, moved[1]),
        still=part(closed, ~moved[0]),
        first=closed,
        room=room,
        before=before,
        after=after,
    )


def part(surface: OrientedMesh, mask: np.ndarray) -> OrientedMesh:
    """Return some faces of a surface, by a mask [face]; its vertices stay."""
    return OrientedMesh(surface.vertices, surface.faces[mask])


def faces_cloud(surface: OrientedMesh) -> Cloud:
    """Return the middles of all faces."""
    return Cloud(surface.centroids, surface.normals, np.arange(len(surface.faces)))
