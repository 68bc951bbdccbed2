"""Free objects: extracted from the merged room, closed, weighed, and set on what carries them."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated

import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

from s2a.core.bounds import AtLeast, Count, Fraction, NotNegative, Positive
from s2a.core.cache import recall
from s2a.core.errors import InputError
from s2a.prepare.mass import MassConfig, annotated_mass
from s2a.prepare.room_hulls import LevelTop, TopConfig, level_top, reused
from s2a.scan import labels
from s2a.scene.geometry.convex import box, clip, close, contains, drop_small_components, grown, hull, vhacd, volume
from s2a.scene.geometry.mesh_ops import merge, within
from s2a.scene.geometry.mesh_query import first_hits, ray_mesh
from s2a.scene.scene import Mesh, Scene, pack, unpack
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody

# [m] How far inside of its foot an object's centre of mass lies at least; less than half the foot's thickness
STABLE = 0.001
# Half the angle [rad] in which a foot lies, seen from the centre of mass; its inner end as a fraction of its outer one
WEDGE, INNER = np.radians(25), 0.5


def whole_foot(solid: Mesh, ground: float, center: np.ndarray, thickness: float, max_vertices: int) -> Mesh:
    """Return the flat hull on which an object stands.

    It stood when it was scanned: where its centre of mass is not above what is known of its underside, the rest of that was
    not seen, and all of the object's outline carries it.

    Args:
        solid: the object, scene coordinates.
        ground: height of what carries it [m].
        center: its centre of mass [m], shape [3].
        thickness: of the hull [m].
        max_vertices: largest number of its vertices.
    """
    points = solid.vertices.astype(np.float64)
    for sole in (points[points[:, 2] < ground + thickness], points):
        flat = np.concatenate([sole * [1, 1, 0] + [0, 0, height] for height in (ground, ground + thickness)])
        foot = hull(flat, max_vertices)
        above = np.array([[*center[:2], ground + thickness / 2]])
        if foot is not None and contains(foot, above, -STABLE)[0]:
            break
    return solid if foot is None else foot


def split_foot(foot: Mesh, center: np.ndarray) -> list[Mesh]:
    """Return three separate hulls around the centre of mass [3], cut out of a flat hull; that itself if it is too small.

    MuJoCo gives a pair of hulls a single contact: on one foot an object of one hull stands on a point, and creeps. Wherever
    in its foot each of three contacts lies, the centre of mass is between them.
    """
    spread = np.linalg.svd(foot.vertices[:, :2] - foot.vertices[:, :2].mean(axis=0), full_matrices=False)[2][0]
    first = float(np.arctan2(spread[1], spread[0]))
    hulls = []
    for turn in first + np.arange(3) * 2 * np.pi / 3:
        left: Mesh | None = foot
        for side in (-1.0, 1.0):  # the wedge around one direction
            edge = turn + side * WEDGE
            normal = side * np.array([-np.sin(edge), np.cos(edge), 0.0])
            left = None if left is None else clip(left, normal, float(normal @ center))
        out = np.array([np.cos(turn), np.sin(turn), 0.0])
        if left is not None:
            far = float((left.vertices @ out).max() - out @ center)
            left = clip(left, -out, -float(out @ center + INNER * far))
        if left is None:
            return [foot]
        hulls.append(left)
    return hulls


HOLLOW, FULL = 0.1, 1.0  # Shares of its convex hull that the volume of a sound solid lies between
# Fraction of a surface that noise may have put below it. Not of its vertices, which are few where a surface is flat
OUTLIERS = 0.005
# Volume [m^3] up to which an object is as dense as its family. Larger ones hold more air: mass grows as the root of the volume,
# and a basket of 0.1 m^3 is a fifth as dense
SOLID = 0.004
# Mass [kg/m^2] of what is made of boards, sheets and walls by the surface of its convex hull, by the last words of its label.
# Estimates, from sizes and masses of such products
SURFACE = {
    name: mass
    for mass, names in {
        2.0: "bin, trash can, trashcan, basket, dish rack, dishrack, tissue box",  # 1.4 kg of 27 x 37 x 38 cm
        4.0: "chair, stool",  # 8 kg of 42 x 49 x 90 cm
        5.0: "table, desk, bench, monitor, clock",  # 32 kg of 160 x 90 x 75 cm
        5.5: "couch, sofa, armchair, ottoman, bed",  # 47 kg of 200 x 90 x 85 cm
        6.0: "toaster, toaster oven, kettle",
        10.0: "cabinet, cupboard, nightstand, dresser, chest of drawers, wardrobe, bookshelf, bookcase, shelf, counter, "
        "microwave, oven, printer, tv, refrigerator, fridge, stove, dishwasher, sink, bathtub, scale",  # 40 kg: 77 x 39 x 147 cm
        16.0: "toilet",
        22.0: "washing machine",
    }.items()
    for name in names.split(", ")
}
RAYS = 24  # Of those that look for a support, along either side of an object


@dataclass(frozen=True, kw_only=True)
class FreeConfig:
    """How an object becomes a free body.

    Attributes:
        mass: what it weighs.
    """

    search_radius: Positive = 0.03  # what carries an object is looked for within this distance of its lowest point [m]
    min_component_area: Fraction = 0.02  # fraction of its surface below which a disconnected component is left out
    # largest number of its convex hulls, besides three support hulls; a gripper's contacts grow with them
    hulls: Count = 3
    resolution: Count = 30000  # voxels of their decomposition
    max_vertices: Annotated[int, AtLeast(4)] = 32  # largest number of vertices of a hull
    foot: Positive = 0.004  # thickness of the support hulls [m]
    margin: NotNegative = 0.05  # how far the support's level top reaches beyond it [m]
    thickness: Positive = 0.02  # of that top [m]
    clearance: NotNegative = 0.003  # what is cut free around it [m]
    mass: MassConfig
    top: TopConfig = TopConfig()  # level tops of what carries objects


@dataclass(frozen=True)
class FreeObject:
    """A free object and what it stands on."""

    body: SimBody  # the object, its frame at its centre of mass
    support: Collider | None  # the horizontal top under it; None where `top` carries all of it
    below: str  # id of what carries it
    top: LevelTop | None  # level top of all of that; None where it is not level
    members: tuple[str, ...]  # ids of all its parts, which leave the room
    space: tuple[Mesh, ...]  # convex hulls that nothing else may reach into, scene coordinates
    bounds: np.ndarray  # lowest and highest corner [m], shape [2 3], scene coordinates


def free_objects(
    scene: Scene, parts: Sequence[str], articulated: Sequence[str], config: FreeConfig
) -> list[FreeObject]:
    """Return objects that were part of the room as free bodies, each once.

    Raises:
        InputError: one of them cannot be extracted (see `free_object`), or stands on one of them or on a part that moves.
    """
    objects: list[FreeObject] = []
    for part in dict.fromkeys(parts):
        objects.append(free_object(scene, part, config, [item.top for item in objects if item.top]))
    moving = {i for part in articulated for i in (part, *scene.descendants(part))}
    moving |= {i for item in objects for i in item.members}
    for item in objects:
        below = item.below
        if below in moving:
            raise InputError(
                f"free={item.body.id}: it stands on {below!r}, which moves too; leave one of them as it is"
            )
    return [replace(item, support=_beside(item, [o for o in objects if o is not item])) for item in objects]


def level_tops(objects: Sequence[FreeObject]) -> list[LevelTop]:
    """Return the level tops on which objects stand, each once."""
    return list({id(item.top): item.top for item in objects if item.top}.values())


def free_object(scene: Scene, part: str, config: FreeConfig, tops: Sequence[LevelTop] = ()) -> FreeObject:
    """Return an object that was part of the room as a free body; on one of some tops, if it stands there.

    Raises:
        InputError: the part is unknown, or belongs to another object, or something of it moves on a joint; it has no surface;
            or nothing horizontal carries it.
    """
    _check(scene, part)
    members = (part, *scene.descendants(part))
    surface = merge([scene.parts[i].mesh for i in members])
    if not surface.face_areas.any():
        raise InputError(f"part {part!r} of scene {scene.name!r} has no surface; it cannot be extracted from the room")
    surface = drop_small_components(surface, config.min_component_area)
    below, ground = _support(scene, part, members, surface, config)
    flat = reused(tops, below, ground, config.top.band)
    flat = flat or level_top(below, scene.parts[below].mesh, ground, config.thickness, config.top)
    ground = flat.height if flat else ground
    solid = close(surface, ground, config.search_radius)

    mass = _mass(scene, members, solid, config)

    def make() -> dict[str, np.ndarray]:
        return pack(_hulls(solid, ground, config))

    foot = whole_foot(solid, ground, np.array(mass.center), config.foot, 2 * config.max_vertices)
    supports = split_foot(foot, np.array(mass.center))
    hulls = [*supports, *unpack(recall("free", [solid, repr((ground, config))], make))]
    spaces = [hull(grown(piece.vertices, config.clearance)) for piece in hulls]
    low, high = solid.bounds
    size = np.array([*(high - low)[:2] + 2 * config.margin, config.thickness])
    top = box(np.array([*(low + high)[:2] / 2, ground - config.thickness / 2]), np.eye(3), size)
    body = _body(part, solid, hulls, mass)
    own = None if flat and flat.carries(low[:2], high[:2]) else Collider(below, top)
    return FreeObject(body, own, below, flat, members, tuple(s for s in spaces if s is not None), solid.bounds)


def _body(part: str, solid: Mesh, hulls: Sequence[Mesh], mass: Mass) -> SimBody:
    """Return the body of a solid in scene coordinates, its frame at the centre of mass."""

    def local(mesh: Mesh) -> Mesh:
        return Mesh(mesh.vertices.astype(np.float64) - mass.center, mesh.faces, mesh.colors)

    colliders = tuple(Collider(part, local(piece)) for piece in hulls)
    return SimBody(part, local(solid), colliders, replace(mass, center=(0.0, 0.0, 0.0)), position=mass.center)


def _beside(item: FreeObject, others: Sequence[FreeObject]) -> Collider | None:
    """Return the support of an object without what of its margin would reach under another object.

    That one stands on a top of its own, which may be a millimetre lower, unless both stand on the same.
    """
    if item.support is None:
        return None
    (low, high), own = item.support.mesh.bounds.copy(), item.bounds
    for other in others:
        if other.top is not None and other.top is item.top:
            continue
        near, far = other.bounds
        if (near >= high).any() or (far <= low).any():
            continue
        # So much would have to go at the upper and lower side of each axis, where the other is beyond the object itself.
        cuts = [(high[k] - near[k], k, near[k]) for k in (0, 1) if near[k] >= own[1][k]]
        cuts += [(far[k] - low[k], k, far[k]) for k in (0, 1) if far[k] <= own[0][k]]
        if cuts:
            _, axis, end = min(cuts)
            (high if end >= own[1][axis] else low)[axis] = end
    return Collider(item.support.part, box((low + high) / 2, np.eye(3), high - low))


def _check(scene: Scene, part: str) -> None:
    """Refuse what cannot be extracted."""
    if scene.part(part).parent is not None:
        raise InputError(f"free={part}: it is a part of {scene.root(part)!r}; give that one")
    moving = [i for i in (part, *scene.descendants(part)) if i in scene.movable]
    if moving:
        raise InputError(
            f"free={part}: {moving[0]!r} moves on a joint; only whole objects without joints can be extracted from the room"
        )


def _support(scene: Scene, part: str, members: Sequence[str], surface: Mesh, config: FreeConfig) -> tuple[str, float]:
    """Return which part carries an object, and the height of its surface there [m].

    Rays look down from just above the object's lowest point, under it and close around it: what is right under it was
    seldom scanned.
    """
    low, high = _lowest(surface), surface.bounds[1]
    x, y = (np.linspace(low[k] - config.search_radius, high[k] + config.search_radius, RAYS) for k in (0, 1))
    starts = np.stack(
        [*(grid.ravel() for grid in np.meshgrid(x, y)), np.full(RAYS**2, low[2] + config.search_radius)], axis=1
    )
    falls: dict[str, np.ndarray] = {}
    for i in scene.parts:
        below = within(scene.parts[i].mesh, starts.min(axis=0) - [0, 0, 2 * config.search_radius], starts.max(axis=0))
        if i not in members and len(below.faces):
            down = np.tile([0.0, 0.0, -1.0], (len(starts), 1))
            falls[i] = first_hits(ray_mesh(below.vertices, below.faces), starts, down)
    first = np.min([np.full(len(starts), 2 * config.search_radius), *falls.values()], axis=0)
    heights = {
        i: low[2] + config.search_radius - fall[(fall == first) & (fall < 2 * config.search_radius)]
        for i, fall in falls.items()
    }
    # Where its top has holes, rays pass through to what is below.
    tops = {i: height[np.abs(height - low[2]) < config.search_radius / 3] for i, height in heights.items()}
    heights = {i: tops[i] if len(tops[i]) else height for i, height in heights.items()}
    best = max(heights, key=lambda i: len(heights[i]), default="")
    if not best or not len(heights[best]):
        raise InputError(
            f"free={part}: no horizontal surface supports it within {100 * config.search_radius:.0f} cm of its lowest point"
        )
    return best, float(np.median(heights[best]))


def _lowest(surface: Mesh) -> np.ndarray:
    """Return the corner below which a fraction OUTLIERS of a surface's area lies, along each axis [m], shape [3]."""
    corners, areas = surface.vertices[surface.faces].astype(np.float64).min(axis=1), surface.face_areas
    order = np.argsort(corners, axis=0)
    total = np.cumsum(areas[order], axis=0)
    first = (total >= OUTLIERS * total[-1]).argmax(axis=0)
    return np.array([corners[order[first[k], k], k] for k in range(3)])


