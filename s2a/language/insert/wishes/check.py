"""Checks of the relations of a placement hint on the triangles of the room with the object in its place.

Left and right, front and back are those of somebody who stands before the thing, on its side towards the middle of the room.
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.spatial import cKDTree

from s2a.language.insert.hints import is_kind_of
from s2a.language.insert.place.preferences import floor_height
from s2a.language.insert.place.serves import front, visible_from
from s2a.language.insert.place.supports import target_mesh
from s2a.language.insert.wishes.parse import Relation
from s2a.scene.geometry.mesh_query import ray_mesh, visible_distance
from s2a.scene.scene import Mesh, Scene

BESIDE, FAR = 0.45, 0.8
"""Largest gap to what a thing is near, and least gap to what it is away from [m]."""
CONTACT = 0.03
"""Largest gap to what carries a thing [m]: the noise of a scan."""
OFF_HEIGHT = 0.1
"""Largest error of a height on a wall [m]."""
SEEN = 0.5
"""Least visible fraction of what is seen from somewhere."""
SEATS = ("sofa", "armchair", "chair", "bed", "bench", "toilet")
"""On which one sits, and looks ahead; before all else one sits or stands, and looks around."""
SITTING, STANDING, BEFORE = 1.15, 1.55, 0.4
"""Heights of the eyes of who sits and of who stands, and how far before a thing [m]."""
AROUND = np.array([(np.cos(a), np.sin(a), 0.0) for a in np.arange(8) * np.pi / 4])


def met(scene: Scene, object: Mesh, relation: Relation) -> bool:
    """Return True if an object in its place has a relation to one of the things that it may mean.

    Args:
        scene: the room, without the object.
        object: in the scene [m].
        relation: of a wish.
    """
    if relation.kind == "height":
        middle = float(object.bounds[:, 2].mean()) - floor_height(scene)
        return abs(middle - float(relation.height or 0.0)) <= OFF_HEIGHT
    holds = any(_holds(scene, object, relation.kind, list(ids)) for ids in product(*relation.part_ids))
    return holds != relation.negated


def _holds(scene: Scene, object: Mesh, kind: str, ids: list[str]) -> bool:
    meshes = [target_mesh(scene, part_id) for part_id in ids]
    if kind == "between":
        return len(meshes) == 2 and ids[0] != ids[1] and between(object, *meshes)
    if kind in ("near", "away"):
        gap = _gap(object, meshes[0])
        return gap <= BESIDE if kind == "near" else gap >= FAR
    if kind == "on":
        return _carried(object, meshes[0])
    if kind == "in":
        return _within(object, meshes[0])
    if kind == "wall":
        return _gap(object, meshes[0]) <= 2 * CONTACT and object.bounds[0, 2] > floor_height(scene) + 0.2
    if kind == "against":
        return _gap(object, meshes[0]) <= 2 * CONTACT
    if kind == "seen from":
        return _seen_from(scene, object, ids[0], meshes[0])
    if kind in ("top", "bottom"):
        return _carried(object, meshes[0]) and _extreme(object, meshes[0], kind == "top")
    return placed(object.bounds, viewer(scene, ids[0]), object, meshes[0], kind)


def viewer(scene: Scene, part_id: str) -> np.ndarray:
    """Return the horizontal direction from a thing to who stands before it, unit, shape [2]: the front of what carries it."""
    return front(scene, _carrier(scene, part_id))


def placed(bounds: np.ndarray, toward: np.ndarray, object: Mesh, mesh: Mesh, kind: str) -> bool:
    """Return True if an object is left of, above ... a thing, as seen by somebody in a direction [2] from it."""
    right = np.array([-toward[1], toward[0]])
    own = np.stack([object.vertices[:, :2] @ right, object.vertices[:, :2] @ toward], axis=1)
    its = np.stack([mesh.vertices[:, :2] @ right, mesh.vertices[:, :2] @ toward], axis=1)
    low, high = its.min(axis=0), its.max(axis=0)
    first, last = own.min(axis=0), own.max(axis=0)
    x, y = (first + last) / 2
    size = np.maximum(high - low, 1e-6)
    beside = np.maximum(np.maximum(first - high, low - last), 0.0)
    share = (np.array([x, y]) - low) / size
    if kind == "left":
        return bool(last[0] <= low[0] + 0.25 * (last - first)[0] and beside[0] <= 0.7 and beside[1] <= 0.3)
    if kind == "right":
        return bool(first[0] >= high[0] - 0.25 * (last - first)[0] and beside[0] <= 0.7 and beside[1] <= 0.3)
    if kind == "front":
        return bool(first[1] >= high[1] - 0.25 * (last - first)[1] and beside[1] <= 0.7 and beside[0] <= 0.1)
    if kind == "behind":
        return bool(last[1] <= low[1] + 0.25 * (last - first)[1] and beside[1] <= 0.7 and beside[0] <= 0.1)
    top = float(mesh.bounds[1, 2])
    if kind == "above":
        return bool(bounds[0, 2] >= top - 0.01 and beside[0] <= 0.0 and beside[1] <= 0.3)
    if kind == "below":
        return bool(bounds[1, 2] <= top + 0.01 and (0.0 <= share).all() and (share <= 1.0).all())
    inner = (share >= -0.05).all() and (share <= 1.05).all()
    if kind == "back edge":
        return bool(inner and (share[1] <= 0.35 or first[1] - low[1] <= 0.1))
    if kind == "front edge":
        return bool(inner and (share[1] >= 0.65 or high[1] - last[1] <= 0.1))
    edge = np.minimum(first - low, high - last)
    if kind == "corner":
        return bool(inner and (edge <= np.maximum(0.15 * size, 0.1)).all())
    return bool(inner and (np.abs(share - 0.5) <= np.maximum(0.17, 0.1 / size)).all())


def between(object: Mesh, one: Mesh, other: Mesh) -> bool:
    """Return True if an object's middle is between two things and not beside the line from one to the other."""
    a, b, c = (mesh.bounds.mean(axis=0)[:2].astype(float) for mesh in (one, other, object))
    line = b - a
    length = float(np.linalg.norm(line))
    if length < 1e-6:
        return False
    along = float((c - a) @ line) / length
    aside = abs(float(np.cross(np.append(line, 0.0), np.append(c - a, 0.0))[2])) / length
    across = np.array([-line[1], line[0]]) / length
    half = max(float(np.ptp(mesh.vertices[:, :2] @ across)) / 2 for mesh in (one, other))
    return bool(0.1 * length < along < 0.9 * length and aside <= max(half, 0.15))


