"""Evidence from the scanned surface about annotated parts and joints, for `s2a check` and for validation reports.

Every function compares an annotation with what was scanned, never with what was derived from the same annotation.
"""

from __future__ import annotations

from dataclasses import dataclass

from s2a.core.bounds import Fraction, NotNegative, Positive


@dataclass(frozen=True)
class Bounds:
    """Bounds of the checks of an annotation.

    Attributes:
        outward: min cosine between the first motion of a front's middle and the side from which it was scanned.
        angle: max angle between a slide and its front's normal or edge, and between a hinge and an edge of its part [deg].
        edge: max distance of a hinge line from the edge of its part [m].
        edge_fraction: the same, as a fraction of the part's breadth across the hinge; the smaller of both counts.
        handle_distance: min distance of the grasp point from the hinge, as a fraction of the part's breadth.
        handle_offset: max horizontal offset of a slide's grasp point from the front's middle, as a fraction of its width.
        depth_margin: travel of a slide beyond the depth behind its front [m].
        length_margin: travel of a slide in its own plane, as a multiple of the part's length along it.
        max_angle: max range of a hinge [rad].
        blocked: max fraction of a part's surface whose path to the open limit runs through the rest of the scan.
        grasp_gap: max distance of a grasp point from the surface of its region [m].
        relief: min height of a grasp region over its front [m].
        handle_gap: max distance of a grasp region from the surface of its part [m].
        contact: max distance of a part from the nearest other surface [m].
        overlap: max fraction of a part's faces that an unrelated part lists too.
        level: min area of level surfaces, as a fraction of that across the direction with the most.
        underside: min excess of surfaces between floor and ceiling that look up over those that look down, of their sum.
        slope: max angle between a slide and a horizontal plane, and the mean floor and a horizontal plane [deg].
        heights: min and max height of a room [m].
        surfaces: min and max height over the floor of what objects stand on, median of the room [m].
        handles: min and max thickness of a grasp region, median of the file [m].
    """

    outward: Positive
    angle: Positive
    edge: Positive
    edge_fraction: Fraction
    handle_distance: Fraction
    handle_offset: Fraction
    depth_margin: NotNegative
    length_margin: Positive
    max_angle: Positive
    blocked: Fraction
    grasp_gap: Positive
    relief: NotNegative
    handle_gap: Positive
    contact: Positive
    overlap: Fraction
    level: Fraction
    underside: Fraction
    slope: Positive
    heights: tuple[Positive, Positive]
    surfaces: tuple[Positive, Positive]
    handles: tuple[Positive, Positive]
