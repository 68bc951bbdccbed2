"""Images of meshes: rays cast from a camera and shaded, and a room seen from above its corner."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import warp as wp
from PIL import Image

from s2a.scene.geometry.camera import CameraPose, OrbitCamera, axes, framing_pose, front_of
from s2a.scene.geometry.mesh_ops import merge, painted
from s2a.scene.geometry.mesh_query import ray_mesh
from s2a.scene.scene import Mesh

GREY = (170, 174, 180)  # RGB of surfaces without colours
BACKGROUND = (255, 255, 255)
GAMMA = 2.2  # Light adds up linearly; the colours of scans and images are its GAMMA-th root
SHADOW_GAP = 0.004  # Rays to the light start this far above the surface [m]: the noise of a scan would shade itself


@wp.struct
class Pinhole:
    """A pinhole camera for the kernel: the ray of a pixel is forward + x right + y up, x and y in [-1, 1]."""

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
    distance = float(0.0)
    for _ in range(64):
        hit = wp.mesh_query_ray(mesh, start + distance * ray, ray, 1.0e4)
        if not hit.result:
            return 0.0, -1, 0.0, 0.0
        distance += hit.t
        if side == 0.0 or side * wp.dot(hit.normal, ray) < 0.0:
            return distance, hit.face, hit.u, hit.v
        distance += 1.0e-4
    return 0.0, -1, 0.0, 0.0


@wp.kernel
def _shade(mesh: wp.uint64, colors: wp.array(dtype=wp.vec3), camera: Pinhole, image: wp.array(dtype=wp.vec3)):
    tid = wp.tid()
    x = 2.0 * (float(tid % camera.width) + 0.5) / float(camera.width) - 1.0
    y = 1.0 - 2.0 * (float(tid // camera.width) + 0.5) / float(camera.height)
    ray = wp.normalize(camera.forward + x * camera.right + y * camera.up)
    distance, face, u, v = _first_hit(mesh, camera.eye, ray, camera.side)
    if face < 0:
        return
    normal = wp.mesh_eval_face_normal(mesh, face)
    if wp.dot(normal, ray) > 0.0:
        normal = -normal
    light = 0.30 - 0.35 * wp.dot(normal, ray) + 0.10 * normal[2]
    toward_sun = wp.dot(normal, camera.sun)
    if toward_sun > 0.0:
        place = camera.eye + distance * ray + SHADOW_GAP * normal
        # The sun, too, sees through what it sees from behind; this ray runs the other distance.
        _t, blocker, _u, _v = _first_hit(mesh, place, camera.sun, -camera.side)
        if blocker < 0:
            light += 0.60 * toward_sun
    a = colors[wp.mesh_get_index(mesh, 3 * face)]
    b = colors[wp.mesh_get_index(mesh, 3 * face + 1)]
    c = colors[wp.mesh_get_index(mesh, 3 * face + 2)]
    image[tid] = light * (u * a + v * b + (1.0 - u - v) * c)


def render(meshes: Sequence[Mesh], pose: CameraPose, camera: OrbitCamera) -> np.ndarray:
    """Render meshes to an RGB image, shape [row column 3], uint8; surfaces without colours are grey.

    `meshes`: in scene coordinates [m].
    """
    size = camera.height * camera.samples, camera.width * camera.samples
    background = np.tile(_linear(np.array(BACKGROUND)), (size[0] * size[1], 1))
    image = wp.array(background, dtype=wp.vec3, device="cpu")
    if any(len(mesh.faces) for mesh in meshes):
        merged = merge([mesh if mesh.colors is not None else painted(mesh, GREY) for mesh in meshes])
        colors = wp.array(_linear(merged.colors), dtype=wp.vec3, device="cpu")
        surface = ray_mesh(merged.vertices, merged.faces)
        inputs = [surface.id, colors, _pinhole(pose, camera)]
        wp.launch(_shade, dim=len(image), inputs=inputs, outputs=[image], device="cpu")
    pixels = image.numpy().reshape(camera.height, camera.samples, camera.width, camera.samples, 3).mean(axis=(1, 3))
    return np.round(255.0 * np.clip(pixels, 0.0, 1.0) ** (1.0 / GAMMA)).astype(np.uint8)


def write_png(image: np.ndarray, path: Path) -> None:
    """Write an RGB image [row column 3] as a PNG file, whatever the path's suffix."""
    Image.fromarray(image).save(path, format="PNG", optimize=True)


def _pinhole(pose: CameraPose, camera: OrbitCamera) -> Pinhole:
    """Return the kernel's camera; its sun stands behind it, to the left and high."""
    forward = np.subtract(pose.target, pose.eye)
    forward = forward / np.linalg.norm(forward)
    right, up = axes(forward)
    tangent = np.tan(camera.fov / 2)
    ahead = np.cross((0.0, 0.0, 1.0), right)
    sun = -0.6 * ahead - 0.5 * right + np.array([0.0, 0.0, 1.1])
    pinhole = Pinhole()
    pinhole.eye, pinhole.forward = wp.vec3(*pose.eye), wp.vec3(*forward)
    pinhole.right = wp.vec3(*(tangent * camera.width / camera.height * right))
    pinhole.up = wp.vec3(*(tangent * up))
    pinhole.sun = wp.vec3(*(sun / np.linalg.norm(sun)))
    pinhole.width, pinhole.height = camera.width * camera.samples, camera.height * camera.samples
    pinhole.side = float(camera.backface_culling)
    return pinhole


def _linear(colors: np.ndarray | None) -> np.ndarray:
    """Return colours as light, 0 to 1."""
    return (np.asarray(colors, np.float32) / np.float32(255.0)) ** np.float32(GAMMA)


CAMERA = OrbitCamera(
    width=1200, height=900, samples=2, fov=0.7, azimuth=0.35, elevation=0.65, margin=1.05, backface_culling=True
)
COLORS = ((220, 50, 40), (40, 160, 60), (40, 80, 220))  # RGB of the axes x, y and z

_LENGTH = 0.3  # of the room's diagonal
_THICK = 0.02  # of an axis's length


def room_image(room: Mesh) -> np.ndarray:
    """Return an RGB image, shape [row column 3], uint8, of a room with z up; x is red, y green, z blue.

    The camera stands on the side from which most surfaces were scanned; the axes meet in the lowest corner before it.
    """
    low, high = (np.quantile(room.vertices, fraction, axis=0) for fraction in (0.002, 0.998))
    length = _LENGTH * float(np.linalg.norm(high - low))
    front = front_of([room])
    front = np.array([1.0, 0.0, 0.0]) if front is None else front
    start = np.array([high[0] if front[0] > 0 else low[0], high[1] if front[1] > 0 else low[1], low[2]])
    shown = [room, *(_beam(start, axis, length, COLORS[axis]) for axis in range(3))]
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    subject = np.concatenate([corners, start + length * np.eye(3)])
    return render(shown, framing_pose(subject, front, CAMERA), CAMERA)


def _beam(start: np.ndarray, axis: int, length: float, color: tuple[int, int, int]) -> Mesh:
    """Return a box from a point along an axis, seen from outside."""
    half = _THICK * length * np.ones(3)
    low, high = start - half, start + half
    high[axis] = start[axis] + length
    corners = np.array(
        [[(low, high)[i][0], (low, high)[j][1], (low, high)[k][2]] for i in (0, 1) for j in (0, 1) for k in (0, 1)]
    )
    quads = np.array([[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]])
    return painted(Mesh(corners, np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])), color)
