"""A room of flat sheets seen from inside, with a drawer and a door in a cabinet: all numbers can be derived by hand.

The room spans 0 to 4 m in x, 0 to 3 m in y, 0 to 2.5 m in z, with a table top of 1 x 1 m at 0.7 m. The cabinet is at x = 0; its
top and sides reach from there to x = 0.5, y 1 to 2, z 0 to 1. The outer surfaces of its fronts lie at x = 0.52: the drawer from
y 1.02 to 1.48 with a bar across its middle, the door from y 1.52 to 1.98 with an upright bar at y 1.55 to 1.57, hinged at y 1.98.
The bars span x 0.53 to 0.56.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from s2a.scan.evidence import Bounds
from s2a.scene.scene import Joint, Mesh, Part, Scene

SIZE = (4.0, 3.0, 2.5)
FRONT = 0.52
"""[m] x of the outer surface of drawer and door."""
DRAWER = Joint("prismatic", (1, 0, 0), (FRONT, 1.25, 0.5), (0.0, 0.4))


def bounds() -> Bounds:
    """Return the bounds of conf/evidence."""
    return Bounds()


def sheet(corner: tuple[float, ...], u: tuple[float, ...], v: tuple[float, ...], cell: float = 0.05) -> Mesh:
    """Return a rectangle of triangles at a corner with two sides [m]; its faces look along u x v."""
    a, b, c = (np.array(x, float) for x in (corner, u, v))
    n, m = (max(1, round(float(np.linalg.norm(side)) / cell)) for side in (b, c))
    grid = np.stack(np.meshgrid(np.linspace(0, 1, n + 1), np.linspace(0, 1, m + 1), indexing="ij"), axis=-1)
    vertices = (a + grid[..., :1] * b + grid[..., 1:] * c).reshape(-1, 3)
    i = (np.arange(n)[:, None] * (m + 1) + np.arange(m)).ravel()
    lower = np.stack([i, i + m + 1, i + 1], axis=1)
    upper = np.stack([i + 1, i + m + 1, i + m + 2], axis=1)
    return Mesh(vertices, np.concatenate([lower, upper]))


def joined(*meshes: Mesh) -> Mesh:
    """Return one mesh of several."""
    starts = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes)])
    faces = [mesh.faces + start for mesh, start in zip(meshes, starts, strict=False)]
    return Mesh(np.concatenate([mesh.vertices for mesh in meshes]), np.concatenate(faces))


def bar(y: tuple[float, float], z: tuple[float, float], x: tuple[float, float]) -> Mesh:
    """Return the five seen sides of a block before a front at the lower x [m]."""
    (y0, y1), (z0, z1), (x0, x1) = y, z, x
    dx, dy, dz = (x1 - x0, 0, 0), (0, y1 - y0, 0), (0, 0, z1 - z0)
    return joined(
        sheet((x1, y0, z0), dy, dz, 0.01),
        sheet((x0, y0, z0), dz, dx, 0.01),
        sheet((x0, y1, z0), dx, dz, 0.01),
        sheet((x0, y0, z0), dx, dy, 0.01),
        sheet((x0, y0, z1), dy, dx, 0.01),
    )


def room() -> Scene:
    """Return the room with a right annotation."""
    x, y, z = SIZE
    front = [sheet((FRONT, y0, 0.02), (0, 0.46, 0), (0, 0, 0.96)) for y0 in (1.02, 1.52)]
    cabinet = joined(
        sheet((0, 1, 1), (0.5, 0, 0), (0, 1, 0)),
        sheet((0, 1, 0), (0.5, 0, 0), (0, 0, 1)),
        sheet((0, 2, 0), (0, 0, 1), (0.5, 0, 0)),
    )
    walls = joined(
        sheet((0, 0, 0), (0, y, 0), (0, 0, z), 0.1),
        sheet((x, 0, 0), (0, 0, z), (0, y, 0), 0.1),
        sheet((0, 0, 0), (0, 0, z), (x, 0, 0), 0.1),
        sheet((0, y, 0), (x, 0, 0), (0, 0, z), 0.1),
    )
    table = joined(sheet((2.5, 1, 0.7), (1, 0, 0), (0, 1, 0)), sheet((3, 1.5, 0), (0.1, 0, 0), (0, 0, 0.7)))
    parts = {
        "floor_1": Part("floor", sheet((0, 0, 0), (x, 0, 0), (0, y, 0), 0.1)),
        "ceiling_2": Part("ceiling", sheet((0, 0, z), (0, y, 0), (x, 0, 0), 0.1)),
        "wall_3": Part("wall", walls),
        "table_4": Part("table", table),
        "cabinet_5": Part("cabinet", cabinet),
        "drawer_6": Part("drawer", front[0], "cabinet_5", DRAWER),
        "handle_7": Part("handle", bar((1.15, 1.35), (0.5, 0.52), (0.53, 0.56)), "drawer_6", graspable=True),
        "door_8": Part("door", front[1], "cabinet_5", door(1.98)),
        "handle_9": Part("handle", bar((1.55, 1.57), (0.4, 0.6), (0.53, 0.56)), "door_8", graspable=True),
    }
    return Scene("box room", parts)


def door(hinge: float) -> Joint:
    """Return the hinge of a leaf that lies to its lower y: about +z its middle, at -y of the hinge, moves along z x -y = +x."""
    return Joint("revolute", (0, 0, 1), (FRONT, hinge, 0.5), (0.0, 1.5))


def changed(scene: Scene, part: str, **values: object) -> Scene:
    """Return a scene with other values in one joint."""
    joint = replace(scene.joint(part), **values)  # type: ignore[arg-type]
    return Scene(scene.name, {**scene.parts, part: replace(scene.parts[part], motion=joint)})


def moved(scene: Scene, matrix: np.ndarray) -> Scene:
    """Return a scene whose points are multiplied by a matrix [3 3]; joints stay as they are written."""
    parts = {
        name: replace(part, mesh=Mesh(part.mesh.vertices @ np.asarray(matrix, float).T, part.mesh.faces))
        for name, part in scene.parts.items()
    }
    return Scene(scene.name, parts)
