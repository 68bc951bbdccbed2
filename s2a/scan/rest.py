"""Parts of a scan's mesh: one mesh a part, annotated ones by their hierarchy, and flat, fixed ones for the rest."""

from __future__ import annotations

import itertools
import logging
from collections.abc import Container, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import fields, labels
from s2a.scan.fields import Record
from s2a.scan.ply import ScanMesh
from s2a.scene.geometry.mesh_ops import components, keep, weighted_quantile
from s2a.scene.scene import UNANNOTATED, Mesh, Part, Scene
from s2a.scene.upright_box import silhouette, upright_box


def cut(surface: ScanMesh, owner: np.ndarray, count: int) -> list[Mesh]:
    """Cut a surface into the meshes of parts 0 to count - 1; vertices on a border go to both sides.

    Args:
        surface: the whole scan.
        owner: the part of each face, shape [face], integers; -1 for none.
        count: number of parts; one that owns nothing gets an empty mesh.

    Returns:
        Meshes that keep the order of the scan's faces and vertices.
    """
    by_owner = np.argsort(owner, kind="stable")
    borders = np.searchsorted(owner[by_owner], np.arange(count + 1))
    return [_piece(surface, by_owner[borders[i] : borders[i + 1]]) for i in range(count)]


def _piece(surface: ScanMesh, chosen: np.ndarray) -> Mesh:
    """Return the mesh of some faces and of the vertices they use."""
    faces = surface.faces[chosen]
    if not len(faces):
        return Mesh(np.empty((0, 3)), faces, None if surface.colors is None else np.empty((0, 3)))
    # A table over the range of vertices in use is several times faster here than np.unique, which sorts.
    low = faces.min()
    used = np.zeros(faces.max() - low + 1, dtype=bool)
    used[faces - low] = True
    new_number = np.cumsum(used) - 1
    old = np.flatnonzero(used) + low
    colors = None if surface.colors is None else surface.colors[old]
    return Mesh(surface.vertices[old], new_number[faces - low], colors)


_MOSTLY = 0.5  # an object with more than this share of its vertices in annotated parts is annotated already


@dataclass(frozen=True)
class Group:
    """One annotated object."""

    label: str  # what it is ("office chair")
    vertices: np.ndarray  # indices into the scan's vertices, ascending, each once, shape [n], int64


def read_segments(segments_path: Path, groups_path: Path, vertex_count: int) -> list[Group]:
    """Read the objects of a scan from `segments.json` (a segment for each vertex) and `segments_anno.json`.

    Raises:
        InputError: another number of vertices than the mesh has, a group of segments that do not exist, wrong types.
    """
    segments = fields.load(segments_path).integers("segIndices")
    if len(segments) != vertex_count:
        raise InputError(
            f"{segments_path}: segIndices counts {len(segments)} vertices, the mesh has {vertex_count}; "
            "take all files from one release"
        )
    records = fields.load(groups_path).records("segGroups", "group")
    # In ScanNet++ every vertex is its own segment as a rule: then segment numbers are vertex numbers.
    each_its_own = np.array_equal(segments, np.arange(vertex_count))
    groups = [_group(record, segments, each_its_own) for record in records]
    return [group for group in groups if len(group.vertices)]


def unclaimed(groups: list[Group], faces: np.ndarray, claimed: np.ndarray) -> list[Group]:
    """Return the groups with at most half their vertices on claimed faces (mask, shape [face]), in their order."""
    taken = np.zeros(int(faces.max()) + 1, dtype=bool)
    taken[faces[claimed]] = True
    # Vertices of no face lie beyond the mask, and count as free.
    return [
        each
        for each in groups
        if taken[each.vertices[each.vertices < len(taken)]].sum() <= _MOSTLY * len(each.vertices)
    ]


