"""Picking a free object and placing it on a support."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import warp as wp

from s2a.core.errors import InputError
from s2a.env.state import State
from s2a.env.task import MdpConfig, Task
from s2a.motion import pick
from s2a.motion.trajectory import Trajectory
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import Simulation
from s2a.sim.world import SimStage
from s2a.tasks.pick_place import mdp
from s2a.tasks.pick_place.config import PickPlaceConfig, PickPlaceMetrics
from s2a.tasks.pick_place.start import shift


class PickPlaceTask(Task):
    """Pick the object of every world and place it; observations are those of `mdp.observe`."""

    Config: ClassVar[type[MdpConfig]] = PickPlaceConfig
    Metrics: ClassVar[type] = PickPlaceMetrics
    Handles: ClassVar[Any] = mdp.PickPlace
    PERSISTENT: ClassVar[tuple[str, ...]] = ("progress", "last", "released", "origin", "rested")
    REWARDS, METRICS_VERSION = mdp.REWARDS, 2
    METRICS: ClassVar[tuple[str, ...]] = mdp.METRICS
    VALUES: ClassVar[tuple[str, ...]] = mdp.VALUES
    INSTRUCTION = "pick up the {part} and put it down at its place"
    Stage: ClassVar[type[SimStage]] = pick.PickStage
    LOGGED = ("success", "placed", "carried", "grasped")
    KERNELS: ClassVar[Any] = mdp

    stage: pick.PickStage
    others: list[int]

    def __init__(self, sim: Simulation, config: PickPlaceConfig, metrics: PickPlaceMetrics) -> None:
        """Bind the task to worlds of a PickStage."""
        self.sim, self.config, self.error_fraction = sim, config, metrics.error_fraction
        if not isinstance(sim.stage, pick.PickStage):
            raise InputError("task pick_place needs the stage that its own read_stage returns")
        self.stage = sim.stage
        rate = sim.config.control_frequency
        self.thresholds = {
            "position": config.position_tolerance,
            "angle": config.angle_tolerance,
            "rest": config.rest_time,
            "carried_fraction": metrics.carried_fraction,
            "drift": metrics.max_drift,
            "disturbance": metrics.max_disturbance,
        }
        with wp.ScopedDevice(sim.device):
            self.sensor = ContactSensor(sim, config.contact_distance)
            self.handles = self._bind(metrics, rate)
        self.observations = 2 * sim.layout.robot_joints + 15

    def _bind(self, metrics: PickPlaceMetrics, rate: float) -> mdp.PickPlace:
        sim, config, h = self.sim, self.config, mdp.PickPlace()
        h.contacts, h.body = self.sensor.found, sim.layout.part_body
        region = self.stage.region
        self._surface = wp.Mesh(
            wp.array(np.asarray(region.vertices, np.float32), dtype=wp.vec3),
            wp.array(np.asarray(region.faces, np.int32).ravel(), dtype=int),
        )
        h.surface, h.tool_link, (h.left, h.right) = self._surface.id, sim.layout.tool_body, sim.layout.finger_bodies
        h.tool = wp.transform(wp.vec3(*sim.robot.tool_offset), wp.quat_identity())
        h.base = wp.quat(*self.stage.base[3:])
        h.goal = wp.transform(*self.stage.goal[:3], *self.stage.goal[3:])
        bodies = sim.model.body_count // sim.num_envs
        others = self.others = [i for i in range(bodies) if i not in (*sim.layout.robot_bodies, sim.layout.part_body)]
        n = sim.num_envs
        h.others = wp.array(others, dtype=int)
        h.progress = wp.zeros((n, mdp.PROGRESS), dtype=float)
        h.last, h.released = wp.zeros(n, dtype=wp.vec3), wp.zeros(n, dtype=wp.vec3)
        h.rested = wp.zeros(n, dtype=wp.transform)
        h.origin = wp.zeros((n, max(1, len(others))), dtype=wp.vec3)
        for name in (
            "contact_force", "velocity_scale", "observation_limit", "position_tolerance", "angle_tolerance", "rest_shift",
            "rest_turn", "clear_distance",
        ):  # fmt: skip
            setattr(h, name, getattr(config, name))
        h.rest_steps, h.settle_steps = round(config.rest_time * rate), round(config.settle_time * rate)
        for name in ("carried_fraction", "max_drift", "max_disturbance"):
            setattr(h, name, getattr(metrics, name))
        return h

    @staticmethod
    def read_stage(
        path: Path, part: str | None, robot: str | None, also: Sequence[str], config: Any, motion: Any
    ) -> pick.PickStage:
        """Read the room, and plan for the object."""
        return pick.read_stage(path, part, robot, also, config, motion)

    def trajectory(self, settings: Any) -> Trajectory:
        """Return the planned trajectory."""
        return pick.trajectory(self.sim, self.stage.plan, settings)

    def start(self, coords: np.ndarray) -> np.ndarray:
        """Return the coordinates with the object at its start."""
        coords = coords.copy()
        first = self.sim.layout.part_coord
        coords[:, first : first + 7] = self.stage.start
        return coords

    def launch(self, kernel: wp.Kernel, state: State, *more: object) -> None:
        """Launch a kernel of (state, handles, ...) in all worlds."""
        wp.launch(kernel, dim=len(state.done), inputs=[state, self.handles, *more])

    def reset(self, state: State) -> None:
        """Start a new episode where one ended."""
        first, (far, turn) = self.sim.layout.part_coord, (self.config.start_shift, self.config.start_turn)
        if far or turn:  # random streams stay as they are where nothing is drawn
            wp.launch(shift, dim=len(state.done), inputs=[state, first, far, turn])
        self.launch(self.KERNELS.reset, state, first)

    def before_step(self, state: State) -> None:
        """Forget the touch of the control step before."""
        self.launch(self.KERNELS.begin, state)

    def after_substep(self, state: State) -> None:
        """Read the contacts, and attribute the object's path to what held it."""
        self.sensor.update()
        # After an odd number of physics steps the poses are in the simulation's other buffer.
        now = self.sim.state.body_q.reshape(state.body_q.shape)
        wp.launch(mdp.track, dim=len(state.done), inputs=[now, self.handles])

    def update(self, state: State) -> None:
        """Count the steps at rest at the place."""
        self.launch(self.KERNELS.update, state)

    def observe(self, state: State) -> None:
        """Write the observations."""
        self.launch(self.KERNELS.observe, state)

    def result(self, state: State) -> None:
        """Write how finished episodes went."""
        self.launch(self.KERNELS.write_result, state)


TASK = PickPlaceTask
