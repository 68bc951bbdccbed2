"""A finding about an annotation: a number, its bound, a verdict, and what a person can do; findings as text and as JSON."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

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


Verdict = Literal["pass", "warn", "fail", "unknown"]
"""The surface agrees; it makes the annotation doubtful; it contradicts it; it does not tell."""


@dataclass(frozen=True)
class Finding:
    """One question to the scanned surface, and its answer.

    Attributes:
        check: what is asked, such as "opens_outward".
        part: id of the part; empty for the whole room.
        verdict: the answer.
        value: the number measured; NaN where the surface does not tell.
        bound: the value from which it passes; NaN where there is none.
        unit: of both.
        message: what was found, in words, with its number.
        remedy: what is possible and what to do; empty where nothing has to be done.
    """

    check: str
    part: str
    verdict: Verdict
    value: float = math.nan
    bound: float = math.nan
    unit: str = ""
    message: str = ""
    remedy: str = ""

    def __str__(self) -> str:
        """Return the finding as one line."""
        return f"{self.part or 'room'}: {self.message}" + (f"; {self.remedy}" if self.remedy else "")


def unknown(check: str, part: str, message: str) -> Finding:
    """Return the finding that the surface does not tell."""
    return Finding(check, part, "unknown", message=message)


def bounded_above(
    check: str, part: str, value: float, bound: float, unit: str, message: str, remedy: str, otherwise: Verdict = "fail"
) -> Finding:
    """Return the finding that passes if value <= bound, and is `otherwise` if not."""
    good = value <= bound
    return Finding(check, part, "pass" if good else otherwise, value, bound, unit, message, "" if good else remedy)


def bounded_below(
    check: str, part: str, value: float, bound: float, unit: str, message: str, remedy: str, otherwise: Verdict = "fail"
) -> Finding:
    """Return the finding that passes if value >= bound, and is `otherwise` if not."""
    good = value >= bound
    return Finding(check, part, "pass" if good else otherwise, value, bound, unit, message, "" if good else remedy)


def doubtful(findings: Sequence[Finding]) -> list[Finding]:
    """Return the findings that fail, and then those that warn."""
    return [f for verdict in ("fail", "warn") for f in findings if f.verdict == verdict]


def failed(findings: Sequence[Finding]) -> bool:
    """Return True if a finding contradicts the annotation."""
    return any(finding.verdict == "fail" for finding in findings)


def text(findings: Sequence[Finding]) -> str:
    """Return what fails and what warns, a line each, and how many of each verdict there are."""
    lines = [f"  {finding.verdict} {finding.check}: {finding}" for finding in doubtful(findings)]
    counts = {verdict: sum(f.verdict == verdict for f in findings) for verdict in ("fail", "warn", "pass", "unknown")}
    return "\n".join([*lines, "  " + ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)])


def to_json(findings: Sequence[Finding], **further: Any) -> str:
    """Return findings as JSON, after further values; NaN and infinity, which JSON lacks, become null."""
    rows = [{key: _plain(value) for key, value in dataclasses.asdict(finding).items()} for finding in findings]
    return json.dumps({"passed": not failed(findings), **_plain(further), "findings": rows}, indent=1) + "\n"


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
