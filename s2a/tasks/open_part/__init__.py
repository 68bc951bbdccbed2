"""Opening an articulated part by its handle."""

from __future__ import annotations

import warp as wp

from s2a.env.state import State
from s2a.motion.open import opening_path
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import Simulation
from s2a.tasks import part, part_handles, part_observation
from s2a.tasks.open_part import mdp, metrics
from s2a.tasks.open_part.config import OpenPartConfig, OpenPartMetrics


class OpenPartTask(part.PartTask):
    """Open the part of every world; observations are the reference's (`s2a.tasks.part_observation`)."""

    Config, Metrics = OpenPartConfig, OpenPartMetrics
    KERNELS, Handles, PERSISTENT = mdp, mdp.OpenPart, ("grasped", "progress")
    REWARDS, METRICS, VALUES, METRICS_VERSION = (
        mdp.REWARDS,
        metrics.METRICS,
        ("opening", "grasped_fraction", "contact_force"),
        metrics.VERSION,
    )
    tool_path = staticmethod(opening_path)
    INSTRUCTION = "open the {part}"
    LOGGED = ("grasp_success", "success", "final_success", "handle_success", "single_finger_success", "open_30cm")

    def __init__(self, sim: Simulation, config: OpenPartConfig, metrics_config: OpenPartMetrics) -> None:
        """Bind the task to worlds."""
        self.sim, self.config, self.error_fraction = sim, config, metrics_config.error_fraction
        with wp.ScopedDevice(sim.device):
            self.sensor = ContactSensor(sim, config.contact_distance)
            self.handles = mdp.bind(sim, part_handles.bind(sim, self.sensor, config), config)
            self.thresholds = metrics.bind(sim, self.handles, metrics_config)
        self.observations = part_observation.length(sim, config)
        told = part_observation.privileged_length(config)
        self.privileged = told + int(mdp.PRIVILEGED_GRASP) if told else 0

    def before_step(self, state: State) -> None:
        """Forget the contacts of the control step before."""
        wp.launch(part.clear_region_force, dim=len(state.done), inputs=[self.handles.p])

    def after_substep(self, state: State) -> None:
        """Read the contacts, and attribute what the part gained to what held it."""
        self.sensor.update()
        wp.launch(part.update_region_force, dim=len(state.done), inputs=[self.handles.p])
        # After an odd number of physics steps the coordinates are in the simulation's other buffer.
        now = self.sim.state.joint_q.reshape(state.joint_q.shape)
        wp.launch(mdp.accumulate_grasped_opening, dim=len(state.done), inputs=[now, self.handles])
        wp.launch(metrics.attribute, dim=len(state.done), inputs=[now, self.handles])

    def update(self, state: State) -> None:
        """Keep what the reward reads, and whether the part stands open."""
        super().update(state)
        self.launch(metrics.notice_standing, state)

    def observe(self, state: State) -> None:
        """Write the observations, and what a critic alone is told."""
        super().observe(state)
        if self.privileged:
            self.launch(mdp.tell_critic, state)

    def result(self, state: State) -> None:
        """Write how finished episodes went."""
        self.launch(metrics.write_result, state)


TASK = OpenPartTask
