"""A task of two kernels, for tests of what the environment does by itself: raise the first joint of the arm."""

# Warp reads kernel annotations at run time, so this file does without "from __future__ import annotations".
from dataclasses import dataclass, fields

import warp as wp
from settings import load

from s2a.env.state import State
from s2a.env.task import MdpConfig, Task
from s2a.sim.simulation import Simulation

HIGH = 0.3
"""Coordinate of the first joint [rad] above its start that ends an episode."""


@dataclass(frozen=True)
class NoMetrics:
    """Nothing to tune."""


@wp.struct
class Lift:
    """The start of the first joint [rad], and the highest it came in an episode above it, shape [world]."""

    start: float
    highest: wp.array(dtype=float)


@wp.func
def height(s: State, h: Lift, world: int):
    """Weight of how far the first joint is above its start [rad]."""
    return s.joint_q[world, 0] - h.start


@wp.kernel
def _update(s: State, h: Lift):
    world = wp.tid()
    h.highest[world] = wp.max(h.highest[world], height(s, h, world))
    s.terminated[world] = wp.where(height(s, h, world) > HIGH, 1, 0)


@wp.kernel
def _finish(s: State, h: Lift):
    world = wp.tid()
    if s.done[world] == 1:
        s.result[world, 0] = float(s.terminated[world])
        s.result[world, 1] = h.highest[world]


@wp.kernel
def _reset(s: State, h: Lift):
    world = wp.tid()
    if s.done[world] == 1:
        h.highest[world] = 0.0


@wp.kernel
def _observe(s: State, h: Lift):
    world = wp.tid()
    s.observation[world, 0] = height(s, h, world)


class LiftTask(Task):
    """Raise the first joint."""

    Config, Metrics, Handles, PERSISTENT = MdpConfig, NoMetrics, Lift, ("highest",)
    REWARDS, METRICS, VALUES, LOGGED, METRICS_VERSION = (height,), ("lifted", "highest"), ("highest",), ("lifted",), 1

    def __init__(self, sim: Simulation, **changes: object) -> None:
        """Bind the task to worlds, with numbers that differ from those of opening."""
        settings = load(dict, "task/open_part")
        shared = {name: settings[name] for name in (each.name for each in fields(MdpConfig))}
        self.config = MdpConfig(**{**shared, "name": "lift", **changes})
        self.observations, self.thresholds = 1, {"high": HIGH}
        self.handles = Lift()
        with wp.ScopedDevice(sim.device):
            self.handles.start, self.handles.highest = sim.layout.home[0], wp.zeros(sim.num_envs, dtype=float)

    def update(self, state: State) -> None:
        """Follow the joint."""
        wp.launch(_update, dim=len(state.done), inputs=[state, self.handles])

    def observe(self, state: State) -> None:
        """Write how high it is."""
        wp.launch(_observe, dim=len(state.done), inputs=[state, self.handles])

    def result(self, state: State) -> None:
        """Write how high it came."""
        wp.launch(_finish, dim=len(state.done), inputs=[state, self.handles])

    def reset(self, state: State) -> None:
        """Forget it."""
        wp.launch(_reset, dim=len(state.done), inputs=[state, self.handles])
