"""Description of a room for a model: one line of JSON per part, with its supports; lengths in whole centimetres."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import ndimage

from s2a.language.grammar import is_kind_of
from s2a.language.insert.fit import NoRoom, swept_volumes
from s2a.language.insert.plan import Plan
from s2a.language.insert.supports import (
    SurfaceConfig,
    floor_height,
    is_basin,
    is_floor,
    target_mesh,
    target_regions,
)
from s2a.scan.rest import UNANNOTATED
from s2a.scene.geometry.mesh_ops import keep, normals
from s2a.scene.geometry.regions import Region, RegionConfig
from s2a.scene.scene import Joint, Mesh, Part, Scene
from s2a.scene.upright_box import Box, silhouette, upright_box
from s2a.scene.usd.descriptive import carriers

if TYPE_CHECKING:
    from s2a.language.insert.settings import Inserted

THICKEST = 0.5
"""Thickness from which a part called wall is more than one wall [m]."""
ALONG = 0.3
"""Largest gap between a wall and what stands or hangs along it [m]."""
BAND = (1.2, 1.8)
"""Heights between which what is along a wall leaves no gap [m]."""
NARROW, WALL_COUNT, SPAN = 0.3, 3, 0.05
"""Smallest gap that is named [m], the most gaps, and the steps along a wall [m]."""


def is_wall(label: str) -> bool:
    """Return True if a label names a wall."""
    return label.lower().endswith("wall")


def wall_line(scene: Scene, part_id: str) -> dict[str, Any]:
    """Return the keys along (ids, in order) and free (widths [m], the widest first) of a wall; none if it has no one side.

    Free is what has the wall's own surface at eye level, and nothing close before it.
    """
    box = upright_box(silhouette(scene.parts[part_id].mesh.vertices))
    turn = box.yaw + (0.0 if box.size[0] >= box.size[1] else np.pi / 2)
    half, thick = max(box.size[:2]) / 2, min(box.size[:2]) / 2
    if 2 * thick > THICKEST:
        return {}
    axes = np.array([(np.cos(turn), np.sin(turn)), (-np.sin(turn), np.cos(turn))])

    def local(mesh: Mesh) -> np.ndarray:
        level = (mesh.vertices[:, :2] - box.center[:2]) @ axes.T
        return np.column_stack([level, mesh.vertices[:, 2] - floor])[mesh.faces]

    floor = floor_height(scene)
    neighbours: list[tuple[float, str]] = []
    taken = np.zeros(max(1, int(2 * half / SPAN)), bool)
    for other, part in scene.parts.items():
        if other == part_id or _is_no_thing(scene, other):
            continue
        corners = local(part.mesh)
        span, off = corners[..., 0], corners[..., 1]
        gap = max(float(off.min()) - thick, -thick - float(off.max()))
        first, last = max(-half, float(span.min())), min(half, float(span.max()))
        if gap > ALONG or last - first <= 0.02:
            continue
        if part.label == UNANNOTATED:  # all the room: only what is before the wall, and not the rest of that itself
            corners = corners[(np.abs(off) > thick + NEAR).any(axis=1)]
        else:
            neighbours.append(((first + last) / 2, other))
        near = corners[np.abs(corners[..., 1]).min(axis=1) <= thick + ALONG]
        taken |= _covered(near, len(taken), half, BAND)
    own = local(scene.parts[part_id].mesh)
    bare = np.logical_and.reduce(
        [_covered(own, len(taken), half, (height, height)) for height in (*BAND, sum(BAND) / 2)]
    )
    free = _gaps(bare & ~taken, 2 * half / len(taken))
    return {"along": [one for _, one in sorted(neighbours)]} | ({"free": free} if free else {})


def _covered(corners: np.ndarray, count: int, half: float, band: tuple[float, float]) -> np.ndarray:
    """Return which of some intervals along a wall triangles cover in a band of heights [m]; corners [face 3 3]."""
    high = corners[(corners[..., 2].min(axis=1) <= band[1]) & (corners[..., 2].max(axis=1) >= band[0]), :, 0]
    cells = np.clip((np.stack([high.min(axis=1), high.max(axis=1)]) + half) * count / (2 * half), -1, count).astype(int)
    edges = np.bincount(np.clip(cells[0], 0, count), minlength=count + 1)[: count + 1].astype(float)
    edges -= np.bincount(np.clip(cells[1] + 1, 0, count), minlength=count + 1)[: count + 1]
    return np.asarray(np.cumsum(edges)[:count] > 0)


def _is_no_thing(scene: Scene, part_id: str) -> bool:
    """Return True for walls, floors, ceilings, parts of furniture, and what has no surface."""
    part = scene.parts[part_id]
    if not len(part.mesh.faces) or isinstance(part.motion, Joint) or part.graspable:
        return True
    return part.parent is not None or is_wall(part.label) or part.label.lower() in ("floor", "ceiling")


def _gaps(free: np.ndarray, width: float) -> list[float]:
    """Return the widths of the runs of free intervals of a width [m], the widest first."""
    runs, count = ndimage.label(free)
    widths = (round(float((runs == run).sum() * width), 1) for run in range(1, count + 1))
    return sorted((one for one in widths if one >= NARROW), reverse=True)[:WALL_COUNT]


Supports = dict[str, list[Region]]
"""Horizontal support regions by part id."""

CENTIMETRES = 2
LEVEL = 0.8
"""Upward component of a normal from which a face of a noisy scan may be horizontal."""
WORTH = 0.008
"""Smallest free area of a described support [m^2]: a glass stands on it."""
SLIVER, FOOT = 0.1, 0.06
"""Smallest free area as a fraction of the part's largest support, and smallest free circle [m], of a described support."""
COUNT = 6
"""Described supports per part."""
SMALL, REACH = 0.5, 2.2
"""Parts without a side this long [m] are small objects, not furniture; above this height [m] parts are out of reach."""
UNDER = 0.3
"""Largest height of a floor without a name over the lowest point of the scan [m]."""
NEAR = 0.03
"""An object whose underside is this close to a support stands on it [m]: the noise of a scan and of its plane."""


