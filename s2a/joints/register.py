"""Two scans of a room, one with parts opened -> the faces that moved and the joint of each part.

The rooms are aligned by what stands still, and flat patches of what changed are found (`register_surface`). They give joints that
could be, which are fitted by least squares (`register_fit`); those that open outwards, are held by what stands still and explain
most surface of both scans are kept (`register_search`).
"""

import json
import shutil
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from scipy import ndimage

from s2a.core.errors import InputError
from s2a.joints import register_surface as surfaces
from s2a.joints.register_fit import starts
from s2a.joints.register_search import ROOM, FittedPart, Scans, candidates, chosen, grown, near_box
from s2a.scan import folder, ply
from s2a.scan.formats import articulate3d
from s2a.scan.ply import ScanMesh
from s2a.scene.articulation import lever_arm, transform
from s2a.scene.scene import Joint

NEAR = 0.007  # [m] A face that moves lies as near to the open scan, once it has moved
ALIKE = 0.6  # Cosine between its normal and that of the open scan, at least
STILL = 0.004  # [m] A face that is as near to the open scan where it was has not moved
CELL = 0.006  # [m] Width of the cells in which the outline of the front is filled
GAP = 4  # Cells that are bridged there
NEXT = 0.02  # [m] Sides of a front are not farther from its outline
# [m] How far what belongs to the part stands before its front; lies behind it within its outline, such as the panes
# of a window; and behind it on its sides
BEFORE, SUNK, BEHIND = 0.09, 0.04, 0.07


def moving_faces(
    joint: Joint, patch: surfaces.Patch, closed: surfaces.OrientedMesh, opened: surfaces.OrientedMesh
) -> np.ndarray:
    """Return the indices of the closed scan's faces that move with a part, ascending.

    `opened`: the open scan in the closed one's frame, all of it.
    """
    near = np.flatnonzero(near_box(closed.centroids, patch, ROOM))
    cloud = surfaces.Cloud(closed.centroids[near], closed.normals[near], near)
    stays = surfaces.match(cloud, opened, surfaces.CHANGED)
    moves = surfaces.match(cloud.moved(transform(joint, joint.limits[1])), opened, NEAR)
    explained = (moves.alike > ALIKE) & ((stays.gap > STILL) | (stays.alike < 0.3)) & (moves.gap < stays.gap)
    height = (cloud.points - patch.centre) @ patch.normal
    layer = (height > -SUNK) & (height < BEFORE)
    flat = (np.abs(height) < 2 * CELL) & (cloud.normals @ patch.normal > 0.7)
    across = np.linalg.svd(patch.normal[None])[2][1:]
    cells = np.floor((cloud.points - patch.centre) @ across.T / CELL).astype(int)
    cells -= cells.min(axis=0) - GAP - 1
    inside = _outline(cells, explained & layer)[tuple(cells.T)] & layer
    # Sides of a thick door lie beyond its outline; what both scans show of them has moved for certain.
    deep = (height > -BEHIND) & (height < BEFORE)
    sides = explained & deep & (stays.gap >= surfaces.CHANGED) & near_box(cloud.points, patch, NEXT)
    return near[(inside & (explained | flat | (stays.gap > STILL))) | sides]


def _outline(cells: np.ndarray, marked: np.ndarray) -> np.ndarray:
    """Return the filled outline of marked points on a grid, its largest connected piece."""
    grid = np.zeros(cells.max(axis=0) + GAP + 2, bool)
    grid[tuple(cells[marked].T)] = True
    grid = ndimage.binary_closing(grid, np.ones((3, 3)), iterations=GAP)
    grid = ndimage.binary_opening(ndimage.binary_fill_holes(grid), np.ones((3, 3)))
    labels, count = ndimage.label(grid)
    if not count:
        return grid
    sizes = ndimage.sum_labels(grid, labels, np.arange(1, count + 1))
    return labels == 1 + int(np.argmax(sizes))


# Fraction of the open scan that lies on the closed one if both are of one room; 0.90 to 0.95 among virtual pairs
MIN_OVERLAP = 0.6

# [m] Standard deviation of a whole front's distance between two scans: registration of the panoramas,
# alignment of the rooms
OFFSET = 0.001


@dataclass(frozen=True, eq=False)
class Proposal:
    """A part that stands open in the open scan."""

    joint: Joint  # in the closed scan's frame; its limits go from 0 to how far the part stands open
    axis_deviation: float  # standard deviation of the axis' direction [rad]
    origin_deviation: float  # of the axis' place beside the part [m]; 0 for a slide, whose axis may be anywhere
    open_deviation: float  # of the open coordinate [m] or [rad]
    faces: np.ndarray  # of the closed scan that move, ascending, shape [face]
    explained: float  # area that the joint explains in both scans [m^2]
    rms: float  # distance between both there, along their normals [m]


@dataclass(frozen=True, eq=False)
class Registration:
    """What two scans say."""

    alignment: surfaces.Alignment  # of the open scan to the closed one
    proposals: list[Proposal]  # the parts that opened, those with most surface first

    @property
    def one_room(self) -> bool:
        """Whether both scans show the same room."""
        return self.alignment.overlap >= MIN_OVERLAP


def register(closed: surfaces.OrientedMesh, opened: surfaces.OrientedMesh) -> Registration:
    """Return the parts that stand open in one scan of a room and not in the other; none where they show two rooms.

    `closed`: the scan with the parts closed, its normals towards free space; `opened`: the other scan, in a frame of
    its own that differs by at most 0.2 rad about z.
    """
    alignment = surfaces.align(closed, opened)
    if alignment.overlap < MIN_OVERLAP:
        return Registration(alignment, [])
    room = opened.moved(alignment.motion)
    scans = difference(closed, room)
    fronts = surfaces.patches(scans.before)
    possible = starts(fronts, surfaces.patches(scans.after), scans.opened)
    picked = chosen(candidates(possible, fronts, scans))
    proposals = []
    for candidate in picked:
        best, whole = grown(candidate, fronts, scans)
        faces = moving_faces(best.fit.joint, whole, closed, room)
        proposals.append(proposed(best, whole, faces))
    return Registration(alignment, proposals)


