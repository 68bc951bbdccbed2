"""Up direction and unit of a mesh: what its file states, checked against the room, or what the room alone tells."""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from s2a.core.errors import InputError
from s2a.scan import upright
from s2a.scan.source import Stated
from s2a.scan.surfels import Sampled, sample
from s2a.scan.upright import Candidate

UP = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
UP |= {"-x": (-1.0, 0.0, 0.0), "-y": (0.0, -1.0, 0.0), "-z": (0.0, 0.0, -1.0)}
"""Directions in the file's frame, by name."""
UNITS = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}  # Metres a unit
TYPICAL = (2.0, 3.6)  # Heights of usual rooms [m]; so narrow that no height is one of them in two of the units
POSSIBLE = (1.5, 6.0)  # Heights of scanned rooms [m], also without ceiling or with a high one
# Heights [m] of parts of rooms, and of stairwells: believed in metres, which nearly all capture programs write
PARTIAL = (0.6, 8.0)
BELIEVED = (0.02, 15.0)  # Heights [m] at which a file's own unit is believed: single objects to halls

_SAME = 12.0  # deg; a stated axis and a direction of the surface this near are the same
_ALIGNED = 1.0  # deg; a direction this near to an axis of the file is that axis: programs that know gravity write it so
_TILT = 2.0  # deg; a floor that tilts more is worth a warning
_RATHER = 3.0  # factor by which the surface alone prefers another direction than the stated, for a warning
_SURE_BY_HINT = 0.9  # confidence that is enough where the poses of cameras or labels speak, too
_STATED, _HINT, _HABIT, _AXIS = 5.0, 6.0, 3.0, 0.7  # what each adds to the logarithm of the odds

_PROGRAMS = (
    (r"scene\d{4}_\d{2}_vh_clean(_2)?(\.labels)?\.ply", "z", "ScanNet"),
    (r"scene_\d{5}_\d{2}\.ply", "z", "MultiScan"),
    (r"mesh_aligned_0\.05\.ply", "z", "ScanNet++"),
    (r"\d+_3dod_mesh\.ply", "z", "ARKitScenes"),
    (r"\w*SpatialMapping\w*\.obj", "y", "HoloLens"),
    (r"textured_output\.obj", "y", "3d Scanner App"),
)


@dataclass(frozen=True, eq=False)
class Hint:
    """An up direction for which more than the surface speaks."""

    up: np.ndarray  # unit, in the file's coordinates, shape [3]
    by: str  # what speaks for it: "the cameras", "the labels"


@dataclass(frozen=True)
class FileFrame:
    """How a file's coordinates become the scan's: z up, metres."""

    up: tuple[float, float, float]  # unit vector in the file's coordinates
    unit: float  # metres a unit of the file
    why_up: str  # evidence for the direction
    why_unit: str  # evidence for the unit
    confidence: float | None = None  # probability that the direction is right; None where it was given
    doubts: tuple[str, ...] = ()  # what is uncertain, for a warning each

    @property
    def name(self) -> str:
        """The direction, as a key of UP or as a vector."""
        return name(np.array(self.up))

    @property
    def tilt(self) -> float:
        """Angle between the direction and the nearest axis of the file [deg]."""
        return _angle(np.array(self.up), np.array(UP[_axis(np.array(self.up))]))

    @property
    def rotation(self) -> np.ndarray:
        """Rotation [3 3] of the file's coordinates; glTF's (x, y, z) becomes (x, -z, y)."""
        axis = np.array(UP[_axis(np.array(self.up))])
        fixed = np.array(UP["y"] if abs(axis[0]) else UP["x"])  # a horizontal direction that stays
        turn = np.stack([fixed, np.cross(axis, fixed), axis])
        leveled: np.ndarray = _to_z(turn @ np.array(self.up)) @ turn
        return leveled

    def apply(self, points: np.ndarray) -> np.ndarray:
        """Return points [point 3] with z up, in metres."""
        turned: np.ndarray = points @ self.rotation.T * self.unit
        return turned

    def summary(self) -> str:
        """Return what was done, in one line."""
        sure = "as given" if self.confidence is None else f"confidence {self.confidence:.2f}"
        leveled = f", levelled by {self.tilt:.1f} deg" if self.tilt > 1e-3 else ""
        return f"up: {self.name}{leveled}; {sure}; unit {self.unit_name}"

    @property
    def unit_name(self) -> str:
        """The unit, as a key of UNITS or in metres."""
        return next((key for key, metres in UNITS.items() if metres == self.unit), f"{self.unit:g} m")