# Least free area [m^2] and clearance [m] of a described support of what nobody annotated, and how many are described
BARE, ROOM, BARE_COUNT = 0.03, 0.15, 16
NAMELESS = (UNANNOTATED, "object")
"""Labels that name no kind of thing."""
LIKENESS = ((0.2, "floor-like"), (0.56, "seat-like"), (0.82, "table-like"), (1.15, "counter-like"), (1.9, "shelf-like"))
"""Heights above the floor up to which a surface without a name is like a floor, a seat, ... [m]."""
HIGH = "out of reach"
FURNITURE = {"coffee table": "seat-like", "table": "table-like", "counter": "counter-like"}
"""What a wish may call such surfaces, where the room has none by that name."""
MATTRESS = 0.35
"""Height below which what is like a seat and has no name may be a bed's or a step [m]."""
TOP = 0.15
"""Least area of these together [m^2]: seats have less, or backs."""


def survey(scene: Scene, config: RegionConfig, part_ids: Iterable[str] | None = None) -> Supports:
    """Return the horizontal supports of some parts, of all by default; movable and graspable parts have none."""
    return {i: _supports(scene, i, config) for i in (scene.parts if part_ids is None else part_ids)}


def describe(scene: Scene, supports: Supports) -> list[dict[str, Any]]:
    """Return a description of the room, one dictionary per part.

    Keys: id, label; center and size of its upright box [m]; part_of; opens (slides or turns); on (the part it stands on);
    supports (kind, height [m], free area [m^2], diameter of the largest free circle [m], room above [m] of each, the largest
    first). Doors and drawers have no box, nor has what carries nothing and is small or out of reach.
    """
    on, floor = carriers(scene), _zero(scene, supports)
    return [_line(scene, part_id, supports, on.get(part_id), floor) for part_id in shown(scene)]


def text(lines: list[dict[str, Any]]) -> str:
    """Return a description as text for a model: furniture with its doors, then small objects by what they stand on."""
    described = [_model_line(line, lines) for line in lines if "size" in line]
    small: dict[str | None, list[str]] = {}
    for line in lines:
        if "size" not in line and "opens" not in line:
            small.setdefault(line.get("on"), []).append(line["id"])
    described += [{**({"on": on} if on else {}), "things": ids} for on, ids in small.items()]
    return "\n".join(json.dumps(line, separators=(",", ":"), ensure_ascii=False) for line in described)


