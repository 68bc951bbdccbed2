"""The front of a moving part in one scan: its plane and its sides, each with its uncertainty."""

from dataclasses import dataclass

import numpy as np

from s2a.scan.evidence.front import FLAT, Front, panel
from s2a.scan.evidence.surface import ScanSurface, moved_parts
from s2a.scene.geometry.mesh_ops import centroids, normals, sample_with_faces
from s2a.scene.scene import Mesh

CELL = 0.05  # [m] Largest width of the cells whose mean heights are fitted, unless there would be more than MOST
MIN_CELL = 0.015  # [m] Smallest one
MOST = 150  # Cells in a front's rectangle; larger fronts get wider cells
DENSITY, FEWEST, LARGEST = 25_000.0, 2_000, 60_000  # Points that stand for a surface: per m^2, at least, at most
# [m] So much of a front's border is left out: a voxel (`conf/detail/demo.yaml`: 6 mm) rounds the edge off, and
# annotated borders are ragged by 2.5 mm. Between 3 and 12 mm it matters little (0.125 to 0.137 degrees up and down,
# root mean square, of the fronts of docs/refinement.md's first row); with the border it is 0.16
PLANE_BORDER = 0.008
FILLED = 0.2  # Cells of which less is seen do not count
OFF = 2.5  # Times the cells' scatter; what is farther off is no noise but a moulding or a handle
MIN_SCATTER = 0.0004  # [m] A cell's height is not known better, however well the cells of a small front agree
WORTH = 3  # Residuals that MIN_SCATTER is worth
LENGTHS = np.geomspace(0.02, 0.22, 7)  # [m] Over which noise may be shared: 30 mrad from 0.7 to 7 m
OWN = 0.1  # Of a whole cell's variance that it shares with none, of the variance that it shares


def spread(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, float]:
    """Return points spread evenly over a surface [m], shape [point 3], its normals there, and the area of each point [m^2]."""
    area = float(mesh.face_areas.sum())
    count = int(np.clip(area * DENSITY, FEWEST, LARGEST))
    points, faces = sample_with_faces(mesh, count, 0)
    return points, normals(mesh)[faces], area / count


def inner(flat: np.ndarray) -> np.ndarray:
    """Return which places of a front [point 2] do not lie at its border [point]; the ends of a narrow one are closer."""
    low, high = np.quantile(flat, [0.005, 0.995], axis=0)
    border = np.minimum(PLANE_BORDER, (high - low) / 6)
    return ((flat > low + border) & (flat < high - border)).all(axis=1)


