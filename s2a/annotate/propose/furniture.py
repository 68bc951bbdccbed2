"""Labels of a scan as evidence for and against fronts: furniture that opens, and things that have no front."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from s2a.annotate.files import BareScan
from s2a.annotate.region import FrontRegion
from s2a.scan import rest

# Words of labels on whose surfaces a front is expected: furniture and appliances with drawers or doors
OPENS = frozenset(
    "cabinet cabinetry cupboard dresser drawer wardrobe armoire closet nightstand sideboard commode credenza locker safe "
    "refrigerator fridge freezer oven stove dishwasher microwave washer washing dryer copier printer bedside vanity door".split()
)
# Words of labels on whose surfaces no front is: seats, beds, sanitary ware, textiles, the structure,
# and what hangs on it
CLOSED = frozenset(
    "couch sofa armchair chair stool ottoman bench bed mattress pillow cushion blanket toilet bathtub bidet urinal sink curtain "
    "drape blind wall floor ceiling column pillar beam carpet rug mat towel clothes picture painting poster whiteboard "
    "blackboard monitor screen tv television lamp plant person backpack bag basket guitar piano radiator heater stair "
    "staircase railing".split()
)
# Fraction of a front's area on such surfaces from which on it is dropped; annotators' borders are a few cm off
MOSTLY = 0.3
READY = 0.5  # The least score of a front on furniture that opens, as a fraction of the least score elsewhere


def opens(label: str) -> bool | None:
    """Return True for a label of furniture that opens, False for one of what has no front, None for any other.

    The words of furniture that opens count first: a "toilet cabinet" and a "bed drawer" open.
    """
    words = {word.removesuffix("s") for word in re.findall("[a-z]+", label.lower())}
    if words & OPENS:
        return True
    return False if words & CLOSED else None


@dataclass(frozen=True, eq=False)
class LabelledFaces:
    """The faces of a scan whose labels speak for or against fronts."""

    areas: np.ndarray  # of all faces of the scan [m^2], shape [face]
    open: np.ndarray  # mask of the faces of furniture that opens, shape [face]
    closed: np.ndarray  # mask of the faces of what has no front, shape [face]

    @classmethod
    def of(cls, areas: np.ndarray, labels: Sequence[str], label: np.ndarray) -> LabelledFaces:
        """Return the evidence of labels; `label` has the index of each face's label, -1 for none, shape [face]."""
        kinds = [opens(text) for text in labels] + [None]
        return cls(
            areas, np.array([kind is True for kind in kinds])[label], np.array([kind is False for kind in kinds])[label]
        )

    def min_score(self, region: FrontRegion, usual: float) -> float:
        """Return the least score with which a front is proposed; above 1 where labels forbid one."""
        faces = region.faces
        total = self.areas[faces].sum()
        if self.areas[faces[self.closed[faces]]].sum() >= MOSTLY * total:
            return np.inf
        return READY * usual if self.areas[faces[self.open[faces]]].sum() >= (1 - MOSTLY) * total else usual


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
