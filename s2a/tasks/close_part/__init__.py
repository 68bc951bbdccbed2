"""Closing an articulated part that stands open."""

from __future__ import annotations

import numpy as np
import warp as wp

from s2a.motion.open import closing_path
from s2a.robot.tool_path import opening_coordinate
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import Simulation
from s2a.tasks import part, part_handles, part_observation
from s2a.tasks.close_part import mdp
from s2a.tasks.close_part.config import ClosePartConfig, ClosePartMetrics


class ClosePartTask(part.PartTask):
    """Close the part of every world; observations are those of `s2a.tasks.part_observation`."""

    Config, Metrics = ClosePartConfig, ClosePartMetrics
    KERNELS, Handles, PERSISTENT = mdp, mdp.ClosePart, ("closed",)
    REWARDS, METRICS, VALUES, METRICS_VERSION = mdp.REWARDS, mdp.METRICS, ("remaining",), 1
    PUSHES, INSTRUCTION = True, "close the {part}"
    tool_path = staticmethod(closing_path)
    LOGGED = ("final_success", "success")

    def __init__(self, sim: Simulation, config: ClosePartConfig, metrics: ClosePartMetrics) -> None:
        """Bind the task to worlds."""
        self.sim, self.config, self.error_fraction = sim, config, metrics.error_fraction
        self.thresholds = {"closed": metrics.closed_opening}
        with wp.ScopedDevice(sim.device):
            h = self.handles = mdp.ClosePart()
            self.sensor = ContactSensor(sim, config.contact_distance)
            h.p = part_handles.bind(sim, self.sensor, config)
            h.closed = wp.zeros(sim.num_envs, dtype=float)
            h.closed_opening = metrics.closed_opening
        self.observations = part_observation.length(sim, config)
        self.privileged = part_observation.privileged_length(config)

    def start(self, coords: np.ndarray) -> np.ndarray:
        """Return the coordinates with the part open."""
        starts = [opening_coordinate(s.joint, s.grasp[:3], self.config.start_opening) for s in self.sim.stages]
        coords = coords.copy()
        coords[np.arange(len(coords)), self.sim.part_coord] = [starts[i] for i in self.sim.stage_of_env]
        return coords


TASK = ClosePartTask
