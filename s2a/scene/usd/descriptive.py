"""The descriptive flavour: the room in words and boxes, for language models; a page of text without a single triangle.

Parts nest as they belong together. A flag that is absent is false, and a part without a motion stands still.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from pxr import Sdf, Usd, UsdGeom

from s2a.core.errors import InputError
from s2a.scene.scene import UNANNOTATED, Joint, Mesh, Part, Scene, Vec3
from s2a.scene.upright_box import Box, silhouette, upright_box
from s2a.scene.usd.joints import KINDS, site_point
from s2a.scene.usd.stage import ROOT, check_ids, new_stage, open_stage, read_attribute, reading, save, write_attribute

FLAVOUR = "descriptive"
# Decimals of lengths [m] and angles [rad], of unit vectors, and of yaw [deg]: a scan knows no more
MILLIMETRES, DIRECTION, DEGREES = 3, 4, 1

LEGEND = """A room, part by part: a prim inside another is a part of it. Metres, z up.
center, size: upright box around a part with all inside it; yaw: degrees its size[0] side is turned from x about z.
motion: prismatic (slides along axis), revolute (turns about axis through origin, right-handed) or free;
limits: m or rad from the pose shown; against: what it moves against. graspable: held here; grasp: where to hold.
on: what carries it; inside: what holds it all around or above; touches: the walls and furniture at its sides;
of a front without furniture of its own: what is most around it; beside: what is near it on the same carrier, the nearest first.
Whatever is absent: false, fixed, not turned, unknown."""

Types = Sdf.ValueTypeNames


@dataclass(frozen=True)
class DescribedPart:
    """What the description says of a part."""

    label: str  # the annotator's name for it
    parent: str | None  # id of the part that it belongs to; None for an object
    motion: str  # "prismatic", "revolute", "free" or "fixed"
    graspable: bool  # a gripper holds the moving part here
    center: Vec3 | None  # of its upright box [m], scene coordinates; None where nothing was scanned of it
    size: Vec3 | None  # of that box [m]; the third is vertical
    yaw: float = 0.0  # how far its first side is turned from the x axis about z [rad]
    joint: Joint | None = None  # how it moves, rounded as it is described; None for what is fixed or free
    against: str | None = None  # id of the body that it moves against, or "world"; None for what has no joint
    mass: float | None = None  # [kg] if annotated, else None
    on: str | None = None  # id of what carries it, of an object that stands on something; else None
    inside: str | None = None  # id of what holds it all around or above, else None
    touches: tuple[str, ...] = ()  # ids of the walls and furniture at its sides, or most around a front
    beside: tuple[str, ...] = ()  # ids of what is near it on the same carrier, the nearest first


# Gaps up to which things touch [m]: the noise of a scan; and up to which one is beside another
TOUCH, BESIDE = 0.04, 0.4
# Width of the ring around a foot [m]: what stands somewhere hides its support from the scanner
RING = 0.04
# Points of a foot, and of a surface, that are looked at: so many at least, and so many a square metre
FEET, POINTS, DENSITY = 40, 2000, 1000
# So many points of a surface are there by more than a few faces of a wrong label
HITS = 5
# A board is above what it covers so much of, seen at COVER x COVER places
ABOVE, COVER = 0.2, 5
# Neighbours that are named, and of eight directions those in which something rises around what is inside
NEIGHBOURS, ROUND = 3, 6


@dataclass(frozen=True)
class Relations:
    """Where an object is among the others: ids, as in `DescribedPart`."""

    on: str | None = None
    inside: str | None = None
    touches: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()


def relations(scene: Scene) -> dict[str, Relations]:
    """Return the relations of the objects of a scene, of all that is not a part of something, structure, or unlabelled rest."""
    solid, own, on = _solid(scene), _own(scene), carriers(scene)
    objects, fronts = list(on), [i for i in own if i not in on]
    points = {i: _points(mesh) for i, mesh in solid.items()}
    boxes = {i: upright_box(silhouette(solid[i].vertices)) for i in own}
    inside = {i: on[i] for i in objects if _is_inside(i, on[i], scene, solid, points)}
    others = {i: [o for o in objects if o != i and on[o] == on[i] and on[i] is not None] for i in objects}
    gaps = {i: {o: _gap(boxes[i], points[o]) for o in near} for i, near in others.items()}
    walls = [i for i in solid if scene.parts[i].label.lower().endswith("wall")]
    sides = {i: [o for o in (*walls, *objects) if o not in (i, on.get(i)) and _meets(solid[i], solid[o])] for i in own}
    large = {i: [o for o in sides[i] if i in fronts or o in walls or _larger(solid[o], solid[i])] for i in own}
    touches = {
        i: _touched(boxes[i], {o: points[o] for o in others}, walls, all_around=i in fronts)
        for i, others in large.items()
    }
    near = {i: sorted((gap, o) for o, gap in gaps[i].items() if gap <= BESIDE)[:NEIGHBOURS] for i in objects}
    return {i: Relations(on.get(i), inside.get(i), touches[i], tuple(o for _, o in near.get(i, ()))) for i in own}


def carriers(scene: Scene) -> dict[str, str | None]:
    """Return the id of what carries each object, or None; fronts of furniture that nobody drew are left out."""
    solid = _solid(scene)
    return {i: _carrier(scene, i, solid) for i in _own(scene) if not isinstance(scene.parts[i].motion, Joint)}


def _solid(scene: Scene) -> dict[str, Mesh]:
    return {i: part.mesh for i, part in scene.parts.items() if len(part.mesh.faces)}


def _own(scene: Scene) -> list[str]:
    """Return the ids of what has a surface and is not a part of something, structure, or unlabelled rest."""
    return [i for i in _solid(scene) if scene.parts[i].parent is None and not _is_structure(scene.parts[i].label)]


def _is_structure(label: str) -> bool:
    return label.lower() in ("floor", "ceiling", UNANNOTATED) or label.lower().endswith("wall")


def _meets(mesh: Mesh, other: Mesh) -> bool:
    """Return True if the boxes of two surfaces are near."""
    return bool(
        (mesh.bounds[0] <= other.bounds[1] + 2 * TOUCH).all() and (other.bounds[0] <= mesh.bounds[1] + 2 * TOUCH).all()
    )


def _larger(mesh: Mesh, than: Mesh) -> bool:
    return bool(np.prod(np.ptp(mesh.bounds, axis=0)) > np.prod(np.ptp(than.bounds, axis=0)))


def _carrier(scene: Scene, part_id: str, solid: dict[str, Mesh]) -> str | None:
    """Return the id of the object or floor whose surface is most below the foot of a part, or around that; None if none is."""
    mesh = solid[part_id]
    low = float(mesh.bounds[0, 2])
    foot = mesh.vertices[mesh.vertices[:, 2] < low + 0.01 + 0.02 * np.ptp(mesh.bounds[:, 2]), :2].astype(float)
    foot = foot[:: max(1, len(foot) // FEET)]
    out = foot - foot.mean(axis=0)
    ring = foot + RING * out / np.maximum(np.linalg.norm(out, axis=1, keepdims=True), 1e-6)
    places = np.concatenate([foot, foot.mean(axis=0)[None], ring])
    corners = np.array([[*(places.min(axis=0) - 0.01), low - TOUCH], [*(places.max(axis=0) + 0.01), low + TOUCH]])
    hits: dict[str, tuple[float, float]] = {}
    for other, surface in solid.items():
        owner = (scene.ancestors(other) or [other])[-1]
        label = scene.parts[owner].label.lower()
        if owner == part_id or isinstance(scene.parts[owner].motion, Joint) or label == UNANNOTATED:
            continue
        near = _triangles(surface, *corners)
        if len(near) and not label.endswith("wall"):
            covered = _covered(places, near, *corners[:, 2])
            hits[owner] = max(hits.get(owner, (0.0, 0.0)), covered)
    most = max((share for share, _ in hits.values()), default=0.0)
    if most >= 0.1:
        return max((i for i in hits if hits[i][0] >= most / 2), key=lambda i: hits[i][1])
    floors = [i for i, part in scene.parts.items() if part.label.lower() == "floor" and i in solid]
    return next((i for i in floors if low <= np.median(solid[i].vertices[:, 2]) + 2 * TOUCH), None)  # hidden by a bed


def _points(mesh: Mesh) -> np.ndarray:
    """Return points spread over a surface by area [m], shape [point 3]."""
    random, areas = np.random.default_rng(0), mesh.face_areas + 1e-12
    count = max(POINTS, int(DENSITY * areas.sum()))
    chosen = random.choice(len(mesh.faces), count, p=areas / areas.sum())
    u, v = np.sort(random.random((2, count)), axis=0)
    corners = mesh.vertices[mesh.faces[chosen]].astype(np.float64)
    return np.einsum("pk,pkd->pd", np.stack([u, v - u, 1 - v], axis=1), corners)


def _triangles(mesh: Mesh, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return the triangles of a surface whose boxes meet a box with these corners [m], shape [triangle 3 3]."""
    if (mesh.bounds[0] > high).any() or (mesh.bounds[1] < low).any():
        return np.empty((0, 3, 3))
    # A bit for each side of the box: all corners of a face beyond one are outside.
    beyond = np.packbits(np.concatenate([mesh.vertices < low, mesh.vertices > high], axis=1), axis=1)[:, 0]
    a, b, c = beyond[mesh.faces.T]
    return mesh.vertices[mesh.faces[(a & b & c) == 0]].astype(float)


