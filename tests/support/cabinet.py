"""A hand-made simulation-ready cabinet: exact boxes, so that tests of the simulation depend on no scan."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from s2a.scene.geometry.mesh_ops import merge
from s2a.scene.scene import Joint, Mesh
from s2a.scene.usd import sim_stage
from s2a.scene.usd.sim_scene import Articulation, Base, Collider, Grasp, Mass, SimBody, SimRoom

HANDLE = np.array([0.351, 0.0, 0.7267])
"""Centre of the drawer's bar [m]; the drawer opens towards +x, the robot stands at x = 0.9."""
TRAVEL = 0.4
"""Of the drawer [m]."""


def box(center: tuple[float, float, float], half: tuple[float, float, float]) -> Mesh:
    """Return a box by centre and half extents [m]."""
    mesh = trimesh.creation.box(
        extents=2.0 * np.array(half), transform=trimesh.transformations.translation_matrix(center)
    )
    return Mesh(mesh.vertices, mesh.faces)


def write_cabinet(
    path: Path,
    grasp: tuple[float, float, float] = tuple(HANDLE),
    base: tuple[float, float, float] = (HANDLE[0] + 0.55, 0.0, 0.0),
    beside: Sequence[Mesh] = (),
    joint: Joint | None = None,
    free: Sequence[SimBody] = (),
    attached: Sequence[Mesh] = (),
    part_of_hull: bool = False,
) -> Path:
    """Write a cabinet of the reference task's size with one drawer and a bar handle (two posts, a gap of 24 mm).

    `beside` are convex hulls of the room besides floor and wall, `joint` moves the drawer instead of its slide, `free` are
    objects that lie about, `attached` are further hulls of the drawer; with `part_of_hull` the bar and its posts are a handle's.
    """
    boards = [box((0.0, y, 0.4), (0.305, 0.0095, 0.381)) for y in (-0.3715, 0.3715)]
    boards += [box((-0.2955, 0.0, 0.4), (0.0095, 0.36, 0.381)), box((0.0, 0.0, 0.795), (0.305, 0.381, 0.007))]
    bar = box(tuple(HANDLE), (0.0071, 0.084, 0.0119))
    posts = [box((0.3345, y, HANDLE[2]), (0.0115, 0.0175, 0.0119)) for y in (-0.0665, 0.0665)]
    front = box((0.31515, 0.0, 0.7172), (0.0095, 0.3594, 0.0619))
    floor = [box((0.5, 0.0, -0.01), (2.0, 2.0, 0.01)), box((-0.5, 0.0, 1.0), (0.02, 2.0, 1.0)), *beside]
    # z into the cabinet (-x), y up, x = y cross z = -y of the world.
    grasp_at = Grasp(grasp, (0.5, -0.5, -0.5, 0.5), (0.168, 0.0238, 0.0142), bar)
    slide = Joint("prismatic", (1.0, 0.0, 0.0), tuple(HANDLE), (0.0, TRAVEL))
    room = SimRoom(
        name="test",
        bodies={
            "cabinet_1": _body("cabinet_1", boards, 60.0, (120, 90, 60)),
            "drawer_2": _drawer([bar, *posts], [front, *attached], "handle_4" if part_of_hull else "drawer_2"),
        },
        articulations={
            "drawer_2": Articulation(joint or slide, "cabinet_1", grasp_at, {"panda": Base(base, (0.0, 0.0, 1.0, 0.0))})
        },
        static_visual=merge(floor),
        static_colliders=tuple(Collider("room_3", mesh) for mesh in floor),
        free={body.id: body for body in free},
    )
    sim_stage.write(room, path)
    return path


def _drawer(handle: list[Mesh], others: list[Mesh], owner: str) -> SimBody:
    """Return the drawer, whose handle's hulls stand for the part `owner`."""
    body = _body("drawer_2", [*handle, *others], 5.32, (200, 20, 20))
    hulls = [replace(c, part=owner) if i < len(handle) else c for i, c in enumerate(body.colliders)]
    return replace(body, colliders=tuple(hulls))


def free_cube(name: str, position: tuple[float, float, float], side: float = 0.1, mass: float = 0.5) -> SimBody:
    """Return a cube that is free to move, its frame in its middle."""
    mesh, moment = box((0.0, 0.0, 0.0), 3 * (side / 2,)), mass * side**2 / 6.0
    return SimBody(name, mesh, (Collider(name, mesh),), Mass(mass, (0.0, 0.0, 0.0), 3 * (moment,)), position=position)


def _body(name: str, meshes: list[Mesh], mass: float, color: tuple[int, int, int]) -> SimBody:
    """Return a body of convex pieces with the inertia of its bounding box."""
    joined = merge(meshes)
    joined = Mesh(joined.vertices, joined.faces, np.tile(np.uint8(color), (len(joined.vertices), 1)))
    size = np.diff(joined.bounds, axis=0)[0]
    inertia = mass / 12.0 * (np.sum(size**2) - size**2)
    colliders = tuple(Collider(name, mesh) for mesh in meshes)
    return SimBody(name, joined, colliders, Mass(mass, tuple(joined.bounds.mean(axis=0)), tuple(inertia)))
