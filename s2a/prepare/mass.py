"""Mass and inertia of bodies."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.core.bounds import NotNegative, Positive
from s2a.core.errors import InputError
from s2a.prepare.interior import HEIGHT
from s2a.scene.articulation import open_limit, opening_direction
from s2a.scene.geometry.convex import hull, volume
from s2a.scene.geometry.mesh_ops import extents
from s2a.scene.geometry.planes import plane_axes
from s2a.scene.scene import Joint, Mesh, Scene
from s2a.scene.usd.sim_scene import Mass

DEEPEST = 0.8
"""[m] Drawers are less deep, however far they slide."""


@dataclass(frozen=True)
class MassRule:
    """How a family of parts is weighed.

    Attributes:
        by: "area": of the front; "volume": of the convex hull, or of a free object's closed surface; "mass": whatever its size.
        value: [kg/m^2], [kg/m^3] or [kg].
        box: of the boards of the box behind a drawer's front [kg/m^2]; by area only.
        contents: of what lies in it, by the area of its bottom [kg/m^2]; by area only.
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
        words = f" {label.lower().replace('_', ' ')}"
        family = max((name for name in self.families if words.endswith(f" {name}")), key=len, default="")
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

    Args:
        scene: the room.
        members: ids of the parts that move together, the one that gives the body its name first.
        config: what to assume.
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
    width, height = front_size(scene.parts[members[0]].mesh, scene.joint(members[0]))
    mass = rule.value * width * height + _behind(width, height, scene.joint(members[0]), rule)
    return config.bounded(mass), f"{width:.2f} x {height:.2f} m of front of a {family or 'part'}"


def front_size(mesh: Mesh, joint: Joint) -> tuple[float, float]:
    """Return width and height [m] of a front as it opens: of the rectangle around it, horizontal where it stands upright."""
    if not mesh.face_areas.any():
        return 0.0, 0.0
    axes = plane_axes(opening_direction(joint, mesh.bounds.mean(axis=0)), mesh.vertices.astype(np.float64))
    width, height, _ = np.subtract(*extents(mesh, axes)[::-1])
    return float(width), float(height)


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
