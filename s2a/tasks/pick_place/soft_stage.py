"""A soft body among the free objects of a room, for a planner that knows its boxes at rest."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.errors import InputError
from s2a.motion.obstacles import Obstacles
from s2a.robot.tool_path import matrix
from s2a.scene.scene import Mesh
from s2a.scene.usd.sim_scene import Collider, Mass, SimBody, SimRoom, in_scene
from s2a.sim.soft_body import SoftBody
from s2a.sim.soft_config import SoftConfig

NAME = "teddy_bear"
GAP = 0.003
"""[m] Between the body and its support where it is put down: a millimetre more than its vertices' radius."""
EVEN = 0.02
"""[m] Up to which a support's height may differ below a soft body."""
NEAR = 0.10
"""[m] From what the body passes, up to which hulls of the room are simulated."""


def with_body(room: SimRoom, body: SoftBody, config: SoftConfig, pose: np.ndarray) -> SimRoom:
    """Return a room with a soft body as a rigid free object at a pose, 7-vector."""
    colliders = tuple(Collider(NAME, box) for box in body.boxes)
    mass = Mass(config.density * body.volume, (0.0, 0.0, 0.0), body.inertia(config.density), source="density")
    position, orientation = tuple(map(float, pose[:3])), tuple(map(float, pose[3:]))
    free = SimBody(NAME, body.surface, colliders, mass, position=position, orientation=orientation)  # type: ignore[arg-type]
    return replace(room, free={**room.free, NAME: free})


def standing(near: Obstacles, support: str, body: SoftBody, at: np.ndarray, yaw: float) -> np.ndarray:
    """Return the pose, 7-vector, of a body that stands on a support at x, y [2], turned by `yaw` about z [rad].

    Raises:
        InputError: there is no support below all of it, or its height differs by more than EVEN.
    """
    turn = Rotation.from_euler("z", yaw)
    low = body.vertices[:, 2].min()
    feet = turn.apply(body.vertices[body.vertices[:, 2] < low + 1e-6])[:, :2] + at
    bounds = np.concatenate([h.vertices for h in near.hulls_of(support)] or [np.zeros((0, 3))])
    if not len(bounds):
        known = ", ".join(dict.fromkeys(near.names))
        raise InputError(f"{support!r} supports nothing near ({at[0]:.2f}, {at[1]:.2f}); near are: {known}")
    height, names = near.below(np.c_[feet, np.full(len(feet), bounds[:, 2].max() + 0.2)])
    if set(names) != {support} or np.ptp(height) > EVEN:
        found = ", ".join(sorted(set(names)))
        raise InputError(
            f"at ({at[0]:.2f}, {at[1]:.2f}) a body of {1000 * np.ptp(body.vertices[:, 0]):.0f} mm stands on {found}, "
            f"{1000 * np.ptp(height):.0f} mm uneven; choose a place in the middle of {support!r}"
        )
    return np.array([*at, height.max() + GAP - low, *turn.as_quat()])


def hulls_near(room: SimRoom, body: SoftBody, ends: list[np.ndarray]) -> list[Mesh]:
    """Return the hulls of a room within NEAR of a body that stands at poses, 7-vectors; of free objects too."""
    every = [c.mesh for c in room.static_colliders]
    for each in (*room.bodies.values(), *(b for i, b in room.free.items() if i != NAME)):
        every += [Mesh(in_scene(each, c.mesh), c.mesh.faces) for c in each.colliders]
    points = [body.vertices @ m[:3, :3].T + m[:3, 3] for m in map(matrix, ends)]
    boxes = [(p.min(axis=0) - NEAR, p.max(axis=0) + NEAR) for p in points]
    return [h for h in every if any(_overlap(h, low, high) for low, high in boxes)]


def _overlap(hull: Mesh, low: np.ndarray, high: np.ndarray) -> bool:
    points = np.asarray(hull.vertices)
    return bool((points.min(axis=0) <= high).all() and (points.max(axis=0) >= low).all())
