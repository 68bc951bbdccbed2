"""Record of a refined joint on the prim of its part (`s2a prepare refine_joints=true`).

s2a:annotated:axis, origin, limits              the joint as annotated
s2a:refined:angle, shift, zero                  how far it was moved [rad], [m], [m] or [rad]
s2a:refined:angleSigma, shiftSigma, unknown     how sure that is [rad], [m], and what the scan does not tell
"""

from __future__ import annotations

from dataclasses import dataclass

from pxr import Sdf, Usd

from s2a.scene.scene import Joint
from s2a.scene.usd.stage import read_attribute, write_attribute

Types = Sdf.ValueTypeNames
NUMBERS = {
    "angle": "angle",
    "shift": "shift",
    "zero": "zero",
    "angle_sigma": "angleSigma",
    "shift_sigma": "shiftSigma",
}
"""Fields that are numbers, and the attributes that hold them."""


@dataclass(frozen=True)
class Refinement:
    """How far a joint was moved from its annotation by what the scan shows.

    Attributes:
        annotated: the joint as it was annotated.
        angle: by which its axis was turned [rad].
        shift: by which its line was moved, at the annotated origin [m]; 0 for a slide, which has no place.
        zero: the coordinate at which the part is closed, where it was scanned ajar [m] or [rad]; 0: as it was annotated.
        angle_sigma: standard deviation of the axis, of the worse of its two directions [rad].
        shift_sigma: the same of the line [m]; 0 for a slide.
        unknown: what the scan does not tell, in words: there the annotation stays.
    """

    annotated: Joint
    angle: float
    shift: float
    zero: float
    angle_sigma: float
    shift_sigma: float
    unknown: tuple[str, ...] = ()


def write(prim: Usd.Prim, refinement: Refinement) -> None:
    """Author what was done to a joint on the prim of its part."""
    annotated = refinement.annotated
    for name, kind in (("axis", Types.Double3), ("origin", Types.Double3), ("limits", Types.Double2)):
        write_attribute(prim, f"annotated:{name}", kind, getattr(annotated, name))
    for field, name in NUMBERS.items():
        write_attribute(prim, f"refined:{name}", Types.Double, getattr(refinement, field))
    write_attribute(prim, "refined:unknown", Types.StringArray, list(refinement.unknown))


def read(prim: Usd.Prim, joint: Joint) -> Refinement | None:
    """Return what was done to a joint, or None where it is as annotated."""
    given = {name: read_attribute(prim, f"annotated:{name}", tuple) for name in ("axis", "origin", "limits")}
    numbers = {field: read_attribute(prim, f"refined:{name}", float) for field, name in NUMBERS.items()}
    if None in {**given, **numbers}.values():
        return None
    unknown = tuple(prim.GetAttribute("s2a:refined:unknown").Get() or ())
    return Refinement(Joint(joint.kind, **given), **numbers, unknown=unknown)
