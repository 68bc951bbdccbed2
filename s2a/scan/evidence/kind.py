"""The kind of a joint against the name of its part: two statements that an annotator made apart from each other."""

from __future__ import annotations

import re

import numpy as np

from s2a.scan.evidence.bounds import Bounds
from s2a.scan.evidence.finding import Finding, unknown
from s2a.scan.evidence.front import Front
from s2a.scan.evidence.opening import normal_angle
from s2a.scan.evidence.slide import LIFTS, along_normal
from s2a.scene.scene import Joint

SLIDES = re.compile(r"\bdrawers?\b")
"""Names of parts that slide."""
TURNS = re.compile(r"\b(doors?|windows?|lids?|flaps?|gates?|mirrors?)\b")
"""Names of parts that turn about an edge, or slide along it, and are never pulled forwards."""


def kind(part: str, label: str, joint: Joint, front: Front, bounds: Bounds) -> Finding:
    """Judge the kind of a joint by the part's label: drawers slide forwards; doors, windows and lids do not."""
    name = label.lower()
    forwards = joint.kind == "prismatic" and along_normal(joint, front)
    upwards = joint.kind == "prismatic" and not forwards and abs(joint.axis[2]) > 0.7 and abs(front.normal[2]) < 0.7
    if SLIDES.search(name):
        wrong, does, usual = (
            not forwards,
            "turns" if joint.kind == "revolute" else "moves in its front's plane",
            "slides",
        )
    elif TURNS.search(name) and not LIFTS.search(name):
        wrong, does = forwards or upwards, "slides forwards" if forwards else "slides upwards"
        usual = "turns about an edge"
    else:
        return unknown("kind", part, "its name does not tell how it moves")
    if joint.kind == "revolute" and normal_angle(np.array(joint.axis), front) < bounds.angle and TURNS.search(name):
        wrong, does = True, "turns in its own plane"
    if not wrong:
        return Finding("kind", part, "pass", message=f"it moves as a {label} does")
    remedy = f"possible: a {label} {usual}; check type and axis, or the label"
    return Finding("kind", part, "warn", message=f"it is called {label!r} and {does}", remedy=remedy)