def find(
    vertices: np.ndarray,
    faces: np.ndarray,
    stated: Stated,
    up: str | Sequence[float],
    unit: str,
    level: bool = False,
    habit: Stated | None = None,
    hint: Hint | None = None,
) -> FileFrame:
    """Return the frame: as given, else as the file states it, else as its name or the room tells.

    Args:
        vertices: shape [vertex 3].
        faces: counter-clockwise as seen from the room, shape [face 3].
        stated: the file's own statement.
        up: a key of UP, a vector of any length, or "auto".
        unit: a key of UNITS, or "auto".
        level: Correct the direction to the floor's, up to `upright.CORRECTED` degrees.
        habit: the frame that files of such a name have; None for any other name.
        hint: what the poses of cameras or the labels of the capture speak for; None without.

    Raises:
        InputError: neither file nor room tells, or the room contradicts the file.
    """
    mesh = sample(vertices, faces)
    statement = stated if stated.up or not habit else Stated(habit.up, stated.unit or habit.unit, habit.by)
    if isinstance(up, str) and up == "auto":
        metres, named = UNITS.get(unit, statement.unit), stated.up is None
        direction, why, confidence, doubts = _detect(mesh, statement, metres, named, hint)
    else:
        direction, why, confidence, doubts = _given(up), "as given", None, ()
    direction, why, tilted = _leveled(mesh, direction, why, level)
    # Quantiles of a few large faces say little.
    height = mesh.height(direction) if len(faces) >= 100 else float(np.ptp(vertices[faces].reshape(-1, 3) @ direction))
    factor, why_unit, more = _unit(height, statement, unit)
    values = tuple(float(x) for x in direction)
    return FileFrame((values[0], values[1], values[2]), factor, why, why_unit, confidence, (*doubts, *tilted, *more))


def by_name(path: Path) -> Stated | None:
    """Return the frame, in metres, that the program behind a file's name writes; None for any other name."""
    for pattern, up, program in _PROGRAMS:
        if re.fullmatch(pattern, path.name):
            return Stated(up, 1.0, f"{program}'s file name")
    return None


def name(direction: np.ndarray) -> str:
    """Return a direction [3] as a key of UP where it is one, else as a vector."""
    axis = _axis(direction)
    if np.allclose(direction, UP[axis], atol=1e-6):
        return axis
    return "(" + ", ".join(f"{x + 0.0:.2f}" for x in direction) + ")"


def _given(up: str | Sequence[float]) -> np.ndarray:
    """Return a direction that was asked for, unit, shape [3]."""
    if isinstance(up, str):
        if up not in UP:
            raise InputError(f"key 'up' is {up!r}; possible: auto, {', '.join(UP)}, or a vector as up=[0,-0.8,-0.6]")
        return np.array(UP[up])
    vector = np.array(up, dtype=float)
    length = float(np.linalg.norm(vector))
    if vector.shape != (3,) or not np.isfinite(vector).all() or length < 1e-9:
        raise InputError(f"key 'up' is {list(up)}; give three finite numbers that are not all 0, as up=[0,-0.8,-0.6]")
    direction: np.ndarray = vector / length
    return direction


