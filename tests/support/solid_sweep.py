"""Whether furniture keeps clear of other furniture: how deep the surface of one part reaches into the solids of others."""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property

import numpy as np
import trimesh
import warp as wp

from s2a.homes.room import Entry, Room, catalog
from s2a.homes.solids import Piece, Surface, join, rotation, translation
from s2a.scene.scene import Joint

POSES = (0.02, 0.1, 0.3, 0.6, 1.0)
"""Shares of a joint's range at which a front is looked at."""
HINGE = 0.04
"""[m] Round a hinge's axis nothing counts: there a real hinge gives way by its own, unmodelled, mechanism."""
SHELL = {"wall", "floor", "ceiling"}


@wp.kernel
def _depth(mesh: wp.uint64, points: wp.array(dtype=wp.vec3), depth: wp.array(dtype=float)):
    tid = wp.tid()
    found = wp.mesh_query_point_sign_winding_number(mesh, points[tid], 0.3)
    if found.result and found.sign < 0.0:
        nearest = wp.mesh_eval_position(mesh, found.face, found.u, found.v)
        depth[tid] = wp.length(nearest - points[tid])


class Solid:
    """Solids that may overlap, may be concave, and may lack a rim: inside is where their winding number says so."""

    def __init__(self, surface: Surface, spacing: float) -> None:
        self.surface, self.spacing = surface, spacing
        self.bounds = np.stack([surface.vertices.min(axis=0), surface.vertices.max(axis=0)])

    @cached_property
    def mesh(self) -> wp.Mesh:
        """For queries."""
        vertices = wp.array(self.surface.vertices.astype(np.float32), dtype=wp.vec3, device="cpu")
        faces = wp.array(self.surface.faces.ravel(), dtype=int, device="cpu")
        return wp.Mesh(vertices, faces, support_winding_number=True)

    @cached_property
    def points(self) -> np.ndarray:
        """Corners, and points spread over the surface, about `spacing` [m] apart, shape [point 3]."""
        mesh = trimesh.Trimesh(self.surface.vertices, self.surface.faces, process=False)
        spread, _ = trimesh.sample.sample_surface(mesh, int(mesh.area / self.spacing**2) + 20, seed=0)
        return np.concatenate([self.surface.vertices, spread])

    def depth(self, points: np.ndarray) -> float:
        """Return how deep the deepest of some points lies inside [m]; 0 if none does."""
        points = points[((points > self.bounds[0]) & (points < self.bounds[1])).all(axis=1)]
        if not len(points):
            return 0.0
        asked = wp.array(points.astype(np.float32), dtype=wp.vec3, device="cpu")
        found = wp.zeros(len(points), dtype=float, device="cpu")
        wp.launch(_depth, dim=len(points), inputs=[self.mesh.id, asked], outputs=[found], device="cpu")
        return float(found.numpy().max())


def parts(piece: Piece) -> Iterator[Piece]:
    """Yield a piece and all parts below it."""
    yield piece
    for child in piece.children:
        yield from parts(child)


def whole(piece: Piece) -> Surface:
    """Return the surface of a piece with all its parts."""
    return join(piece.surface, *(whole(child) for child in piece.children))


def motion(joint: Joint, value: float) -> np.ndarray:
    """Return the motion of a part by a joint's coordinate, shape [4 4]."""
    if joint.kind == "prismatic":
        return translation(value * np.array(joint.axis))
    origin = np.array(joint.origin)
    return translation(origin) @ rotation(value * np.array(joint.axis)) @ translation(-origin)


def moved(points: np.ndarray, transform: np.ndarray) -> np.ndarray:
    """Return points after a rigid motion, shape [point 3]."""
    return points @ transform[:3, :3].T + transform[:3, 3]


def clashes(room: Room, tolerance: float, spacing: float = 0.02) -> list[str]:
    """Return a line for each part that, on its way, enters anything else in the room deeper than the tolerance [m].

    What it is in when closed is not counted: a sash lies in the rebate of its frame.
    """
    entries = catalog(room.pieces)
    solids = [Solid(entry.piece.surface, 1.5 * spacing) for entry in entries]
    boxes = np.stack([solid.bounds for solid in solids])
    found = []
    for entry in entries:
        if entry.piece.joint is not None:
            own = _below(entry, entries)
            others = np.array([other.number not in own for other in entries])
            for index, (depth, share) in _entered(entry, solids, boxes, others, spacing).items():
                if depth > tolerance:
                    found.append(f"{entry.label} at {share:.0%} enters {entries[index].label} by {1e3 * depth:.1f} mm")
    return found


def _entered(
    entry: Entry, solids: list[Solid], boxes: np.ndarray, others: np.ndarray, spacing: float
) -> dict[int, tuple[float, float]]:
    """Return how much deeper than when closed a front enters other solids [m], and at which share of its range."""
    joint, front = entry.piece.joint, Solid(whole(entry.piece), spacing)
    assert joint is not None
    worst: dict[int, tuple[float, float]] = {}
    closed: dict[int, float] = {}
    for share in (0.0, *POSES):
        move = motion(joint, joint.limits[1] * share)
        points = moved(front.points, move)
        low, high = points.min(axis=0), points.max(axis=0)
        met = others & (boxes[:, 0] < high).all(axis=1) & (boxes[:, 1] > low).all(axis=1)
        for i in np.flatnonzero(met).tolist():
            back = moved(_far(solids[i].points, joint), np.linalg.inv(move))
            depth = max(solids[i].depth(_far(points, joint)), front.depth(back))
            if share == 0.0:
                closed[i] = depth
            worst[i] = max(worst.get(i, (0.0, 0.0)), (depth - closed.get(i, 0.0), share))
    return worst


def _below(entry: Entry, entries: list[Entry]) -> set[int]:
    """Return the numbers of a part, of all its parts, and of what lies in them and moves with it."""
    own = {entry.number}
    for other in entries:
        if other.parent in own or other.carrier in own:
            own.add(other.number)
    return own


def _far(points: np.ndarray, joint: Joint) -> np.ndarray:
    """Return the points that are not at a hinge, shape [point 3]."""
    if joint.kind == "prismatic":
        return points
    return points[np.linalg.norm(np.cross(points - joint.origin, joint.axis), axis=1) > HINGE]


def overlaps(room: Room, tolerance: float, spacing: float = 0.03) -> list[str]:
    """Return a line for each pair of objects of which one reaches into the other deeper than the tolerance [m]."""
    pieces = [thing for piece in room.pieces for thing in (piece, *carried(piece))]
    solids = [Solid(whole(piece), spacing) for piece in pieces]
    boxes = np.stack([solid.bounds for solid in solids])
    found = []
    for solid, piece in zip(solids, pieces, strict=True):
        met = (boxes[:, 0] < solid.bounds[1]).all(axis=1) & (boxes[:, 1] > solid.bounds[0]).all(axis=1)
        for i in np.flatnonzero(met).tolist():
            if solids[i] is not solid and not {piece.name, pieces[i].name} <= SHELL:
                depth = solid.depth(solids[i].points)
                if depth > tolerance:
                    found.append(f"{pieces[i].name} is {1e3 * depth:.1f} mm inside {piece.name}")
    return found


def carried(piece: Piece) -> list[Piece]:
    """Return all that lies in or on a piece and its parts."""
    return [*piece.contents, *(thing for child in piece.children for thing in carried(child))]
