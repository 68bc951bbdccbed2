"""Which bodies overlap somewhere on the path of an articulated part, and so must not collide."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from s2a.scene.geometry.convex import hull
from s2a.scene.geometry.sweep import deepest, grown, sweep
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd.sim_scene import SimBody

MAX_CONTACT_DEPTH = 1e-5
"""[m] Hulls that overlap by less touch at most; float32 points of a room are exact to 1e-6. A door whose
edge lies 0.1 mm in a neighbour does not open."""
TOUCHING = 2e-4
"""[m] Gap below which neighbours count as overlapping: no scan resolves it. Fronts that were cut along one border touch all over,
and twelve contacts without depth hold a drawer against a pull of 15 N."""


def filtered_pairs(
    moving: Mapping[str, SimBody], fixed: Mapping[str, SimBody], joints: Mapping[str, Joint]
) -> dict[str, dict[str, float]]:
    """Return, for each articulated part, the bodies that it overlaps on its path, and how deep [m].

    Hulls bulge over what was scanned: of two neighbouring doors one can hit the other's handle, which must not be cut off for
    that. The other body stands at its scanned pose. Of bodies that only touch the depth is 0.

    Args:
        moving: articulated parts by id.
        fixed: cabinets and anchors by id.
        joints: of the articulated parts.
    """
    found: dict[str, dict[str, float]] = {part: {} for part in moving}
    bounds = {i: _bounds([c.mesh for c in body.colliders]) for i, body in {**fixed, **moving}.items()}
    for part, body in moving.items():
        meshes = [hull(grown(collider.mesh.vertices, TOUCHING)) for collider in body.colliders]
        hulls = [mesh for mesh in meshes if mesh is not None]
        reach = _bounds([cover for piece in hulls for cover in sweep(piece, joints[part])])
        for other, still in {**fixed, **moving}.items():
            low, high = bounds[other]
            if other == part or (low > reach[1]).any() or (high < reach[0]).any():
                continue
            depth = deepest(hulls, [collider.mesh for collider in still.colliders], joints[part])
            if depth > MAX_CONTACT_DEPTH:
                found[part][other] = max(0.0, depth - TOUCHING / 2)
    return found


def _bounds(meshes: Sequence[Mesh]) -> np.ndarray:
    """Return the lowest and highest corner of meshes [m], shape [2 3]; an empty box where there is none."""
    if not meshes:
        return np.array([[np.inf] * 3, [-np.inf] * 3])
    corners = np.array([mesh.bounds for mesh in meshes])
    return np.stack([corners[:, 0].min(axis=0), corners[:, 1].max(axis=0)])