def proposed(fitted: FittedPart, front: surfaces.Patch, faces: np.ndarray) -> Proposal:
    """Return a proposal with its standard deviations: those of the fit, and of OFFSET, which no number of samples lessens."""
    joint, deviations = fitted.fit.joint, fitted.fit.deviations
    hinge = joint.kind == "revolute"
    reach = max(lever_arm(joint, point) for point in front.cloud.points[:: max(1, len(front.cloud) // 200)])
    return Proposal(
        joint=joint,
        axis_deviation=float(np.linalg.norm(deviations[:2])),
        origin_deviation=float(np.hypot(np.linalg.norm(deviations[2:4]), OFFSET)) if hinge else 0.0,
        open_deviation=float(np.hypot(deviations[-1], OFFSET / reach)),
        faces=faces,
        explained=fitted.area,
        rms=fitted.fit.rms,
    )


def difference(closed: surfaces.OrientedMesh, room: surfaces.OrientedMesh) -> Scans:
    """Return what changed between two scans in one frame, as surfaces and as samples SPACING apart."""
    gaps = []
    for one, other in ((closed, room), (room, closed)):
        middles = surfaces.Cloud(one.centroids, one.normals, np.arange(len(one.faces)))
        gaps.append(surfaces.match(middles, other, surfaces.REACH).gap)
    moved = [gap > surfaces.CHANGED for gap in gaps]
    before, after = (surfaces.changed(one, mask) for one, mask in zip((closed, room), moved, strict=True))
    return Scans(
        closed=surfaces.OrientedMesh(closed.vertices, closed.faces[moved[0]]),
        opened=surfaces.OrientedMesh(room.vertices, room.faces[moved[1]]),
        still=surfaces.OrientedMesh(closed.vertices, closed.faces[~moved[0]]),
        first=closed,
        room=room,
        before=before,
        after=after,
    )


REPORT = "register.json"  # The file with all figures, by which an earlier output is known
# What a proposed part is called, by the kind of its joint; what it is nobody knows
NAMES = {"prismatic": "drawer", "revolute": "door"}


def read(path: Path) -> ScanMesh:
    """Read the mesh of a scan's folder, whatever annotations are beside it.

    Raises:
        InputError: no folder, no mesh in it, several, or a damaged one.
    """
    if not path.is_dir():
        what = "is a file" if path.exists() else "does not exist"
        raise InputError(f"{path}: {what}; give the folder of one scan, which holds its mesh ({folder.MESH})")
    return ply.read(folder.find_bare(path).mesh)


def label(index: int, proposal: Proposal) -> str:
    """Return the label of a proposal by its place in the list, such as "drawer.2"."""
    return f"{NAMES[proposal.joint.kind]}.{index + 1}"


def write(registration: Registration, mesh: ScanMesh, name: str, out: Path, **facts: Any) -> None:
    """Write proposals as an annotated scan into a folder. `facts`: what else register.json says."""
    shutil.copyfile(mesh.path, out / folder.MESH)
    labels = [label(i, proposal) for i, proposal in enumerate(registration.proposals)]
    numbered = list(zip(range(1, len(labels) + 1), labels, registration.proposals, strict=True))
    parts = [{"partId": n, "objectId": n, "label": text, "triIndices": p.faces.tolist()} for n, text, p in numbered]
    stats = {"totalFaces": len(mesh.faces), "totalVertices": len(mesh.vertices)}
    joints = [joint_record(n, p, mesh.origin) for n, _, p in numbered]
    listed = [{"pid": n, "label": text, "group": "others"} for n, text, _ in numbered]
    data = {"parts": {"stats": stats, "annotations": parts}, "artic": {"parts": listed, "articulations": joints}}
    for ending, content in data.items():
        _write(out / f"{name}_{ending}.json", {"modelId": f"register.{name}", "data": content})
    about = registration.alignment
    alignment = {"motion": about.motion.tolist(), "overlap": about.overlap, "rms_m": about.rms}
    figures = [{"label": text} | figures_of(p) for _, text, p in numbered]
    _write(out / REPORT, {**facts, "alignment": alignment, "parts": figures}, indent=1)


def joint_record(number: int, proposal: Proposal, origin: np.ndarray) -> dict[str, Any]:
    """Return Articulate3D's record of a joint; `origin` takes the reader's coordinates to the file's [m], shape [3]."""
    joint = proposal.joint
    place = {"origin": (np.array(joint.origin) + origin).tolist(), "axis": list(joint.axis), "base": []}
    limits = {"rangeMin": joint.limits[0], "rangeMax": joint.limits[1]}
    return {"pid": number, "type": articulate3d.TYPES[joint.kind], **place, **limits}


def figures_of(proposal: Proposal) -> dict[str, Any]:
    """Return how certain a proposal is: standard deviations in radians and metres, and what it explains."""
    p = proposal
    figures = {"kind": p.joint.kind, "open": p.joint.limits[1], "faces": len(p.faces)}
    deviations = {"axis": p.axis_deviation, "origin": p.origin_deviation, "open": p.open_deviation}
    return {**figures, "explained_m2": p.explained, "rms_m": p.rms, "deviations": deviations}


def _write(path: Path, content: dict[str, Any], indent: int | None = None) -> None:
    path.write_text(json.dumps(content, indent=indent) + "\n", encoding="utf-8")
