"""Bedroom and living room: furnished as asked, and everything that opens opens into free space."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import pytest
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull

from s2a.geometry.rays import first_hits, nearest_faces, ray_mesh
from s2a.scan.virtual.catalog import cad, catalog, moves
from s2a.scan.virtual.room import Room
from s2a.scan.virtual.rooms import ROOMS
from s2a.scan.virtual.solids import Piece, box, rotation, translation
from s2a.scene import Joint

EVERY = [(name, seed) for name in ("bedroom", "living_room") for seed in range(3)]
CLASH = 0.003
"""How deep a moving front may be in something [m]: as much as a hinge's play and a front that hangs askew."""
SHELL = {"wall", "floor", "ceiling"}
SPACING = 0.03
"""Between the points that stand for a surface [m]."""
SOFT = {"pillow": 0.03, "blanket": 0.03, "teddy bear": 0.02, "clothes": 0.01, "sofa": 0.02, "bed": 0.02}
"""How deep soft things may press into others [m]."""


@dataclass(frozen=True, eq=False)
class Solid:
    """A connected surface, taken as its convex hull: nothing has to be in a lamp's shade either.

    Attributes:
        owner: name and number of the object.
        part: the part whose surface it belongs to.
        corners: of its triangles [m], shape [face 3 3].
    """

    owner: str
    part: Piece
    corners: np.ndarray

    @cached_property
    def bounds(self) -> np.ndarray:
        """Smallest and largest corner, shape [2 3]."""
        return np.stack([self.corners.min(axis=(0, 1)), self.corners.max(axis=(0, 1))])

    @cached_property
    def planes(self) -> np.ndarray:
        """Rows (nx, ny, nz, d), inside where n.x + d <= 0, shape [plane 4]."""
        return ConvexHull(self.corners.reshape(-1, 3), qhull_options="QJ").equations

    @cached_property
    def points(self) -> np.ndarray:
        """Points on its triangles no farther apart than SPACING, shape [point 3]."""
        longest = np.linalg.norm(self.corners - np.roll(self.corners, 1, axis=1), axis=2).max(axis=1)
        steps = np.ceil(longest / SPACING).astype(int).clip(1, 60)
        points = []
        for n in np.unique(steps):
            i, j = np.array([(i, j) for i in range(n + 1) for j in range(n + 1 - i)]).T / n
            weights = np.stack([i, j, 1 - i - j], axis=1)
            points.append((weights @ self.corners[steps == n]).reshape(-1, 3))
        return np.concatenate(points)

    def moved(self, transform: np.ndarray) -> Solid:
        """Return the solid after a rigid motion, shape [4 4]."""
        return Solid(self.owner, self.part, self.corners @ transform[:3, :3].T + transform[:3, 3])


def solids(part: Piece, owner: str) -> Iterator[Solid]:
    """Split a part's surface into its connected pieces."""
    f, count = part.surface.faces, len(part.surface.vertices)
    ends = np.concatenate([f[:, 0], f[:, 1]]), np.concatenate([f[:, 1], f[:, 2]])
    _, label = connected_components(coo_array((np.ones(2 * len(f)), ends), (count, count)), directed=False)
    corners = part.surface.vertices[f]
    for number in np.unique(label[f[:, 0]]):
        yield Solid(owner, part, corners[label[f[:, 0]] == number])


def overlap(a: Solid, b: Solid) -> float:
    """Return how deep points of one solid lie in the other [m]; 0 if apart."""
    deepest = 0.0
    for inner, outer in ((a, b), (b, a)):
        near = inner.points[((inner.points > outer.bounds[0]) & (inner.points < outer.bounds[1])).all(axis=1)]
        if len(near):
            depth = -(near @ outer.planes[:, :3].T + outer.planes[:, 3]).max(axis=1)
            deepest = max(deepest, float(depth.max()))
    return deepest


@dataclass(frozen=True)
class Furnished:
    """A room with its solids; owners are numbered names of the pieces."""

    room: Room
    owners: dict[str, Piece]
    solids: list[Solid]
    boxes: np.ndarray

    def near(self, solid: Solid, slack: float) -> list[Solid]:
        """Return the solids whose boxes overlap a solid's by more than slack [m] along every axis."""
        low = np.maximum(self.boxes[:, 0], solid.bounds[0])
        high = np.minimum(self.boxes[:, 1], solid.bounds[1])
        return [self.solids[i] for i in np.flatnonzero((high - low > slack).all(axis=1))]


@cache
def furnished(name: str, seed: int) -> Furnished:
    """Furnish a room and split it into solids."""
    room = ROOMS[name](np.random.default_rng(seed))
    owners = {f"{piece.name} {i}": piece for i, piece in enumerate(room.pieces)}
    found = [s for owner, piece in owners.items() for part in parts(piece) for s in solids(part, owner)]
    return Furnished(room, owners, found, np.stack([s.bounds for s in found]))


def parts(piece: Piece) -> Iterator[Piece]:
    """Yield a piece and all parts below it."""
    yield piece
    for child in piece.children:
        yield from parts(child)


def movables(piece: Piece) -> list[Piece]:
    """Return the parts of a piece that have a joint."""
    return [part for part in parts(piece) if part.joint is not None]


