"""Pictures of meshes: rays cast from a camera, shaded by a sun, the sky and a lamp at the camera."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import warp as wp
from PIL import Image

from s2a.geometry.camera_pose import LookConfig, View, axes
from s2a.geometry.mesh_ops import merge
from s2a.geometry.mesh_query import ray_mesh
from s2a.scene import Mesh

GREY = (170, 174, 180)
"""What has no colours of its own."""
BACKGROUND = (255, 255, 255)
GAMMA = 2.2
"""Light adds up linearly; the colours of scans and pictures are its GAMMA-th root."""
SHADOW_GAP = 0.004
"""Rays to the light start this far above the surface [m]: the noise of a scan would shade itself."""


@wp.struct
class Lens:
    """A camera as the kernel wants it: the ray of a pixel is forward + x right + y up, x and y in [-1, 1]."""

    eye: wp.vec3
    forward: wp.vec3
    right: wp.vec3
    up: wp.vec3
    sun: wp.vec3
    width: int
    height: int
    side: float


@wp.func
def _first_hit(mesh: wp.uint64, start: wp.vec3, ray: wp.vec3, side: float):
    """Distance of the first surface along a ray, its face and barycentric coordinates; face -1 where there is none.

    Surfaces count from both sides where side is 0, only against their normals where it is 1, only along them at -1.
    """
    way = float(0.0)
    for _ in range(64):
        hit = wp.mesh_query_ray(mesh, start + way * ray, ray, 1.0e4)
        if not hit.result:
            return 0.0, -1, 0.0, 0.0
        way += hit.t
        if side == 0.0 or side * wp.dot(hit.normal, ray) < 0.0:
            return way, hit.face, hit.u, hit.v
        way += 1.0e-4
    return 0.0, -1, 0.0, 0.0


@wp.kernel
def _shade(mesh: wp.uint64, colors: wp.array(dtype=wp.vec3), lens: Lens, image: wp.array(dtype=wp.vec3)):
    tid = wp.tid()
    x = 2.0 * (float(tid % lens.width) + 0.5) / float(lens.width) - 1.0
    y = 1.0 - 2.0 * (float(tid // lens.width) + 0.5) / float(lens.height)
    ray = wp.normalize(lens.forward + x * lens.right + y * lens.up)
    way, face, u, v = _first_hit(mesh, lens.eye, ray, lens.side)
    if face < 0:
        return
    normal = wp.mesh_eval_face_normal(mesh, face)
    if wp.dot(normal, ray) > 0.0:
        normal = -normal
    light = 0.30 - 0.35 * wp.dot(normal, ray) + 0.10 * normal[2]
    toward_sun = wp.dot(normal, lens.sun)
    if toward_sun > 0.0:
        place = lens.eye + way * ray + SHADOW_GAP * normal
        # The sun, too, sees through what it sees from behind; this ray runs the other way.
        _t, blocker, _u, _v = _first_hit(mesh, place, lens.sun, -lens.side)
        if blocker < 0:
            light += 0.60 * toward_sun
    a = colors[wp.mesh_get_index(mesh, 3 * face)]
    b = colors[wp.mesh_get_index(mesh, 3 * face + 1)]
    c = colors[wp.mesh_get_index(mesh, 3 * face + 2)]
    image[tid] = light * (u * a + v * b + (1.0 - u - v) * c)


def draw(meshes: Sequence[Mesh], view: View, look: LookConfig) -> np.ndarray:
    """Return a picture of meshes, shape [row column 3], uint8; what has no colours is grey.

    Args:
        meshes: in scene coordinates; those without faces are not seen.
        view: where the camera stands.
        look: how it is taken.
    """
    size = look.height * look.samples, look.width * look.samples
    paper = np.tile(_linear(np.array(BACKGROUND)), (size[0] * size[1], 1))
    image = wp.array(paper, dtype=wp.vec3, device="cpu")
    if any(len(mesh.faces) for mesh in meshes):
        whole = merge([mesh if mesh.colors is not None else painted(mesh, GREY) for mesh in meshes])
        colors = wp.array(_linear(whole.colors), dtype=wp.vec3, device="cpu")
        surface = ray_mesh(whole.vertices, whole.faces)
        inputs = [surface.id, colors, _lens(view, look)]
        wp.launch(_shade, dim=len(image), inputs=inputs, outputs=[image], device="cpu")
    pixels = image.numpy().reshape(look.height, look.samples, look.width, look.samples, 3).mean(axis=(1, 3))
    return np.round(255.0 * np.clip(pixels, 0.0, 1.0) ** (1.0 / GAMMA)).astype(np.uint8)


def write(picture: np.ndarray, path: Path) -> None:
    """Write a picture [row column 3] as a PNG file, whatever the path's ending."""
    Image.fromarray(picture).save(path, format="PNG", optimize=True)


def painted(mesh: Mesh, color: tuple[int, int, int]) -> Mesh:
    """Return a mesh in one colour."""
    return Mesh(mesh.vertices, mesh.faces, np.tile(np.array(color, np.uint8), (len(mesh.vertices), 1)))


def _lens(view: View, look: LookConfig) -> Lens:
    """Return a camera for the kernel; its sun stands behind it, to the left and high."""
    forward = np.subtract(view.target, view.eye)
    forward = forward / np.linalg.norm(forward)
    right, up = axes(forward)
    tangent = np.tan(look.fov / 2)
    ahead = np.cross((0.0, 0.0, 1.0), right)
    sun = -0.6 * ahead - 0.5 * right + np.array([0.0, 0.0, 1.1])
    lens = Lens()
    lens.eye, lens.forward = wp.vec3(*view.eye), wp.vec3(*forward)
    lens.right, lens.up = wp.vec3(*(tangent * look.width / look.height * right)), wp.vec3(*(tangent * up))
    lens.sun = wp.vec3(*(sun / np.linalg.norm(sun)))
    lens.width, lens.height = look.width * look.samples, look.height * look.samples
    lens.side = float(look.see_through)
    return lens


def _linear(colors: np.ndarray | None) -> np.ndarray:
    """Return colours as light, 0 to 1."""
    return (np.asarray(colors, np.float32) / np.float32(255.0)) ** np.float32(GAMMA)
