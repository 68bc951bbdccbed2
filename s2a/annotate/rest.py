"""What nobody annotated, as floor, ceiling, walls and connected objects, so that each gets colliders of its own.

Taken as one part, a room becomes convex hulls that reach through its free space.
"""

from __future__ import annotations

import numpy as np

from s2a.annotate.surface import SplitSurface, connected

LEVEL, UPRIGHT = 0.9, 0.3
"""Vertical component of the normals of level faces, at least, and of upright ones, at most."""
THICK = 0.06
"""[m] Faces this near to a wall's, floor's or ceiling's plane are its own."""
WALL_AREA, WALL_HEIGHT = 1.2, 1.6
"""[m^2] and [m] from which an upright plane is one of the structure: a wall, or a wardrobe's side, which a box fits as well."""
TURNS = 36
"""Azimuths that are tried, over the full circle."""
STEP = 0.02
"""[m] Bins of the offsets of planes."""
MIN_OBJECT = 0.02
"""[m^2] Smaller pieces go to the structure, whose boxes leave them out."""


def divide(surface: SplitSurface, free: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return labels and faces of what is left of a scan.

    Args:
        surface: the scan, z up.
        free: which faces nobody has, shape [face].
    """
    left = free & (surface.source >= 0)
    found = [(label, faces) for label, faces in _level(surface, left) if len(faces)]
    for _, faces in found:
        left[faces] = False
    walls = _walls(surface, left)
    for faces in walls:
        left[faces] = False
    found += [("wall", faces) for faces in walls]
    some = np.flatnonzero(left)
    if not len(some):
        return found
    number = connected(surface.adjacent(some), len(some))
    large = np.bincount(number, surface.areas[some]) >= MIN_OBJECT
    objects = [("object", some[number == index]) for index in np.flatnonzero(large)]
    bits = some[~large[number]]
    if len(bits) and found:
        found[0] = (found[0][0], np.sort(np.concatenate([found[0][1], bits])))
    return found + objects


def _level(surface: SplitSurface, left: np.ndarray) -> list[tuple[str, np.ndarray]]:
    """Return the floor and the ceiling: level faces near the lowest, and the highest, height with much of them."""
    found = []
    height = surface.middles[:, 2]
    for label, sign in (("floor", 1.0), ("ceiling", -1.0)):
        level = left & (sign * surface.normals[:, 2] > LEVEL)
        planes = _planes(sign * height[level], surface.areas[level], WALL_AREA)
        if planes:
            found.append((label, np.flatnonzero(level & (np.abs(sign * height - min(planes)) < THICK))))
    return found


def _walls(surface: SplitSurface, left: np.ndarray) -> list[np.ndarray]:
    """Return the faces of each upright plane that is large and high."""
    left, found = left.copy(), []
    upright = np.abs(surface.normals[:, 2]) < UPRIGHT
    azimuth = np.arctan2(surface.normals[:, 1], surface.normals[:, 0])
    sector = ((azimuth + np.pi) / (2 * np.pi) * TURNS).astype(int) % TURNS
    areas = np.bincount(sector[upright & left], surface.areas[upright & left], TURNS)
    for index in np.argsort(-areas):
        near = np.isin(sector, [(index + k) % TURNS for k in (-1, 0, 1)]) & upright & left
        if surface.areas[near].sum() < WALL_AREA:
            continue
        normal = surface.areas[near] @ surface.normals[near] * [1.0, 1.0, 0.0]
        offset = surface.middles @ (normal / np.linalg.norm(normal))
        for plane in _planes(offset[near], surface.areas[near], WALL_AREA):
            faces = np.flatnonzero(near & left & (np.abs(offset - plane) < THICK))
            if surface.areas[faces].sum() >= WALL_AREA and np.ptp(surface.middles[faces, 2]) > WALL_HEIGHT:
                found.append(faces)
                left[faces] = False
    return found


def _planes(offsets: np.ndarray, areas: np.ndarray, least: float) -> list[float]:
    """Return the offsets [m] around which there is so much area [m^2], most first."""
    if not len(offsets):
        return []
    low = offsets.min()
    full = np.bincount(((offsets - low) / STEP).astype(int), areas)
    reach = round(THICK / STEP)
    found: list[float] = []
    while True:
        sums = np.convolve(full, np.ones(2 * reach + 1), "same")
        peak = int(np.argmax(sums))
        if sums[peak] < least:
            return found
        window = slice(max(peak - reach, 0), peak + reach + 1)
        places = low + (np.arange(len(full))[window] + 0.5) * STEP
        found.append(float(np.average(places, weights=full[window])))
        full[window] = 0.0
