"""The worlds of many stages, built side by side: a stage takes half a second of one core, and a pool has hundreds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import newton

from s2a import robot
from s2a.core.workers import spread
from s2a.sim.nearby import Missing, warn
from s2a.sim.solver import SimConfig
from s2a.sim.world import SimStage, build_world, empty_world

FEW = 8
"""Stages that are built before a helper has started."""
ATTRIBUTES = "custom_attributes"


@dataclass(frozen=True)
class WorldSettings:
    """What the worlds of a batch share.

    Attributes:
        config: how physics is stepped.
        with_robot: load the robot.
        both_kinds: give each part a slide and a hinge; see `build_world`.
    """

    config: SimConfig
    with_robot: bool
    both_kinds: bool


def build_worlds(stages: Sequence[SimStage], settings: WorldSettings) -> list[newton.ModelBuilder]:
    """Return a builder for each stage, in their order; warns once of what they lack of their rooms."""
    found = list(spread(_packed_world, settings, stages, few=FEW))
    warn([missing for _, missing in found])
    return [_unpack(values) for values, _ in found]


def _packed_world(settings: WorldSettings, stage: SimStage) -> tuple[dict[str, Any], Missing | None]:
    """Return a stage's world as values that another process can be sent, and what it lacks of its room."""
    config, spec = settings.config, robot.load(stage.robot)
    missing: list[Missing | None] = []
    values = _pack(
        build_world(
            stage,
            config.joint,
            config.dt,
            robot=spec if settings.with_robot else None,
            gains=config.gains_of(spec),
            gravity_compensation=config.gravity_compensation,
            static_colliders=config.load_static_colliders,
            realistic=config.limits is not None and config.limits.drives,
            coupled_fingers=config.coupled_fingers,
            both_kinds=settings.both_kinds,
            missing=missing,
        )
    )
    return values, missing[0]


def _pack(world: newton.ModelBuilder) -> dict[str, Any]:
    """Return a builder's state; of its attributes only the values, as their types cannot be sent (warp's, made at run time)."""
    return vars(world) | {ATTRIBUTES: {name: each.values for name, each in world.custom_attributes.items()}}


def _unpack(state: dict[str, Any]) -> newton.ModelBuilder:
    """Return the builder that `_pack` was given."""
    world = empty_world()
    for name, values in state[ATTRIBUTES].items():
        world.custom_attributes[name].values = values
    vars(world).update(state | {ATTRIBUTES: world.custom_attributes})
    return world
