"""The up direction of a room from its surface alone: what stands on the floor, what looks up, how high rooms are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import ndimage

from s2a.scan.surfels import Sampled, Surfels, cos
from s2a.scene.geometry.occupancy import connected_cells

# Weight of each kind of evidence in the logarithm of a direction's odds, as tools/bench_upright.py fits them
WEIGHTS = {
    "height": 2.4,  # it is as large as rooms are high
    "tops": 0.9,  # more looks up than down
    "furniture": 0.8,  # more looks up in the lower half than down in the upper half
    "floor": 2.3,  # the lowest level surface covers the footprint
    "seen_above": 1.3,  # something that looks up covers the footprint
    "standing": 2.4,  # objects reach the floor
    "hanging": -1.0,  # objects reach the ceiling
    "standing_deep": 1.9,  # so do objects without what is near to a wall
    "hanging_deep": -0.6,
    "gap": 0.8,  # objects away from the walls are nearer to the floor than to the ceiling
    "low": 1.7,  # and begin near to the floor
    "turned": 2.3,  # what is askew is turned about this axis
    "plinths": -2.1,  # tops are as high as this furniture
    "tables": 2.3,
    "chests": 0.6,
    "shelves": -0.5,
}
SURE = 0.98  # Confidence from which on a direction is believed for a part of a room
# Confidence from which on a direction is believed along which a scan is narrow: it may be a strip along a
# wall on its back
SURE_OF_STRIP = 0.995
SURE_OF_WHOLE = 0.7  # Confidence from which on a direction is believed for a closed room
# Confidence without a doubt where a side of the room is missing: of an open room, and of one closed otherwise
CERTAIN = (0.992, 0.998)
# A direction counts if at least this much of what lies along or across the best one lies along or across it
FAMILIAR = 0.75

CORRECTED = 15.0  # Largest tilt of a floor that is corrected [deg]

_SIDE = 12.0  # deg; a surfel faces along or across a direction within this angle
_LEVEL = 18.0  # deg; a surfel is level within this angle
_WALLS = 25.0  # deg; rough walls face inwards within this angle
_RIM = 0.06  # fraction of an extent at either end in which floor, ceiling and walls lie
_DEPTHS = (0.06, 0.12)  # fractions of an extent at either end that are cut off to part objects
_PLANE = 0.02  # fraction of the surface in one plane that makes it a wall, a floor or a large front
_COMPONENT = 8e-4  # fraction of the surface from which on a component is an object
# Heights of furniture [m]
_BENCHES = {"plinths": (0.10, 0.34), "tables": (0.67, 0.80), "chests": (0.98, 1.40), "shelves": (1.40, 2.00)}
_FLOOR, _UPRIGHT = 0.15, 0.05  # fraction of the footprint that the floor, and of the surface that walls at least are
_FLOOR_POINTS = 200  # samples in a floor, from which on its plane is fitted
_CLOSED = (0.62, 0.72, 0.80)  # mean coverage of six sides: of a part of a room, most rooms without ceiling, whole ones
_MISSING = (0.3, 0.5)  # coverage of a side that was not scanned, and of one that was, at least
_NARROW = 1.8  # m; what is narrower is no whole room


@dataclass(frozen=True)
class Candidate:
    """A direction that may be up."""

    up: np.ndarray  # unit, in the mesh's coordinates, shape [3]
    evidence: dict[str, float]  # what speaks for it, by the keys of WEIGHTS

    @property
    def score(self) -> float:
        """Logarithm of the odds, up to what is common to all candidates."""
        return sum(weight * self.evidence[name] for name, weight in WEIGHTS.items())


@dataclass(frozen=True, eq=False)
class Clutter:
    """What stands in a room: surfels beside its walls, floor, ceiling and large planes, in connected components."""

    index: np.ndarray  # surfels, shape [member]
    label: np.ndarray  # component of each, shape [member]
    weight: np.ndarray  # square root of each component's part of the surface; 0 for crumbs, shape [component]


def candidates(mesh: Sampled, metres: float | None = None) -> list[Candidate]:
    """Return the directions that may be up, with the evidence for each, the likeliest first.

    Args:
        mesh: with faces counter-clockwise as seen from the room.
        metres: metres a unit; None where it is not known.

    Returns:
        an empty list for a surface without flat parts.
    """
    surface, axes = mesh.surfels, mesh.directions
    if not len(axes):
        return []
    along = np.abs(surface.normals @ axes.T)
    square = ((along > cos(_SIDE)) | (along < cos(90 - _SIDE))).T @ surface.weights
    axes = axes[square > FAMILIAR * square.max()]
    shell = _shell(surface, axes)
    planes = shell | _planes(surface, axes)
    clutter = {depth: _clutter(surface, planes | _near_sides(surface, axes, depth)) for depth in _DEPTHS}
    turned = _turned(surface, axes, planes)
    longest = max(np.subtract(*surface.extent(axis)[::-1]) for axis in axes)
    scale = metres or next((unit for unit in (1.0, 0.01, 0.001) if longest * unit < 30.0), 0.001)
    directions = [
        Candidate(up, _evidence(surface, up, shell, clutter, scale) | {"turned": turned[i]})
        for i, axis in enumerate(axes)
        for up in (axis, -axis)
    ]
    return sorted(directions, key=lambda candidate: -candidate.score)


def required(candidates: list[Candidate], best: Candidate) -> float:
    """Return the confidence from which on the likeliest candidate is believed.

    Closed rooms are told apart well. Half a room or a strip along one wall may look like a whole room lying on its side.
    """
    if best.evidence["extent"] < _NARROW:
        return SURE_OF_STRIP
    sides = sorted(candidates, key=lambda candidate: -candidate.evidence["floor"])[:6]
    if min(side.evidence["extent"] for side in sides) < _NARROW:
        return SURE
    closed = float(np.mean([side.evidence["floor"] for side in sides]))
    return float(np.interp(closed, _CLOSED, (SURE, SURE_OF_WHOLE + 0.1, SURE_OF_WHOLE)))


def certain(candidates: list[Candidate]) -> float:
    """Return the confidence from which on the likeliest candidate, once believed, is told without a doubt.

    Half a room looks like a room without ceiling that lies on its side, and a closed room's half has more of such walls.
    """
    sides = sorted(candidates, key=lambda candidate: -candidate.evidence["floor"])[:6]
    if min(side.evidence["extent"] for side in sides) < _NARROW:
        return CERTAIN[1]
    covered = [side.evidence["floor"] for side in sides]
    part = float(np.interp(np.mean(covered), _CLOSED[:2], CERTAIN))
    return float(np.interp(min(covered), _MISSING, (part, SURE_OF_WHOLE)))


def reasons(candidate: Candidate) -> list[str]:
    """Return why a direction should not be believed, however much likelier than the others it is."""
    evidence = candidate.evidence
    doubts = {
        "no floor is seen": evidence["floor"] < _FLOOR,
        "no walls are seen": evidence["walls"] < _UPRIGHT,
        "its outer faces look outwards": evidence["inwards"] < 0.0,
    }
    return [reason for reason, holds in doubts.items() if holds]


def floor_normal(mesh: Sampled, up: np.ndarray) -> np.ndarray | None:
    """Return the floor's normal, unit, shape [3]; None where nothing flat faces within CORRECTED degrees of a direction."""
    points, normals, surface, axes = mesh.points, mesh.normals, mesh.surfels, mesh.directions
    if not len(axes):
        return None
    axis: np.ndarray = axes[int(np.argmax(np.abs(axes @ up)))]
    axis = axis * np.sign(axis @ up)
    if axis @ up < cos(CORRECTED):
        return None
    low, high = surface.extent(axis)
    top = surface.normals @ axis > cos(_LEVEL)
    floor = low + _lowest(surface.points @ axis - low, high - low, top, surface.weights, surface.cell)
    chosen = (normals @ axis > cos(_LEVEL)) & (np.abs(points @ axis - floor) < 1.5 * surface.cell)
    normal = axis
    for tail in (1.0, 0.8, 0.7):
        if chosen.sum() < _FLOOR_POINTS:
            return axis
        middle = points[chosen].mean(axis=0)
        normal = np.linalg.svd(points[chosen] - middle, full_matrices=False)[2][2]
        normal = normal * np.sign(normal @ axis)
        off = np.abs((points - middle) @ normal)
        chosen &= off <= np.quantile(off[chosen], tail)
    # A strip of floor says little about the tilt across it.
    return normal if normal @ axis > cos(3.0) else axis