def shown(scene: Scene) -> list[str]:
    """Return the ids of the parts that are described: all with a surface except handles and children of doors and drawers."""
    hidden = {below for i in scene.movable for below in scene.descendants(i)}
    parts = scene.parts.items()
    return [i for i, part in parts if len(part.mesh.faces) and i not in hidden and not part.graspable]


def worth(regions: list[Region], foot: float = FOOT, whole_room: bool = False, floor: float = 0.0) -> list[Region]:
    """Return the regions with a free circle of some diameter [m], those with the most free area first.

    `whole_room`: They are of all that nobody annotated: a table is small beside the floor, at some height [m], and no kind of
    surface takes the place of all others.
    """
    largest = 0.0 if whole_room else max((region.free_area for region in regions), default=0.0)
    free = [region for region in regions if region.free_area >= max(WORTH, SLIVER * largest) and circle(region) >= foot]
    if whole_room:
        free = [region for region in free if region.free_area >= BARE and region.clearance >= ROOM]
        free.sort(key=lambda region: -region.free_area)
        alike = [[one for one in free if likeness(one, floor) == name][:COUNT] for _, name in (*LIKENESS, (0.0, HIGH))]
        free = [one for some in alike for one in some]
    return sorted(free, key=lambda region: -region.free_area)[: BARE_COUNT if whole_room else COUNT]


def likeness(region: Region, floor: float) -> str:
    """Return what a surface without a name is like, by its height above a floor [m]."""
    return next((name for height, name in LIKENESS if region.height - floor < height), HIGH)


def _zero(scene: Scene, supports: Supports) -> float:
    """Return the height of the floor [m]: of the part of that name, else of the lowest large surface if little is below it."""
    lowest = floor_height(scene)
    if any(is_floor(scene, i) for i in scene.parts):
        return lowest
    regions = [region for some in supports.values() for region in some]
    large = 0.25 * max((region.area for region in regions), default=0.0)
    level = min((region.height for region in regions if region.area >= large), default=lowest)
    return level if level < lowest + UNDER else lowest  # a table top alone has no floor


def circle(region: Region) -> float:
    """Return the diameter of the largest free circle on a region [m]."""
    return 2.0 * region.cell * float(ndimage.distance_transform_edt(np.pad(region.free, 1)).max())


def support(region: Region) -> dict[str, Any]:
    """Return the description of a support."""
    kind = "basin" if is_basin(region) else region.kind
    return {
        "kind": kind,
        "height": round(region.height, CENTIMETRES) + 0.0,
        "free": _two_digits(region.free_area),
        "circle": round(circle(region), CENTIMETRES),
        "room": round(region.clearance, 1 if region.clearance >= 1.0 else CENTIMETRES),
    }


def box_of(scene: Scene, part_id: str) -> Box:
    """Return the upright box around a part and its descendants."""
    points = [silhouette(scene.parts[i].mesh.vertices) for i in (part_id, *scene.descendants(part_id))]
    return upright_box(np.concatenate(points))


def faces_up(mesh: Mesh) -> bool:
    """Return True if enough of a surface faces up to carry an object: a quick test before regions are grown."""
    return bool(mesh.face_areas[normals(mesh)[:, 2] > LEVEL].sum() > 0.1 * WORTH)


def context_of(scene: Scene, supports: Supports, plan: Plan, count: int) -> dict[str, Any]:
    """Return the support that a plan refers to, and the objects nearest to its place, one per label and none longer than a metre.

    A wall is a support without measures: its ledges carry nothing of what hangs on it.
    """
    choice = plan.choices[0]
    regions = [] if choice.relation == "hanging" else supports.get(choice.target, [])
    meant = choice.height
    if meant is not None:
        near_by = [region for region in regions if abs(region.height - meant) < NEAR]
        regions = sorted(near_by, key=lambda region: -region.free_area) or sorted(
            regions, key=lambda region: abs(region.height - meant)
        )
    part = scene.parts[choice.target]
    below: dict[str, Any] = {"part": part.label}
    middle = part.mesh.bounds.mean(axis=0) if len(part.mesh.vertices) else np.zeros(3)
    if regions:
        below |= support(regions[0]) | {"widest": round(float(np.hypot(*regions[0].size)), CENTIMETRES)}
        middle = regions[0].center
    if plan.near is not None and len(scene.parts[plan.near].mesh.vertices):
        middle = scene.parts[plan.near].mesh.bounds.mean(axis=0)
    bounds = {i: scene.parts[i].mesh.bounds for i in shown(scene) if i != choice.target and i not in scene.movable}
    near = [
        (float(np.linalg.norm(b.mean(axis=0) - middle)), i) for i, b in bounds.items() if np.ptp(b, axis=0).max() < 1.0
    ]
    first = {scene.parts[i].label: i for _, i in sorted(near, reverse=True)}  # of each kind the nearest
    nearest = [i for _, i in sorted(near) if first[scene.parts[i].label] == i][:count]
    things = [{"label": scene.parts[i].label, "size": _rounded(box_of(scene, i).size)} for i in nearest]
    return {"support": below, "neighbours": things}


