"""What the pads of a parallel gripper must find between them to hold an object."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace


@dataclass(frozen=True)
class Contact:
    """What the pads must find between them.

    Attributes:
        flat: up to which the surface may lie off the pads at a point that holds [m]. What is inclined more turns between the
            pads until it is parallel to them, or is squeezed out.
        held: least fraction of the points at which both pads hold.
        centered: largest distance of the middle of what holds from that of the surface between the pads [m]: a wedge is held
            where it is thickest, and slips out.
        body_gap: least distance of the gripper's body from the object [m], where more than to be clear of it.
        lever: largest lever arm of the weight about the closing axis [m], for what turns between the pads.
    """

    flat: float
    held: float
    centered: float
    lever: float = math.inf
    body_gap: float = 0.0


FIRM = Contact(0.0007, 0.3, 0.003)
"""5 degrees over half a pad, and a rod of 8 mm. With twice as much a perfume bottle turned by 20 degrees in the gripper."""
SLOPING = replace(FIRM, flat=0.0014, centered=0.005)
"""A doll's head, a lamp, a tube: their sides recede too much to be FIRM, and what holds lies nearer to one edge of the pads. They
may turn in the gripper, as the perfume bottle did; it is that or no plan."""
HANGING = tuple(
    replace(FIRM, held=held, lever=0.008, body_gap=body_gap)
    for held, body_gap in ((0.9, 0.012), (0.7, 0.006), (0.7, 0.0))
)
"""For a soft body, whose vertices pads meet, the best first. With 12 mm of lever arm a bear turned by 45 degrees when lifted; by
half of the pads it was squeezed out on its way, 8 mm in 10 s; its head, 2 mm from the gripper's body, bulged against that."""