def _seen_from(scene: Scene, object: Mesh, part_id: str, mesh: Mesh) -> bool:
    """Return True if who uses a thing sees most of an object: over a seat, and ahead of it; else before the thing."""
    toward, floor = viewer(scene, part_id), floor_height(scene)
    axes = np.array([toward, (-toward[1], toward[0])])
    seat = any(is_kind_of(scene.parts[part_id].label, one) for one in SEATS)
    low, high = (mesh.vertices[:, :2] @ axes.T).min(axis=0), (mesh.vertices[:, :2] @ axes.T).max(axis=0)
    along = (low[0] + high[0]) / 2 if seat else high[0] + BEFORE
    height = floor + (SITTING if mesh.bounds[1, 2] < floor + SITTING else STANDING)
    aside = low[1] + np.array([0.25, 0.5, 0.75]) * (high[1] - low[1])
    eyes = np.array([[*(axes.T @ (along, a)), height] for a in aside])
    ahead = float(object.bounds.mean(axis=0)[:2] @ toward) > along
    return bool((ahead or not seat) and visible_from(scene, object, eyes).max() >= SEEN)


def _carrier(scene: Scene, part_id: str) -> str:
    """Return the id of what a small thing stands on, for that has a front; else its own."""
    mesh = target_mesh(scene, part_id)
    if np.ptp(mesh.bounds, axis=0)[:2].max() > 0.7:
        return part_id
    for other, part in scene.parts.items():
        big = len(part.mesh.vertices) and part.parent is None and "floor" not in part.label.lower()
        if not big or other == part_id or np.ptp(part.mesh.bounds, axis=0)[:2].max() < 0.5:
            continue
        if _carried(mesh, part.mesh):
            return other
    return part_id


