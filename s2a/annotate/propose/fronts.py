"""Fronts from the network's map of a plane: rectangles, the ways in which they open, and their handles."""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from s2a.annotate import handle as handles
from s2a.annotate.annotation import Draft, Item
from s2a.annotate.propose import layers
from s2a.annotate.propose.furniture import READY, LabelledFaces, refrigerator_doors, turns_right, upright_hinge
from s2a.annotate.propose.network import COARSE, MOTIONS, FrontNetwork, Motion, image, load
from s2a.annotate.region import FrontRegion, GrowConfig, hinge_at, inside, slide
from s2a.annotate.surface import SplitSurface
from s2a.scene.geometry.planes import fit_plane
from s2a.scene.scene import Joint


@dataclass(frozen=True)
class CellBox:
    """A rectangle of an image: cells from `low` to below `high`, each (column, row)."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def width(self) -> float:
        """Columns."""
        return self.right - self.left

    @property
    def height(self) -> float:
        """Rows."""
        return self.top - self.bottom

    @property
    def cells(self) -> tuple[slice, slice]:
        """What it selects of an image: rows and columns."""
        return slice(int(self.bottom), int(np.ceil(self.top))), slice(int(self.left), int(np.ceil(self.right)))

    @property
    def middle(self) -> tuple[float, float]:
        """Column and row of its middle."""
        return (self.left + self.right) / 2, (self.bottom + self.top) / 2


TURNS: tuple[Motion, Motion] = (("hinge", "left"), ("hinge", "right"))  # Of the two doors of a pair
SEEN = 0.5  # Probability from which on a cell is a front's, or a handle's
AGREES = 0.5  # Intersection over union of two cells' rectangles from which on they are of one front
NEAR = 0.05  # [m] A cell's word on a side counts half as much at this distance as beside it: what is near is seen well
THIN = 1e-3  # [m] A cell is farther from each side of its front: a rectangle has an area
# A handle this far from the middle of a door, as a fraction of its width, tells its hinge more surely
# than the door does
BESIDE = 0.2
AT_HINGE = 0.3  # Of a front's breadth: what is seen nearer to its hinge is no handle, but a frame or another front's
SCANNED = 0.5  # Fraction of a column or a row of cells at a front's side that holds surface of its plane, at least
REMAINS = 0.72  # Fraction of a front's width and height that holds surface of its plane, at least; of windows less does
# [m] Narrowest leaf of a pair, widest single door of a cabinet and of one whose handle is beside its middle, widest pair
# without visible frames, and its height at most. Modules of kitchens are 0.3, 0.4, 0.45, 0.5, 0.6, 0.8 and 0.9 m wide;
# one door is usual up to 0.6 m, two from 0.8 m on
NARROW, SINGLE, WIDEST, PAIR, TALL_DOOR = 0.2, 0.65, 0.8, 1.0, 1.2
# [m] The stiles of two framed doors stand out over their panels by more, also where a mesh has smeared them
STILE = 0.0015


@dataclass(frozen=True, eq=False)
class SeenFront:
    """A front on a plane's image."""

    box: CellBox  # its rectangle
    motion: Motion  # how it opens, of MOTIONS
    score: float  # probability, 0 to 1, times the fraction of its cells that agree about the rectangle
    handle: CellBox | None  # rectangle around its handle; None where none is seen