def face_groups(groups: list[Group], faces: np.ndarray, vertex_count: int) -> np.ndarray:
    """Return for each face the position of its group, or -1, shape [face], int32.

    A vertex of several groups belongs to the smallest of them (a cushion on a sofa). A face goes where two of its
    vertices belong, or else with its first.
    """
    group_of = np.full(vertex_count, -1, dtype=np.int32)
    for i in sorted(range(len(groups)), key=lambda i: len(groups[i].vertices), reverse=True):
        group_of[groups[i].vertices] = i
    first, second, third = group_of[faces].T
    return np.where(second == third, second, first)


def _group(record: Record, segments: np.ndarray, each_its_own: bool) -> Group:
    """Return a group with the vertices of its segments."""
    label = " ".join(record.text("label").split())  # a label is one line
    named = Record(record.values, f"{record.where} {label!r}")
    if each_its_own:
        return Group(label, np.unique(named.indices("segments", len(segments), "vertices")))
    wanted = named.integers("segments")
    unknown = wanted[~np.isin(wanted, segments)]
    if len(unknown):
        raise InputError(
            f"{named.where}: segments holds {unknown[0]}, which no vertex has; take both files from one release"
        )
    return Group(label, np.flatnonzero(np.isin(segments, wanted)))


_log = logging.getLogger(__name__)

REMOVED = -2  # Owner of faces that annotators marked as artefacts of the reconstruction; no part gets them


def claim(surface: ScanMesh, owner: np.ndarray, count: int, files: tuple[Path, Path] | None) -> list[str]:
    """Give the faces without owner to further parts: annotated objects, and "unannotated" for what is left then.

    Objects that annotators call REMOVE are artefacts, whose faces are left out with a warning; SPLIT ones are objects that could
    not be annotated, and stay "unannotated", as do faces that an object's label spilled onto (`stray_faces`).

    Args:
        surface: the whole scan.
        owner: the part of each face, shape [face], integers; its -1 are replaced in place, by positions from count on or REMOVED.
        count: number of parts so far.
        files: segments and groups of segments, or None.

    Returns:
        The labels of the further parts, in the order of their positions.
    """
    names: list[str] = []
    free = owner == -1
    if files is not None:
        groups = read_segments(*files, len(surface.vertices))
        groups = unclaimed(groups, surface.faces, owner >= 0)
        place: list[int] = []
        for label in (group.label for group in groups):
            place.append(REMOVED if labels.is_removed(label) else -1 if labels.is_split(label) else count + len(names))
            names += [label] if place[-1] >= 0 else []
        owner[free] = np.array([*place, -1])[face_groups(groups, surface.faces[free], len(surface.vertices))]
        strays = stray_faces(surface, owner, dict(enumerate(names, start=count)))
        owner[strays] = -1
        _warn_of_removed(files[1], owner)
    if (owner == -1).any():
        owner[owner == -1] = count + len(names)
        names.append(UNANNOTATED)
    return names