def fitted_plane(flat: np.ndarray, height: np.ndarray, area: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Return offset and slopes [3] of the plane through a front, and their covariance [3 3]; None where too little is seen.

    Args:
        flat: places in the plane, evenly spread [m], shape [point 2].
        height: over it [m], shape [point].
        area: of each point [m^2].
    """
    cells = _cells(flat, height, area)
    if cells is None:
        return None
    place, mean, filled = cells
    design = np.column_stack([np.ones(len(place)), place])
    own = OWN / filled + _off(design, mean, filled)
    distance = np.linalg.norm(place[:, None] - place[None], axis=2)
    fits = [_shared(design, mean, _kernel(distance / length) + np.diag(own)) for length in LENGTHS]
    likely = np.array([fit[0] for fit in fits])
    weights = np.exp(likely - likely.max()) / np.exp(likely - likely.max()).sum()
    mean = sum(weight * fit[1] for weight, fit in zip(weights, fits, strict=True))
    both = [fit[2] + np.outer(fit[1] - mean, fit[1] - mean) for fit in fits]
    return np.asarray(mean), np.einsum("l,lij->ij", weights, np.array(both))


def _cells(flat: np.ndarray, height: np.ndarray, area: float) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Return the middles of what is seen in each cell [cell 2], its mean height [cell], and the fraction that is seen [cell]."""
    if len(flat) < WORTH:
        return None
    sides = np.ptp(flat, axis=0)
    width = max(float(np.clip(sides.min() / 3.0, MIN_CELL, CELL)), float(np.sqrt(np.prod(sides) / MOST)))
    index = np.unique(np.floor(flat / width).astype(int), axis=0, return_inverse=True)[1].ravel()
    count = np.bincount(index)
    mean = np.stack([np.bincount(index, v) for v in (*flat.T, height)], axis=1) / count[:, None]
    filled = np.minimum(1.0, count * area / width**2)
    keep = filled > FILLED
    return (mean[keep, :2], mean[keep, 2], filled[keep]) if keep.sum() > 5 else None


def _off(design: np.ndarray, height: np.ndarray, filled: np.ndarray) -> np.ndarray:
    """Return the variance of cells that lie off a robust plane, in units of the cells' variance; 0 of those near it."""
    weight = filled
    for _ in range(10):
        root = np.sqrt(weight)
        residual = height - design @ np.linalg.lstsq(design * root[:, None], height * root, rcond=None)[0]
        scatter = max(MIN_SCATTER, 1.4826 * float(np.median(np.abs(residual))))
        weight = filled / (1.0 + (residual / (2.0 * scatter)) ** 2)
    return np.maximum(0.0, (residual / scatter) ** 2 - OFF**2)


def _kernel(distance: np.ndarray) -> np.ndarray:
    """Return the correlation of noise at distances in units of the length over which it is shared (Matern's, of 3/2)."""
    far = np.sqrt(3.0) * distance
    return (1.0 + far) * np.exp(-far)


def _shared(design: np.ndarray, height: np.ndarray, shape: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return the restricted log-likelihood of one shape of the noise [cell cell], the plane [3] and its covariance [3 3]."""
    lower = np.linalg.cholesky(shape)
    sides, target = np.linalg.solve(lower, design), np.linalg.solve(lower, height)
    information = sides.T @ sides
    plane = np.linalg.solve(information, sides.T @ target)
    squares = float(((target - sides @ plane) ** 2).sum()) + WORTH * MIN_SCATTER**2
    free = len(height) - design.shape[1] + WORTH
    bulk = 2.0 * float(np.log(np.diag(lower)).sum()) + float(np.linalg.slogdet(information)[1])
    likely = -0.5 * (free * np.log(squares) + bulk)
    return likely, plane, squares / (free - 2) * np.linalg.inv(information)  # the variance of a Student's t


# [m] To each side of an edge faces tell where it is: two standard deviations of a hasty annotator's border, and the gap
BAND = 0.03
FEW = 10  # Faces from which on they tell anything
BIN = 0.03  # [m] Sections of a border in which its farthest face is looked for
HEAVIEST = 4.0  # Times the mean area: a face weighs no more, for it is one annotation
STEEP = 20.0  # [1/m] Logits per metre across a border; less is a mixture over more than the band
# Variance of labels over that of independent ones: neighbouring faces share a nearest place; checked against true sides
SPREAD = 2.0
END = 0.005  # [m] Standard deviation of the place of a side that is only known from where own faces end
SKEW = 0.1  # [rad] A border that runs more askew, or may do so, is none
# [m] Standard deviation of a fitted side's place, besides what its fit says: rounded edges, gaps, edge pulls
BORDER = 0.003


class Faces:
    """The faces of a scanned room, measured once.

    Attributes:
        surface: the room.
        centroids: of the faces [m], shape [face 3].
        areas: of the faces [m^2], shape [face].
    """

    def __init__(self, surface: ScanSurface) -> None:
        self.surface = surface
        self.centroids = centroids(surface.mesh)
        self.areas = surface.mesh.face_areas

    def own(self, part: str, faces: np.ndarray) -> np.ndarray:
        """Return which of some faces [face] move with a part, shape [face]."""
        ids = [self.surface.ids.index(i) for i in moved_parts(self.surface.scene, part)]
        return np.isin(self.surface.owner[faces], ids)

    def near(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return the faces whose middles lie in a box with these corners [m], shape [face]."""
        faces = np.arange(len(self.centroids))
        for axis in range(3):
            place = self.centroids[faces, axis]
            faces = faces[(place >= low[axis]) & (place <= high[axis])]
        return faces


@dataclass(frozen=True)
class FrontSide:
    """A straight side of a front."""

    outward: np.ndarray  # unit direction in the front's plane, across the side, out of the front, shape [3]
    along: np.ndarray  # unit direction of the side, shape [3]
    middle: np.ndarray  # a point on it, in the middle [m], shape [3]
    sigma: float  # standard deviation of its place [m]
    angle: float  # standard deviation of its direction in the plane [rad]; inf where it is not told


def find_sides(
    faces: Faces, part: str, normal: np.ndarray, center: np.ndarray, axes: np.ndarray, extent: float
) -> tuple[FrontSide, ...]:
    """Return the four sides of a front that is a rectangle; none where too few faces are its own.

    Args:
        faces: of the room.
        part: id of the part.
        normal: of its front, shape [3].
        center: of the front [m], shape [3].
        axes: directions of its sides, as columns, shape [3 2].
        extent: length of its diagonal [m].
    """
    reach = extent / 2 + 2 * BAND
    near = faces.near(center - reach, center + reach)
    near = near[np.abs((faces.centroids[near] - center) @ normal) < BAND]
    place, mine, weights = (faces.centroids[near] - center) @ axes, faces.own(part, near), faces.areas[near]
    sides: list[FrontSide] = []
    if mine.sum() < FEW:
        return ()
    for k in (0, 1):
        for sign in (-1.0, 1.0):
            border = sign * np.quantile(sign * place[mine, k], 0.98)
            half = np.quantile(np.abs(place[mine, 1 - k]), 0.98)
            band = (np.abs(place[:, k] - border) < BAND) & (np.abs(place[:, 1 - k]) < half - 0.01)
            x, t = sign * (place[band, k] - border), place[band, 1 - k]
            offset, slope, sigma, angle = _border(x, t, mine[band], weights[band])
            outward, along = sign * axes[:, k], axes[:, 1 - k]
            point = center + axes[:, k] * (border + sign * offset)
            # Where the border runs outwards by `slope` per metre along.
            sides.append(
                FrontSide(
                    outward - slope * along, along + slope * outward, point, float(np.hypot(sigma, BORDER)), angle
                )
            )
    return tuple(sides)


def _border(x: np.ndarray, t: np.ndarray, mine: np.ndarray, areas: np.ndarray) -> tuple[float, float, float, float]:
    """Return where a border between own and other faces runs: place at t = 0, slope, and the standard deviations of both.

    Args:
        x: place across the border, outwards [m], shape [face].
        t: place along it [m], shape [face].
        mine: which faces are the front's own, shape [face].
        areas: of the faces, shape [face].
    """
    if mine.sum() < FEW or np.ptp(t) < BIN:
        return 0.0, 0.0, BAND / 2, np.inf
    last = _last(x[mine], t[mine])
    if (~mine).sum() < FEW:  # nothing beside it: the surface ends
        return last, 0.0, END, np.inf
    weight = np.minimum(areas / areas.mean(), HEAVIEST)
    scale = np.array([1.0, 0.01, max(0.01, float(np.std(t)))])
    design = np.column_stack([np.ones(len(x)), x, t]) / scale
    solution = np.array([0.0, -1.0, 0.0])
    ridge = np.diag([1e-3, 1e-2, 1e-3])
    for _ in range(40):
        chance = 1.0 / (1.0 + np.exp(-np.clip(design @ solution, -30, 30)))
        gradient = design.T @ (weight * (mine - chance)) - ridge @ (solution - [0.0, -1.0, 0.0])
        curvature = (design * (weight * chance * (1 - chance))[:, None]).T @ design + ridge
        step = np.linalg.solve(curvature, gradient)
        solution = solution + step / max(1.0, float(np.abs(step).max()))
    constant, across, along = solution / scale
    if across > -STEEP:  # own and other faces are mixed over more than the band: no border
        return last, 0.0, BAND / 2, np.inf
    covariance = np.linalg.inv(curvature) / np.outer(scale, scale) * SPREAD
    # place = -(constant + along t) / across
    offset, slope = -constant / across, -along / across
    sigma = float(np.sqrt(covariance[0, 0])) / abs(across)
    angle = float(np.sqrt(covariance[2, 2])) / abs(across)
    if offset < -BAND or abs(slope) > SKEW or angle > SKEW:
        return last, 0.0, END, np.inf
    return min(float(offset), last), float(slope), sigma, angle


def _last(x: np.ndarray, t: np.ndarray) -> float:
    """Return how far own faces reach outwards, typically along a border [m]: the median of the farthest in each 3 cm."""
    index = np.unique(np.floor(t / BIN), return_inverse=True)[1]
    farthest = np.full(index.max() + 1, -np.inf)
    np.maximum.at(farthest, index, x)
    return float(np.median(farthest))


NEAR = 0.015  # [m] Faces farther from the plane are no part of it: panels in a frame, mouldings, handles
RECTANGLE = 0.9  # Fill of its rectangle from which a front has straight sides; an ellipse fills 0.79


@dataclass(frozen=True)
class Seen:
    """A front as the scan shows it."""

    normal: np.ndarray  # unit, outwards, shape [3]
    center: np.ndarray  # a point of the plane, in the middle [m], shape [3]
    tilt: np.ndarray  # covariance of the normal's directions in the plane [rad^2], shape [3 3], of rank 2
    height: float  # standard deviation of the plane's place [m]
    sides: tuple[FrontSide, ...]  # the four sides; empty for a round front
    thickness: float  # of the part behind the plane, as far as it is seen [m]

    def sigma(self, direction: np.ndarray) -> float:
        """Return the standard deviation of the angle between the normal and a unit direction in the plane [3] [rad]."""
        return float(np.sqrt(direction @ self.tilt @ direction))


def seen_front(faces: Faces, part: str, front: Front) -> Seen | None:
    """Return what the scan tells of the front of a moving part, or None where it is too small to tell anything."""
    mesh = panel(faces.surface.scene, part)
    if not mesh.face_areas.any():
        return None
    normal, center, axes = _start(centroids(mesh), normals(mesh), mesh.face_areas.astype(float), front)
    points, facing, area = spread(mesh)
    for _ in range(3):
        height = (points - center) @ normal
        plane = (np.abs(height) < NEAR) & (np.abs(facing @ normal) > 0.8)
        if not plane.any():
            return None
        flat, height = (points[plane] - center) @ axes, height[plane]
        within = inner(flat)
        fitted = fitted_plane(flat[within], height[within], area)
        if fitted is None:
            return None
        (offset, *slope), covariance = fitted
        center = center + offset * normal
        normal = normal - axes @ np.array(slope)
        normal /= np.linalg.norm(normal)
        axes = _upright(axes, normal)
    tilt = axes @ covariance[1:, 1:] @ axes.T
    sides: tuple[FrontSide, ...] = ()
    if front.fill > RECTANGLE:
        sides = find_sides(faces, part, normal, center, axes, float(np.linalg.norm(front.size)))
    return Seen(normal, center, tilt, float(np.sqrt(covariance[0, 0])), sides, front.thickness)


def _upright(axes: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return the directions [3 2] turned into the plane across a normal."""
    axes = axes - np.outer(normal, normal @ axes)
    return axes / np.linalg.norm(axes, axis=0)


def _start(
    points: np.ndarray, facing: np.ndarray, areas: np.ndarray, front: Front
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return normal, centre and axes of the plane with most of a part's area near it.

    The largest plane of a window may run obliquely through its frame and its pane; what its faces look at does not.
    """
    planes = []
    like = facing @ front.normal
    mean = np.average(facing[like > 0.9], axis=0, weights=areas[like > 0.9]) if (like > 0.9).any() else front.normal
    for normal in (front.normal, mean / np.linalg.norm(mean)):
        height = (points - front.center) @ normal
        levels = np.arange(-0.05, 0.05, 0.002)
        near = np.abs(height[:, None] - levels) < FLAT
        area = areas @ near
        best = float(np.mean(levels[area >= area.max() * (1 - 1e-9)]))
        planes.append((float(area.max()), normal, front.center + best * normal))
    _, normal, center = max(planes, key=lambda item: item[0])
    return normal, center, _upright(front.axes, normal)
