"""A scanned cabinet made by hand: a drawer over a pair of doors, every face a grid of triangles with some noise."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh, Part, Scene

FRONT = 0.3
"""The fronts' faces lie in the plane x = 0.3 m and look along +x."""
DRAWER = Joint("prismatic", (1.0, 0.0, 0.0), (FRONT, 0.0, 0.7), (0.0, 0.4))
LEFT = Joint("revolute", (0.0, 0.0, -1.0), (FRONT, -0.3, 0.3), (0.0, 1.5))
RIGHT = Joint("revolute", (0.0, 0.0, 1.0), (FRONT, 0.3, 0.3), (0.0, 1.5))
TRUE = {"drawer_2": DRAWER, "door_3": LEFT, "door_4": RIGHT}
"""The right joints: of a drawer, and of doors that turn about the outer edges of their fronts."""
NOISE = 0.001
"""[m] Standard deviation of a vertex, along each axis."""


def sheet(corner: tuple[float, float, float], u: np.ndarray, v: np.ndarray, step: float = 0.012) -> Mesh:
    """Return a rectangle of triangles about `step` [m] wide; it looks along u x v."""
    m, n = (max(1, round(float(np.linalg.norm(side)) / step)) for side in (u, v))
    a, b = np.meshgrid(np.linspace(0, 1, m + 1), np.linspace(0, 1, n + 1), indexing="ij")
    points = np.array(corner) + a.reshape(-1, 1) * u + b.reshape(-1, 1) * v
    cell = np.add.outer(np.arange(m) * (n + 1), np.arange(n)).ravel()
    corners = [(0, n + 1, n + 2), (0, n + 2, 1)]
    return Mesh(points, np.concatenate([cell[:, None] + np.array(c) for c in corners]))


def upright(y: tuple[float, float], z: tuple[float, float], x: float = FRONT) -> Mesh:
    """Return a rectangle across x that looks along +x."""
    return sheet((x, y[0], z[0]), np.array([0.0, y[1] - y[0], 0.0]), np.array([0.0, 0.0, z[1] - z[0]]))


def cabinet(joints: Mapping[str, Joint] = TRUE, ajar: float = 0.0) -> Scene:
    """Return the scanned cabinet with some annotation, its drawer scanned `ajar` [m] open, in front of a wall."""
    rng = np.random.default_rng(0)
    body = [
        upright((-0.32, -0.302), (0.0, 0.83)),
        upright((0.302, 0.32), (0.0, 0.83)),
        upright((-0.302, 0.302), (0.802, 0.83)),
        upright((-0.302, 0.302), (0.0, 0.048)),
        sheet((-0.3, -0.32, 0.83), np.array([0.6, 0.0, 0.0]), np.array([0.0, 0.64, 0.0])),
    ]
    surfaces = {
        "cabinet_1": merge(body),
        "drawer_2": upright((-0.3, 0.3), (0.6, 0.8), FRONT + ajar),
        "door_3": upright((-0.3, -0.002), (0.05, 0.598)),
        "door_4": upright((0.002, 0.3), (0.05, 0.598)),
        "wall_5": upright((-2.0, 2.0), (0.0, 2.5), -0.32),
    }
    noisy = {i: Mesh(m.vertices + rng.normal(0, NOISE, m.vertices.shape), m.faces) for i, m in surfaces.items()}
    parts = {
        i: Part(i.split("_")[0], mesh, "cabinet_1" if i in TRUE else None, joints.get(i, "fixed"))
        for i, mesh in noisy.items()
    }
    return Scene("cabinet", parts)


def tilted(joint: Joint, degrees: float, about: tuple[float, float, float], shift: np.ndarray | float = 0.0) -> Joint:
    """Return a joint whose axis is turned about a direction across it, and whose origin is moved [m]."""
    angle, axis = np.radians(degrees), np.array(joint.axis)
    turned = np.cos(angle) * axis + np.sin(angle) * np.cross(about, axis)
    return replace(joint, axis=tuple(turned / np.linalg.norm(turned)), origin=tuple(np.array(joint.origin) + shift))


def with_part(scene: Scene, part_id: str, part: Part) -> Scene:
    """Return a scene with another part."""
    return replace(scene, parts={**scene.parts, part_id: part})