# Labels of what goes on behind other things: its components are apart, and all belong to it
STRUCTURE = ("wall", "floor", "ceiling")
# Weight of a tail's area against the length that it adds to a box, where it borders on other labels along its whole length, as a
# strip of a wall does, and where it ends in the air, as a lamp's pole does; fractions of the length between which the weight
# changes, and the pieces [m] in which the length is looked at
SPILLED, FREE, BETWEEN, BIN = 2.5, 12.0, (0.4, 0.8), 0.02
# Added to the lengths of a box when they are compared [m]: what is thin is not trimmed to a sheet
NOISE = 0.1
# Extent [m] below which an object's sides are no tails: a front's edges are. Those of a wall may be
THIN = 0.12
# Least gain of a tail; fraction of an area that is trimmed for less; and that from which what leaves through the top or the
# bottom is no tail
WORTH, DUST, SMALL = 0.03, 0.015, 0.12
# Largest fraction of an object's area in one tail, and in all
TAIL, IN_ALL = 0.18, 0.3
# Largest extent of a tail across, over that of the rest: a side of a cabinet is as high as its front. Those of a wall may be as
# wide as it is, where it is then as thin as this [m] and they have no more than that fraction of its area
NARROW, PLATE = 0.7, (0.2, 0.08)
# The floor at a foot, which faces up outside of it, is no higher than this above its lowest point: a foot's plate is [m]
SKIRT = 0.01
# Least vertical component of the normal of floor that rises to a foot, as a scan rounds the corner between them
RISING = 0.4
# What is lower than this above the lowest point touches what carries it, whose label borders on it there; what begins at the
# second height has a lower side that may be trimmed, at the third no foot [m]
FOOT, LIFTED, HUNG = 0.06, 0.5, 1.2
# A component apart from the largest one by this fraction of its own length is another thing; so is one beside that with less
# than this fraction of its area, from this distance on [m]
APART, PART = 0.5, (0.25, 0.05)
# Largest usual height [m] of what has a level top, by the last words of its label: what rises above the top of a higher one
# stands on it or behind it. Height of the band in which the top is looked for; least vertical component of its normals; least
# fraction of the area below it
USUAL = {"refrigerator": 2.0, "fridge": 2.0, "washing machine": 0.95, "dishwasher": 0.95, "desk": 0.85, "nightstand": 0.75,
         "coffee table": 0.6, "microwave": 0.4, "toaster oven": 0.38, "dishrack": 0.35, "dish rack": 0.35}  # fmt: skip
TOP, UPWARDS, MOST = 0.08, 0.7, 0.5
TOUCHING = 0.01  # Largest distance of the boxes of components that touch [m]


def stray_faces(surface: ScanMesh, owner: np.ndarray, names: Mapping[int, str]) -> np.ndarray:
    """Return the faces that belong to no object although its label covers them, shape [stray].

    Labels spill onto what is behind and beside an object: onto components apart from it, tongues along a wall, the floor at its
    feet. Such a tail adds much to the object's box and little to its area, and borders on other labels along its sides, which a
    thin part that ends in the air does not.

    Args:
        surface: the whole scan.
        owner: position of the part of each face, shape [face]; negative for none.
        names: labels of the objects to look at, by position.
    """
    scan, border = Mesh(surface.vertices, surface.faces), _borders(surface, owner)
    strays = [np.empty(0, np.int64)]
    for position, label in names.items():
        own = np.flatnonzero(owner == position)
        if len(own) > 1:
            mesh = keep(scan, own)
            whole = label.lower().rpartition(" ")[2] in STRUCTURE
            joined = np.zeros(len(own), int) if whole else components(mesh)
            points = mesh.vertices.astype(np.float64)
            body = _body(points, mesh.faces, border[own], joined, whole)
            body &= ~_above_top(points[mesh.faces], body, USUAL.get(labels.family(USUAL, label), np.inf))
            strays.append(own[~body])
    return np.concatenate(strays)


def _borders(surface: ScanMesh, owner: np.ndarray) -> np.ndarray:
    """Return the length of each face's edges that it shares with faces of other owners [m], shape [face]."""
    # Both ends of a shared edge are vertices of several owners, which few are.
    one = np.empty(len(surface.vertices), owner.dtype)
    one[surface.faces] = owner[:, None]
    shared = np.zeros(len(surface.vertices), bool)
    shared[surface.faces[one[surface.faces] != owner[:, None]]] = True
    corner = shared[surface.faces]
    ends = ((0, 1), (1, 2), (2, 0))
    chosen = [np.flatnonzero(corner[:, i] & corner[:, j]) for i, j in ends]
    face = np.concatenate(chosen)
    sides = np.concatenate([surface.faces[few][:, pair] for few, pair in zip(chosen, ends, strict=True)])
    sides = np.sort(sides, axis=1)
    order = np.lexsort((sides[:, 1], sides[:, 0]))
    sides, face = sides[order], face[order]
    pairs = np.flatnonzero((sides[1:] == sides[:-1]).all(axis=1) & (owner[face[1:]] != owner[face[:-1]]))
    edges = surface.vertices[sides[pairs]].astype(np.float64)
    length = np.linalg.norm(edges[:, 0] - edges[:, 1], axis=1)
    return np.bincount(np.concatenate([face[pairs], face[pairs + 1]]), np.tile(length, 2), len(owner))


