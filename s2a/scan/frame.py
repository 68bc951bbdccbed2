"""Up axis and unit of a mesh: what its file states, checked against the room, or what the room alone tells."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from s2a.core.errors import InputError
from s2a.scan.source import Stated

UP = {
    "x": (1.0, 0.0, 0.0),
    "y": (0.0, 1.0, 0.0),
    "z": (0.0, 0.0, 1.0),
    "-x": (-1.0, 0.0, 0.0),
    "-y": (0.0, -1.0, 0.0),
    "-z": (0.0, 0.0, -1.0),
}
"""Directions in the file's frame, by name."""
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
"""Metres a unit."""
TYPICAL = (2.0, 3.6)
"""Heights of usual rooms [m]; so narrow that no height is one of them in two of the units."""
POSSIBLE = (1.5, 6.0)
"""Heights of scanned rooms [m], also without ceiling or with a high one."""
BELIEVED = (0.02, 15.0)
"""Heights [m] at which a file's own unit is believed: single objects to halls."""

_LEVEL = 0.95  # cosine; within 18 degrees
_ENDS = 0.12  # fraction of the height at either end in which floor and ceiling lie
_TOPS = 0.02  # fraction of the footprint that tops of furniture must exceed to count as evidence
_SEEN = 0.1  # of nine virtual rooms one had less (0.07), and is asked for
_CLEAR = 1.6  # factor by which the best direction has to beat the next


@dataclass(frozen=True)
class FileFrame:
    """How a file's coordinates become the scan's: z up, metres.

    Attributes:
        up: direction in the file, a key of UP.
        unit: metres a unit of the file.
        why_up: evidence for the direction.
        why_unit: evidence for the unit.
        doubts: what is uncertain, for a warning each.
    """

    up: str
    unit: float
    why_up: str
    why_unit: str
    doubts: tuple[str, ...] = ()

    @property
    def rotation(self) -> np.ndarray:
        """Rotation [3 3] of the file's coordinates; glTF's (x, y, z) becomes (x, -z, y)."""
        up = np.array(UP[self.up])
        kept = np.array(UP["y"] if abs(up[0]) else UP["x"])  # a horizontal direction that stays
        return np.stack([kept, np.cross(up, kept), up])

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Return points [point 3] with z up, in metres."""
        turned: np.ndarray = points @ self.rotation.T * self.unit
        return turned


def find(vertices: np.ndarray, faces: np.ndarray, stated: Stated, up: str, unit: str) -> FileFrame:
    """Return the frame: as given, else as the file states it, else as the room tells.

    Args:
        vertices: shape [vertex 3].
        faces: shape [face 3].
        stated: the file's own statement.
        up: a key of UP, or "auto".
        unit: a key of UNITS, or "auto".

    Raises:
        InputError: neither file nor room tells, or the room contradicts the file's unit.
    """
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    direction, why_up, doubts = _up(corners, normals, stated, up)
    height = _height(corners, normals, np.array(UP[direction]))
    factor, why_unit, more = _unit(height, stated, unit)
    return FileFrame(direction, factor, why_up, why_unit, (*doubts, *more))


def _up(corners: np.ndarray, normals: np.ndarray, stated: Stated, asked: str) -> tuple[str, str, tuple[str, ...]]:
    """Return the up direction, why, and doubts about it."""
    if asked != "auto":
        return asked, "as given", ()
    scores = {name: _floor_score(corners, normals, np.array(direction)) for name, direction in UP.items()}
    best, second = sorted(scores, key=lambda name: -scores[name])[:2]
    clear = scores[best] > _SEEN and scores[best] > _CLEAR * scores[second]
    told = ", ".join(f"{name} {score:.2f}" for name, score in scores.items())
    if stated.up:
        doubt = f"{stated.by} states {stated.up} up, but the floor seems to face {best} ({told}); if so, give up={best}"
        return stated.up, f"stated by {stated.by}", (doubt,) if clear and best != stated.up else ()
    if not clear:
        raise InputError(
            f"the up axis cannot be told from the room (floor evidence: {told}); give up=y or up=z (or x, -x, -y, -z)"
        )
    return best, f"floor evidence {scores[best]:.2f}, next {second} {scores[second]:.2f}", ()


def _floor_score(corners: np.ndarray, normals: np.ndarray, up: np.ndarray) -> float:
    """Return how much a room looks as if a direction were up, 0 to 1: coverage of the footprint by a floor, times asymmetry.

    Floor and ceiling face each other as opposite walls do. But between them tops of furniture outweigh the undersides, while the
    fronts of furniture along opposite walls balance.
    """
    area = np.linalg.norm(normals, axis=1) / 2
    facing = normals @ up / np.maximum(2 * area, np.finfo(float).tiny)
    low, high = _span(corners, area, up)
    across = [np.subtract(*_span(corners, area, axis)[::-1]) for axis in np.eye(3)[np.abs(up) < 0.5]]
    footprint = float(np.prod(across))
    if footprint <= 0 or high <= low:
        return 0.0
    height = (corners.mean(axis=1) @ up - low) / (high - low)
    between = (height > _ENDS) & (height < 1 - _ENDS)
    tops, undersides = (float(area[between & (sign * facing > _LEVEL)].sum()) for sign in (1, -1))
    floor = float(area[(facing > _LEVEL) & (height <= _ENDS)].sum())
    asymmetry = (tops - undersides) / (tops + undersides + _TOPS * footprint)
    return min(1.0, floor / footprint) * max(0.0, asymmetry)


def _span(corners: np.ndarray, area: np.ndarray, axis: np.ndarray) -> tuple[float, float]:
    """Return between which coordinates along an axis all but 1 % of the area lies, at either end."""
    along = corners.mean(axis=1) @ axis
    order = np.argsort(along)
    total = np.cumsum(area[order])
    low, high = np.searchsorted(total, [0.01 * total[-1], 0.99 * total[-1]])
    return float(along[order][low]), float(along[order][min(high, len(order) - 1)])


def _height(corners: np.ndarray, normals: np.ndarray, up: np.ndarray) -> float:
    """Return the height of what was scanned, in the file's unit."""
    along = corners @ up
    if len(corners) < 100:  # quantiles of centres of a few large faces say little
        return float(np.ptp(along))
    low, high = _span(corners, np.linalg.norm(normals, axis=1), up)
    return high - low


