"""Opening an articulated part by its handle."""

from __future__ import annotations

import warp as wp

from s2a.env.state import State
from s2a.env.task import Task
from s2a.sim.contacts import ContactSensor
from s2a.sim.simulation import Simulation
from s2a.tasks import part
from s2a.tasks.open_part import mdp, metrics
from s2a.tasks.open_part.config import OpenPartConfig, OpenPartMetrics


class OpenPartTask(Task):
    """Open the part of every world; observations are the reference's (`s2a.tasks.part.observe`)."""

    Config, Metrics = OpenPartConfig, OpenPartMetrics
    Handles, PERSISTENT = mdp.OpenPart, ("led", "progress")
    REWARDS, METRICS, VALUES, METRICS_VERSION = (
        mdp.REWARDS,
        metrics.METRICS,
        ("opening", "grasped_fraction"),
        metrics.VERSION,
    )
    LOGGED = ("grasp_success", "success", "final_success", "handle_success", "single_finger_success", "open_30cm")

    def __init__(self, sim: Simulation, config: OpenPartConfig, metrics_config: OpenPartMetrics) -> None:
        """Bind the task to worlds."""
        self.sim, self.config, self.error_fraction = sim, config, metrics_config.error_fraction
        with wp.ScopedDevice(sim.device):
            self.sensor = ContactSensor(sim, config.contact_distance)
            self.handles = mdp.bind(sim, part.bind(sim, self.sensor, config), config)
            self.thresholds = metrics.bind(sim, self.handles, metrics_config)
        self.observations = 2 * sim.layout.robot_joints + 5

    def reset(self, state: State) -> None:
        """Forget the last episode."""
        wp.launch(mdp.reset, dim=len(state.done), inputs=[state, self.handles])

    def before_step(self, state: State) -> None:
        """Forget the contacts of the control step before."""
        wp.launch(part.clear_touch, dim=len(state.done), inputs=[self.handles.p])

    def after_substep(self, state: State) -> None:
        """Read the contacts, and attribute what the part gained."""
        self.sensor.update()
        wp.launch(part.keep_touch, dim=len(state.done), inputs=[self.handles.p])
        # After an odd number of physics steps the coordinates are in the simulation's other buffer.
        now = self.sim.state.joint_q.reshape(state.joint_q.shape)
        wp.launch(metrics.attribute, dim=len(state.done), inputs=[now, self.handles])

    def update(self, state: State) -> None:
        """Keep what the reward reads."""
        wp.launch(mdp.update, dim=len(state.done), inputs=[state, self.handles])
        wp.launch(metrics.notice_standing, dim=len(state.done), inputs=[state, self.handles])

    def observe(self, state: State) -> None:
        """Write the observations."""
        wp.launch(part.observe, dim=len(state.done), inputs=[state, self.handles.p])

    def result(self, state: State) -> None:
        """Write how finished episodes went."""
        wp.launch(metrics.write_result, dim=len(state.done), inputs=[state, self.handles])


TASK = OpenPartTask