def fronts(layer: layers.Layer, maps: tuple[np.ndarray, ...], config: layers.ProposeConfig) -> Iterator[SeenFront]:
    """Yield the fronts that a network sees on a plane (its `maps`), of `min_score` and `min_front` or more."""
    probability, sides, motion, handle = maps
    rows, columns = np.nonzero(probability > SEEN)
    p = probability[rows, columns]
    away = sides[:, rows, columns].clip(THIN) / config.cell
    middle = COARSE * (np.stack([columns, rows]) + 0.5)
    boxes = np.concatenate([middle - away[:2], middle + away[2:]])
    sure = p * np.sqrt(_balance(away[0], away[2]) * _balance(away[1], away[3]))
    left = np.ones(len(p), bool)
    while left.any():
        best = np.argmax(np.where(left, sure, -1.0))
        group = left & (_overlap(boxes, boxes[:, best]) > AGREES)
        weight = p[group] / (away[:, group] * config.cell + NEAR)
        box = (boxes[:, group] * weight).sum(axis=1) / weight.sum(axis=1)
        within = (middle > box[:2, None]).all(axis=0) & (middle < box[2:, None]).all(axis=0)
        agree = within & (_overlap(boxes, box) > AGREES)
        score = float(p[agree].sum() / max(_cells(box), 1))
        opens = MOTIONS[int(np.argmax(motion[:, rows[group], columns[group]].mean(axis=1)))]
        left &= ~group
        if score < config.min_score or ((box[2:] - box[:2]) * config.cell < config.min_front).any():
            continue
        left &= ~within  # those that are wrong about their rectangle
        rectangle = scanned(layer, CellBox(*map(float, box)))
        if (np.array([rectangle.width, rectangle.height]) * config.cell < config.min_front).any():
            continue
        for leaf, motion_of_leaf in leaves(layer, rectangle, opens, _handle(handle, rectangle)):
            grip = _handle(handle, leaf)
            yield SeenFront(leaf, motion_of_leaf or _hinged(opens, leaf, grip), score, grip)


def scanned(layer: layers.Layer, box: CellBox) -> CellBox:
    """Return a rectangle without the columns and rows at its sides that hold hardly any surface of the plane.

    Where less than REMAINS of a side would be left, it is a window, whose glass is not scanned, and stays as it is.
    """
    rows, columns = (slice(max(cells.start, 0), cells.stop) for cells in box.cells)
    seen = ~np.isnan(layer.height[rows, columns])
    if not seen.size:
        return box
    sides = [box.left, box.bottom, box.right, box.top]
    for axis, (low, high), start in ((0, (0, 2), columns.start), (1, (1, 3), rows.start)):
        filled = np.flatnonzero(seen.mean(axis=axis) >= SCANNED)
        if len(filled):
            sides[low] = max(sides[low], float(start + filled[0]))
            sides[high] = min(sides[high], float(start + filled[-1] + 1))
    part = CellBox(*sides)
    return part if part.width >= REMAINS * box.width and part.height >= REMAINS * box.height else box


def leaves(
    layer: layers.Layer, box: CellBox, motion: Motion, handle: CellBox | None = None
) -> list[tuple[CellBox, Motion | None]]:
    """Return the doors of a rectangle: two leaves that open away from their seam, each with its motion, or one without.

    A handle beside the middle is that of one door, up to WIDEST; two leaves have theirs at the seam.
    """
    whole: list[tuple[CellBox, Motion | None]] = [(box, None)]
    wide, high = box.width * layer.cell, box.height * layer.cell
    if motion[0] != "hinge" or wide < 2 * NARROW:
        return whole
    widest_single = WIDEST if abs(_beside(box, handle)) >= BESIDE else SINGLE
    is_pair = motion[1] in ("left", "right") and widest_single < wide < PAIR and high < TALL_DOOR
    if not is_pair and _stile(layer, box) < STILE:
        return whole
    middle = box.middle[0]
    return [(replace(box, right=middle), ("hinge", "left")), (replace(box, left=middle), ("hinge", "right"))]


