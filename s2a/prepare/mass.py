"""Mass and inertia of bodies, and the interiors that a scan of a closed part cannot show."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.bounds import NotNegative, Positive
from s2a.core.errors import InputError
from s2a.prepare.grasp import Target
from s2a.scan import labels
from s2a.scene.articulation import open_limit, opening_direction
from s2a.scene.geometry.convex import box, hull, volume
from s2a.scene.geometry.mesh_ops import extents, sample
from s2a.scene.geometry.planes import plane_axes
from s2a.scene.scene import Joint, Mesh, Scene
from s2a.scene.usd.sim_scene import Mass

WALL = 0.006  # [m] Thickness of a drawer box's sides and bottom
INSET = 0.015  # [m] How far its sides stay behind the edges of the front: the slides lie there
FRONT = 0.02  # [m] Thickness of the front, behind which the box begins
HEIGHT = 0.7  # Height of the box as a share of the front's
SHALLOWEST = 0.05  # [m] A box that is less deep is not worth adding
# [m] What is less deep is the frame of a door or window; what is deeper is no plain box but an L of
# cabinets, or a table
FLATTEST, DEEPEST_FRONT = 0.2, 0.8
NEAR = 0.02  # [m] A wall counts as scanned, and an end of the furniture as seen, where its surface is so near
SEEN = 0.5  # Share of a wall above which it was scanned, and of an end's length below which there is none
CELL = 0.05  # [m] Grain in which both are counted


def drawer_box(target: Target) -> list[Mesh]:
    """Return bottom, two sides and back of a drawer's box as convex hulls, at the pose in which it was scanned.

    It is as deep as the joint's range, but ends inside the cabinet, unless of that no more than a frame was scanned: what
    slides out so far is so deep. None for a part that turns or opens upwards, or whose front was not scanned.
    """
    joint, front = target.joint, target.front
    inwards = -opening_direction(joint, front.bounds.mean(axis=0))
    if joint.kind != "prismatic" or abs(inwards[2]) > 0.5 or not front.face_areas.any():
        return []
    up = np.array([0.0, 0.0, 1.0]) - inwards[2] * inwards
    up /= np.linalg.norm(up)
    frame = np.stack([np.cross(up, inwards), up, inwards], axis=1)
    low, high = extents(front, frame)
    start = low[2] + FRONT
    behind = _cabinet_end(target.cabinet, inwards) - WALL - start
    depth = min(abs(open_limit(joint)), behind if behind > FLATTEST else np.inf)
    width, height = high[0] - low[0] - 2 * INSET, HEIGHT * (high[1] - low[1])
    if depth < SHALLOWEST or min(width, height) < SHALLOWEST / 2:
        return []
    left, bottom = low[0] + INSET, low[1] + (high[1] - low[1] - height) / 2
    # Lower corner and size of each wall along the frame's axes: sideways, up, inwards.
    walls = [
        ((left, bottom, start), (width, WALL, depth)),
        ((left, bottom, start + depth - WALL), (width, height, WALL)),
    ]
    walls += [((x, bottom, start), (WALL, height, depth)) for x in (left, left + width - WALL)]
    return [box(frame @ (np.array(at) + np.array(size) / 2), frame, np.array(size)) for at, size in walls]


def _cabinet_end(cabinet: Mesh, inwards: np.ndarray) -> float:
    """Return how far inwards furniture was scanned [m]; without limit where there is none."""
    return float((cabinet.vertices @ inwards).max()) if len(cabinet.vertices) else np.inf


def cabinet_walls(surface: Mesh, target: Target) -> list[Mesh]:
    """Return the back and the sides of furniture that were not scanned, as convex hulls.

    A wall is added where the scan shows that the furniture ends there, along half of its length or more, and less than half
    of the wall itself. None for furniture that is no plain box, or whose doors open upwards.

    `target`: a part of the furniture that moves; it is at the front.
    """
    inwards = -opening_direction(target.joint, target.point)
    inwards = np.array([*inwards[:2], 0.0])
    if not surface.face_areas.any() or np.linalg.norm(inwards) < 0.7:
        return []
    inwards /= np.linalg.norm(inwards)
    frame = np.stack([np.cross([0.0, 0.0, 1.0], inwards), [0.0, 0.0, 1.0], inwards], axis=1)
    low, high = extents(surface, frame)
    if not FLATTEST < high[2] - low[2] < DEEPEST_FRONT:
        return []
    points = sample(surface, int(4 * surface.face_areas.sum() / CELL**2), 0) @ frame
    boxes = []
    for normal, side in ((0, 0), (0, 1), (2, 1)):  # left and right of the front, and the back
        at = (low, high)[side][normal]
        close = points[np.abs(points[:, normal] - at) < NEAR]
        spans = [k for k in range(3) if k != normal]
        ends = max(_filled(close[:, [k]], low[[k]], high[[k]]) for k in spans)
        if ends >= SEEN > _filled(close[:, spans], low[spans], high[spans]):
            first, last = low.copy(), high.copy()
            first[normal], last[normal] = (at - WALL, at) if side else (at, at + WALL)
            boxes.append(box(frame @ ((first + last) / 2), frame, last - first))
    return boxes


def _filled(points: np.ndarray, low: np.ndarray, high: np.ndarray) -> float:
    """Return the share of the cells between two corners [axis] in which points [point axis] lie."""
    shape = np.maximum(np.ceil((high - low) / CELL).astype(int), 1)
    cells = np.clip(((points - low) / CELL).astype(int), 0, shape - 1)
    return len(np.unique(cells, axis=0)) / float(shape.prod()) if len(points) else 0.0


DEEPEST = 0.8  # [m] Drawers are less deep, however far they slide


@dataclass(frozen=True)
class MassRule:
    """How a family of parts is weighed.

    Attributes:
        by: "area": of the front; "volume": of the convex hull, or of a free object's closed surface; "mass": whatever its size.
        value: [kg/m^2], [kg/m^3] or [kg].
        box: mass of the boards of the box behind a drawer's front [kg/m^2]; by area only.
        contents: mass of its contents by the area of its bottom [kg/m^2]; by area only.
    """

    by: Literal["area", "volume", "mass"]
    value: Positive
    box: NotNegative = 0.0
    contents: NotNegative = 0.0


@dataclass(frozen=True)
class MassConfig:
    """What to assume where no mass is annotated.

    Attributes:
        families: rule by the last words of a label; of several the longest counts.
        default: of all other labels.
        min_estimate: min mass from an area or volume [kg].
        max_estimate: max mass from an area or volume [kg].
    """

    families: dict[str, MassRule]
    default: MassRule
    min_estimate: Positive
    max_estimate: Positive

    def __post_init__(self) -> None:
        """Refuse bounds that leave no mass between them."""
        if self.min_estimate > self.max_estimate:
            raise InputError(
                f"key 'mass.min_estimate' is {self.min_estimate:g}; expected {self.max_estimate:g} or less, as mass.max_estimate"
            )

    def rule(self, label: str) -> tuple[str, MassRule]:
        """Return the family that a label belongs to, "" for none, and its rule."""
        family = labels.family(self.families, label)
        return family, self.families.get(family, self.default)

    def bounded(self, mass: float) -> float:
        """Return an estimate within the bounds [kg]."""
        return float(np.clip(mass, self.min_estimate, self.max_estimate))


def annotated_mass(scene: Scene, members: Sequence[str]) -> float | None:
    """Return the annotated mass of a body [kg], the one that gives it its name first; None where that has none."""
    annotated = [scene.parts[i].mass for i in members]
    return None if annotated[0] is None else float(sum(mass for mass in annotated if mass is not None))


def moving_mass(scene: Scene, members: Sequence[str], config: MassConfig) -> tuple[float, str]:
    """Return the mass of an articulated part's body [kg] and where it comes from: annotated, or by its family's rule.

    `members`: ids of the parts that move together, the one that gives the body its name first.
    """
    annotated = annotated_mass(scene, members)
    if annotated is not None:
        return annotated, "annotated"
    family, rule = config.rule(scene.parts[members[0]].label)
    if rule.by == "mass":
        return rule.value, f"usual for a {family}" if family else "usual"
    if rule.by == "volume":
        closed = hull(np.concatenate([scene.parts[i].mesh.vertices for i in members]))
        return config.bounded(rule.value * (volume(closed) if closed is not None else 0.0)), "volume of its hull"
    width, height = front_size(scene.parts[members[0]].mesh, scene.joint(members[0]), panel=not rule.box)
    mass = rule.value * width * height + _behind(width, height, scene.joint(members[0]), rule)
    return config.bounded(mass), f"{width:.2f} x {height:.2f} m of front of a {family or 'part'}"


def front_size(mesh: Mesh, joint: Joint, panel: bool = False) -> tuple[float, float]:
    """Return width and height [m] of a front as it opens: of the rectangle around it, horizontal where it stands upright.

    `panel`: nothing is behind it. One that slides within its own plane, as a sliding door does, is as wide as it is that way.
    """
    if not mesh.face_areas.any():
        return 0.0, 0.0
    axes = plane_axes(opening_direction(joint, mesh.bounds.mean(axis=0)), mesh.vertices.astype(np.float64))
    width, height, along = (float(each) for each in np.subtract(*extents(mesh, axes)[::-1]))
    if panel and joint.kind == "prismatic" and along > min(width, height):
        width, height = (along, height) if width < height else (width, along)
    return width, height


def _behind(width: float, height: float, joint: Joint, rule: MassRule) -> float:
    """Return the mass [kg] of the box behind a front [m], as deep as it slides, and of its contents."""
    if joint.kind != "prismatic":
        return 0.0
    depth = min(abs(open_limit(joint)), DEEPEST)
    bottom, walls = width * depth, HEIGHT * height * (2.0 * depth + width)
    return rule.box * (bottom + walls) + rule.contents * bottom


def box_mass(mesh: Mesh, mass: float, frame: np.ndarray, source: str = "") -> Mass:
    """Return centre and inertia of a solid box that bounds a mesh.

    Args:
        mesh: the body's surface, which is open and says nothing of what is inside.
        mass: [kg].
        frame: the box's axes as columns of a rotation [3 3].
        source: where the mass comes from.
    """
    along = mesh.vertices @ frame if len(mesh.vertices) else np.zeros((1, 3))
    low, high = along.min(axis=0), along.max(axis=0)
    squares = np.maximum(high - low, 0.01) ** 2
    inertia = mass / 12.0 * (squares.sum() - squares)
    center = frame @ ((low + high) / 2)
    axes = Rotation.from_matrix(frame).as_quat(canonical=True)
    return Mass(mass, tuple(map(float, center)), tuple(map(float, inertia)), tuple(map(float, axes)), source)  # type: ignore[arg-type]