def _unit(height: float, stated: Stated, asked: str) -> tuple[float, str, tuple[str, ...]]:
    """Return metres a unit, why, and doubts about it."""
    if asked != "auto":
        return UNITS[asked], "as given", ()
    usual = [name for name, factor in UNITS.items() if TYPICAL[0] <= factor * height <= TYPICAL[1]]
    possible = [name for name, factor in UNITS.items() if POSSIBLE[0] <= factor * height <= POSSIBLE[1]]
    if stated.unit is not None:
        return stated.unit, f"stated by {stated.by}", _stated_doubts(height, stated, possible)
    if usual:
        return UNITS[usual[0]], f"the room is {height * UNITS[usual[0]]:.2f} m high in {usual[0]}", ()
    if len(possible) == 1:
        doubt = f"the room would be {height * UNITS[possible[0]]:.2f} m high in {possible[0]}; if it is not, give unit="
        return UNITS[possible[0]], f"the only unit in which {height:.4g} is a room's height", (doubt + "m|cm|mm|in",)
    raise InputError(
        f"the unit cannot be told: what was scanned is {height:.4g} units high, "
        f"{'a room in ' + ' and in '.join(possible) if possible else 'no room in m, cm, mm or in'}; give unit=m|cm|mm|in"
    )


def _stated_doubts(height: float, stated: Stated, possible: list[str]) -> tuple[str, ...]:
    """Return doubts about a stated unit.

    Raises:
        InputError: what was scanned is no room in it, but one in another.
    """
    assert stated.unit is not None
    metres = height * stated.unit
    if BELIEVED[0] <= metres <= BELIEVED[1]:
        usual = POSSIBLE[0] <= metres <= POSSIBLE[1]
        return () if usual else (f"what was scanned is {metres:.3g} m high; if that is wrong, give unit=",)
    other = f", but a room in {' or '.join(possible)}" if possible else ""
    give = f"unit={possible[0]}" if possible else "unit=m|cm|mm|in"
    raise InputError(
        f"{stated.by} states {stated.unit:g} m a unit, in which what was scanned is {metres:.4g} m high{other}; give {give}"
    )
