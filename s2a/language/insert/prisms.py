"""A simulated world of a free body, made of convex hulls, and of a scan's triangles, each a thin prism behind its face."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import mujoco
import numpy as np

from s2a.scene.scene import Mesh

if TYPE_CHECKING:
    from s2a.language.insert.drop_test import DropTestConfig

ANGLES = np.arange(12) * np.pi / 12
SIDES = np.array([[0.0, 0.0, 1.0], *np.stack([np.cos(ANGLES), np.sin(ANGLES), 0.0 * ANGLES], axis=1)])
"""Directions in which triangles may be too far away to matter, shape [13 3]: boxes turned by 15 deg, of which one fits."""
CLOSE = 0.025
"""Until an object has moved by almost so much, triangles farther away than this in one of these directions do not matter [m]."""


def near(support: Mesh, bounds: np.ndarray, reach: float) -> np.ndarray:
    """Return the triangles that hulls may touch [m], shape [face 3 3], float64.

    Args:
        support: the scene's triangles.
        bounds: of the hulls [m], shape [hull 2 3].
        reach: triangles within this distance of a hull's box are meant [m].
    """
    triangles = support.vertices[support.faces].astype(np.float64)
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    found = np.zeros(len(triangles), bool)
    for first, last in bounds:
        found |= ((low <= last + reach) & (high >= first - reach)).all(axis=1)
    return triangles[found & (support.face_areas > 1e-8)]


def close(triangles: np.ndarray, hulls: Sequence[Mesh]) -> np.ndarray:
    """Return which triangles matter as long as the hulls hardly move, shape [face]."""
    along = triangles @ SIDES.T
    low, high = along.min(axis=1), along.max(axis=1)
    found = np.zeros(len(triangles), bool)
    for hull in hulls:
        own = hull.vertices @ SIDES.T
        found |= ((low <= own.max(axis=0) + CLOSE) & (high >= own.min(axis=0) - CLOSE)).all(axis=1)
    return found


def model(hulls: Sequence[Mesh], triangles: np.ndarray, center: np.ndarray, config: DropTestConfig) -> mujoco.MjModel:
    """Return a model of prisms and a free body, its frame at the object's middle."""
    spec = mujoco.MjSpec()
    spec.option.timestep = config.step
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    spec.default.mesh.inertia = mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX
    geom = spec.default.geom
    geom.type, geom.density, geom.condim = mujoco.mjtGeom.mjGEOM_MESH, config.density, 6
    geom.friction, geom.solref[:] = config.friction, [config.stiffness, 1.0]
    across = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    behind = across / np.linalg.norm(across, axis=1, keepdims=True) * config.thickness
    prisms = np.concatenate([triangles, triangles - behind[:, None]], axis=1) - center
    for number, prism in enumerate(prisms):
        _geom(spec, spec.worldbody, f"prism_{number}", prism)
    body = spec.worldbody.add_body(name="object")
    body.add_freejoint()
    for number, hull in enumerate(hulls):
        _geom(spec, body, f"hull_{number}", hull.vertices.astype(np.float64) - center)
    return spec.compile()


def _geom(spec: mujoco.MjSpec, body: mujoco.MjsBody, name: str, points: np.ndarray) -> None:
    """Add the convex hull of points [point 3] to a body."""
    spec.add_mesh(name=name, uservert=points.ravel())
    body.add_geom(meshname=name)