def _detect(
    mesh: Sampled, stated: Stated, metres: float | None, named: bool, hint: Hint | None
) -> tuple[np.ndarray, str, float, tuple[str, ...]]:
    """Return the up direction, why, its probability, and doubts about it.

    Raises:
        InputError: it is not clear, or the surface contradicts the statement.
    """
    candidates = upright.candidates(mesh, metres)
    if stated.up is None:
        return _undeclared(mesh, candidates, hint)
    axis = np.array(UP[stated.up])
    odds = _odds(candidates, axis, _HABIT if named else _STATED)
    if not candidates:
        return axis, f"stated by {stated.by}", 1.0, ()
    alone = _odds(candidates, None, 0.0)
    best, own = int(np.argmax(alone)), min(range(len(candidates)), key=lambda i: _angle(candidates[i].up, axis))
    sure = alone[best] >= upright.required(candidates, candidates[best]) and not upright.reasons(candidates[best])
    flat = _angle(candidates[own].up, axis) < _SAME
    if flat and (not sure or int(np.argmax(odds)) == own):
        rather = alone[best] > _RATHER * alone[own]
        doubt = f"the surface agrees better with {_list(candidates, alone)}; check image=FILE.png, or give up="
        return axis, f"stated by {stated.by}", float(odds[own]), (doubt,) if rather else ()
    if sure and not flat:
        doubt = f"{stated.by} states {stated.up} up, but no horizontal surface faces it; the room is levelled by its surface"
        return candidates[best].up, "by the surface, against the file", float(alone[best]), (doubt,)
    raise InputError(
        f"{stated.by} states {stated.up} up, but the surface agrees with {_list(candidates, alone)}; "
        f"give up={stated.up} or another direction"
    )


def _undeclared(
    mesh: Sampled, candidates: list[Candidate], hint: Hint | None
) -> tuple[np.ndarray, str, float, tuple[str, ...]]:
    """Return the up direction that the surface and a hint tell, why, its probability, and doubts about it.

    Raises:
        InputError: it is not clear.
    """
    give = "give up=y or up=z (or x, -x, -y, -z) or a vector, as up=[0,-0.8,-0.6]"
    if not candidates:
        raise InputError(f"the up axis cannot be determined from the surface, which has no flat region; {give}")
    odds = _odds(candidates, hint.up if hint else None, _HINT)
    best = int(np.argmax(odds))
    # A hint, too, tells a strip along a wall from a low room, and a table top from a floor.
    reasons = [] if hint else upright.reasons(candidates[best])
    needed = _SURE_BY_HINT if hint else upright.required(candidates, candidates[best])
    if odds[best] < needed or reasons:
        why = f" ({'; '.join(reasons)})" if reasons else f" (less sure than {needed:.2f})"
        raise InputError(f"the up axis cannot be determined from the room{why}: {_list(candidates, odds)}; {give}")
    floor = upright.floor_normal(mesh, candidates[best].up)
    direction = candidates[best].up if floor is None else floor
    axis = _axis(direction)
    if _angle(direction, np.array(UP[axis])) < _ALIGNED:
        direction = np.array(UP[axis])
    if hint:
        alone = _odds(candidates, None, 0.0)
        doubt = f"the surface alone agrees better with {_list(candidates, alone)}; check image=FILE.png, or give up="
        doubts = (doubt,) if alone.max() > _RATHER * alone[best] else ()
        return direction, f"by the surface and {hint.by}", float(odds[best]), doubts
    doubt = "a side of the room was not scanned, so that up is not certain; check image=FILE.png, or give up="
    return direction, "by the surface", float(odds[best]), (doubt,) if odds[best] < upright.certain(candidates) else ()


def _odds(candidates: list[Candidate], stated: np.ndarray | None, belief: float) -> np.ndarray:
    """Return the probability of each candidate, given what is stated."""
    if not candidates:
        return np.zeros(0)
    scores = np.array([candidate.score for candidate in candidates])
    for i, candidate in enumerate(candidates):
        if stated is not None:
            scores[i] += belief * (_angle(candidate.up, stated) < _SAME)
        else:
            scores[i] += _AXIS * (min(_angle(candidate.up, np.array(UP[axis])) for axis in ("y", "z", "-y")) < _ALIGNED)
    powers = np.exp(scores - scores.max())
    odds: np.ndarray = powers / powers.sum()
    return odds