def _body(
    points: np.ndarray, faces: np.ndarray, border: np.ndarray, component: np.ndarray, structure: bool
) -> np.ndarray:
    """Return which faces are an object's body, shape [face].

    Args:
        points: its vertices [m], shape [vertex 3], float64.
        faces: indices of its faces' corners, shape [face 3].
        border: length of each face's edges with other labels [m], shape [face].
        component: number of each face's connected component, shape [face].
        structure: It is a wall, a floor or a ceiling.
    """
    corners = points[faces]
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area = np.maximum(0.5 * np.linalg.norm(cross, axis=1), 1e-12)
    middle = corners.mean(axis=1)
    up = cross[:, 2] / (2 * area)  # the floor that a foot goes over into faces up, the foot does not
    body, apart = _one_component(corners, area, component)
    bottom = weighted_quantile(middle[body, 2], area[body], 0.01)
    if middle[body, 2].max() - bottom > 2 * FOOT:
        skirt = _skirt(points, faces, middle, body, up, bottom)
        body &= ~skirt if area[skirt].sum() < IN_ALL * area[body].sum() else True
    border = np.where((middle[:, 2] < bottom + FOOT) & (bottom < HUNG) & (up < RISING), 0.0, border)
    # What other labels or air cut off from the rest hangs on it no more than what borders on other labels all around.
    # What borders on none and touches the rest does, as a handle that is a solid of its own.
    cut_off = (component != np.bincount(component, area).argmax()) & (np.bincount(component, border)[component] > 0.0)
    border = np.where(cut_off | apart, np.maximum(border, BIN), border)
    least = (1.0 - IN_ALL) * area[body].sum()
    while (tail := _tail(points, faces, middle, area, border, body, bottom > LIFTED, structure, least)) is not None:
        body[tail] = False
    return body


def _above_top(corners: np.ndarray, body: np.ndarray, usual: float) -> np.ndarray:
    """Return the faces of a body above its level top, where it is higher than usual [m], shape [face].

    The top is the largest level surface that has most of the body below it: a shelf or an open lid has little.

    Args:
        corners: of its faces [m], shape [face 3 3].
        body: faces of the body, shape [face].
        usual: largest usual height [m].
    """
    cross = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area, middle = 0.5 * np.linalg.norm(cross, axis=1), corners[:, :, 2].mean(axis=1)
    height = middle - middle[body].min()
    if height[body].max() <= usual:
        return np.zeros(len(body), bool)
    bins = (height / BIN).astype(int)
    flat = body & (cross[:, 2] > 2 * UPWARDS * area) & (height < usual)
    band = np.convolve(np.bincount(bins[flat], area[flat]), np.ones(round(TOP / BIN)))
    below = np.cumsum(np.bincount(bins[body], area[body], len(band)))
    band[below[: len(band)] < MOST * below[-1]] = 0.0
    if not band.any():
        return np.zeros(len(body), bool)
    top = flat & (bins <= band.argmax()) & (bins > band.argmax() - round(TOP / BIN))
    return body & (height > weighted_quantile(height[top], area[top], 0.9) + BIN)


