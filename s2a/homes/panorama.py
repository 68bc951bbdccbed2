"""Panoramas of ranges of a laser scanner on a tripod, by casting rays at a triangle mesh.

A panorama is a cube map: six square faces whose pixels are almost evenly spaced in angle. Unlike an equirectangular image it
wastes no rays at the poles, and a point is projected into it without trigonometry. A pixel's plane comes from its direct
neighbours: ones farther away lie beside a handle's bar, which is two or three pixels wide, and would turn its planes by tens of
degrees.
"""

from dataclasses import dataclass

import numpy as np
import warp as wp

from s2a.core.bounds import Fraction, NotNegative, Positive
from s2a.core.workers import chunks, in_parallel
from s2a.scene.geometry.mesh_query import RayMesh

# A cube-map face maps the tangent u in [-1, 1] to u (1 + BEND - BEND u^2): within 20 % of even angular spacing
BEND = 0.25
# Standard deviation of unit white noise on a cubic lattice once it is interpolated linearly along three axes
LATTICE_RMS = (2.0 / 3.0) ** 1.5


@dataclass(frozen=True)
class NoiseConfig:
    """Errors of a scanner's ranges.

    Attributes:
        white: standard deviation of the independent error of each ray [m].
        correlated: standard deviation of the error that neighbouring rays share [m].
        correlation: angle over which it is shared [rad].
        registration: standard deviation of the offset of a whole panorama [m].
        grazing_cutoff: rays whose incidence has a cosine below this return nothing, raggedly (half of them at this value).
        tripod_blind_cone: rays steeper down than this below the horizon return nothing [rad]: the tripod.
        max_elevation: rays steeper up than this above the horizon return nothing [rad].
    """

    white: NotNegative
    correlated: NotNegative
    correlation: Positive
    registration: NotNegative
    grazing_cutoff: Fraction
    tripod_blind_cone: NotNegative
    max_elevation: NotNegative


@wp.struct
class Errors:
    """The errors of one panorama, as the kernel wants them; `lattice` is unit white noise on [-1, 1]^3."""

    seed: int
    white: float
    correlated: float
    offset: float
    grazing_cutoff: float
    lowest: float
    highest: float
    lattice: wp.array3d(dtype=float)


@wp.func
def _smooth_noise(lattice: wp.array3d(dtype=float), d: wp.vec3):
    """Noise of unit variance that neighbouring directions share: the lattice, interpolated."""
    last = float(lattice.shape[0] - 1)
    u = (d[0] * 0.5 + 0.5) * last
    v = (d[1] * 0.5 + 0.5) * last
    w = (d[2] * 0.5 + 0.5) * last
    i = wp.min(int(u), lattice.shape[0] - 2)
    j = wp.min(int(v), lattice.shape[0] - 2)
    k = wp.min(int(w), lattice.shape[0] - 2)
    u -= float(i)
    v -= float(j)
    w -= float(k)
    low = wp.lerp(
        wp.lerp(lattice[i, j, k], lattice[i, j, k + 1], w),
        wp.lerp(lattice[i, j + 1, k], lattice[i, j + 1, k + 1], w),
        v,
    )
    high = wp.lerp(
        wp.lerp(lattice[i + 1, j, k], lattice[i + 1, j, k + 1], w),
        wp.lerp(lattice[i + 1, j + 1, k], lattice[i + 1, j + 1, k + 1], w),
        v,
    )
    return wp.lerp(low, high, u) / LATTICE_RMS