def _stile(layer: layers.Layer, box: CellBox) -> float:
    """Return how far the middle of a rectangle stands out over the panels at both sides of it [m], as the frames of two do.

    A single panel, flat or framed, has 0; a bulge, whose sides are lower than its panels, has no more than they.
    """
    rows, columns = (slice(max(cells.start, 0), cells.stop) for cells in box.cells)
    height = layer.height[rows, columns]
    height = height[len(height) // 8 : len(height) - len(height) // 8]
    with np.errstate(invalid="ignore"), warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # of columns without any surface
        profile = np.nanmedian(height, axis=0)
    place = (np.arange(len(profile)) + 0.5) / len(profile)
    panels = [_mean(profile[(place > low) & (place < high)]) for low, high in ((0.15, 0.35), (0.65, 0.85))]
    sides = [_mean(profile[place < 0.08]), _mean(profile[place > 0.92])]
    middle = _mean(profile[np.abs(place - 0.5) < 0.06])
    ridge = middle - max(panels)
    frame = (sum(sides) - sum(panels)) / 2
    return float(min(ridge, frame + ridge / 2)) if np.isfinite([ridge, frame]).all() else 0.0


def _mean(values: np.ndarray) -> float:
    seen = values[~np.isnan(values)]
    return float(seen.mean()) if len(seen) else np.nan


def _hinged(motion: Motion, box: CellBox, handle: CellBox | None) -> Motion:
    """Return a motion, of a door about the side away from a handle that is beside its middle."""
    if handle is None or motion not in (("hinge", "left"), ("hinge", "right")):
        return motion
    off = _beside(box, handle)
    if abs(off) < BESIDE:
        return motion
    return ("hinge", "left") if off > 0 else ("hinge", "right")


def _beside(box: CellBox, handle: CellBox | None) -> float:
    """Return how far a handle is to the right of a front's middle, as a fraction of its width; 0: there is none."""
    return 0.0 if handle is None else (handle.middle[0] - box.middle[0]) / box.width


def _cells(box: np.ndarray) -> int:
    """Return how many of the network's cells have their middle in a rectangle (left, bottom, right, top)."""
    low, high = box[:2] / COARSE - 0.5, box[2:] / COARSE - 0.5
    return int((np.ceil(high) - np.floor(low) - 1).clip(0).prod())


def _balance(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Return 1 for cells in the middle between two sides, 0 at one of them."""
    return np.asarray(np.minimum(one, other) / np.maximum(np.maximum(one, other), 1e-6))


def _overlap(boxes: np.ndarray, one: np.ndarray) -> np.ndarray:
    """Return the intersection over union of rectangles (left, bottom, right, top), shape [4 box], with one."""
    one = one[:, None]
    shared = (np.minimum(boxes[2:], one[2:]) - np.maximum(boxes[:2], one[:2])).clip(min=0.0).prod(axis=0)
    both = (boxes[2:] - boxes[:2]).prod(axis=0) + (one[2:] - one[:2]).prod(axis=0) - shared
    return np.asarray(shared / np.maximum(both, 1e-9))


def _handle(probability: np.ndarray, box: CellBox) -> CellBox | None:
    """Return the rectangle around the blob that is most of a handle, of the cells whose middles lie in a front."""
    low, high = (max(round(x), 0) for x in (box.left, box.bottom)), (max(round(x), 0) for x in (box.right, box.top))
    (left, bottom), (right, top) = low, high
    area = np.pad(probability[bottom:top, left:right], 1)  # closing takes away from what touches the image's border
    labels, count = ndimage.label(ndimage.binary_closing(area > SEEN, np.ones((3, 3))))
    if not count:
        return None
    best = int(np.argmax(ndimage.sum_labels(area, labels, np.arange(1, count + 1))))
    rows, columns = ndimage.find_objects(labels)[best]
    x, y = left - 1, bottom - 1
    return CellBox(x + columns.start, y + rows.start, x + columns.stop, y + rows.stop)


SHALLOW = 0.4  # [m] Shoe cabinets whose flaps tip forward are no deeper; sold ones have 0.17 to 0.35 m
# A front at least this fraction as high as its furniture is deep is a flap: of 206 drawers of 29 virtual homes one is
TALL = 0.8
WIDE = 1.3  # Width over height from which on a front is not a box of a shelf, which is about as wide as high
# [m] How far behind a front the wall is looked for, and how thick it may seem
NEAREST, FARTHEST, THICK = 0.1, 1.0, 0.02
STRIP = 0.1  # [m] Height of the strip of a wall that tells where it is
FACING = 0.8  # Cosine between the wall and the front, at least


def is_flap(region: FrontRegion, points: layers.Points, density: float) -> bool:
    """Return whether a front that could slide out tips forward about its lower side instead.

    `density`: of the points, which are spread over the scan's upright surface, per m^2.
    """
    wide, high = region.size
    if wide < WIDE * high:
        return False
    depth = depth_behind(region, points, density)
    return depth is not None and depth <= SHALLOW and high >= TALL * depth


def depth_behind(region: FrontRegion, points: layers.Points, density: float) -> float | None:
    """Return how far behind a front the wall is [m]: the farthest surface that faces as it does; None where none is seen."""
    behind = region.offset - points.place @ region.normal
    some = points[(behind > NEAREST) & (behind < FARTHEST)]
    place = region.local(some.place)
    beside = np.abs(place[:, 0]) < region.size[0] / 2
    facing = some.normal @ region.normal > FACING
    depths = np.sort(-place[beside & facing, 2])
    count = max(round(STRIP * region.size[0] * density), 1)
    if len(depths) < count:
        return None
    enough = np.flatnonzero(depths[count - 1 :] - depths[: len(depths) - count + 1] < THICK)
    return float(np.median(depths[enough[-1] : enough[-1] + count])) if len(enough) else None


SIDES = {"right": 0, "left": 1, "top": 2, "bottom": 3}  # Index of a side in `joints.hinge_at`
OVERLAP = 0.5  # Fraction of the smaller front that two proposals may share; the better one stays


def propose(
    surface: SplitSurface,
    config: layers.ProposeConfig,
    grow: GrowConfig,
    network: FrontNetwork | None = None,
    labels: LabelledFaces | None = None,
) -> tuple[Item, ...]:
    """Return proposed parts of a scan, best first; triangles are not split yet, and handles are places.

    Args:
        surface: the scan, z up, floor at 0.
        config: how fronts are proposed.
        grow: how far before and behind a plane faces belong to a front.
        network: what sees fronts; None: the one that comes with s2a.
        labels: of the scan's objects, which forbid fronts on what has none, and expect them on furniture that opens.
    """
    network = network or load()
    config = replace(config, layer=layers.layer_of(surface, config.layer))
    floor, points = layers.floor_of(surface), layers.spread(surface, config.density)
    ready = config if labels is None else replace(config, min_score=READY * config.min_score)
    candidates: list[Item] = []
    rows: list[tuple[layers.Layer, np.ndarray, list[CellBox], float]] = []
    for layer in layers.layers(points, config):
        maps = network.see(image(layer, floor))
        candidates += filter(
            None, (_item(surface, points, layer, one, config, grow) for one in fronts(layer, maps, ready))
        )
        for doors, sure in layers.framed_rows(layer) if labels else ():
            rows.append((layer, maps[3], [scanned(layer, CellBox(*map(float, door))) for door in doors], sure))
    for layer, handle, boxes, sure in rows:
        row = framed(boxes, handle, _first(layer, boxes, candidates), ready.min_score * (1 + sure), config)
        row_doors = filter(None, (_item(surface, points, layer, one, config, grow) for one in row))
        candidates += [door for door in row_doors if labels and not labels.one_leaf(door.region)]
    if labels is not None:
        candidates = [item for item in candidates if item.score >= labels.min_score(item.region, config.min_score)]
        return refrigerator_doors(surface, _best(surface, candidates), labels, grow)
    return _best(surface, candidates)


def framed(
    boxes: list[CellBox], handle: np.ndarray, first: int, score: float, config: layers.ProposeConfig
) -> Iterator[SeenFront]:
    """Yield the doors of a row of framed ones, which open away from each other in pairs.

    Args:
        boxes: their rectangles, from left to right.
        handle: probability of a handle in each cell of their plane.
        first: the side that the first one turns about, an index of TURNS.
        score: of each.
        config: has the least size of a front.
    """
    for index, box in enumerate(boxes):
        if (np.array([box.width, box.height]) * config.cell >= config.min_front).all():
            grip = _handle(handle, box)
            yield SeenFront(box, _hinged(TURNS[(first + index) % 2], box, grip), score, grip)


def _first(layer: layers.Layer, boxes: list[CellBox], others: list[Item]) -> int:
    """Return the side that the first door of a row turns about, an index of TURNS: as other proposals of its doors do."""
    votes = np.zeros(2)
    for index, box in enumerate(boxes):
        middle, wide = _place(layer, *box.middle), box.width * layer.cell
        for item in filter(upright_hinge, others):
            region = item.region
            near = np.abs(region.local(middle[None])[0]) < [*region.size / 4, layers.AHEAD]
            if near.all() and wide > AGREES * region.size[0]:
                votes[(turns_right(item) + index) % 2] += item.score
    return int(np.argmax(votes))


def cut(surface: SplitSurface, items: tuple[Item, ...], grow: GrowConfig) -> Draft:
    """Return an annotation of proposed parts whose borders are cut, with handles as if their places had been clicked.

    Where the network sees no handle, one is added at its usual place, since whatever opens is opened by something.
    """
    annotation = Draft(surface, items)
    for index, item in enumerate(items):
        annotation = annotation.with_rectangle(index, item.region, grow)
    for index, item in enumerate(items):
        if item.grip is not None:
            annotation = annotation.with_handle(index, item.grip, None)
        else:
            annotation = annotation.with_handle(index, handles.usual_place(item.region, item.joint), handles.USUAL)
    return annotation


def _item(
    surface: SplitSurface,
    points: layers.Points,
    layer: layers.Layer,
    front: SeenFront,
    config: layers.ProposeConfig,
    grow: GrowConfig,
) -> Item | None:
    """Return a front as a part; None where it is hardly scanned."""
    region = _region(surface, layer, front.box, grow)
    if region is None:
        return None
    tips = front.motion == ("slide", "out") and is_flap(region, points, config.density)
    joint = _joint(region, ("hinge", "bottom") if tips else front.motion)
    grip = _grip(layer, front.handle) if front.handle else None
    if grip is not None and joint.kind == "revolute":
        far = np.linalg.norm(np.cross(grip - np.array(joint.origin), np.array(joint.axis)))
        grip = (
            grip if far > AT_HINGE * np.linalg.norm(np.cross(2 * (region.center - joint.origin), joint.axis)) else None
        )
    return Item(region, joint=joint, proposed=True, score=front.score, grip=grip)


def _grip(layer: layers.Layer, handle: CellBox) -> np.ndarray:
    """Return the middle of a handle, as far out as it stands [m], shape [3]."""
    out = float(np.quantile(layer.ahead[handle.cells], 0.9))
    return np.asarray(_place(layer, *handle.middle) + out * layer.normal)


def _joint(region: FrontRegion, motion: Motion) -> Joint:
    if motion[0] == "slide":
        return slide(region, motion[1])
    return hinge_at(region, SIDES[motion[1]])


def _place(layer: layers.Layer, column: float, row: float) -> np.ndarray:
    """Return the point of a plane at a place of its image [m], shape [3]."""
    u, v = layer.low + layer.cell * np.array([column, row])
    return np.asarray(u * layer.right + v * np.array([0.0, 0.0, 1.0]) + layer.offset * layer.normal)


def _rectangle(layer: layers.Layer, box: CellBox) -> FrontRegion:
    """Return a box as a rectangle of a plane, without faces."""
    axes = np.stack([layer.right, np.array([0.0, 0.0, 1.0])], axis=1)
    size = np.array([box.width, box.height]) * layer.cell
    return FrontRegion(layer.normal, _place(layer, *box.middle), axes, size, np.empty(0, int))


def _region(surface: SplitSurface, layer: layers.Layer, box: CellBox, grow: GrowConfig) -> FrontRegion | None:
    """Return a box as a region of the surface, its plane fitted to its faces and upright; None where it holds hardly any."""
    region = _rectangle(layer, box)
    faces = inside(surface, region, grow.distance)
    if surface.areas[faces].sum() < 0.3 * region.size.prod():
        return None
    normal, _ = fit_plane(surface.centroids[faces], surface.areas[faces], layer.normal)
    normal = normal * [1.0, 1.0, 0.0]
    normal /= np.linalg.norm(normal)
    if normal @ layer.normal < 0.99:
        normal = layer.normal
    right = np.array([-normal[1], normal[0], 0.0])
    offset = float(np.median(surface.centroids[faces] @ normal))
    center = region.center + (offset - float(region.center @ normal)) * normal
    turned = replace(region, normal=normal, center=center, axes=np.stack([right, region.axes[:, 1]], axis=1))
    return replace(turned, faces=inside(surface, turned, grow.thickness))


def _best(surface: SplitSurface, candidates: list[Item]) -> tuple[Item, ...]:
    """Return proposals, best first, without those that mostly repeat a better one."""
    best: list[Item] = []
    taken = np.zeros(len(surface.faces), bool)
    for item in sorted(candidates, key=lambda one: (-one.score, -len(one.region.faces))):
        areas = surface.areas[item.region.faces]
        if areas[taken[item.region.faces]].sum() <= OVERLAP * areas.sum():
            faces = item.region.faces[~taken[item.region.faces]]
            best.append(replace(item, region=replace(item.region, faces=faces)))
            taken[item.region.faces] = True
    return tuple(best)
