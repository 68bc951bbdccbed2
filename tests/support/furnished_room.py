"""A furnished room as one mesh, z up and in metres, seen from inside; parts of it; and random rotations."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import trimesh


def turned_box(size: Sequence[float], place: Sequence[float], yaw: float) -> trimesh.Trimesh:
    """Return a box that stands on z = place[2], turned about the vertical [rad]."""
    box = trimesh.creation.box(size)
    box.apply_transform(trimesh.transformations.rotation_matrix(yaw, (0, 0, 1)))
    box.apply_translation((place[0], place[1], place[2] + size[2] / 2))
    return box


def open_below(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Return a mesh without the faces that look down, which no scanner sees."""
    mesh.update_faces(mesh.face_normals[:, 2] > -0.9)
    return mesh


def room(seed: int = 0, ceiling: bool = True) -> trimesh.Trimesh:
    """Return a room of 5 x 4 x 2.5 m with a table, chairs, a bed, a shelf and cupboards; its floor lies at z 0."""
    rng = np.random.default_rng(seed)
    shell = trimesh.creation.box((5.0, 4.0, 2.5))
    shell.apply_translation((0, 0, 1.25))
    shell.invert()
    if not ceiling:
        shell.update_faces(shell.triangles_center[:, 2] < 2.4)
    parts = [shell, turned_box((1.4, 0.8, 0.04), (0.3, 0.2, 0.7), 0.4)]
    for x, y in ((-0.2, -0.6), (0.9, 0.9), (0.3, -0.7)):
        parts.append(turned_box((0.42, 0.42, 0.45), (x, y, 0.0), float(rng.uniform(0, 1.5))))
    parts.append(turned_box((2.0, 0.9, 0.5), (-1.45, 1.5, 0.0), 0.0))
    parts.append(turned_box((0.35, 1.2, 1.8), (2.3, -1.0, 0.0), 0.0))
    parts.append(turned_box((1.6, 0.6, 0.75), (-1.6, -1.68, 0.0), 0.0))
    parts.append(turned_box((0.3, 0.2, 0.25), (0.3, 0.2, 0.74), 0.9))
    return trimesh.util.concatenate([parts[0], *map(open_below, parts[1:])])


def rotations(count: int, seed: int) -> list[np.ndarray]:
    """Return random rotations, shape [3 3] each."""
    generator = np.random.default_rng(seed)
    return [trimesh.transformations.random_rotation_matrix(generator.random(3))[:3, :3] for _ in range(count)]