@wp.func
def pixel_direction(tangents: wp.array(dtype=float), n: int, tid: int):
    """Unit direction of a pixel; pixels count along columns, rows, then faces (+x -x +y -y +z -z)."""
    face = tid // (n * n)
    axis = face // 2
    d = wp.vec3(0.0, 0.0, 0.0)
    d[axis] = 1.0 - 2.0 * float(face % 2)
    d[(axis + 1) % 3] = tangents[tid % n]
    d[(axis + 2) % 3] = tangents[(tid // n) % n]
    return wp.normalize(d)


@wp.func
def direction_pixel(d: wp.vec3, n: int):
    """Index of the pixel that a direction falls into."""
    axis = int(0)
    a = wp.vec3(wp.abs(d[0]), wp.abs(d[1]), wp.abs(d[2]))
    if a[1] > a[0] and a[1] >= a[2]:
        axis = 1
    elif a[2] > a[0]:
        axis = 2
    u = d[(axis + 1) % 3] / a[axis]
    v = d[(axis + 2) % 3] / a[axis]
    face = 2 * axis
    if d[axis] < 0.0:
        face += 1
    col = wp.clamp(int((u * (1.0 + BEND - BEND * u * u) + 1.0) * 0.5 * float(n)), 0, n - 1)
    row = wp.clamp(int((v * (1.0 + BEND - BEND * v * v) + 1.0) * 0.5 * float(n)), 0, n - 1)
    return (face * n + row) * n + col


@wp.kernel
def _cast(
    mesh: wp.uint64,
    dropout: wp.array(dtype=float),
    tangents: wp.array(dtype=float),
    origin: wp.vec3,
    turn: wp.mat33,
    errors: Errors,
    first: int,
    ranges: wp.array(dtype=float),
):
    tid = first + wp.tid()
    d = pixel_direction(tangents, tangents.shape[0], tid)
    ranges[tid] = 0.0
    if d[2] < errors.lowest or d[2] > errors.highest:
        return
    ray = turn * d
    hit = wp.mesh_query_ray(mesh, origin, ray, 100.0)
    if not hit.result:
        return
    rng = wp.rand_init(errors.seed, tid)
    if wp.abs(wp.dot(hit.normal, ray)) < errors.grazing_cutoff * 2.0 * wp.randf(rng):
        return
    # Sharing the lattice between ranges and dropouts is harmless: glass has no other surface to be compared with.
    shared = _smooth_noise(errors.lattice, d)
    if dropout[hit.face] > wp.max(0.5 + 0.3 * shared, 0.0):
        return
    ranges[tid] = hit.t + errors.offset + errors.correlated * shared + errors.white * wp.randn(rng)


def pixel_tangents(spacing: float) -> np.ndarray:
    """Return the tangents of the pixel centres along a cube-map face, shape [pixel], for a mean angular spacing [rad]."""
    n = int(np.ceil(np.pi / 2 / spacing))
    fine = np.linspace(-1.0, 1.0, 20001)
    centres = (np.arange(n) + 0.5) / n * 2.0 - 1.0
    return np.interp(centres, fine * (1 + BEND - BEND * fine**2), fine).astype(np.float32)


def cast_panorama(
    mesh: RayMesh,
    dropout: np.ndarray,
    T_mesh_scanner: np.ndarray,
    spacing: float,
    noise: NoiseConfig,
    rng: np.random.Generator,
) -> np.ndarray:
    """Return the noisy range [m] of every pixel of a panorama, shape [pixel], float32; 0 where nothing returns.

    Args:
        mesh: what is scanned (see `ray_mesh`); rays are fastest where its walls are parallel to its axes.
        dropout: share of rays that a face of the mesh swallows, in patches, shape [face]: glass, screens.
        T_mesh_scanner: pose of the scanner, whose axes are the panorama's, in the mesh's frame, shape [4 4].
        spacing: mean angle between rays [rad].
        noise: the scanner's errors.
        rng: where this panorama's errors come from.
    """
    errors = Errors()
    errors.seed = int(rng.integers(1 << 30))
    errors.white, errors.correlated, errors.grazing_cutoff = noise.white, noise.correlated, noise.grazing_cutoff
    errors.offset, errors.lowest = float(rng.normal(0.0, noise.registration)), -float(np.sin(noise.tripod_blind_cone))
    errors.highest = float(np.sin(noise.max_elevation)) if noise.max_elevation < np.pi / 2 else 2.0
    cells = (int(2.0 / noise.correlation) + 2,) * 3
    errors.lattice = wp.array(rng.normal(size=cells).astype(np.float32), dtype=float, device="cpu")
    tangents = wp.array(pixel_tangents(spacing), dtype=float, device="cpu")
    ranges = wp.empty(6 * len(tangents) ** 2, dtype=float, device="cpu")
    pose = np.asarray(T_mesh_scanner, np.float64)
    inputs = [mesh.id, wp.array(dropout, dtype=float, device="cpu"), tangents]
    inputs += [wp.vec3(*map(float, pose[:3, 3])), wp.mat33(*map(float, pose[:3, :3].ravel())), errors]

    def cast(some: slice) -> None:
        wp.launch(_cast, some.stop - some.start, inputs=[*inputs, some.start], outputs=[ranges], device="cpu")

    in_parallel(cast, chunks(len(ranges)))
    return ranges.numpy()


@dataclass
class View:
    """A panorama and the planes that its pixels measured."""

    scanner: wp.vec3  # where it was taken [m]
    tangents: wp.array  # of the pixel centres along a cube-map face (see `s2a.homes.panorama.pixel_tangents`)
    ranges: wp.array  # of its pixels [m], 0 where nothing returned, shape [pixel]
    # unit normal towards the scanner, and its product with points of the plane seen from the scanner [m], shape [pixel]
    planes: wp.array


@wp.func
def _slope(ranges: wp.array(dtype=float), tangents: wp.array(dtype=float), tid: int, place: int, step: int):
    """Difference vector between a pixel's neighbours along a row or column, from the side that continues its surface."""
    n = tangents.shape[0]
    r = ranges[tid]
    back = float(0.0)
    ahead = float(0.0)
    if place >= 1:
        back = ranges[tid - step]
    if place + 1 < n:
        ahead = ranges[tid + step]
    here = r * pixel_direction(tangents, n, tid)
    jump = r * 16.0 / float(n)
    to_back = wp.where(back > 0.0, wp.abs(back - r), 1.0e6)
    to_ahead = wp.where(ahead > 0.0, wp.abs(ahead - r), 1.0e6)
    if wp.min(to_back, to_ahead) > jump:
        return wp.vec3(0.0, 0.0, 0.0)
    p_back = back * pixel_direction(tangents, n, wp.max(tid - step, 0))
    p_ahead = ahead * pixel_direction(tangents, n, wp.min(tid + step, ranges.shape[0] - 1))
    if wp.max(to_back, to_ahead) < 1.0e5 and wp.abs(back + ahead - 2.0 * r) < 0.25 * jump:
        return p_ahead - p_back
    if to_back < to_ahead:
        return here - p_back
    return p_ahead - here


@wp.kernel
def _planes(ranges: wp.array(dtype=float), tangents: wp.array(dtype=float), planes: wp.array(dtype=wp.vec4)):
    tid = wp.tid()
    n = tangents.shape[0]
    if ranges[tid] <= 0.0:
        return
    d = pixel_direction(tangents, n, tid)
    across = wp.cross(_slope(ranges, tangents, tid, tid % n, 1), _slope(ranges, tangents, tid, (tid // n) % n, n))
    normal = -d
    if wp.length(across) > 0.0:
        normal = wp.normalize(across)
        normal = normal * -wp.sign(wp.dot(normal, d))
    planes[tid] = wp.vec4(normal[0], normal[1], normal[2], ranges[tid] * wp.dot(d, normal))


def measure(panoramas: list[np.ndarray], scanners: np.ndarray, spacing: float) -> list[View]:
    """Return panoramas with the planes that their pixels measured.

    Args:
        panoramas: ranges [m] of each panorama (see `s2a.homes.panorama.cast_panorama`), shape [pixel] each.
        scanners: where each was taken [m], shape [panorama 3].
        spacing: angle between the rays [rad].
    """
    tangents = wp.array(pixel_tangents(spacing), dtype=float, device="cpu")

    def view(ranges: np.ndarray, scanner: np.ndarray) -> View:
        pixels = wp.array(ranges, dtype=float, device="cpu", copy=False)
        planes = wp.zeros(len(ranges), dtype=wp.vec4, device="cpu")
        wp.launch(_planes, len(ranges), inputs=[pixels, tangents], outputs=[planes], device="cpu")
        return View(wp.vec3(*map(float, scanner)), tangents, pixels, planes)

    return in_parallel(view, panoramas, scanners)