def _list(candidates: list[Candidate], odds: np.ndarray) -> str:
    texts = []
    for i in np.argsort(-odds)[:3]:
        up, axis = candidates[i].up, _axis(candidates[i].up)
        aligned = _angle(up, np.array(UP[axis])) < _ALIGNED
        texts.append(f"{axis if aligned else '[' + ','.join(f'{x + 0.0:.2f}' for x in up) + ']'} {odds[i]:.2f}")
    return ", ".join(texts)


def _leveled(mesh: Sampled, direction: np.ndarray, why: str, level: bool) -> tuple[np.ndarray, str, tuple[str, ...]]:
    """Return a direction, corrected to the floor's if asked; else a doubt if the floor tilts much against it.

    Raises:
        InputError: it shall be corrected, and there is no floor.
    """
    floor = upright.floor_normal(mesh, direction)
    if floor is None:
        if not level:
            return direction, why, ()
        raise InputError(f"no floor lies within {upright.CORRECTED:g} deg of up {name(direction)}; give level=false")
    tilt = _angle(floor, direction)
    if level:
        return floor, f"{why}, corrected by {tilt:.2f} deg to the floor", ()
    doubt = f"the floor tilts by {tilt:.1f} deg; if that is an error, give level=true"
    return direction, why, (doubt,) if tilt > _TILT else ()


def _axis(direction: np.ndarray) -> str:
    """Return the key of UP that is nearest to a direction [3]."""
    return max(UP, key=lambda key: float(np.array(UP[key]) @ direction))


def _angle(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.degrees(np.arctan2(np.linalg.norm(np.cross(first, second)), first @ second)))


def _to_z(direction: np.ndarray) -> np.ndarray:
    """Return the smallest rotation [3 3] that turns a unit vector within 90 degrees of z to z."""
    x, y, z = direction
    if z > 1 - 1e-15:
        return np.eye(3)
    scale = 1 / (1 + z)
    return np.array([[1 - x * x * scale, -x * y * scale, -x], [-x * y * scale, 1 - y * y * scale, -y], [x, y, z]])


def _unit(height: float, stated: Stated, unit: str) -> tuple[float, str, tuple[str, ...]]:
    if unit != "auto":
        return UNITS[unit], "as given", ()
    usual = [key for key, factor in UNITS.items() if TYPICAL[0] <= factor * height <= TYPICAL[1]]
    possible = [key for key, factor in UNITS.items() if POSSIBLE[0] <= factor * height <= POSSIBLE[1]]
    if stated.unit is not None:
        return stated.unit, f"stated by {stated.by}", _stated_doubts(height, stated, possible)
    if usual:
        return UNITS[usual[0]], f"the room is {height * UNITS[usual[0]]:.2f} m high in {usual[0]}", ()
    if PARTIAL[0] <= height <= PARTIAL[1]:
        return 1.0, f"{height:.2f} m high in m: a part of a room, or a high one", ()
    if len(possible) == 1:
        doubt = f"the room would be {height * UNITS[possible[0]]:.2f} m high in {possible[0]}; if it is not, give unit="
        return UNITS[possible[0]], f"the only unit in which {height:.4g} is a room's height", (doubt + "m|cm|mm|in",)
    raise InputError(
        f"the unit cannot be determined: what was scanned is {height:.4g} units high, "
        f"{'a room in ' + ' and in '.join(possible) if possible else 'no room in m, cm, mm or in'}; give unit=m|cm|mm|in"
    )


def _stated_doubts(height: float, stated: Stated, possible: list[str]) -> tuple[str, ...]:
    """Return doubts about a stated unit; InputError: what was scanned is no room in it, but one in another."""
    assert stated.unit is not None
    metres = height * stated.unit
    if BELIEVED[0] <= metres <= BELIEVED[1]:
        usual = PARTIAL[0] <= metres <= PARTIAL[1]
        return () if usual else (f"what was scanned is {metres:.3g} m high; if that is wrong, give unit=",)
    other = f", but a room in {' or '.join(possible)}" if possible else ""
    give = f"unit={possible[0]}" if possible else "unit=m|cm|mm|in"
    raise InputError(
        f"{stated.by} states {stated.unit:g} m a unit, in which what was scanned is {metres:.4g} m high{other}; give {give}"
    )
