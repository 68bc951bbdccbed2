"""Walls for a model: what stands or hangs along each, in order, and the gaps between at eye level."""

from __future__ import annotations

from typing import Any

import numpy as np

from s2a.scene.scene import Joint, Scene
from s2a.scene.usd.boxes import silhouette, upright_box

THICKEST = 0.5
"""Thickness from which a part called wall is more than one wall [m]."""
ALONG = 0.3
"""Largest gap between a wall and what stands or hangs along it [m]."""
BAND = (1.2, 1.8)
"""Heights between which what is along a wall leaves no gap [m]."""
NARROW, COUNT = 0.3, 3
"""Smallest gap that is named [m], and the most gaps."""


def is_wall(label: str) -> bool:
    """Return True if a label names a wall."""
    return label.lower().endswith("wall")


def wall_line(scene: Scene, part_id: str) -> dict[str, Any]:
    """Return the keys along (ids, in order) and free (widths [m], the widest first) of a wall; none if it has no one side."""
    box = upright_box(silhouette(scene.parts[part_id].mesh.vertices))
    turn = box.yaw + (0.0 if box.size[0] >= box.size[1] else np.pi / 2)
    half, thick = max(box.size[:2]) / 2, min(box.size[:2]) / 2
    if 2 * thick > THICKEST:
        return {}
    along = np.array([np.cos(turn), np.sin(turn)])
    across = np.array([-along[1], along[0]])
    found: list[tuple[float, float, str, bool]] = []
    for other, part in scene.parts.items():
        if other == part_id or _is_no_thing(scene, other):
            continue
        points = part.mesh.vertices
        off = (points[:, :2] - box.center[:2]) @ across
        span = (points[:, :2] - box.center[:2]) @ along
        gap = max(float(off.min()) - thick, -thick - float(off.max()))
        first, last = max(-half, float(span.min())), min(half, float(span.max()))
        if gap <= ALONG and last - first > 0.02:
            low, high = points[:, 2].min(), points[:, 2].max()
            found.append((first, last, other, bool(low < BAND[1] and high > BAND[0])))
    found.sort(key=lambda one: (one[0] + one[1]) / 2)
    free = _gaps([one[:2] for one in found if one[3]], half)
    return {"along": [one[2] for one in found]} | ({"free": free} if free else {})


def _is_no_thing(scene: Scene, part_id: str) -> bool:
    """Return True for walls, floors, ceilings, parts of furniture, and what has no surface."""
    part = scene.parts[part_id]
    if not len(part.mesh.faces) or isinstance(part.motion, Joint) or part.graspable:
        return True
    return part.parent is not None or is_wall(part.label) or part.label.lower() in ("floor", "ceiling")


def _gaps(taken: list[tuple[float, float]], half: float) -> list[float]:
    """Return the widths of what some intervals leave of a wall from -half to half [m], the widest first."""
    at, found = -half, []
    for first, last in sorted(taken):
        found.append(first - at)
        at = max(at, last)
    found.append(half - at)
    return sorted((round(float(gap), 1) for gap in found if gap >= NARROW), reverse=True)[:COUNT]
