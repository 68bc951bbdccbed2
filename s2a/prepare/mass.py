"""What a body weighs, and how it resists turning."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from s2a.errors import InputError
from s2a.geometry.convex import hull, volume
from s2a.ranges import Positive
from s2a.scene import Mesh, Scene
from s2a.usd.sim_scene import Mass


@dataclass(frozen=True)
class MassConfig:
    """What to assume where no mass is annotated.

    Attributes:
        priors: mass [kg] by the last word of a label.
        min_estimate: min mass from a volume [kg].
        max_estimate: max mass from a volume [kg].
        density: [kg/m^3] by which a volume is weighed, for labels without a prior.
    """

    priors: dict[str, Positive]
    min_estimate: Positive
    max_estimate: Positive
    density: Positive

    def __post_init__(self) -> None:
        """Refuse bounds that leave no mass between them."""
        if self.min_estimate > self.max_estimate:
            raise InputError(
                f"key 'mass.min_estimate' is {self.min_estimate:g}; expected {self.max_estimate:g} or less, as mass.max_estimate"
            )

    def estimate(self, volume: float) -> float:
        """Return what a volume [m^3] weighs within bounds [kg]."""
        return float(np.clip(self.density * volume, self.min_estimate, self.max_estimate))


def known_mass(scene: Scene, members: Sequence[str], config: MassConfig) -> tuple[float, str] | None:
    """Return the mass of a body [kg] and where it comes from: annotated, else its label's; None if neither says it.

    Args:
        scene: the room.
        members: ids of the parts that move together, the one that gives the body its name first.
        config: what to assume.
    """
    annotated = [scene.parts[i].mass for i in members]
    if annotated[0] is not None:
        return float(sum(mass for mass in annotated if mass is not None)), "annotated"
    words = scene.parts[members[0]].label.lower().replace("_", " ").split()
    if not words or words[-1] not in config.priors:
        return None
    return config.priors[words[-1]], f"usual for a {words[-1]}"


def moving_mass(scene: Scene, members: Sequence[str], config: MassConfig) -> tuple[float, str]:
    """Return a body's `known_mass`, or else what the convex hull of its surface holds."""
    closed = hull(np.concatenate([scene.parts[i].mesh.vertices for i in members]))
    estimate = config.estimate(volume(closed) if closed is not None else 0.0), "volume of its hull"
    return known_mass(scene, members, config) or estimate


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