def _supports(scene: Scene, part_id: str, config: RegionConfig) -> list[Region]:
    part = scene.parts[part_id]
    if isinstance(part.motion, Joint) or part.graspable or not faces_up(part.mesh):
        return []
    return target_regions(scene, part_id, config, ("horizontal", "inside"))


def _line(scene: Scene, part_id: str, supports: Supports, on: str | None, floor: float) -> dict[str, Any]:
    """Return the description of one part, `on` another one; `floor`: its height [m]."""
    part, box = scene.parts[part_id], box_of(scene, part_id)
    small = part.parent is None and max(box.size) < SMALL
    bare, nameless, own = part.label == UNANNOTATED, part.label in NAMELESS, supports.get(part_id, [])
    carries = worth(own, 2.0 * FOOT if small or bare else FOOT, bare, floor)
    line: dict[str, Any] = {"id": part_id, "label": part.label}
    if part.parent is not None:
        line["part_of"] = part.parent
    if isinstance(part.motion, Joint):
        return {**line, "opens": "slides" if part.motion.kind == "prismatic" else "turns"}
    if on:
        line["on"] = on
    if carries or not (small or box.center[2] - box.size[2] / 2 > REACH):
        line |= {"center": _rounded(box.center), "size": _rounded(box.size)}
    if carries:
        line["supports"] = [
            support(region) | ({"like": likeness(region, floor)} if nameless else {}) for region in carries
        ]
    if is_wall(part.label):
        line |= wall_line(scene, part_id)
    return line


def _model_line(line: dict[str, Any], lines: list[dict[str, Any]]) -> dict[str, Any]:
    """Return a description as a model reads it: without what the id implies, supports as plain lists, with doors and drawers."""
    id_says = line["id"].rpartition("_")[0].replace("_", " ")
    described = {key: value for key, value in line.items() if key != "label" or value != id_says}
    if "supports" in line:
        described["supports"] = [list(values.values()) for values in line["supports"]]
    opens = {other["id"]: other["opens"] for other in lines if "opens" in other and other.get("part_of") == line["id"]}
    return described | ({"opens": opens} if opens else {})


def _two_digits(value: float) -> float:
    return float(f"{value:.2g}")


def _rounded(values: Iterable[float]) -> list[float]:
    """Round, without negative zeros."""
    return [round(float(value), CENTIMETRES) + 0.0 for value in values]


def _nameless(scene: Scene, supports: Supports) -> dict[str, Part]:
    """Return a part for each support that is as high as a kind of furniture of which the room has none by name.

    It has no name, or that of a table: a low one is a coffee table.
    """
    parts: dict[str, Part] = {}
    floor, labels = _zero(scene, supports), [part.label for part in scene.parts.values()]
    for kind, like in FURNITURE.items():
        if any(is_kind_of(label, kind) for label in labels):
            continue
        tables = [i for i in supports if scene.parts[i].label == "table" and kind == "coffee table"]
        low = [i for i in tables if (top := _top(supports[i])) is not None and likeness(top, floor) == like]
        for some, least in ((low, 0.0), ([i for i in supports if scene.parts[i].label in NAMELESS], MATTRESS)):
            level = {i: [one for one in _level(supports[i]) if one.height - floor >= least] for i in some}
            tops = {i: [one for one in own if likeness(one, floor) == like] for i, own in level.items()}
            large = {i: own for i, own in tops.items() if sum(region.area for region in own) >= TOP}
            parts |= {
                f"{i}.{kind}": Part(kind, keep(scene.parts[i].mesh, _of(scene.parts[i].mesh, own)))
                for i, own in large.items()
            }
            if large:
                break
    return {i: part for i, part in parts.items() if len(part.mesh.faces)}


