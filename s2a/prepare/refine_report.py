"""What was done to a joint, in words."""

from __future__ import annotations

import math

from s2a.scene.usd.refinement import Refinement


def sentence(part: str, change: Refinement) -> str:
    """Return how far a joint was moved, how sure that is, and what the scan does not tell."""
    hinge = change.annotated.kind == "revolute"
    turned = f"{math.degrees(change.angle):.2f} deg (sigma {math.degrees(change.angle_sigma):.2f})"
    words = [f"joint of {part} refined: axis turned by {turned}"]
    if hinge:
        words.append(f"line moved by {1e3 * change.shift:.1f} mm (sigma {1e3 * change.shift_sigma:.1f})")
    if change.zero:
        amount = f"{abs(math.degrees(change.zero)):.1f} deg" if hinge else f"{1e3 * abs(change.zero):.0f} mm"
        words.append(f"scanned {amount} ajar")
    if change.unknown:
        words.append(f"as annotated, since the scan does not tell: {', '.join(change.unknown)}")
    return "; ".join(words)