def _covered(places: np.ndarray, triangles: np.ndarray, low: float, high: float) -> tuple[float, float]:
    """Return at which fraction of places [place 2] triangles [triangle 3 3] have a height between two, and its mean [m]."""
    a, ab, ac = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
    area = ab[:, 0] * ac[:, 1] - ab[:, 1] * ac[:, 0]
    level = np.abs(area) > 1e-9
    a, ab, ac, area = a[level], ab[level], ac[level], area[level]
    off = places[:, None] - a[:, :2]
    v = (off[..., 0] * ac[:, 1] - off[..., 1] * ac[:, 0]) / area
    w = (ab[:, 0] * off[..., 1] - ab[:, 1] * off[..., 0]) / area
    height = a[:, 2] + v * ab[:, 2] + w * ac[:, 2]
    there = (v >= 0) & (w >= 0) & (v + w <= 1) & (height >= low) & (height <= high)
    return float(there.any(axis=1).mean()), float(height[there].mean()) if there.any() else 0.0


def _is_inside(
    part_id: str, carrier: str | None, scene: Scene, solid: dict[str, Mesh], points: dict[str, np.ndarray]
) -> bool:
    """Return True for what its carrier has a board above, or rises around."""
    if carrier is None or carrier not in points or _is_structure(scene.parts[carrier].label):
        return False
    (low, high), holder = solid[part_id].bounds.astype(float), points[carrier]
    middle, top = (low + high) / 2, float(solid[carrier].bounds[1, 2]) + TOUCH
    boards = _triangles(solid[carrier], np.array([*low[:2], high[2] + TOUCH]), np.array([*high[:2], top]))
    steps = (np.arange(COVER) + 0.5) / COVER
    places = low[:2] + np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2) * (high - low)[:2]
    above, _ = _covered(places, boards, high[2] + TOUCH, top)
    around = holder[holder[:, 2] > low[2] + min(0.05, 0.5 * (high - low)[2])] - middle
    sectors = np.floor(np.arctan2(around[:, 1], around[:, 0]) / (np.pi / 4)).astype(int)
    return bool(above >= ABOVE or (np.bincount(sectors % 8) >= HITS).sum() >= ROUND)