def _gap(object: Mesh, mesh: Mesh) -> float:
    """Return the distance between two surfaces [m], up to the spacing of their vertices and middles of faces."""
    points = [np.concatenate([one.vertices, one.vertices[one.faces].mean(axis=1)]) for one in (object, mesh)]
    low, high = object.bounds
    box = float(np.linalg.norm(np.maximum(np.maximum(low - mesh.bounds[1], mesh.bounds[0] - high), 0.0)))
    return max(box, min(float(cKDTree(points[1]).query(points[0])[0].min()), box + 0.02))


def _carried(object: Mesh, mesh: Mesh) -> bool:
    """Return True if rays from an object's underside meet a surface right below it."""
    low = float(object.bounds[0, 2])
    foot = object.vertices[object.vertices[:, 2] < low + 0.01 + 0.02 * float(np.ptp(object.bounds[:, 2]))]
    foot = foot[:: max(1, len(foot) // 200)].astype(float)
    middle = np.append(foot[:, :2].mean(axis=0), low)
    points = np.concatenate([foot, (foot + middle) / 2, middle[None]]) + (0.0, 0.0, 0.02)
    reach = 0.02 + CONTACT + 0.01
    below = points - (0.0, 0.0, reach)
    if (below.min(axis=0) > mesh.bounds[1]).any() or (points.max(axis=0) < mesh.bounds[0]).any():
        return False  # no ray comes near it, and to ask them takes milliseconds
    seen, _ = visible_distance(ray_mesh(mesh.vertices, mesh.faces), points, np.array([0.0, 0.0, -1.0]), reach)
    return bool((seen < 0.02 + CONTACT + 0.009).mean() > 0.2)


def _within(object: Mesh, mesh: Mesh) -> bool:
    """Return True if a thing rises around an object's middle, and the object begins below its top."""
    middle = object.bounds.mean(axis=0).astype(float)
    low, high = mesh.bounds
    if (
        (middle[:2] < low[:2]).any()
        or (middle[:2] > high[:2]).any()
        or not low[2] - CONTACT < object.bounds[0, 2] < high[2] - 0.01
    ):
        return False
    # At a third of what is below the rim: shallow trays hold tall things.
    height = object.bounds[0, 2] + min(0.5 * np.ptp(object.bounds[:, 2]), 0.5 * (high[2] - object.bounds[0, 2]))
    start = np.tile((middle[0], middle[1], height), (8, 1))
    reach = float(np.linalg.norm(high - low))
    seen, _ = visible_distance(ray_mesh(mesh.vertices, mesh.faces), start, AROUND, reach)
    return bool((seen < 0.999 * reach).sum() >= 5)


def _extreme(object: Mesh, mesh: Mesh, top: bool) -> bool:
    """Return True if no board of a shelf lies above an object, other than its lid; or none below what carries it."""
    middle = object.bounds.mean(axis=0).astype(float)
    asked, reach = ray_mesh(mesh.vertices, mesh.faces), 3.0
    up = 1.0 if top else -1.0
    start, levels = middle.copy(), []
    start[2] = object.bounds[1, 2] if top else object.bounds[0, 2] - 2 * CONTACT
    for _ in range(12):
        seen, _ = visible_distance(asked, start[None], np.array([0.0, 0.0, up]), reach)
        if seen[0] >= reach:
            break
        start[2] += up * (float(seen[0]) + 0.05)  # over the board
        levels.append(start[2])
    # The lid of a shelf may be above its uppermost board, and its base below the lowest.
    return len(levels) <= 1
