"""Handles before a front at x = 0 as a scanner in the room sees them."""

from __future__ import annotations

import itertools

import numpy as np
import trimesh

from s2a.scene.geometry.mesh_ops import keep, merge, normals
from s2a.scene.scene import Mesh

FRAME = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
"""Grasp frame of a level handle on a front at x = 0 that looks along +x: x along +y, y up, z into the furniture."""
PLANE = (np.array([1.0, 0.0, 0.0]), 0.0)


def block(low: tuple[float, float, float], high: tuple[float, float, float]) -> Mesh:
    """Return a box, in triangles of a few millimetres."""
    solid = trimesh.creation.box(bounds=[low, high]).subdivide_to_size(0.006)
    return Mesh(solid.vertices, solid.faces)


def seen(mesh: Mesh) -> Mesh:
    """Return what a scanner in the room sees of a surface: nothing that looks at the front."""
    return keep(mesh, normals(mesh)[:, 0] > -0.5)


def knob(sides: int = 64) -> Mesh:
    """Return a knob, 30 mm wide at its head, on a stalk of 14 mm, 28 mm high, as seen."""
    turned = trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])
    solids = []
    for radius, low, high in ((0.007, 0.0, 0.014), (0.015, 0.014, 0.028)):
        solid = trimesh.creation.cylinder(radius, segment=[[0, 0, low], [0, 0, high]], sections=sides)
        solids.append(solid.apply_transform(turned).subdivide_to_size(0.004))
    return seen(merge([Mesh(solid.vertices, solid.faces) for solid in solids]))


def turned_knob(profile: list[tuple[float, float]]) -> Mesh:
    """Return a round handle with a profile of (radius, height above the front) [m], as seen."""
    solid = trimesh.creation.revolve([(0, profile[0][1]), *profile, (0, profile[-1][1])], sections=64)
    solid = solid.apply_transform(trimesh.transformations.rotation_matrix(np.pi / 2, [0, 1, 0])).subdivide_to_size(
        0.002
    )
    return seen(Mesh(solid.vertices, solid.faces))


def ring_behind(inner: float, outer: float, depth: float) -> np.ndarray:
    """Return points behind a head, between two radii, from the front to a depth [m]."""
    random = np.random.default_rng(0)
    turn, radius = random.uniform(0, 2 * np.pi, 4000), np.sqrt(random.uniform(inner**2, outer**2, 4000))
    return np.stack([random.uniform(0, depth, 4000), radius * np.cos(turn), radius * np.sin(turn)], axis=1)


def edge() -> trimesh.Trimesh:
    """Return an edge pull, 0.3 m long: a sheet that stands 20 mm out from a front and bends down by 14 mm."""
    spans = (((-0.012, 0.02), (-0.15, 0.15), (0.0, 0.002)), ((0.02 - 0.002, 0.02), (-0.15, 0.15), (-0.014, 0.0)))
    corners = np.concatenate([list(itertools.product(*span)) for span in spans])
    quads = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])
    faces = quads[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)
    return trimesh.Trimesh(corners, np.concatenate([faces, faces + 8]))


def cup() -> trimesh.Trimesh:
    """Return a cup pull of 100 x 40 x 28 mm: half a bowl, 2 mm thick, open below, its upper rim at z = 0 on the front."""
    across, up = np.meshgrid(np.linspace(0, np.pi, 17), np.linspace(0, np.pi / 2, 7), indexing="ij")
    bowl = np.stack([np.sin(across) * np.cos(up), np.cos(across), np.sin(across) * np.sin(up)], axis=-1).reshape(-1, 3)
    index = np.arange(17 * 7).reshape(17, 7)
    a, b, c, d = (x.ravel() for x in (index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    outer, inner = (bowl * np.subtract((0.028, 0.05, 0.04), thick) - (0, 0, 0.04) for thick in (0.0, 0.002))
    return trimesh.Trimesh(outer, faces) + trimesh.Trimesh(inner, faces[:, ::-1])


def outside(sheet: trimesh.Trimesh) -> Mesh:
    """Return what is seen of a sheet from the room, above it."""
    solid = sheet.subdivide_to_size(0.004)
    mesh = Mesh(solid.vertices, solid.faces)
    return keep(mesh, normals(mesh) @ [0.8, 0.0, 0.6] > 0.05)


def noisy(mesh: Mesh, sigma: float, seed: int = 0) -> Mesh:
    """Return a surface whose vertices a scanner lifted off it or pressed into it, each by itself, along their normals [m]."""
    solid = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)
    off = np.random.default_rng(seed).normal(0.0, sigma, len(mesh.vertices))
    return Mesh(mesh.vertices + off[:, None] * solid.vertex_normals, mesh.faces)


def pull(lift: float = 0.0, skirt: bool = False) -> Mesh:
    """Return an edge pull as seen: a lip of 14 mm before its front, a wall above it, bowed by a lift in its middle [m]."""
    whole = edge().subdivide_to_size(0.002)
    mesh = Mesh(whole.vertices, whole.faces)
    region = keep(mesh, (normals(mesh)[:, 0] > 0.5) | (normals(mesh)[:, 2] > 0.5))
    region = keep(region, region.vertices[region.faces][:, :, 0].min(axis=1) > 0.0)
    if skirt:  # from the lip's lower edge into its shadow, 8 mm farther down
        corners = [[0.02, -0.15, -0.014], [0.02, 0.15, -0.014], [0.008, 0.15, -0.022], [0.008, -0.15, -0.022]]
        hanging = trimesh.Trimesh(corners, [[0, 2, 1], [0, 3, 2]]).subdivide_to_size(0.002)
        region = merge([region, Mesh(hanging.vertices, hanging.faces)])
    bow = lift * np.cos(np.pi * region.vertices[:, 1] / 0.3)
    return Mesh(region.vertices + np.outer(bow, [1, 0, 0]), region.faces)