def _from(box: Box, points: np.ndarray) -> np.ndarray:
    """Return how far points [point 3] are out of a box along its axes [m], 0 inside, shape [point 3]."""
    local = points - box.center
    c, s = math.cos(box.yaw), math.sin(box.yaw)
    local[:, :2] = local[:, :2] @ np.array([[c, -s], [s, c]])
    return np.maximum(np.abs(local) - np.array(box.size) / 2, 0.0)


def _gap(box: Box, points: np.ndarray) -> float:
    """Return the distance of a box to the points of a surface [m]."""
    return float(np.linalg.norm(_from(box, points), axis=1).min())


def _touched(box: Box, points: dict[str, np.ndarray], walls: Sequence[str], *, all_around: bool) -> tuple[str, ...]:
    """Return what has several points at the sides of a box, at a height between its own.

    All around, of a front, furniture above and below counts, too, and what has less than half as many points as another piece
    is its neighbour: the refrigerator below a wall cabinet's door.
    """
    hits = {}
    for i, surface in points.items():
        off = _from(box, surface)
        if all_around and i not in walls:
            near = np.linalg.norm(off, axis=1) <= 1.5 * TOUCH
        else:
            near = (off[:, 2] == 0.0) & (np.linalg.norm(off[:, :2], axis=1) <= 1.5 * TOUCH)
        hits[i] = int(near.sum())
    most = max((count for i, count in hits.items() if i not in walls), default=0) if all_around else 0
    return tuple(i for i, count in hits.items() if count >= HITS and (i in walls or 2 * count >= most))


def write(scene: Scene, path: Path) -> None:
    """Write the description of a scene to exactly this path, which ends in .usda.

    Raises:
        InputError: an id that cannot be a prim's name, or a path that cannot be written.
    """
    check_ids(scene)
    stage = new_stage()
    stage.GetRootLayer().documentation = LEGEND
    root = stage.GetDefaultPrim()
    write_attribute(root, "flavour", Types.String, FLAVOUR)
    write_attribute(root, "name", Types.String, scene.name)
    outlines = {part_id: silhouette(part.mesh.vertices) for part_id, part in scene.parts.items()}
    _write_box(root, list(outlines.values()))
    related = relations(scene)
    for part_id in scene.parts:
        prim = _write_part(stage, scene, part_id)
        for name, value in vars(related.get(part_id, Relations())).items():
            if value:
                _describe(prim, name, Types.String, value if isinstance(value, str) else " ".join(value))
        _write_box(prim, [outlines[i] for i in (part_id, *scene.descendants(part_id))])
    save(stage, path)