def _shell(surface: Surfels, axes: np.ndarray) -> np.ndarray:
    """Return which surfels look inwards from either end along an axis: floor, ceiling and outer walls, shape [surfel]."""
    shell = np.zeros(len(surface.points), bool)
    for axis in np.concatenate([axes, -axes]):
        low, high = surface.extent(axis)
        near = surface.points @ axis < low + max(2.5 * surface.cell, _RIM * (high - low))
        shell |= near & (surface.normals @ axis > cos(_WALLS))
    return shell


def _planes(surface: Surfels, axes: np.ndarray) -> np.ndarray:
    """Return which surfels lie in a large plane, shape [surfel]."""
    planes = np.zeros(len(surface.points), bool)
    for axis in axes:
        along = surface.points @ axis
        layer = np.floor((along - along.min()) / surface.cell).astype(int)
        for facing in (surface.normals @ axis, -surface.normals @ axis):
            flat = facing > cos(15)
            filled = np.convolve(np.bincount(layer[flat], surface.weights[flat], layer.max() + 1), np.ones(3), "same")
            planes |= (facing > cos(30)) & (filled[layer] > _PLANE)
    return planes


def _near_sides(surface: Surfels, axes: np.ndarray, depth: float) -> np.ndarray:
    """Return which surfels are near a side of the room's box, whatever they face, shape [surfel].

    Rough walls and what hangs on them join all furniture along them to one component.
    """
    main: list[np.ndarray] = []
    for axis in axes:
        if all(abs(axis @ other) < 0.3 for other in main):
            main.append(axis)
    near = np.zeros(len(surface.points), bool)
    for axis in main:
        low, high = surface.extent(axis)
        along = surface.points @ axis
        near |= (along < low + depth * (high - low)) | (along > high - depth * (high - low))
    return near