def _one_component(corners: np.ndarray, area: np.ndarray, component: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the faces that belong to an object's largest component, and those that do not touch it, shape [face] each."""
    areas = np.bincount(component, area)
    main = int(areas.argmax())
    order = np.argsort(component, kind="stable")
    first = np.searchsorted(component[order], np.arange(len(areas)))
    a, b, c = corners[order].swapaxes(0, 1)
    low = np.minimum.reduceat(np.minimum(np.minimum(a, b), c), first, axis=0)
    high = np.maximum.reduceat(np.maximum(np.maximum(a, b), c), first, axis=0)
    gap = np.maximum(np.maximum(low - high[main], low[main] - high), 0.0)
    beside = np.linalg.norm(gap[:, :2], axis=1) > PART[1]
    far = (areas < PART[0] * areas[main]) | (np.linalg.norm(gap, axis=1) > APART * (high - low).max(axis=1))
    touching, reached = np.zeros(len(areas), bool), np.array([main])
    while len(reached):  # what touches something that touches the largest touches it, too
        touching[reached] = True
        others = np.flatnonzero(~touching)
        between = np.maximum(low[others, None] - high[reached], low[reached] - high[others, None])
        near = np.linalg.norm(np.maximum(between, 0.0), axis=2) <= TOUCHING
        reached = others[near.any(axis=1)]
    return ~(beside & far)[component], ~touching[component]


def _outline(points: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """Return the points that the upright box of some faces depends on [point 3]."""
    used = np.zeros(len(points), bool)
    used[faces] = True
    return silhouette(points[used])


def _skirt(
    points: np.ndarray, faces: np.ndarray, middle: np.ndarray, body: np.ndarray, up: np.ndarray, bottom: float
) -> np.ndarray:
    """Return the faces of the floor around an object's foot, shape [face]: they face up, outside of what is above them.

    `up`: vertical component of each face's normal, shape [face].
    """
    low = body & (middle[:, 2] < bottom + SKIRT)
    box = upright_box(_outline(points, faces[body & ~low]))
    axes = np.array([[np.cos(box.yaw), np.sin(box.yaw)], [-np.sin(box.yaw), np.cos(box.yaw)]])
    out = np.abs((middle[:, :2] - box.center[:2]) @ axes.T) - np.array(box.size[:2]) / 2
    return low & (out.max(axis=1) > 2 * SKIRT) & (up > 0.5)


def _tail(
    points: np.ndarray,
    faces: np.ndarray,
    middle: np.ndarray,
    area: np.ndarray,
    border: np.ndarray,
    body: np.ndarray,
    lifted: bool,
    structure: bool,
    least: float,
) -> np.ndarray | None:
    """Return the faces of the body's tail that adds most to its box for its area, shape [tail]; None if none is worth it.

    `lifted`: the tail may be at its lower side. `least`: area that stays [m^2].
    """
    inside = np.flatnonzero(body)
    faces, middle, area, border = faces[inside], middle[inside], area[inside], border[inside]
    yaw = upright_box(_outline(points, faces)).yaw
    axes = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    a, b, c = (points @ axes.T)[faces.T]
    top, bottom = np.maximum(np.maximum(a, b), c), np.minimum(np.minimum(a, b), c)
    best, tail, total = WORTH, None, float(area.sum())
    for axis, sign in ((0, 1), (0, -1), (1, 1), (1, -1), (2, 1), (2, -1))[: 6 if lifted else 5]:
        end, other = (top[:, axis], bottom[:, axis]) if sign > 0 else (-bottom[:, axis], -top[:, axis])
        low, high = float(other.min()), float(end.max())
        if high - low < THIN and not structure:
            continue
        bins = ((high - end) / BIN).astype(int)
        # Pieces that together are more than a tail are not looked at.
        few = np.flatnonzero(bins <= np.searchsorted(np.cumsum(np.bincount(bins, area)), TAIL * total, side="right"))
        order = few[np.argsort(-end[few], kind="stable")]
        left, length, bins = np.append(end[order[1:]], low) - low, high - low, bins[order]
        areas = np.cumsum(area[order])
        share = areas / total
        spilled = np.cumsum(np.bincount(bins, border[order]) >= BIN)[bins] / (bins + 1)
        weight = np.interp(spilled, BETWEEN, (FREE, SPILLED))
        gain = np.log((length + NOISE) / (left + NOISE)) - weight * share
        gain[(share > (TAIL if axis < 2 else SMALL)) | (total - areas < least)] = -1.0
        gain[share < DUST] += WORTH / 3
        for first, until in itertools.pairwise((0.0, DUST, 0.06, 1.0)):
            last = int(np.argmax(np.where((first <= share) & (share < until), gain, -1.0)))
            if gain[last] <= best:
                continue
            across = np.delete(axes, axis, axis=0)
            stays = np.ones(len(middle), bool)
            stays[order[: last + 1]] = False
            rest = np.ptp(middle[stays] @ across.T, axis=0)
            wide = np.ptp(np.quantile(middle[order[: last + 1]] @ across.T, (0.05, 0.95), axis=0), axis=0)
            plate = structure and left[last] < min(PLATE[0], rest.min() / 2) and share[last] < PLATE[1]
            if until == DUST or plate or (wide <= NARROW * rest).all():
                best, tail = float(gain[last]), inside[order[: last + 1]]
    return tail


def staying(
    path: Path,
    names: Mapping[int, str],
    parent_of: Mapping[int, int | None],
    moving: Container[int],
    owner: np.ndarray,
) -> tuple[np.ndarray, dict[int, int | None]]:
    """Return annotated parts without artefacts of the scan, which are counted in a warning, and without what was not annotated.

    Args:
        path: of the annotation.
        names: label of each part by its number.
        parent_of: number of each part's parent.
        moving: numbers of the parts with a joint; others that annotators call SPLIT could not be annotated.
        owner: position of the part of each face among `names`, -1 for none, shape [face].

    Returns:
        The same of each face among the parts that stay, REMOVED for artefacts; and the parents of those parts.
    """
    removed = labels.artefacts(names, parent_of)
    split = {number for number, name in names.items() if number not in moving and labels.is_split(name)}
    left = labels.without(parent_of, removed | split)
    order = np.cumsum([number in left for number in names]) - 1
    place = [REMOVED if number in removed else -1 if number in split else order[i] for i, number in enumerate(names)]
    owner = np.array([*place, -1])[owner]
    _warn_of_removed(path, owner)
    return owner, left


def scene(
    name: str,
    surface: ScanMesh,
    owner: np.ndarray,
    names: Mapping[int, str],
    parent_of: Mapping[int, int | None],
    facts: Mapping[int, Mapping[str, Any]],
    files: tuple[Path, Path] | None,
) -> Scene:
    """Return a scan as a scene: annotated parts, each followed by what belongs to it; then flat, fixed ones for the rest.

    Args:
        name: of the scan.
        surface: all of it.
        owner: position of the part of each face among `parent_of`, -1 for none, or REMOVED, shape [face].
        names: label of each part by its number, also of those that are left out; further parts are numbered after them.
        parent_of: number of each part's parent.
        facts: further attributes of each `Part`.
        files: as in `claim`.
    """
    further = claim(surface, owner, len(parent_of), files)
    meshes = cut(surface, owner, len(parent_of) + len(further))
    mesh_of = dict(zip(parent_of, meshes, strict=False))
    name_of = {number: labels.split(names[number])[0] for number in parent_of}
    id_of = {number: labels.part_id(name_of[number], number) for number in parent_of}
    parts = {
        id_of[number]: Part(
            label=name_of[number],
            mesh=mesh_of[number],
            parent=None if (parent := parent_of[number]) is None else id_of[parent],
            **facts[number],
        )
        for number in labels.parents_first(parent_of)
    }
    first = max(names, default=0) + 1
    for number, (label, mesh) in enumerate(zip(further, meshes[len(parent_of) :], strict=True), start=first):
        parts[labels.part_id(label, number)] = Part(label, mesh)
    return Scene(name, parts, tuple(surface.origin.tolist()))


def _warn_of_removed(path: Path, owner: np.ndarray) -> None:
    if faces := int((owner == REMOVED).sum()):
        _log.warning("%s: %d faces that annotators named 'remove' are left out: artefacts of the scan", path, faces)