def read(path: Path) -> dict[str, DescribedPart]:
    """Read the parts of a description by id, parents before children.

    Raises:
        InputError: no such file, not USD, or a stage of another flavour.
    """
    with reading(path):
        stage = open_stage(path)
        root = stage.GetDefaultPrim()
        flavour = read_attribute(root, "flavour", str)
        if flavour != FLAVOUR:
            raise InputError(f"{path}: flavour {flavour!r}; expected {FLAVOUR!r}: the descriptive.usda of s2a export")
        prims = [
            prim for prim in Usd.PrimRange(root) if prim != root and read_attribute(prim, "label", str) is not None
        ]
        return {prim.GetName(): _read_part(prim, root) for prim in prims}


def _read_part(prim: Usd.Prim, root: Usd.Prim) -> DescribedPart:
    parent = prim.GetParent()
    return DescribedPart(
        label=read_attribute(prim, "label", str),
        parent=None if parent == root else parent.GetName(),
        motion=read_attribute(prim, "motion", str, "fixed"),
        graspable=read_attribute(prim, "graspable", bool, False),
        center=read_attribute(prim, "center", tuple),
        size=read_attribute(prim, "size", tuple),
        yaw=math.radians(read_attribute(prim, "yaw", float, 0.0)),
        joint=described_joint(prim),
        against=read_attribute(prim, "against", str),
        mass=read_attribute(prim, "mass", float),
        on=read_attribute(prim, "on", str),
        inside=read_attribute(prim, "inside", str),
        touches=tuple(read_attribute(prim, "touches", str, "").split()),
        beside=tuple(read_attribute(prim, "beside", str, "").split()),
    )


def described_joint(prim: Usd.Prim) -> Joint | None:
    """Return the joint that a prim describes, or None."""
    kind, axis = read_attribute(prim, "motion", str), read_attribute(prim, "axis", tuple)
    if kind not in KINDS.values() or axis is None:
        return None
    # Rounded there, so no longer of unit length.
    unit = tuple(x / math.hypot(*axis) for x in axis)
    return Joint(kind, unit, read_attribute(prim, "origin", tuple), read_attribute(prim, "limits", tuple))


def prim_path(scene: Scene, part_id: str) -> str:
    """Return the path of the prim that describes a part: its ancestors, then itself."""
    return "/".join((ROOT, *reversed(scene.ancestors(part_id)), part_id))


def _write_part(stage: Usd.Stage, scene: Scene, part_id: str) -> Usd.Prim:
    part = scene.parts[part_id]
    prim = UsdGeom.Xform.Define(stage, prim_path(scene, part_id)).GetPrim()
    _describe(prim, "label", Types.String, part.label)
    if part.graspable:
        _describe(prim, "graspable", Types.Bool, True)
    if part.mass is not None:
        _describe(prim, "mass", Types.Double, round(part.mass, MILLIMETRES))
    _write_motion(prim, scene, part_id, part)
    return prim


def _write_box(prim: Usd.Prim, outlines: Sequence[np.ndarray]) -> None:
    """Describe the box around some outlines [n 3]; nothing where there is no point."""
    points = np.concatenate([np.zeros((0, 3)), *outlines])
    if not len(points):
        return
    box = upright_box(points)
    _describe(prim, "center", Types.Double3, _rounded(box.center))
    _describe(prim, "size", Types.Double3, _rounded(box.size))
    if yaw := round(math.degrees(box.yaw), DEGREES):
        _describe(prim, "yaw", Types.Double, yaw)


def _write_motion(prim: Usd.Prim, scene: Scene, part_id: str, part: Part) -> None:
    """Describe how a part moves, against what, and where to hold it; nothing for a fixed part."""
    if part.motion == "fixed":
        return
    _describe(prim, "movable", Types.Bool, True)
    _describe(prim, "motion", Types.Token, part.motion.kind if isinstance(part.motion, Joint) else part.motion)
    if not isinstance(part.motion, Joint):
        return
    _describe(prim, "against", Types.String, scene.parent_body(part_id) or "world")
    _describe(prim, "axis", Types.Double3, _rounded(part.motion.axis, DIRECTION))
    _describe(prim, "origin", Types.Double3, _rounded(part.motion.origin))
    _describe(prim, "limits", Types.Double2, _rounded(part.motion.limits))
    point = site_point(scene, part_id)
    if point is not None:
        _describe(prim, "grasp", Types.Double3, _rounded(point))


def _describe(prim: Usd.Prim, name: str, kind: Sdf.ValueTypeName, value: object) -> None:
    """Author an attribute in as few words as USD's text allows."""
    write_attribute(prim, name, kind, value, terse=True)


def _rounded(values: Sequence[float] | np.ndarray, decimals: int = MILLIMETRES) -> tuple[float, ...]:
    """Round, without negative zeros."""
    return tuple(round(float(value), decimals) + 0.0 for value in values)
