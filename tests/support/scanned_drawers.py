"""A drawer as a scan shows it: one fused noisy surface with ragged part borders, without what no scanner saw."""

from __future__ import annotations

import numpy as np
import trimesh
from scipy.ndimage import gaussian_filter
from skimage.measure import marching_cubes

from s2a.scene.geometry.mesh_ops import centroids, keep, merge, normals, sample
from s2a.scene.scene import Joint, Mesh, Part, Scene

FRONT = np.array([[-0.1, -0.3794, -0.0619], [0.0, 0.3794, 0.0619]])
"""Lower and upper corner [m]; the front plane is x = 0, outwards is +x."""
BAR = np.array([[0.0239, -0.0841, -0.0119], [0.0381, 0.0841, 0.0119]])
POSTS = tuple(
    np.array([[0.0, *sorted((s * 0.049, s * 0.0841))[:1], -0.0119], [0.0239, max(s * 0.049, s * 0.0841), 0.0119]])
    for s in (1, -1)
)
VOXEL = 0.003
"""[m]"""


def scanned_drawer(
    seed: int = 0, noise: float = 0.001, height: float = 0.73, yaw: float = 0.0, web: float = 0.0
) -> Scene:
    """Return a room of a drawer cabinet (front and handle of drawer_7, no cabinet surface) as scanned.

    Args:
        seed: of the noise.
        noise: standard deviation of the surface [m], correlated over 6 mm.
        height: of the bar above the floor [m].
        yaw: of the room [rad]; the drawer opens along +x turned by it.
        web: share of the gap's depth that is closed by a skin between bar and front, as fusion leaves it.
    """
    mesh, is_handle = _fuse(seed, noise, web)
    turn = np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1.0]])
    mesh = Mesh(mesh.vertices @ turn.T + [0, 0, height], mesh.faces, mesh.colors)
    joint = Joint("prismatic", tuple(turn @ [1.0, 0, 0]), (0.0, 0.0, height), (0.0, 0.4))
    floor = Mesh(np.array([[-1, -1, 0], [2, -1, 0], [2, 1, 0], [-1, 1, 0]]) @ turn.T, [[0, 1, 2], [0, 2, 3]])
    parts = {
        "floor_1": Part("floor", floor),
        "cabinet_3": Part("cabinet", Mesh(np.empty((0, 3)), np.empty((0, 3)))),
        "drawer_7": Part("drawer", keep(mesh, ~is_handle), "cabinet_3", joint),
        "handle_9": Part("handle", keep(mesh, is_handle), "drawer_7", graspable=True),
    }
    return Scene("scanned", parts)


def true_handle(count: int = 4000) -> np.ndarray:
    """Return points all over the true handle's surface [m], in the drawer's frame (yaw 0, bar at height 0)."""
    solids = [BAR, *POSTS]
    meshes = [trimesh.creation.box(bounds=solid) for solid in solids]
    points = sample(merge([Mesh(mesh.vertices, mesh.faces) for mesh in meshes]), count, 0)
    inner = np.min([_signed_distance(points, solid) for solid in [*solids, FRONT]], axis=0) < -1e-6
    return points[~inner & (points[:, 0] > 1e-6)]


def _fuse(seed: int, noise: float, web: float) -> tuple[Mesh, np.ndarray]:
    """Return one surface around front and handle, and which faces the annotator gave to the handle."""
    low, high = FRONT[0] - 0.012, np.maximum(FRONT[1], BAR[1]) + 0.012
    axes = [np.arange(low[i], high[i], VOXEL) for i in range(3)]
    points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
    solids = [FRONT, BAR, *POSTS]
    if web:
        solids.append(np.array([[0.0, -0.049, 0.009], [0.0239 * web, 0.049, 0.0119]]))
    field = np.min([_signed_distance(points, solid) for solid in solids], axis=0)
    random = np.random.default_rng(seed)
    rough = gaussian_filter(random.standard_normal(field.shape), 0.006 / VOXEL)
    field = field + noise * rough / rough.std()
    vertices, faces, _, _ = marching_cubes(field, 0.0, spacing=(VOXEL,) * 3)
    mesh = Mesh(vertices + low, faces[:, ::-1], np.full((len(vertices), 3), 170, np.uint8))
    if normals(mesh)[centroids(mesh)[:, 0] > 0.03].mean(axis=0)[0] < 0:
        mesh = Mesh(mesh.vertices, faces, mesh.colors)
    middle, facing = centroids(mesh), normals(mesh)
    behind = (facing[:, 0] < -0.3) | (middle[:, 0] < -0.03 - 0.005 * random.random(len(middle)))
    shaded = (np.abs(middle[:, 2]) < 0.006) & (np.abs(middle[:, 1]) < 0.045) & (middle[:, 0] < 0.02)
    mesh = keep(mesh, ~behind & ~shaded)
    ragged = 0.002 + 0.0025 * random.random(len(mesh.faces))
    middle = centroids(mesh)
    return mesh, (middle[:, 0] > ragged) & (np.abs(middle[:, 1]) < 0.1) & (np.abs(middle[:, 2]) < 0.03)


def _signed_distance(points: np.ndarray, solid: np.ndarray) -> np.ndarray:
    """Return the signed distance to an axis-parallel box [m]."""
    outside = np.abs(points - solid.mean(axis=0)) - np.ptp(solid, axis=0) / 2
    return np.linalg.norm(np.maximum(outside, 0), axis=-1) + np.minimum(outside.max(axis=-1), 0)