def _level(regions: list[Region]) -> list[Region]:
    """Return the regions with nothing close above them."""
    return [region for region in regions if region.kind == "horizontal"]


def _top(regions: list[Region]) -> Region | None:
    """Return the highest level region that is no sliver; None where there is none."""
    large = SLIVER * max((region.area for region in _level(regions)), default=0.0)
    level = [region for region in _level(regions) if region.area >= large]
    return max(level, key=lambda region: region.height, default=None)


def _of(mesh: Mesh, regions: list[Region]) -> np.ndarray:
    """Return which faces of a surface belong to some of its regions, shape [face]."""
    own = np.zeros(len(mesh.faces), bool)
    for region in regions:
        cells = region.places(mesh.vertices[mesh.faces].mean(axis=1))
        row, column = np.clip(np.floor(cells[:, :2]).astype(int), 0, np.array(region.support.shape) - 1).T
        own |= region.support[row, column] & (np.abs(cells[:, 2]) < NEAR)
    return own


class RoomState:
    """A room with the objects inserted so far; a copy (`copy.copy`) is independent of the original.

    Attributes:
        scene: the room with the objects inserted so far.
        geometry_free_text: USD text of its stage without geometry, before any insertion.
        volumes: swept volumes of its drawers and doors.
    """

    def __init__(self, scene: Scene, geometry_free_text: str, config: SurfaceConfig) -> None:
        self.scene, self.geometry_free_text, self._config = scene, geometry_free_text, config.regions
        self.volumes = swept_volumes(scene)
        self._supports = survey(scene, config.regions)
        self._lines = describe(scene, self._supports)
        self._levels = {part_id: regions for part_id, regions in self._supports.items() if regions}
        self._unseen: list[tuple[Scene, Inserted]] = []
        self._named: Scene | None = None

    @property
    def supports(self) -> Supports:
        """Support regions of the room's parts, with what the inserted objects leave free."""
        self._survey()
        return self._supports

    @property
    def named(self) -> Scene:
        """The scene for wishes: unlabelled supports that are as high as a table or a counter are parts of it, by these names."""
        self._survey()
        if self._named is None:
            self._named = replace(self.scene, parts=self.scene.parts | _nameless(self.scene, self._supports))
        return self._named

    @property
    def lines(self) -> list[dict[str, Any]]:
        """The room's description."""
        self._survey()
        return self._lines

    def levels(self, target: str) -> list[Region]:
        """Return the horizontal support regions of a part, with what all other parts leave free.

        Raises:
            NoRoom: none of its surface faces up.
            InputError: no such part, or one without a surface.
        """
        self._survey()
        if target not in self._levels:
            if not faces_up(target_mesh(self.scene, target)):
                raise NoRoom("nothing of it looks upwards")
            self._levels[target] = target_regions(self.scene, target, self._config, ("horizontal", "inside"))
        return self._levels[target]

    def add(self, inserted: Inserted) -> None:
        """Add an object; the survey is updated when it is needed next."""
        parts = {**self.scene.parts, inserted.placement.part_id: inserted.part}
        self.scene = Scene(self.scene.name, parts, self.scene.origin)
        self._unseen, self._named = [*self._unseen, (self.scene, inserted)], None

    def _survey(self) -> None:
        """Update the survey around the last objects."""
        if not self._unseen:
            return
        for scene, inserted in self._unseen:
            names = inserted.candidate.target, inserted.placement.part_id
            changed = survey(scene, self._config, names)
            self._supports = self._supports | changed
            mesh, reach = inserted.part.mesh, self._config.search_height
            apart = {
                i: regions
                for i, regions in self._levels.items()
                if not any(_meets(mesh, region, reach) for region in regions)
            }
            self._levels = apart | {i: regions for i, regions in changed.items() if regions}
        self._unseen = []
        self._lines = describe(self.scene, self._supports)


def _meets(mesh: Mesh, region: Region, reach: float) -> bool:
    """Return True if the box around a mesh meets the box over a region, up to a height [m]."""
    rows, columns = region.support.shape
    corners = region.points(np.array([(-1, -1), (rows + 1, -1), (-1, columns + 1), (rows + 1, columns + 1)]))
    corners = np.concatenate([corners, corners + reach * region.normal])
    low, high = mesh.bounds
    return bool((low <= corners.max(axis=0)).all() and (high >= corners.min(axis=0)).all())