def _clutter(surface: Surfels, planes: np.ndarray) -> Clutter:
    index = np.flatnonzero(~planes)
    if not len(index):
        return Clutter(index, index, np.zeros(0))
    label = connected_cells(np.floor(surface.points[index] / (2 * surface.cell)).astype(np.int64)) - 1
    part = np.bincount(label, surface.weights[index])
    return Clutter(index, label, np.sqrt(part) * (part > _COMPONENT))


def _turned(surface: Surfels, axes: np.ndarray, planes: np.ndarray) -> np.ndarray:
    """Return how much of what is askew is only turned about each axis, as furniture is about the vertical, shape [axis]."""
    angle = np.degrees(np.arccos(np.clip(np.abs(surface.normals @ axes.T), 0, 1)))
    askew = (angle > _SIDE).all(axis=1) & ~planes & surface.smooth
    about = np.array([surface.weights[askew & (angle[:, i] > 82)].sum() for i in range(len(axes))])
    return np.asarray(about / (about.sum() + 1e-3))


def _evidence(
    surface: Surfels, up: np.ndarray, shell: np.ndarray, clutter: dict[float, Clutter], metres: float
) -> dict[str, float]:
    weights, cell = surface.weights, surface.cell
    height, facing = surface.points @ up, surface.normals @ up
    low, high = surface.extent(up)
    top, under = facing > cos(_LEVEL), facing < -cos(_LEVEL)
    floor, ceiling = _lowest(height - low, high - low, top, weights, cell), high - low
    ceiling -= _lowest(high - height, high - low, under, weights, cell)
    if ceiling - floor < 0.4 * (high - low):
        floor, ceiling = 0.0, high - low
    level = (height - low - floor) / (ceiling - floor)
    column, columns = _columns(surface.points, up, 2 * cell)
    covered = _coverage(surface, column, height - low, floor, high - low, top)
    between = (level > 0.07) & (level < 0.93) & ~shell
    upwards, downwards = (weights[side & between].sum() for side in (top, under))
    upwards_low = weights[top & between & (level < 0.5)].sum()
    downwards_high = weights[under & between & (level > 0.5)].sum()
    outer, flat = (level < 0.1) | (level > 0.9), np.abs(facing) > cos(_WALLS)
    inwards, outwards = (
        weights[outer & flat & (((facing > 0) == (level < 0.5)) == side)].sum() for side in (True, False)
    )
    return {
        "inwards": (inwards - outwards) / (inwards + outwards + 0.01),
        "walls": float(weights[shell & (np.abs(facing) < cos(90 - _SIDE))].sum()),
        "height": _height_odds((high - low) * metres),
        "tops": (upwards - downwards) / (upwards + downwards + 0.02),
        "furniture": (upwards_low - downwards_high) / (upwards_low + downwards_high + 0.01),
        **covered,
        **_bench_heights((height - low - floor)[top & between] * metres, weights[top & between]),
        **_standing(surface, up, clutter[_DEPTHS[0]], low, high, _DEPTHS[0], ""),
        **_standing(surface, up, clutter[_DEPTHS[1]], low, high, _DEPTHS[1], "_deep"),
        **_gaps(column, columns, level, facing, shell),
        "extent": (high - low) * metres,
    }


