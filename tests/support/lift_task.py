"""A small task, for tests of what the environment does by itself: raise the first joint of the arm."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from dataclasses import fields

import warp as wp
from settings import load

from s2a.sim.simulation import Simulation
from s2a.tasks.base import MdpConfig, MetricsConfig, Results, Task, terms
from s2a.tasks.state import State, World, columns

HIGH = 0.3
"""Coordinate of the first joint [rad] above its start that ends an episode."""


OWN = ("start", "highest")
"""The first joint's coordinate at the start [rad], and the highest it came above it."""
Own = columns(OWN)


@wp.func
def height(s: State, w: World, world: int) -> float:
    """Weight of how far the first joint is above its start [rad]."""
    return s.joint_q[world, 0] - w.own[world, Own.start]


@wp.func
def lifted(s: State, w: World, world: int):
    """Lifted up to HIGH."""
    return float(s.terminated[world])


@wp.func
def highest(s: State, w: World, world: int):
    """The highest that it came [rad]."""
    return w.own[world, Own.highest]


@wp.kernel
def _update(s: State, w: World):
    world = wp.tid()
    w.own[world, Own.highest] = wp.max(w.own[world, Own.highest], height(s, w, world))
    s.terminated[world] = wp.where(height(s, w, world) > HIGH, 1, 0)


@wp.kernel
def _reset(s: State, w: World):
    world = wp.tid()
    if s.done[world] == 1:
        w.own[world, Own.highest] = 0.0


class Lift(Task):
    """Raise the first joint."""

    Config, Metrics, OWN = MdpConfig, MetricsConfig, OWN
    REWARDS, OBSERVATIONS = terms(height), {"": (height,)}
    RESULTS = Results(terms(lifted), terms(highest), logged=("lifted",), success="lifted", version=1)

    def __init__(self, sim: Simulation, **changes: object) -> None:
        """Bind the task to worlds, with settings that differ from those of opening."""
        settings = load(dict, "task/open_part")
        shared = {name: settings[name] for name in (each.name for each in fields(MdpConfig))}
        super().__init__(sim, MdpConfig(**{**shared, "name": "lift", **changes}), MetricsConfig())

    def bind(self) -> None:
        """Keep where the joint starts."""
        self.thresholds = {"high": HIGH}
        wp.to_torch(self.world.own)[:, Own.start] = self.sim.layout.home[0]

    def update(self, state: State) -> None:
        """Follow the joint."""
        self.launch(_update, state)

    def reset(self, state: State) -> None:
        """Clear the highest position."""
        self.launch(_reset, state)
