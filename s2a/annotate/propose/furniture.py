"""Labels of a scan as evidence for and against fronts: furniture that opens, and things that have no front."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from s2a.annotate.annotation import Item
from s2a.annotate.files import BareScan
from s2a.annotate.region import FrontRegion, GrowConfig, hinge_at, inside
from s2a.annotate.surface import SplitSurface
from s2a.scan import rest

# Words of labels on whose surfaces a front is expected: furniture and appliances with drawers or doors
OPENS = frozenset(
    "cabinet cabinetry cupboard dresser drawer wardrobe armoire closet nightstand sideboard commode credenza locker safe "
    "refrigerator fridge freezer oven stove dishwasher microwave washer washing dryer copier printer bedside vanity door".split()
)
# Words of labels on whose surfaces no front is: seats, beds, sanitary ware, textiles, the structure,
# and what hangs on it
CLOSED = frozenset(
    "couch sofa armchair chair stool ottoman bench bed mattress pillow cushion blanket toilet bathtub bidet urinal "
    "shower sink curtain drape blind wall floor ceiling column pillar beam carpet rug mat towel clothes picture "
    "painting poster whiteboard blackboard monitor screen tv television lamp plant person backpack bag basket "
    "guitar piano radiator heater stair staircase railing".split()
)
# Fraction of a front's area on such surfaces from which on it is dropped; annotators' borders are a few cm off
MOSTLY = 0.3
# Words of labels of what has panels and is one leaf, not a row of doors, where no word of furniture stands beside them
LEAF = frozenset("door doorway doorframe window shutter gate fence".split())
REFRIGERATOR = frozenset("refrigerator fridge freezer".split())
# [m] Narrowest refrigerator of two doors side by side: sold ones are 0.8 to 0.95 m wide, others 0.5 to 0.76 m; and the widest
# front of one of them, which a drawer below both is not
SIDE_BY_SIDE, ONE_DOOR = 0.78, 0.6
READY = 0.5  # The least score of a front on furniture that opens, as a fraction of the least score elsewhere


def opens(label: str) -> bool | None:
    """Return True for a label of furniture that opens, False for one of what has no front, None for any other.

    The words of furniture that opens count first: a "toilet cabinet" and a "bed drawer" open.
    """
    if _words(label) & OPENS:
        return True
    return False if _words(label) & CLOSED else None


def _words(label: str) -> set[str]:
    return {word.removesuffix("s") for word in re.findall("[a-z]+", label.lower())}


@dataclass(frozen=True, eq=False)
class LabelledFaces:
    """The faces of a scan whose labels speak for or against fronts."""

    areas: np.ndarray  # of all faces of the scan [m^2], shape [face]
    open: np.ndarray  # mask of the faces of furniture that opens, shape [face]
    closed: np.ndarray  # mask of the faces of what has no front, shape [face]
    leaf: np.ndarray  # mask of the faces of a door of the room, a window and their like, shape [face]
    cold: np.ndarray  # label of the faces of each refrigerator, -1 elsewhere, shape [face]

    @classmethod
    def of(cls, areas: np.ndarray, labels: Sequence[str], label: np.ndarray) -> LabelledFaces:
        """Return the evidence of labels; `label` has the index of each face's label, -1 for none, shape [face]."""
        kinds = [opens(text) for text in labels] + [None]
        cold = np.array([i if _words(text) & REFRIGERATOR else -1 for i, text in enumerate(labels)] + [-1])
        return cls(
            areas,
            np.array([kind is True for kind in kinds])[label],
            np.array([kind is False for kind in kinds])[label],
            np.array([bool(_words(text) & LEAF) and not _words(text) & OPENS - LEAF for text in labels] + [False])[
                label
            ],
            cold[label],
        )

    def min_score(self, region: FrontRegion, usual: float) -> float:
        """Return the least score with which a front is proposed; above 1 where labels forbid one."""
        faces = region.faces
        total = self.areas[faces].sum()
        if self.areas[faces[self.closed[faces]]].sum() >= MOSTLY * total:
            return np.inf
        return READY * usual if self.areas[faces[self.open[faces]]].sum() >= (1 - MOSTLY) * total else usual

    def one_leaf(self, region: FrontRegion) -> bool:
        """Return whether a front lies on a door of the room or a window, whose panels are no doors."""
        faces = region.faces
        return bool(self.areas[faces[self.leaf[faces]]].sum() >= MOSTLY * self.areas[faces].sum())