def _bench_heights(height: np.ndarray, weights: np.ndarray) -> dict[str, float]:
    """Return which part of the tops lies as high above the floor [m] as each kind of furniture is.

    Against a wall taken for the floor, cupboards are 0.3 to 0.6 m deep; little is as deep as tables and counters are high.
    """
    total = weights.sum() + 0.01
    return {
        kind: float(weights[(height > low) & (height < high)].sum() / total) for kind, (low, high) in _BENCHES.items()
    }


def _lowest(height: np.ndarray, extent: float, level: np.ndarray, weights: np.ndarray, cell: float) -> float:
    """Return the height of the fullest level layer in the lowest third of an extent."""
    count = max(int(extent / cell), 8)
    layer = np.clip((height / extent * count).astype(int), 0, count - 1)
    filled = np.convolve(np.bincount(layer[level], weights[level], count), np.ones(3), "same")
    return (int(np.argmax(filled[: int(0.3 * count) + 1])) + 0.5) / count * extent


def _columns(points: np.ndarray, up: np.ndarray, edge: float) -> tuple[np.ndarray, tuple[int, int]]:
    """Return the upright column that each point lies in, shape [point], and the numbers of columns along two sides."""
    across = np.linalg.svd(up[None])[2][1:]
    places = np.floor((points @ across.T) / edge).astype(int)
    places -= places.min(axis=0)
    rows, columns = (int(n) + 1 for n in places.max(axis=0))
    return places[:, 0] * columns + places[:, 1], (rows, columns)


def _coverage(
    surface: Surfels, column: np.ndarray, height: np.ndarray, floor: float, extent: float, top: np.ndarray
) -> dict[str, float]:
    """Return which part of the footprint the floor covers, and which part anything that looks up."""
    near = max(2 * surface.cell, 0.04 * extent)
    footprint = len(np.unique(column))
    seen = {"floor": top & (np.abs(height - floor) < near), "seen_above": top}
    return {name: len(np.unique(column[chosen])) / footprint for name, chosen in seen.items()}


def _standing(
    surface: Surfels, up: np.ndarray, clutter: Clutter, low: float, high: float, depth: float, suffix: str
) -> dict[str, float]:
    """Return which part of the objects reaches the lower end of an extent, and which the upper end."""
    if not clutter.weight.sum():
        return {f"standing{suffix}": 0.5, f"hanging{suffix}": 0.5}
    height = surface.points[clutter.index] @ up
    bottom, top = np.full(len(clutter.weight), np.inf), np.full(len(clutter.weight), -np.inf)
    np.minimum.at(bottom, clutter.label, height)
    np.maximum.at(top, clutter.label, height)
    near = depth * (high - low) + 3.5 * surface.cell
    return {
        f"standing{suffix}": float(np.average(bottom - low < near, weights=clutter.weight)),
        f"hanging{suffix}": float(np.average(high - top < near, weights=clutter.weight)),
    }


def _gaps(
    column: np.ndarray, columns: tuple[int, int], level: np.ndarray, facing: np.ndarray, shell: np.ndarray
) -> dict[str, float]:
    """Return how much nearer objects away from the walls are to the floor than to the ceiling, and how many begin near it."""
    walls = np.zeros(columns, bool)
    walls.reshape(-1)[column[shell & (np.abs(facing) < 0.5)]] = True
    walls = ndimage.binary_dilation(walls, iterations=2)
    free = ~shell & (level > 0.05) & (level < 0.95) & ~walls.reshape(-1)[column]
    if free.sum() < 30:
        return {"gap": 0.0, "low": 0.3}
    lowest, highest = np.full(walls.size, np.inf), np.full(walls.size, -np.inf)
    np.minimum.at(lowest, column[free], level[free])
    np.maximum.at(highest, column[free], level[free])
    used = np.isfinite(lowest)
    lowest, highest = lowest[used], highest[used]
    return {"gap": float(np.mean(1 - highest - lowest)), "low": float(np.mean(lowest < 0.14))}


def _height_odds(extent: float) -> float:
    """Return the logarithm of the odds that an extent [m] is a room's height and not a side of its plan."""

    def bell(middle: float, spread: float) -> float:
        return float(np.exp(-0.5 * ((np.log(extent / middle)) / spread) ** 2)) / spread

    heights = 0.6 * bell(2.55, 0.15) + 0.25 * bell(1.7, 0.35) + 0.15 * bell(3.6, 0.35)  # whole rooms, parts, halls
    return float(np.log((heights + 0.02) / (bell(3.9, 0.5) + 0.02)))
