"""Usefulness of an object in its place: visible, hiding nothing, out of the way."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from s2a.language.grammar import is_kind_of
from s2a.language.insert.search import Keep
from s2a.language.insert.supports import bounds_of, facing, floor_height, is_floor, nearby, over, target_mesh
from s2a.scene.geometry.mesh_ops import normals, sample
from s2a.scene.geometry.mesh_query import kept_ray_mesh, visible_distance
from s2a.scene.geometry.regions import Region
from s2a.scene.scene import Joint, Mesh, Scene
from s2a.scene.upright_box import Box, silhouette, upright_box

# Weights of what tells the front: what opens there, what is high behind, a wall behind, a long side, the surface, the
# middle of the room
OPENS, HIGH, BACKED, LONG, SHOWN, INWARD = 1.5, 1.0, 1.0, 0.5, 2.0, 0.15
ELONGATED = 1.6  # What is longer than this many widths is used from a long side: counters and desks, and not toilets
# On which one sits, and looks ahead; before all else one sits or stands, and looks around
SEATS = ("sofa", "couch", "armchair", "chair", "bed", "bench", "toilet")
TOP = 0.75  # What is above this fraction of the height is high
CLOSE, REACH = 0.1, 0.6  # Distance over which a wall's closeness fades, and length of the rays that look for one [m]
# Places of these rays along a side, in widths from its middle, and their heights, in heights
ALONG, UP = (-0.35, 0.0, 0.35), (0.25, 0.5, 0.75)


def front(scene: Scene, part_id: str) -> np.ndarray:
    """Return the horizontal direction in which a thing faces, unit, shape [2]: of the four of its upright box the likeliest.

    Drawers and doors are in front. Sofas, chairs, beds and toilets are highest behind. Furniture has its back to a wall that is
    close; a chair before a desk covers only some of the rays to that side. What is long is used from a long side. A scan shows a
    front more than a back, which nobody walked around. Where nothing else tells, it looks towards the middle of the room.

    `part_id`: the thing; its descendants belong to it.
    """
    own = [part_id, *scene.descendants(part_id)]
    mesh = target_mesh(scene, part_id)
    box = upright_box(silhouette(mesh.vertices))
    sides = np.array([(np.cos(box.yaw + a), np.sin(box.yaw + a)) for a in np.arange(4) * np.pi / 2])
    closeness = _closeness(scene, own, mesh, box, sides)
    inward = bounds_of(scene).mean(axis=0)[:2] - box.center[:2]
    inward /= max(float(np.linalg.norm(inward)), 1e-9)
    shown = (normals(mesh)[:, :2] * mesh.face_areas[:, None]).sum(axis=0) / max(float(mesh.face_areas.sum()), 1e-9)
    places = _normalised(mesh.vertices, box, sides)
    low, high = mesh.bounds[:, 2]
    top = np.quantile(places[mesh.vertices[:, 2] >= low + TOP * (high - low)], (0.05, 0.95), axis=0).mean(axis=0)
    score = BACKED * (np.roll(closeness, 2) - closeness) + sides @ (INWARD * inward + SHOWN * shown)
    if max(box.size[:2]) > ELONGATED * min(box.size[:2]):
        score[[0, 2] if box.size[0] < box.size[1] else [1, 3]] += LONG
    seat = any(is_kind_of(scene.parts[part_id].label, one) for one in SEATS)  # what is high on a desk stands on it
    score += OPENS * _opening(scene, own, box, sides) - (HIGH if seat else HIGH / 4) * np.array([*top, *-top])
    return np.asarray(sides[np.argmax(score)])


def _normalised(points: np.ndarray, box: Box, sides: np.ndarray) -> np.ndarray:
    """Return horizontal places in a box, -1 to 1 along its two axes, shape [point 2]."""
    half = np.maximum(np.array(box.size[:2]) / 2, 1e-6)
    return np.asarray((points[:, :2] - box.center[:2]) @ sides[:2].T / half)


def _opening(scene: Scene, own: list[str], box: Box, sides: np.ndarray) -> np.ndarray:
    """Return for each side how much of what opens is there or slides there, -1 to 1, shape [4]."""
    directions = []
    for part in (scene.parts[i] for i in own):
        if not isinstance(part.motion, Joint) or not len(part.mesh.vertices):
            continue
        if part.motion.kind == "prismatic":
            way = 1.0 if sum(part.motion.limits) >= 0.0 else -1.0
            directions.append(way * sides[:2] @ np.array(part.motion.axis)[:2])
        else:
            places = _normalised(part.mesh.vertices, box, sides)
            directions.append((places.min(axis=0) + places.max(axis=0)) / 2)
    along = np.mean(directions, axis=0) if directions else np.zeros(2)
    return np.array([*along, *-along])


def _closeness(scene: Scene, own: list[str], mesh: Mesh, box: Box, sides: np.ndarray) -> np.ndarray:
    """Return for each side how close other things are there, 1 where they touch, shape [4]."""
    others = [i for i in scene.parts if i not in own]
    around = nearby(scene, mesh.bounds[0] - REACH, mesh.bounds[1] + REACH, others)
    closeness = np.zeros(4)
    if not len(around.faces):
        return closeness
    tree, low = kept_ray_mesh(around), float(mesh.bounds[0, 2])
    for i, side in enumerate(sides):
        depth, width = box.size[i % 2], box.size[1 - i % 2]
        across = np.array([-side[1], side[0]])
        level = np.array(box.center[:2]) + 0.45 * depth * side
        starts = [[*(level + a * width * across), low + u * box.size[2]] for a in ALONG for u in UP]
        seen, _ = visible_distance(tree, np.array(starts), np.append(side, 0.0), REACH)
        closeness[i] = np.exp(-np.maximum(seen - 0.05 * depth, 0.0) / CLOSE).mean()
    return closeness


SEEN, CLEAR = 0.5, 0.75  # Least visible fractions of an object that is not hidden, and of one of which little is
# Height of the eyes above the floor, their distance, and their least height over the object's middle [m]
EYE, AWAY, ABOVE = 1.45, 1.0, 0.1
# Directions of the eyes from the front of the support [rad]: an object is seen from two of them
AZIMUTHS = np.radians([0.0, 35.0, -35.0])
POINTS = 60
GAP = 0.004  # Rays start this far from the surface [m]
# What others may hide stands on the same region up to this error, and is no longer than this: furniture is not hidden
# [m]
STANDS, LONGEST = 0.03, 0.7
# Kinds before which people need all the room to use them; a bathtub is long
USED_STANDING = ("toilet", "washbasin", "shower", "stove", "refrigerator", "washing machine", "dishwasher")
# Free depth before these, about that of a standing person, and height of what one steps over, such as a mat [m]
ROOM_BEFORE, LOW = 0.55, 0.08


class Fault(IntEnum):
    """What is wrong with a place; the higher, the worse."""

    NONE = 0
    PARTLY = 1
    MOSTLY = 2


# Its two level axes [axis 2], and its least and largest places on them [m]
Rectangle = tuple[np.ndarray, np.ndarray, np.ndarray]


class PlaceServes:
    """The faults of places on a level region of a part.

    Attributes:
        fixtures: on a floor, the rectangles in which people stand to use fixtures.
    """

    def __init__(self, scene: Scene, region: Region, target: str) -> None:
        self._scene, self._front = scene, facing(scene, target, region)
        self._inside, self._floor = region.kind == "inside", floor_height(scene)
        self._on_floor = is_floor(scene, target)
        self._things = [] if self._on_floor else _standing_on(scene, region, target)
        self.fixtures = [_room_before(scene, i) for i in scene.parts if _is_used(scene, i)] if self._on_floor else []

    def fault(self, object: Mesh) -> Fault:
        """Return what is wrong with an object in its place [m].

        It is `MOSTLY` hidden, or stands where people stand to use a fixture. On furniture it is `PARTLY` hidden, or hides
        something itself; a floor is seen from many sides.
        """
        if any(_stands_in(object, rectangle, self._floor) for rectangle in self.fixtures):
            return Fault.MOSTLY
        visible = self._visible(object)
        if visible < SEEN:
            return Fault.MOSTLY
        if self._on_floor:
            return Fault.NONE
        return Fault.PARTLY if visible < CLEAR or any(self._covers(object, one) for one in self._things) else Fault.NONE

    def clear_of_fixtures(self, object: Mesh, keep: Keep | None) -> Keep:
        """Return a filter of places [m] that an object [m] leaves fixtures free from, roughly; those of another filter alone."""
        half = float(np.ptp(object.bounds, axis=0)[:2].min()) / 2
        low = np.ptp(object.bounds[:, 2]) <= LOW

        def kept(places: np.ndarray) -> np.ndarray:
            stays = np.ones(len(places), bool) if keep is None else keep(places)
            for axes, least, most in [] if low else self.fixtures:
                on_axes = places[:, :2] @ axes.T
                stays = stays & ~((on_axes > least - half) & (on_axes < most + half)).all(axis=1)
            return stays

        return kept

    def _visible(self, object: Mesh) -> float:
        """Return the fraction of an object that the room leaves visible to who stands before its support."""
        return float(np.median(visible_from(self._scene, object, self._eyes(object))))

    def _covers(self, object: Mesh, thing: Mesh) -> bool:
        """Return True if an object hides much of a thing that stands behind it from who stands straight before that."""
        points = sample(thing, POINTS, seed=0).astype(np.float64)
        return bool(visible_fraction(object, points, self._eyes(thing)[:1])[0] < CLEAR)

    def _eyes(self, object: Mesh) -> np.ndarray:
        """Return the places of the eyes that look at an object [m], shape [azimuth 3]."""
        middle = object.bounds.mean(axis=0).astype(np.float64)
        height = middle[2] + ABOVE if self._inside else max(self._floor + EYE, middle[2] + ABOVE)
        return np.array([[*(middle[:2] + AWAY * self._turned(angle)), height] for angle in AZIMUTHS])

    def _turned(self, angle: float) -> np.ndarray:
        x, y = self._front[:2]
        return np.array([np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y])


def visible_from(scene: Scene, object: Mesh, eyes: np.ndarray) -> np.ndarray:
    """Return the fraction of an object in its place that a room leaves visible to each of some eyes [m], [eye 3]; shape [eye]."""
    points = sample(object, POINTS, seed=0).astype(np.float64)
    low, high = np.minimum(points.min(axis=0), eyes.min(axis=0)), np.maximum(points.max(axis=0), eyes.max(axis=0))
    return visible_fraction(nearby(scene, low - 0.05, high + 0.05), points, eyes)


def visible_fraction(obstacles: Mesh, points: np.ndarray, eyes: np.ndarray, gap: float = GAP) -> np.ndarray:
    """Return the fraction of points [point 3] that obstacles leave visible to each of some eyes [eye 3], shape [eye].

    The points may be on the obstacles: rays start `gap` [m] away from them.
    """
    return np.asarray(visible(obstacles, points, eyes, gap).mean(axis=1))


def visible(obstacles: Mesh, points: np.ndarray, eyes: np.ndarray, gap: float = GAP) -> np.ndarray:
    """Return which points each eye sees, as in `visible_fraction`, shape [eye point]."""
    if not len(obstacles.faces):
        return np.ones((len(eyes), len(points)), bool)
    away = eyes[:, None] - points
    distance = np.linalg.norm(away, axis=2)
    direction = (away / distance[..., None]).reshape(-1, 3)
    start, reach = np.tile(points, (len(eyes), 1)) + gap * direction, float(distance.max())
    seen, _ = visible_distance(kept_ray_mesh(obstacles), start, direction, reach)
    # Distances are in single precision: what is as far as the farthest ray counts as seen.
    return np.asarray(seen.reshape(distance.shape) >= np.minimum(distance - 2 * gap, reach * 0.999))


def _standing_on(scene: Scene, region: Region, target: str) -> list[Mesh]:
    """Return the small things that stand on a region."""
    meshes = []
    for part_id, part in scene.parts.items():
        if part_id == target or part.parent is not None or not len(part.mesh.faces):
            continue
        middle, extent = part.mesh.bounds.mean(axis=0), np.ptp(part.mesh.bounds, axis=0)
        if over(region, middle) and abs(part.mesh.bounds[0, 2] - region.height) < STANDS and extent.max() < LONGEST:
            meshes.append(part.mesh)
    return meshes


def _is_used(scene: Scene, part_id: str) -> bool:
    part = scene.parts[part_id]
    return (
        part.parent is None and len(part.mesh.faces) > 0 and any(is_kind_of(part.label, one) for one in USED_STANDING)
    )


def _room_before(scene: Scene, part_id: str) -> Rectangle:
    """Return the rectangle before a fixture."""
    mesh = target_mesh(scene, part_id)
    toward = front(scene, part_id)
    axes = np.array([toward, (-toward[1], toward[0])])
    on_axes = silhouette(mesh.vertices)[:, :2] @ axes.T
    low, high = on_axes.min(axis=0), on_axes.max(axis=0)
    return axes, np.array([high[0], low[1]]), np.array([high[0] + ROOM_BEFORE, high[1]])


def _stands_in(object: Mesh, rectangle: Rectangle, floor: float) -> bool:
    """Return True if an object reaches into a rectangle and is too high to step over."""
    axes, low, high = rectangle
    on_axes = object.vertices[:, :2] @ axes.T
    overlap = np.minimum(on_axes.max(axis=0), high) - np.maximum(on_axes.min(axis=0), low)
    return bool((overlap > 0.02).all() and object.bounds[1, 2] > floor + LOW)