def refrigerator_doors(
    surface: SplitSurface, items: tuple[Item, ...], labels: LabelledFaces, grow: GrowConfig
) -> tuple[Item, ...]:
    """Return proposals with two doors for those on each refrigerator whose doors stand side by side.

    Their surface shines and has dispensers, so that the pieces of a door are seen, one over the other. Two columns of them that
    turn about their outer sides are two doors, each as high as the refrigerator.
    """
    for number in np.unique(labels.cold[labels.cold >= 0]):
        cold = labels.cold == number
        areas = np.where(cold, surface.areas, 0.0)
        mine = [x for x in items if areas[x.region.faces].sum() > 0.5 * surface.areas[x.region.faces].sum()]
        if not mine:
            continue
        plane = max(mine, key=lambda item: float(item.region.size.prod())).region
        mine = [item for item in mine if item.region.normal @ plane.normal > 0.9]
        columns = [[x for x in mine if upright_hinge(x) and turns_right(x) == right] for right in (False, True)]
        place = plane.local(surface.centroids[np.flatnonzero(cold & (surface.normals @ plane.normal > 0.7))])[:, :2]
        corners = plane.local(np.concatenate([item.region.corners for item in mine]))[:, :2]
        low = np.maximum(np.quantile(place, 0.01, axis=0), corners.min(axis=0))
        high = np.minimum(np.quantile(place, 0.99, axis=0), corners.max(axis=0))
        whole = all(columns) and len(columns[0] + columns[1]) == len(mine) > 2
        # Upper sides of the pieces of each column: doors over doors break at the same height
        tops = [sorted(x.region.center[2] + x.region.size[1] / 2 for x in column) for column in columns]
        crossed = len(tops[0]) == len(tops[1]) > 1 and np.allclose(tops[0], tops[1], atol=0.05)
        if (
            crossed
            or not whole
            or high[0] - low[0] < SIDE_BY_SIDE
            or max(item.region.size[0] for item in mine) > ONE_DOOR
        ):
            continue
        ends = [
            np.median([plane.local(item.region.corners)[:, 0].max() for item in columns[0]]),
            np.median([plane.local(item.region.corners)[:, 0].min() for item in columns[1]]),
        ]
        seam = float(np.mean(ends))
        doors = []
        for column, (left, right), side in ((columns[0], (low[0], seam), 1), (columns[1], (seam, high[0]), 0)):
            middle = np.array([left + right, low[1] + high[1]]) / 2
            region = replace(
                plane, center=plane.center + plane.axes @ middle, size=np.array([right - left, high[1] - low[1]])
            )
            region = replace(region, faces=inside(surface, region, grow.thickness))
            best = max(column, key=lambda item: float(item.region.size.prod()))
            doors.append(replace(best, region=region, joint=hinge_at(region, side)))
        items = tuple(item for item in items if not any(item is one for one in mine)) + tuple(doors)
    return items


def upright_hinge(item: Item) -> bool:
    """Return whether a part turns about an upright axis."""
    return item.joint is not None and item.joint.kind == "revolute" and abs(item.joint.axis[2]) > 0.7


def turns_right(item: Item) -> bool:
    """Return whether the hinge of a part is at its right side, as seen from the room."""
    assert item.joint is not None
    return bool((np.array(item.joint.origin) - item.region.center) @ item.region.axes[:, 0] > 0)


def labelled(scan: BareScan) -> LabelledFaces | None:
    """Return the labels of a scan's objects on its faces; None for a scan without any.

    Raises:
        InputError: the files of its segments are damaged.
    """
    if scan.files.segments is None:
        return None
    count = len(scan.mesh.vertices)
    groups = rest.read_segments(*scan.files.segments, count)
    index = rest.face_groups(groups, scan.mesh.faces, count)
    return LabelledFaces.of(scan.surface.areas, [group.label for group in groups], index)
