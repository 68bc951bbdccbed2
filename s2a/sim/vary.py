"""Worlds of a batch that differ in what nobody knows of a real part and a real arm: resistance, mass, friction, gains."""

from __future__ import annotations

from dataclasses import dataclass

import newton
import numpy as np

from s2a.core.ranges import CountFromZero, Positive
from s2a.sim.layout import Layout

Range = tuple[Positive, Positive]
"""Least and greatest factor; drawn evenly on a logarithmic scale."""


@dataclass(frozen=True)
class Variation:
    """By what each world's values are multiplied; drawn once, so that they stay as long as the worlds.

    Attributes:
        joint_friction: of the part's joint: its dry friction.
        joint_damping: its damping.
        mass: of the part.
        contact_friction: of all surfaces of a world.
        gains: stiffness and damping of the arm's position controller.
        seed: of the draws.
    """

    joint_friction: Range
    joint_damping: Range
    mass: Range
    contact_friction: Range
    gains: Range
    seed: CountFromZero


def vary(model: newton.Model, layout: Layout, part_dof: np.ndarray, settings: Variation) -> None:
    """Multiply each world's values in a model that no solver has read yet.

    Args:
        model: of all worlds.
        layout: of a world.
        part_dof: the part's velocity in each world, shape [world].
        settings: the factors.
    """
    worlds, random = len(part_dof), np.random.default_rng(settings.seed)

    def factors(limits: Range) -> np.ndarray:
        return np.exp(random.uniform(np.log(limits[0]), np.log(limits[1]), worlds))

    every, part = np.arange(worlds), (np.arange(worlds), part_dof)
    _multiply(model.joint_friction, worlds, part, factors(settings.joint_friction))
    _multiply(model.joint_target_kd, worlds, part, factors(settings.joint_damping))
    mass, body = factors(settings.mass), (every, layout.part_body)
    for array, power in (("body_mass", 1), ("body_inertia", 1), ("body_inv_mass", -1), ("body_inv_inertia", -1)):
        _multiply(getattr(model, array), worlds, body, mass**power)
    world = model.shape_world.numpy()
    friction = model.shape_material_mu.numpy()
    model.shape_material_mu.assign(friction * np.append(factors(settings.contact_friction), 1.0)[world])
    gains, arm = factors(settings.gains)[:, None], (every[:, None], np.arange(layout.arm_joints)[None])
    for array in ("joint_target_ke", "joint_target_kd"):
        _multiply(getattr(model, array), worlds, arm, gains)


def _multiply(array, worlds: int, index: tuple, factor: np.ndarray) -> None:
    """Multiply some values of an array that has as many entries for every world."""
    values = array.numpy()
    each = values.reshape(worlds, -1, *values.shape[1:])
    each[index] *= factor.reshape(*factor.shape, *[1] * (each[index].ndim - factor.ndim))
    array.assign(values)
