"""Objects lifted out of the merged room: closed, weighed, and set on what carries them, free to move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from s2a.cache import pack, recall, unpack
from s2a.errors import InputError
from s2a.geometry.closed_solid import close, drop_small_components
from s2a.geometry.convex import box, clip, contains, hull, volume
from s2a.geometry.decompose import vhacd
from s2a.geometry.mesh_ops import keep, merge
from s2a.geometry.mesh_query import first_hits, ray_mesh
from s2a.geometry.sweep import grown
from s2a.prepare.mass import MassConfig, known_mass
from s2a.ranges import AtLeast, Count, Fraction, NotNegative, Positive
from s2a.scene import Mesh, Scene
from s2a.usd.sim_scene import Collider, Mass, SimBody

HOLLOW, FULL = 0.1, 1.0
"""Shares of its convex hull that the volume of a sound solid lies between."""
STABLE = 0.001
"""[m] How far inside of its foot an object's centre of mass lies at least; less than half the foot's thickness."""
RAYS = 24
"""Of those that look for a support, along either side of an object."""


@dataclass(frozen=True)
class LooseConfig:
    """How an object becomes a free body.

    Attributes:
        near: what carries an object is looked for within this distance of its lowest point [m].
        crumb: share of its surface below which a disconnected piece is left out.
        pieces: largest number of its convex pieces, beside the foot.
        resolution: voxels of their decomposition.
        max_vertices: largest number of vertices of a piece.
        foot: thickness of the piece on which it stands [m].
        margin: how far the support's level top reaches beyond it [m].
        thickness: of that top [m].
        clearance: what is cut free around it [m].
        mass: what it weighs.
    """

    near: Positive
    crumb: Fraction
    pieces: Count
    resolution: Count
    max_vertices: Annotated[int, AtLeast(4)]
    foot: Positive
    margin: NotNegative
    thickness: Positive
    clearance: NotNegative
    mass: MassConfig


@dataclass(frozen=True)
class Loose:
    """A free object and what it stands on.

    Attributes:
        body: the object.
        support: the level top under it.
        members: ids of all its parts, which leave the room.
        space: convex pieces that nothing else may reach into.
    """

    body: SimBody
    support: Collider
    members: tuple[str, ...]
    space: tuple[Mesh, ...]


def lift_all(scene: Scene, parts: Sequence[str], target: str, config: LooseConfig) -> list[Loose]:
    """Return objects that were part of the room as free bodies, each once.

    Raises:
        InputError: one of them cannot be lifted out (see `lift`), or stands on the target or on another of them.
    """
    found = [lift(scene, part, target, config) for part in dict.fromkeys(parts)]
    moving = {target, *scene.descendants(target), *(i for thing in found for i in thing.members)}
    for thing in found:
        below = thing.support.part
        if below in moving:
            raise InputError(
                f"free={thing.body.id}: it stands on {below!r}, which moves too; leave one of them as it is"
            )
    return found


def lift(scene: Scene, part: str, target: str, config: LooseConfig) -> Loose:
    """Return an object that was part of the room as a free body.

    Raises:
        InputError: the part is unknown, belongs to the target's furniture or to another object, or something of it moves on
            a joint; it has no surface; or nothing level carries it.
    """
    _check(scene, part, target)
    members = (part, *scene.descendants(part))
    surface = merge([scene.parts[i].mesh for i in members])
    if not surface.face_areas.any():
        raise InputError(f"part {part!r} of scene {scene.name!r} has no surface; it cannot be lifted out of the room")
    surface = drop_small_components(surface, config.crumb)
    below, ground = _support(scene, part, members, surface, config)
    solid = close(surface, ground, config.near)

    mass = _mass(scene, members, solid, config)

    def make() -> dict[str, np.ndarray]:
        return pack(_pieces(solid, ground, config))

    pieces = [_foot(solid, ground, mass, config), *unpack(recall("loose", [solid, repr((ground, config))], make))]
    spaces = [hull(grown(piece.vertices, config.clearance)) for piece in pieces]
    low, high = solid.bounds
    size = np.array([*(high - low)[:2] + 2 * config.margin, config.thickness])
    top = box(np.array([*(low + high)[:2] / 2, ground - config.thickness / 2]), np.eye(3), size)
    body = SimBody(part, solid, tuple(Collider(part, piece) for piece in pieces), mass)
    return Loose(body, Collider(below, top), members, tuple(piece for piece in spaces if piece is not None))


def _check(scene: Scene, part: str, target: str) -> None:
    """Refuse what cannot be lifted out."""
    chosen = scene.part(part)
    if scene.root(part) == scene.root(target):
        raise InputError(f"free={part}: it belongs to {scene.root(target)!r}, whose part {target!r} is the target")
    if chosen.parent is not None:
        raise InputError(f"free={part}: it is a part of {scene.root(part)!r}; lift that one out")
    moving = [i for i in (part, *scene.descendants(part)) if i in scene.movable]
    if moving:
        raise InputError(
            f"free={part}: {moving[0]!r} moves on a joint; only whole objects without joints can be lifted out"
        )


def _support(scene: Scene, part: str, members: Sequence[str], surface: Mesh, config: LooseConfig) -> tuple[str, float]:
    """Return which part carries an object, and the height of its surface there [m].

    Rays look down from just above the object's lowest point, under it and close around it: what is right under it was
    seldom scanned.
    """
    low, high = np.quantile(surface.vertices, 0.005, axis=0), surface.bounds[1]
    x, y = (np.linspace(low[k] - config.near, high[k] + config.near, RAYS) for k in (0, 1))
    starts = np.stack([*(grid.ravel() for grid in np.meshgrid(x, y)), np.full(RAYS**2, low[2] + config.near)], axis=1)
    falls: dict[str, np.ndarray] = {}
    for i in scene.parts:
        below = _within(scene.parts[i].mesh, starts.min(axis=0) - [0, 0, 2 * config.near], starts.max(axis=0))
        if i not in members and len(below.faces):
            down = np.tile([0.0, 0.0, -1.0], (len(starts), 1))
            falls[i] = first_hits(ray_mesh(below.vertices, below.faces), starts, down)
    first = np.min([np.full(len(starts), 2 * config.near), *falls.values()], axis=0)
    heights = {i: low[2] + config.near - fall[(fall == first) & (fall < 2 * config.near)] for i, fall in falls.items()}
    # Where its top has holes, one looks through to what is below.
    tops = {i: height[np.abs(height - low[2]) < config.near / 3] for i, height in heights.items()}
    heights = {i: tops[i] if len(tops[i]) else height for i, height in heights.items()}
    best = max(heights, key=lambda i: len(heights[i]), default="")
    if not best or not len(heights[best]):
        raise InputError(f"free={part}: nothing level carries it within {100 * config.near:.0f} cm of its lowest point")
    return best, float(np.median(heights[best]))


def _within(mesh: Mesh, low: np.ndarray, high: np.ndarray) -> Mesh:
    """Return the faces whose boxes meet a box [3], [3]."""
    if not len(mesh.faces) or (mesh.bounds[0] > high).any() or (mesh.bounds[1] < low).any():
        return merge([])
    corners = mesh.vertices[mesh.faces]
    return keep(mesh, ((corners.min(axis=1) <= high) & (corners.max(axis=1) >= low)).all(axis=1))


def _pieces(solid: Mesh, ground: float, config: LooseConfig) -> list[Mesh]:
    """Return convex pieces above the ground."""
    found = vhacd(solid, config.pieces, config.resolution, config.max_vertices)
    cut = [clip(piece, np.array([0.0, 0.0, -1.0]), -ground) for piece in found]
    return [piece for piece in cut if piece is not None]


def _foot(solid: Mesh, ground: float, mass: Mass, config: LooseConfig) -> Mesh:
    """Return the flat piece on which an object stands.

    It stood when it was scanned: where its centre of mass is not above what is known of its underside, the rest of that was
    not seen, and all of the object's outline carries it.
    """
    points = solid.vertices.astype(np.float64)
    for sole in (points[points[:, 2] < ground + config.foot], points):
        flat = np.concatenate([sole * [1, 1, 0] + [0, 0, height] for height in (ground, ground + config.foot)])
        foot = hull(flat, 2 * config.max_vertices)
        above = np.array([[*mass.center[:2], ground + config.foot / 2]])
        if foot is not None and contains(foot, above, -STABLE)[0]:
            break
    return solid if foot is None else foot


def _mass(scene: Scene, members: Sequence[str], solid: Mesh, config: LooseConfig) -> Mass:
    """Return mass, centre and inertia: annotated, else its label's, else its volume's within bounds."""
    shape = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    closed = hull(solid.vertices)
    whole = volume(closed) if closed is not None else 0.0
    if closed is not None and not HOLLOW * whole < shape.volume <= FULL * whole:
        shape = trimesh.Trimesh(closed.vertices, closed.faces, process=False)
    mass, source = known_mass(scene, members, config.mass) or (config.mass.estimate(shape.volume), "its volume")
    moments, axes = np.linalg.eigh(shape.moment_inertia * (mass / shape.volume))
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    quat = Rotation.from_matrix(axes).as_quat(canonical=True)
    return Mass(mass, tuple(shape.center_mass.tolist()), tuple(moments.tolist()), tuple(quat.tolist()), source)
