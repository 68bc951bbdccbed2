"""The plane of a scanned front, with the uncertainty that noise leaves which neighbouring places share.

A scanner's noise is shared over an angle (`conf/synth`: 30 mrad), so over 5 cm at 1.6 m and over 12 cm at 4 m; how far it was
away, a scan does not say. So that length is told by the front's own residuals: generalised least squares with each of LENGTHS,
averaged by their restricted likelihoods. Cells of equal area are fitted, for a mesh has small faces where it bends and large
ones where it is flat; and not the border, which scanning rounds off.
"""

from __future__ import annotations

import numpy as np

from s2a.scene.geometry.mesh_ops import normals, sample_with_faces
from s2a.scene.scene import Mesh

CELL = 0.05
"""[m] Largest width of the cells whose mean heights are fitted, unless there would be more than MOST."""
MIN_CELL = 0.015
"""[m] Smallest one."""
MOST = 150
"""Cells in a front's rectangle; larger fronts get wider cells."""
DENSITY, FEWEST, LARGEST = 25_000.0, 2_000, 60_000
"""Points that stand for a surface: per m^2, at least, at most."""
BORDER = 0.008
"""[m] So much of a front's border is left out: a voxel (`conf/synth/demo.yaml`: 6 mm) rounds the edge off, and annotated borders
are ragged by 2.5 mm. Between 3 and 12 mm it matters little (0.125 to 0.137 degrees up and down, root mean square, of the fronts
of docs/refinement.md's first row); with the border it is 0.16."""
FILLED = 0.2
"""Cells of which less is seen do not count."""
OFF = 2.5
"""Times the cells' scatter; what is farther off is no noise but a moulding or a handle."""
MIN_SCATTER = 0.0004
"""[m] A cell's height is not known better, however well the cells of a small front agree."""
WORTH = 3
"""Residuals that MIN_SCATTER is worth."""
LENGTHS = np.geomspace(0.02, 0.22, 7)
"""[m] Over which noise may be shared: 30 mrad from 0.7 to 7 m."""
OWN = 0.1
"""Of a whole cell's variance that it shares with none, of the variance that it shares."""


def spread(mesh: Mesh) -> tuple[np.ndarray, np.ndarray, float]:
    """Return points spread evenly over a surface [m], shape [point 3], its normals there, and the area of each point [m^2]."""
    area = float(mesh.face_areas.sum())
    count = int(np.clip(area * DENSITY, FEWEST, LARGEST))
    points, faces = sample_with_faces(mesh, count, 0)
    return points, normals(mesh)[faces], area / count


def inner(flat: np.ndarray) -> np.ndarray:
    """Return which places of a front [point 2] do not lie at its border [point]; the ends of a narrow one are closer."""
    low, high = np.quantile(flat, [0.005, 0.995], axis=0)
    border = np.minimum(BORDER, (high - low) / 6)
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
    found = sum(weight * fit[1] for weight, fit in zip(weights, fits, strict=True))
    both = [fit[2] + np.outer(fit[1] - found, fit[1] - found) for fit in fits]
    return np.asarray(found), np.einsum("l,lij->ij", weights, np.array(both))


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