def _hulls(solid: Mesh, ground: float, config: FreeConfig) -> list[Mesh]:
    """Return convex hulls above the ground."""
    pieces = vhacd(solid, config.hulls, config.resolution, config.max_vertices)
    cut = [clip(piece, np.array([0.0, 0.0, -1.0]), -ground) for piece in pieces]
    return [piece for piece in cut if piece is not None]


def _mass(scene: Scene, members: Sequence[str], solid: Mesh, config: FreeConfig) -> Mass:
    """Return mass, centre and inertia: annotated, else by the rule of its label's family."""
    shape = trimesh.Trimesh(solid.vertices, solid.faces, process=False)
    closed = hull(solid.vertices)
    whole = volume(closed) if closed is not None else 0.0
    if closed is not None and not HOLLOW * whole < shape.volume <= FULL * whole:
        shape = trimesh.Trimesh(closed.vertices, closed.faces, process=False)
    mass, source = _estimate(scene, members, float(shape.volume), closed, config.mass)
    moments, axes = np.linalg.eigh(shape.moment_inertia * (mass / shape.volume))
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    quat = Rotation.from_matrix(axes).as_quat(canonical=True)
    return Mass(mass, tuple(shape.center_mass.tolist()), tuple(moments.tolist()), tuple(quat.tolist()), source)


def _estimate(
    scene: Scene, members: Sequence[str], inside: float, closed: Mesh | None, config: MassConfig
) -> tuple[float, str]:
    """Return an object's mass [kg] and where it comes from; by its volume [m^3], or the surface of its convex hull."""
    annotated, label = annotated_mass(scene, members), scene.parts[members[0]].label
    if annotated is not None:
        return annotated, "annotated"
    surface = SURFACE.get(labels.family((*config.families, *SURFACE), label))
    family, rule = config.rule(label)
    if surface is not None and family not in SURFACE:
        area = float(closed.face_areas.sum()) if closed is not None else 0.0
        return config.bounded(surface * area), f"the surface of its hull, {surface:g} kg/m^2"
    if rule.by == "mass":
        return rule.value, f"usual for a {family}"
    density = rule.value * min(1.0, math.sqrt(SOLID / max(inside, 1e-9)))
    return config.bounded(density * inside), f"its volume, {density:.3g} kg/m^3"