def opened(joint: Joint, value: float) -> np.ndarray:
    """Return the motion of a part at a joint's coordinate, shape [4 4]."""
    axis, origin = np.array(joint.axis), np.array(joint.origin)
    if joint.kind == "prismatic":
        return translation(value * axis)
    return translation(origin) @ rotation(value * axis) @ translation(-origin)


every_room = pytest.mark.parametrize(("name", "seed"), EVERY)


@every_room
def test_a_room_has_many_objects_and_every_kind_of_handle(name: str, seed: int) -> None:
    pieces = ROOMS[name](np.random.default_rng(seed)).pieces
    moving = [part for piece in pieces for part in movables(piece)]
    everything = [part for piece in pieces for part in parts(piece)]
    assert sum(piece.name not in ("wall", "floor", "ceiling", "book") for piece in pieces) >= 25
    assert len(moving) >= 6
    assert {"drawer", "door", "lid", "window"} <= {part.name for part in moving}
    assert {"bar", "knob", "cup", "edge", "lever"} <= {part.style for part in everything if part.style}
    tall = [np.ptp(part.surface.vertices[:, 2]) > 0.1 for part in everything if part.style == "bar"]
    assert any(tall) and not all(tall), "upright and level bars"
    hinges = {np.sign(part.joint.axis[2]) for part in moving if part.name == "door"}
    assert hinges == {1.0, -1.0}, "doors that open to the left and to the right"
    assert [moves(piece) for piece in pieces] == sorted((moves(piece) for piece in pieces), reverse=True)


@every_room
def test_things_stand_beside_each_other_not_in_each_other(name: str, seed: int) -> None:
    scene, clashes = furnished(name, seed), []
    for solid in scene.solids:
        for other in scene.near(solid, 0.005):
            names = {solid.owner.rsplit(" ", 1)[0], other.owner.rsplit(" ", 1)[0]}
            # A blanket hangs around what it covers; walls, floor and ceiling meet.
            if other.owner <= solid.owner or names <= SHELL or names in ({"blanket", "bed"}, {"blanket", "sofa"}):
                continue
            depth = overlap(solid, other)
            if depth > max(0.005, *(SOFT.get(owner, 0.0) for owner in names)):
                clashes.append((solid.owner, other.owner, round(depth, 4)))
    assert clashes == []


@every_room
def test_whatever_opens_moves_through_free_space(name: str, seed: int) -> None:
    scene, clashes = furnished(name, seed), []
    for owner, piece in scene.owners.items():
        for part in movables(piece):
            moving = {id(p) for p in parts(part)}
            for share in (0.0, 0.15, 0.5, 1.0):
                motion = opened(part.joint, share * part.joint.limits[1])
                for solid in (s.moved(motion) for s in scene.solids if id(s.part) in moving):
                    for other in scene.near(solid, CLASH):
                        # A sash lies in its frame's rebate, which the hulls know nothing of.
                        rebate = (part.name, other.part.name) == ("window", "window frame")
                        if id(other.part) not in moving and not rebate and overlap(solid, other) > CLASH:
                            clashes.append((owner, solid.part.name, share, other.owner, other.part.name))
    assert clashes == []


@every_room
def test_whoever_opens_furniture_has_room_to_stand(name: str, seed: int) -> None:
    scene, crowded = furnished(name, seed), []
    for owner, piece in scene.owners.items():
        if not moves(piece) or piece.name in ("door frame", "window frame"):
            continue
        fronts = np.concatenate([part.surface.vertices for part in movables(piece)])
        local = (fronts - piece.pose[:3, 3]) @ piece.pose[:3, :3]
        low, high = local.min(axis=0), local.max(axis=0)
        free = box((high[0] + 0.05, high[0] + 1.2), (low[1], high[1]), (0.05, 1.6), (0, 0, 0))
        space = next(solids(Piece("free", free.moved(piece.pose)), "free"))
        crowded += [(owner, s.owner) for s in scene.near(space, 0.0) if s.owner != owner and overlap(space, s) > 0.01]
    assert crowded == []


@every_room
def test_scanners_stand_in_free_air_and_see_every_handle(name: str, seed: int) -> None:
    room = furnished(name, seed).room
    surface, owners = cad(entries := catalog(room.pieces))
    mesh = ray_mesh(surface.vertices, surface.faces)
    assert len(room.scanners) == 6
    assert (room.scanners > 0).all() and (room.scanners < room.size).all()
    assert nearest_faces(mesh, room.scanners)[1].min() > 0.2, "no scanner stands in or against something"
    unseen = {}
    for entry in entries:
        if entry.piece.style is not None:
            points = surface.vertices[np.unique(surface.faces[owners == entry.number])]
            rays = points[None] - room.scanners[:5, None]
            far = np.linalg.norm(rays, axis=2)
            starts = np.broadcast_to(room.scanners[:5, None], rays.shape)
            hits = first_hits(mesh, starts.reshape(-1, 3), (rays / far[..., None]).reshape(-1, 3)).reshape(far.shape)
            below = np.arcsin(-rays[..., 2] / far) < 1.05
            seen = ((hits > far - 0.004) & below).mean(axis=1)
            if np.sort(seen)[-2:].min() < 0.1:
                unseen[entry.label, entry.parent] = seen.round(2).tolist()
    assert unseen == {}
