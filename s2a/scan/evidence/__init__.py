"""Evidence from the scanned surface about annotated parts and joints, for `s2a check` and for validation reports.

Every function compares an annotation with what was scanned, never with what was derived from the same annotation.
"""

from dataclasses import dataclass

from s2a.core.bounds import Fraction, NotNegative, Positive


@dataclass(frozen=True)
class Bounds:
    """Bounds of the checks of an annotation.

    Attributes:
        outward: min cosine between the first motion of a front's middle and the side from which it was scanned. Right
            annotations reach 0.99, reversed ones -0.99, and motion in the front's plane 0.
        angle: max angle between a slide and its front's normal or edge, and between a hinge and an edge of its part
            [deg]. Hasty annotators err by 3 (conf/annotator/hasty.yaml), a fitted edge by 1; half of a tilt of 15.
        edge: max distance of a hinge line from the edge of its part [m]. Hasty annotators err by 0.03, scanned borders
            by 0.01, and knuckles stand 0.03 beside a leaf.
        edge_fraction: the same, as a fraction of the part's breadth across the hinge; the smaller of both counts. Of
            the breadth; nearer to the middle than this it is nobody's edge, however small the part.
        handle_distance: min distance of the grasp point from the hinge, as a fraction of the part's breadth. Of the
            breadth; handles of doors and lids sit at 0.74 to 1.0, and the lever arm is the reason.
        handle_offset: max horizontal offset of a slide's grasp point from the front's middle, as a fraction of its
            width. Of the width; a drawer pulled far off its middle jams in its slides.
        depth_margin: travel of a slide beyond the depth behind its front [m]. Over-travel slides end 0.025 behind the
            front of the cabinet.
        length_margin: travel of a slide in its own plane, as a multiple of the part's length along it. Of the length; a
            sliding door moves by its own width at most.
        max_angle: max range of a hinge [rad]. 171 deg; the widest concealed hinges open 170 deg, and annotated doors of
            MultiScan 91 deg.
        blocked: max fraction of a part's surface whose path to the open limit runs through the rest of the scan. Of the
            surface; ragged borders and what stands near block 0.04 of right parts.
        grasp_gap: max distance of a grasp point from the surface of its region [m]. Half of the thickness of a thick
            bar; 0.016 where a depth camera scanned it.
        relief: min height of a grasp region over its front [m]. Three times the noise of a laser scan, and less than
            half of a finger's thickness.
        handle_gap: max distance of a grasp region from the surface of its part [m]. The clear space behind a bar, whose
            posts were not annotated.
        contact: max distance of a part from the nearest other surface [m]. Nothing floats, but scans lose legs and
            brackets: 0.077 under a plant of a virtual room.
        overlap: max fraction of a part's faces that an unrelated part lists too. Of the smaller part's faces; ragged
            borders share single faces.
        level: min area of level surfaces, as a fraction of that across the direction with the most. Of the most; a
            corridor's walls exceed its floor and ceiling by a third.
        underside: min excess of surfaces between floor and ceiling that look up over those that look down, of their
            sum. Of their sum; scanners at eye height see tables from above: 0.55 to 0.81 in virtual rooms.
        slope: max angle between a slide and a horizontal plane, and the mean floor and a horizontal plane [deg].
            Drawers and floors are level.
        heights: min and max height of a room [m]. Of rooms, and of halls.
        surfaces: min and max height over the floor of what objects stand on, median of the room [m]. Seats 0.45, beds
            0.5, tables 0.75, worktops 0.9, shelves above: 0.45 to 1.0 in virtual rooms.
        handles: min and max thickness of a grasp region, median of the file [m]. A hand does not close around more; a
            depth camera thickens handles to 0.06.
    """

    outward: Positive = 0.3
    angle: Positive = 8.0
    edge: Positive = 0.08
    edge_fraction: Fraction = 0.35
    handle_distance: Fraction = 0.6
    handle_offset: Fraction = 0.25
    depth_margin: NotNegative = 0.03
    length_margin: Positive = 1.1
    max_angle: Positive = 2.985
    blocked: Fraction = 0.1
    grasp_gap: Positive = 0.02
    relief: NotNegative = 0.005
    handle_gap: Positive = 0.05
    contact: Positive = 0.1
    overlap: Fraction = 0.02
    level: Fraction = 0.75
    underside: Fraction = 0.25
    slope: Positive = 10.0
    heights: tuple[Positive, Positive] = (1.6, 6.0)
    surfaces: tuple[Positive, Positive] = (0.2, 1.4)
    handles: tuple[Positive, Positive] = (0.006, 0.08)
